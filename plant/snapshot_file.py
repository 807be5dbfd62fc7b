"""The plant's own memory: its whole state in a file, so that a simulated world outlives the process that ran it.

The file has a line that says what it is, a number that grows, values as JSON, arrays as they are in memory.
Nothing outside the plant reads it.

There are two of them, written in turn and each with a checksum: a kill in the middle of a write spoils the older one.
Overwriting costs a tenth of what putting a new file in place does. What only grows is appended as rows to a third file,
of which a snapshot says how much belongs to it, so that what is written does not grow with the time that has passed.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from skills.robot import FloatArray

if TYPE_CHECKING:
    from plant.engine import Engine
    from plant.referee.referee import Referee

PERIOD_S: Final = 1.0
MAGIC: Final = b"errand plant 3\n"
_WORLD: Final = "world: "
_POINT_VALUES: Final = 4
_SLOTS: Final = (".a", ".b")
_ROW_FILES: Final = (".c", ".d")
"""A new run writes its rows into the one to which the last snapshot of the run before does not refer."""


class SnapshotError(ValueError):
    """A snapshot cannot be used; the message names the file, what is wrong and the hint."""


@dataclass(frozen=True)
class Rows:
    """How many rows of `width` doubles at the beginning of a file belong to a snapshot, and their checksum."""

    file: str
    width: int
    count: int = 0
    checksum: int = 0


@dataclass(frozen=True)
class Snapshot:
    """A plant's state: values as JSON has them, arrays by name, and the rows (N, width) that had grown until then.

    `number` grows from one snapshot to the next; `kept` says where the rows stand.
    """

    number: int
    values: Mapping[str, Any]
    arrays: Mapping[str, FloatArray]
    kept: Rows | None = None
    rows: FloatArray = field(default_factory=lambda: np.empty((0, 0)))


def encoded(
    number: int,
    values: Mapping[str, Any],
    arrays: Mapping[str, tuple[tuple[int, ...], bytes]],
    rows: Rows | None = None,
) -> bytes:
    """The file's content; each array is given as its shape and its doubles."""
    shapes = [[name, shape] for name, (shape, _) in arrays.items()]
    kept = None if rows is None else astuple(rows)
    told = {"number": number, "values": values, "arrays": shapes, "rows": kept}
    text = json.dumps(told, separators=(",", ":")).encode()
    body = b"".join((len(text).to_bytes(8, "little"), text, *(raw for _, raw in arrays.values())))
    return b"".join((MAGIC, zlib.crc32(body).to_bytes(4, "little"), len(body).to_bytes(8, "little"), body))


def decoded(content: bytes) -> Snapshot:
    """The state of a file's content. Raises ValueError when it is damaged or of another kind."""
    if not content.startswith(MAGIC):
        raise ValueError("it is no snapshot that this errand reads")
    begin = len(MAGIC) + 12
    checksum, size = content[len(MAGIC) : len(MAGIC) + 4], int.from_bytes(content[len(MAGIC) + 4 : begin], "little")
    body = content[begin : begin + size]
    if len(body) < size or zlib.crc32(body).to_bytes(4, "little") != checksum:
        raise ValueError("it is damaged")
    end = 8 + int.from_bytes(body[:8], "little")
    told, arrays = json.loads(body[8:end]), {}
    for name, shape in told["arrays"]:
        count = int(np.prod(shape))
        arrays[name] = np.frombuffer(body, np.float64, count, end).reshape(shape).copy()
        end += 8 * count
    return Snapshot(told["number"], told["values"], arrays, None if told["rows"] is None else Rows(*told["rows"]))


class SnapshotFile:
    """Writes snapshots, each in place of the last but one, and appends rows of `width` doubles.

    `rows` are those so far; `bytes_written` counts what was written of all.
    """

    def __init__(self, path: Path, *, width: int = 1) -> None:
        """`path` is the name without the ending. An older snapshot there stays until the second is written."""
        path.parent.mkdir(parents=True, exist_ok=True)
        old = {slot: _try_read(path, slot) for slot in _SLOTS}
        numbers = {slot: each.number if isinstance(each, Snapshot) else 0 for slot, each in old.items()}
        self._slots = sorted(_SLOTS, key=lambda slot: numbers[slot])
        newest = old[self._slots[-1]]
        used = newest.kept.file if isinstance(newest, Snapshot) and newest.kept is not None else None
        self.rows = Rows(next(name for name in _ROW_FILES if name != used), width)
        names = (*_SLOTS, self.rows.file)
        self._files = {name: os.open(_beside(path, name), os.O_RDWR | os.O_CREAT, 0o644) for name in names}
        os.ftruncate(self._files[self.rows.file], 0)
        self.next_number = max(numbers.values()) + 1
        self.bytes_written = 0

    def append(self, rows: FloatArray) -> None:
        """Writes rows (N, width) after those so far. Raises OSError when the disk is full: they can be given again."""
        content, kept = rows.tobytes(), self.rows
        self._write(kept.file, content, kept.count * kept.width * 8)
        checksum = zlib.crc32(content, kept.checksum)
        self.rows = replace(kept, count=kept.count + len(rows), checksum=checksum)

    def write(self, content: bytes) -> None:
        """Writes one whole snapshot. Raises OSError when the disk is full: the one before stays whole."""
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
    """The newest whole snapshot. Raises SnapshotError."""
    found = [_try_read(path, slot) for slot in _SLOTS]
    whole = [each for each in found if isinstance(each, Snapshot)]
    if whole:
        return max(whole, key=lambda snapshot: snapshot.number)
    hint = "without it the simulated world is gone; run the mission again"
    raise SnapshotError(f"{path}: the plant's state cannot be used: {found[0]}; {hint}")


