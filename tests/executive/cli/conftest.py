"""Lets the tests here import the skills' small detector, the made speech of the speech's tests, and a backend."""

import json
import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parents[2] / "skills"), str(Path(__file__).parents[1] / "speech")]
sys.path.append(str(Path(__file__).parent))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The folder of a data set without pictures."""
    folder = tmp_path / "data"
    folder.mkdir()
    for name in ("train.json", "val.json"):
        (folder / name).write_text(json.dumps({"images": [], "annotations": [], "categories": []}))
    return folder
