"""Makes the small networks and the made speech of other tests importable, and an empty data set."""

import json
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "skills"), str(HERE.parent / "executive" / "speech")]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The folder of a data set without pictures."""
    folder = tmp_path / "data"
    folder.mkdir()
    for name in ("train.json", "val.json"):
        (folder / name).write_text(json.dumps({"images": [], "annotations": [], "categories": []}))
    return folder