class SnapshotWriter:
    """Writes a plant's whole state to a file whenever it is called. `facts` tell which world it is.

    It stands in for a world that stays while the executive is away: the mission itself goes on from its journal.
    """

    def __init__(
        self, path: Path, engine: Engine, referee: Referee, facts: Mapping[str, Any], robots: Sequence[str]
    ) -> None:
        self._file = SnapshotFile(path, width=1 + _POINT_VALUES)
        self._engine, self._referee, self._facts = engine, referee, dict(facts)
        self._robots, self._from = tuple(robots), 0
        self._points = dict.fromkeys(robots, 0)
        self._due_s = 0.0

    @property
    def bytes_written(self) -> int:
        """How many bytes were written so far."""
        return self._file.bytes_written

    def __call__(self) -> None:
        """Writes it."""
        self._due_s = self._engine.now() + PERIOD_S
        self._append_points()
        self._file.write(self.content())

    def when_due(self) -> None:
        """Writes it when the last time was a while ago."""
        if self._engine.now() >= self._due_s:
            self()

    def content(self) -> bytes:
        """What is written, without the points of the paths."""
        world = {_WORLD + name: (array.shape, array.tobytes()) for name, array in self._engine.world_state().items()}
        paths = {"robots": self._robots, "from": self._from}
        values = {"facts": self._facts, "engine": self._engine.state(), "referee": self._referee.state()}
        return encoded(self._file.next_number, {**values, "paths": paths}, world, self._file.rows)

    def _append_points(self) -> None:
        """Appends what the paths have grown by; paths that began again are written as a whole after the old ones."""
        if any(len(self._referee.points(robot)) < count for robot, count in self._points.items()):
            self._from = self._file.rows.count
            self._points = dict.fromkeys(self._robots, 0)
        for number, robot in enumerate(self._robots):
            grown = self._referee.points(robot)[self._points[robot] :]
            if grown:
                points = np.array(grown, dtype=np.float64)
                self._file.append(np.column_stack([np.full(len(points), float(number)), points]))
                self._points[robot] += len(points)


def restore(snapshot: Snapshot, engine: Engine, referee: Referee, facts: Mapping[str, Any]) -> None:
    """Brings a plant to a snapshot's state; all of `facts` must be as they were.

    Raises:
        SnapshotError: the snapshot is one of another world, of other robots or of another version of the plant.
    """
    kept = snapshot.values["facts"]
    differing = ", ".join(key for key in facts if kept.get(key) != facts[key])
    if differing:
        raise SnapshotError(f"the plant's state is that of another simulation ({differing}); run the mission again")
    named = snapshot.arrays.items()
    world = {name.removeprefix(_WORLD): array for name, array in named if name.startswith(_WORLD)}
    try:
        told = snapshot.values["paths"]
        rows = snapshot.rows[told["from"] :]
        paths = {robot: rows[rows[:, 0] == number, 1:] for number, robot in enumerate(told["robots"])}
        engine.go_on(snapshot.values["engine"], world)
        referee.go_on(snapshot.values["referee"], paths)
    except (KeyError, TypeError, ValueError) as error:
        what = f"the plant's state was written by another version ({error!r})"
        raise SnapshotError(f"{what}; run the mission again") from error


def _beside(path: Path, name: str) -> Path:
    return path.with_name(path.name + name)


def _try_read(path: Path, slot: str) -> Snapshot | str:
    """The snapshot in one file with its rows, or why there is none."""
    try:
        snapshot = decoded(_beside(path, slot).read_bytes())
        return snapshot if snapshot.kept is None else replace(snapshot, rows=_rows(path, snapshot.kept))
    except OSError as error:
        return error.strerror or str(error)
    except ValueError as error:
        return str(error)


def _rows(path: Path, kept: Rows) -> FloatArray:
    """The rows of a snapshot. Raises ValueError when they are damaged, OSError when they cannot be read."""
    if kept.file not in _ROW_FILES:
        raise ValueError("it is no snapshot that this errand reads")
    size = kept.count * kept.width * 8
    with _beside(path, kept.file).open("rb") as file:
        content = file.read(size)
    if len(content) < size or zlib.crc32(content) != kept.checksum:
        raise ValueError("its rows are damaged")
    return np.frombuffer(content, np.float64).reshape(kept.count, kept.width).copy()
