"""What a snapshot writer writes: no more in the second hour than in the first minute."""

import numpy as np
import pytest

from plant.snapshot_file import SnapshotWriter, read_snapshot, restore

FACTS = {"world": "flat"}
MOST_BYTES_PER_MINUTE = 500_000


class Plant:
    """Engine and referee of two robots that walk without end, as far as the writer calls them."""

    def __init__(self):
        self.now_s, self.paths, self.restored = 0.0, {"Alice": [], "Bob": []}, None

    def now(self):
        return self.now_s

    def world_state(self):
        return {"0": np.zeros(180)}

    def state(self):
        return {"objects": ["a can that stands on the table"] * 60}

    @property
    def names(self):
        return tuple(self.paths)

    def points(self, name):
        return self.paths[name]

    def walk(self, seconds):
        for _ in range(seconds):
            self.now_s += 1.0
            for path in self.paths.values():
                path += [np.array([self.now_s, n, 0.0, self.now_s]) for n in range(20)]
            yield

    def resume(self, state, arrays):
        self.restored = arrays


@pytest.fixture
def plant():
    return Plant()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "kept.plant"


@pytest.fixture
def writer(path, plant):
    return SnapshotWriter(path, plant, plant, FACTS)


def written_in(writer, plant, seconds):
    before = writer.bytes_written
    for _ in plant.walk(seconds):
        writer.write_if_due()
    return writer.bytes_written - before


def test_the_bytes_written_in_a_minute_stay_within_a_budget(writer, plant):
    first = written_in(writer, plant, 60)
    written_in(writer, plant, 3480)
    last = written_in(writer, plant, 60)
    assert first < MOST_BYTES_PER_MINUTE and last < 1.02 * first


def restored(path):
    """The paths that another plant takes up."""
    other = Plant()
    restore(read_snapshot(path), other, other, FACTS)
    return {name: each.tolist() for name, each in other.restored.items()}


def test_all_paths_are_taken_up_as_they_were(writer, plant, path):
    written_in(writer, plant, 3)
    assert restored(path) == {name: np.array(points).tolist() for name, points in plant.paths.items()}


def test_paths_that_begin_again_are_taken_up_from_there(writer, plant, path):
    written_in(writer, plant, 3)
    plant.paths = {"Alice": [], "Bob": [np.array([9.0, 9.0, 0.0, 4.0])]}
    plant.now_s += 1.0
    writer()
    assert restored(path) == {"Alice": [], "Bob": [[9.0, 9.0, 0.0, 4.0]]}
