"""Snapshots of the plant: its whole state in files, so that a simulated world outlives its process.

A snapshot has a first line that identifies it, an increasing number, values as JSON and arrays as they are in memory.
Only the plant reads it.

Two snapshot files with checksums are overwritten in turn: a kill in the middle of a write spoils only the older one.
Overwriting a file takes a tenth of the time of replacing it. Paths only grow, so their rows are appended to a third
file, and a snapshot has the number of its rows: its size does not grow with the time of the run.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from skills.robot import FloatArray

if TYPE_CHECKING:
    from plant.engine import Engine
    from plant.referee.referee import Referee

PERIOD_S: Final = 1.0
MAGIC: Final = b"errand plant 4\n"
_WORLD: Final = "world: "
_POINT_VALUES: Final = 4
_SLOTS: Final = (".a", ".b")
_ROW_FILES: Final = (".c", ".d")
"""Files of rows: a new run writes to the file that the last snapshot of the previous run does not use."""


class SnapshotError(ValueError):
    """Error of a snapshot that cannot be used, with the reason and a hint."""


@dataclass(frozen=True)
class Rows:
    """Rows of a snapshot: the first `count` rows of `width` doubles in a file, and their checksum."""

    file: str
    width: int
    count: int = 0
    checksum: int = 0


@dataclass(frozen=True)
class Snapshot:
    """State of a plant: JSON values, arrays by name, and all rows (N, width) up to then.

    `number` increases from one snapshot to the next; `stored` describes where the rows are stored.
    """

    number: int
    values: Mapping[str, Any]
    arrays: Mapping[str, FloatArray]
    stored: Rows | None = None
    rows: FloatArray = field(default_factory=lambda: np.empty((0, 0)))


def encode(
    number: int,
    values: Mapping[str, Any],
    arrays: Mapping[str, tuple[tuple[int, ...], bytes]],
    rows: Rows | None = None,
) -> bytes:
    """Returns the content of a snapshot file; an array is given as its shape and its doubles."""
    shapes = [[name, shape] for name, (shape, _) in arrays.items()]
    stored = None if rows is None else astuple(rows)
    head = {"number": number, "values": values, "arrays": shapes, "rows": stored}
    text = json.dumps(head, separators=(",", ":")).encode()
    body = b"".join((len(text).to_bytes(8, "little"), text, *(raw for _, raw in arrays.values())))
    return b"".join((MAGIC, zlib.crc32(body).to_bytes(4, "little"), len(body).to_bytes(8, "little"), body))


def decode(content: bytes) -> Snapshot:
    """Returns the snapshot in the content of a file. Raises ValueError when it is damaged or no snapshot."""
    if not content.startswith(MAGIC):
        raise ValueError("it is no snapshot of this version of Errand")
    begin = len(MAGIC) + 12
    checksum, size = content[len(MAGIC) : len(MAGIC) + 4], int.from_bytes(content[len(MAGIC) + 4 : begin], "little")
    body = content[begin : begin + size]
    if len(body) < size or zlib.crc32(body).to_bytes(4, "little") != checksum:
        raise ValueError("it is damaged")
    end = 8 + int.from_bytes(body[:8], "little")
    head, arrays = json.loads(body[8:end]), {}
    for name, shape in head["arrays"]:
        count = int(np.prod(shape))
        arrays[name] = np.frombuffer(body, np.float64, count, end).reshape(shape).copy()
        end += 8 * count
    return Snapshot(head["number"], head["values"], arrays, None if head["rows"] is None else Rows(*head["rows"]))


class SnapshotFile:
    """Writes snapshots, each over the one before the last, and rows of `width` doubles.

    `rows` describes the rows so far; `bytes_written` counts all bytes.
    """

    def __init__(self, path: Path, *, width: int = 1) -> None:
        """`path` has no suffix. An older snapshot there stays until the second new one is written."""
        path.parent.mkdir(parents=True, exist_ok=True)
        old = {slot: _try_read(path, slot) for slot in _SLOTS}
        numbers = {slot: each.number if isinstance(each, Snapshot) else 0 for slot, each in old.items()}
        self._slots = sorted(_SLOTS, key=lambda slot: numbers[slot])
        newest = old[self._slots[-1]]
        used = newest.stored.file if isinstance(newest, Snapshot) and newest.stored is not None else None
        self.rows = Rows(next(name for name in _ROW_FILES if name != used), width)
        names = (*_SLOTS, self.rows.file)
        self._files = {name: os.open(_beside(path, name), os.O_RDWR | os.O_CREAT, 0o644) for name in names}
        os.ftruncate(self._files[self.rows.file], 0)
        self.next_number = max(numbers.values()) + 1
        self.bytes_written = 0

    def append(self, rows: FloatArray) -> None:
        """Appends rows (N, width). Raises OSError when the disk is full; the same rows may be appended again."""
        content, before = rows.tobytes(), self.rows
        self._write(before.file, content, before.count * before.width * 8)
        checksum = zlib.crc32(content, before.checksum)
        self.rows = replace(before, count=before.count + len(rows), checksum=checksum)

    def write(self, content: bytes) -> None:
        """Writes one snapshot. Raises OSError when the disk is full; the previous snapshot stays valid."""
        self._write(self._slots[0], content, 0)
        self._slots.reverse()
        self.next_number += 1

    def _write(self, name: str, content: bytes, offset: int) -> None:
        done = 0
        while done < len(content):
            done += os.pwrite(self._files[name], content[done:], offset + done)
        self.bytes_written += done

    def close(self) -> None:
        """Closes the files; idempotent."""
        while self._files:
            os.close(self._files.popitem()[1])


def read_snapshot(path: Path) -> Snapshot:
    """Returns the newest valid snapshot. Raises SnapshotError when there is none."""
    found = [_try_read(path, slot) for slot in _SLOTS]
    whole = [each for each in found if isinstance(each, Snapshot)]
    if whole:
        return max(whole, key=lambda snapshot: snapshot.number)
    hint = "without it the simulated world is gone; run the mission again"
    raise SnapshotError(f"{path}: the plant's state cannot be used: {found[0]}; {hint}")


class SnapshotWriter:
    """Writes a plant's whole state, once per call. `facts` identify the simulation.

    The file represents a real world, which stays while the executive is away; the journal stores the mission itself.
    """

    def __init__(self, path: Path, engine: Engine, referee: Referee, facts: Mapping[str, Any]) -> None:
        self._file = SnapshotFile(path, width=1 + _POINT_VALUES)
        self._engine, self._referee, self._facts = engine, referee, dict(facts)
        self._names, self._from = referee.names, 0
        self._points = dict.fromkeys(self._names, 0)
        self._due_s = 0.0

    @property
    def bytes_written(self) -> int:
        """Number of bytes written so far."""
        return self._file.bytes_written

    def __call__(self) -> None:
        """Writes a snapshot now."""
        self._due_s = self._engine.now() + PERIOD_S
        self._append_points()
        self._file.write(self.content())

    def write_if_due(self) -> None:
        """Writes a snapshot when the last one is older than `PERIOD_S`."""
        if self._engine.now() >= self._due_s:
            self()

    def content(self) -> bytes:
        """Returns the content of a snapshot taken now, without the path points."""
        world = {_WORLD + name: (array.shape, array.tobytes()) for name, array in self._engine.world_state().items()}
        paths = {"names": self._names, "from": self._from}
        values = {"facts": self._facts, "engine": self._engine.state(), "referee": self._referee.state()}
        return encode(self._file.next_number, {**values, "paths": paths}, world, self._file.rows)

    def _append_points(self) -> None:
        """Appends the new points of the paths; appends all paths again when one has become shorter."""
        if any(len(self._referee.points(name)) < count for name, count in self._points.items()):
            self._from = self._file.rows.count
            self._points = dict.fromkeys(self._names, 0)
        for number, name in enumerate(self._names):
            grown = self._referee.points(name)[self._points[name] :]
            if grown:
                points = np.array(grown, dtype=np.float64)
                self._file.append(np.column_stack([np.full(len(points), float(number)), points]))
                self._points[name] += len(points)


def restore(snapshot: Snapshot, engine: Engine, referee: Referee, facts: Mapping[str, Any]) -> None:
    """Restores a plant from a snapshot with the same `facts`.

    Raises:
        SnapshotError: the snapshot is of another world, of other robots or of another version of the plant.
    """
    stored = snapshot.values["facts"]
    differing = ", ".join(key for key in facts if stored.get(key) != facts[key])
    if differing:
        raise SnapshotError(f"the plant's state is that of another simulation ({differing}); run the mission again")
    named = snapshot.arrays.items()
    world = {name.removeprefix(_WORLD): array for name, array in named if name.startswith(_WORLD)}
    try:
        values = snapshot.values["paths"]
        rows = snapshot.rows[values["from"] :]
        paths = {name: rows[rows[:, 0] == number, 1:] for number, name in enumerate(values["names"])}
        engine.resume(snapshot.values["engine"], world)
        referee.resume(snapshot.values["referee"], paths)
    except (KeyError, TypeError, ValueError) as error:
        what = f"the plant's state was written by another version ({error!r})"
        raise SnapshotError(f"{what}; run the mission again") from error


def _beside(path: Path, name: str) -> Path:
    return path.with_name(path.name + name)


def _try_read(path: Path, slot: str) -> Snapshot | str:
    """Returns the snapshot in one file with its rows, or the reason for its absence."""
    try:
        snapshot = decode(_beside(path, slot).read_bytes())
        return snapshot if snapshot.stored is None else replace(snapshot, rows=_rows(path, snapshot.stored))
    except OSError as error:
        return error.strerror or str(error)
    except ValueError as error:
        return str(error)


def _rows(path: Path, stored: Rows) -> FloatArray:
    """Reads the rows of a snapshot. Raises ValueError when they are damaged, OSError when they cannot be read."""
    if stored.file not in _ROW_FILES:
        raise ValueError("it is no snapshot of this version of Errand")
    size = stored.count * stored.width * 8
    with _beside(path, stored.file).open("rb") as file:
        content = file.read(size)
    if len(content) < size or zlib.crc32(content) != stored.checksum:
        raise ValueError("its rows are damaged")
    return np.frombuffer(content, np.float64).reshape(stored.count, stored.width).copy()
