from pathlib import Path

import numpy as np
import pytest

from skills.detect.training.labels import Labels
from skills.detect.training.mining import HardPlace, errors_in, read_places, write_places
from skills.detection import Detection

NAMES = ("beer", "coke")
THING = (100.0, 100.0, 200.0, 200.0)


def labels(ignored: bool = False) -> Labels:
    """One beer."""
    x0, y0, x1, y1 = THING
    outline = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=np.float32)
    return Labels((outline,), np.array([0]), np.ones(1, np.float32), np.array([ignored]))


# what is seen of a beer (class, score, box; a few pixels off, elsewhere, or nothing) -> what is hard
@pytest.mark.parametrize(
    ("seen", "expected"),
    [
        ([("beer", 0.9, (102, 101, 203, 199))], []),
        ([("beer", 0.4, (102, 101, 203, 199))], [THING]),
        ([], [THING]),
        ([("coke", 0.9, THING)], [THING, THING]),
        ([("beer", 0.9, THING), ("coke", 0.3, (400, 0, 440, 60))], [(400, 0, 440, 60)]),
        ([("beer", 0.9, THING), ("coke", 0.2, (400, 0, 440, 60))], []),
        ([("beer", 0.9, (100, 100, 200, 120))], [THING, (100, 100, 200, 120)]),
    ],
)
def test_places_are_hard_where_things_are_missed_or_seen_falsely(seen, expected) -> None:
    found = [Detection(name, score, box) for name, score, box in seen]
    assert errors_in(labels(), found, NAMES).tolist() == [list(map(float, box)) for box in expected]


@pytest.mark.parametrize("found", [(), (Detection("coke", 0.9, (120, 120, 160, 160)),)])
def test_what_is_to_be_ignored_is_no_hard_place(found) -> None:
    assert len(errors_in(labels(ignored=True), found, NAMES)) == 0


def test_written_places_are_read_back(tmp_path: Path) -> None:
    places = (HardPlace(3, (1.5, 2.0, 30.0, 40.25)), HardPlace(0, (0.0, 0.0, 9.0, 9.0)))
    write_places(tmp_path / "places.json", places)
    assert read_places(tmp_path / "places.json") == places
    assert read_places(tmp_path / "none.json") == ()
