"""The snapshot's file: a line that says what it is, a number that grows, values as JSON, arrays as they are in memory.

There are two of them, written in turn and each with a checksum: a kill in the middle of a write spoils the older one.
Overwriting costs a tenth of what putting a new file in place does. What only grows is appended as rows to a third file,
of which a snapshot says how much belongs to it, so that what is written does not grow with the time that has passed.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from skills.robot import FloatArray

MAGIC: Final = b"errand plant 2\n"
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
        """Write rows (N, width) after those so far. Raises OSError when the disk is full: they can be given again."""
        content, kept = rows.tobytes(), self.rows
        self._write(kept.file, content, kept.count * kept.width * 8)
        checksum = zlib.crc32(content, kept.checksum)
        self.rows = replace(kept, count=kept.count + len(rows), checksum=checksum)

    def write(self, content: bytes) -> None:
        """Write one whole snapshot. Raises OSError when the disk is full: the one before stays whole."""
        self._write(self._slots[0], content, 0)
        self._slots.reverse()
        self.next_number += 1

    def _write(self, name: str, content: bytes, offset: int) -> None:
        done = 0
        while done < len(content):
            done += os.pwrite(self._files[name], content[done:], offset + done)
        self.bytes_written += done

    def close(self) -> None:
        """Close the files; idempotent."""
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
