"""Snapshot files stay valid after a kill at any byte, and are refused when damaged."""

import errno
import math
import os

import numpy as np
import pytest

from plant.snapshot_file import SnapshotError, SnapshotFile, encode, read_snapshot


@pytest.fixture
def path(tmp_path):
    return tmp_path / "kept.plant"


def content(number, value):
    array = np.full((2, 3), float(value))
    return encode(number, {"value": value}, {"x": (array.shape, array.tobytes())})


def file_with(path, *values):
    """A snapshot file in which values were written one after another."""
    file = SnapshotFile(path)
    for value in values:
        file.write(content(file.next_number, value))
    return file


def test_the_newest_is_read(path):
    file_with(path, 1, 2, 3)
    snapshot = read_snapshot(path)
    assert (snapshot.number, snapshot.values, snapshot.arrays["x"].tolist()) == (3, {"value": 3}, [[3.0] * 3] * 2)


def test_a_write_that_was_cut_off_leaves_the_one_before(path):
    third = content(file_with(path, 1, 2).next_number, 3)
    for size in range(0, len(third), 7):
        slot = path.with_name("kept.plant.a")
        slot.write_bytes(third[:size] + slot.read_bytes()[size:])
        assert read_snapshot(path).values["value"] == 2


def test_a_full_disk_leaves_the_previous_snapshot_valid(path, monkeypatch):
    """A disk that becomes full: writes a part, reports its size, and refuses the rest."""
    file, room, write = SnapshotFile(path), [math.inf], os.pwrite

    def filling(descriptor, data, offset):
        taken = int(min(len(data), room[0]))
        if not taken:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        room[0] -= taken
        return write(descriptor, data[:taken], offset)

    monkeypatch.setattr(os, "pwrite", filling)
    for value in (1, 2):
        file.write(content(file.next_number, value))
    for left in (60, 0):
        room[0] = left
        with pytest.raises(OSError, match="No space left"):
            file.write(content(file.next_number, 3))
        assert read_snapshot(path).values["value"] == 2
    room[0] = math.inf
    file.write(content(file.next_number, 4))
    assert read_snapshot(path).values["value"] == 4


def test_a_shorter_one_over_a_longer_one_is_read(path):
    file = SnapshotFile(path)
    file.write(encode(file.next_number, {"value": "long" * 99}, {}))
    file.write(content(file.next_number, 2))
    file.write(content(file.next_number, 3))
    assert read_snapshot(path).values["value"] == 3


def test_another_process_goes_on_counting_and_spares_the_newest(path):
    file_with(path, 1, 2, 3).close()
    again = SnapshotFile(path)
    again.write(content(again.next_number, 4)[:30])
    assert read_snapshot(path).values["value"] == 3


def test_nothing_damaged_or_foreign_is_read(path):
    with pytest.raises(SnapshotError, match=r"No such file.*run the mission again"):
        read_snapshot(path)
    for slot in ("a", "b"):
        path.with_name(f"kept.plant.{slot}").write_bytes(b"something else")
    with pytest.raises(SnapshotError, match="no snapshot of this version of Errand"):
        read_snapshot(path)


def rows(*values):
    return np.array([[value, value] for value in values], dtype=np.float64)


def with_rows(path, *values):
    """A snapshot file in which rows were written, one with each snapshot."""
    file = SnapshotFile(path, width=2)
    for value in values:
        file.append(rows(value))
        file.write(encode(file.next_number, {"value": value}, {}, file.rows))
    return file


def test_rows_are_appended_and_read_up_to_the_snapshots_count(path):
    with_rows(path, 1, 2, 3).append(rows(4))
    assert read_snapshot(path).rows.tolist() == rows(1, 2, 3).tolist()


def test_the_size_of_a_snapshot_does_not_grow_with_its_rows(tmp_path):
    written = [with_rows(tmp_path / f"{count}.plant", *[1] * count).bytes_written for count in range(1, 6)]
    assert np.ptp(np.diff(written)) <= 4  # digits of numbers


def test_damaged_rows_leave_the_snapshot_before_them(path):
    kept = path.with_name(path.name + with_rows(path, 1, 2).rows.file)
    kept.write_bytes(kept.read_bytes()[:16] + b"\xff" * 16)
    assert read_snapshot(path).rows.tolist() == rows(1).tolist()


def test_another_process_spares_the_rows_of_the_last_snapshot_until_it_has_written_one(path):
    with_rows(path, 1, 2, 3).close()
    again = SnapshotFile(path, width=2)
    again.append(rows(4))
    assert read_snapshot(path).rows.tolist() == rows(1, 2, 3).tolist()
    again.write(encode(again.next_number, {}, {}, again.rows))
    assert read_snapshot(path).rows.tolist() == rows(4).tolist()
