"""The snapshot's file: a line that says what it is, a number that grows, values as JSON, arrays as they are in memory.

There are two of them, written in turn and each with a checksum: a kill in the middle of a write spoils the older one.
Overwriting costs a tenth of what putting a new file in place does.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from skills.robot import FloatArray

MAGIC: Final = b"errand plant 1\n"
_SLOTS: Final = (".a", ".b")


class SnapshotError(ValueError):
    """A snapshot cannot be used; the message names the file, what is wrong and the hint."""


@dataclass(frozen=True)
class Snapshot:
    """A plant's state: values as JSON has them, and arrays by name. `number` grows from one to the next."""

    number: int
    values: Mapping[str, Any]
    arrays: Mapping[str, FloatArray]


def encoded(
    number: int, values: Mapping[str, Any], arrays: Mapping[str, tuple[tuple[int, ...], bytes | bytearray]]
) -> bytes:
    """The file's content; each array is given as its shape and its doubles."""
    shapes = [[name, shape] for name, (shape, _) in arrays.items()]
    told = {"number": number, "values": values, "arrays": shapes}
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
    return Snapshot(told["number"], told["values"], arrays)


class SnapshotFile:
    """Writes snapshots, each in place of the last but one."""

    def __init__(self, path: Path) -> None:
        """`path` is the name without the ending. An older snapshot there stays until the second is written."""
        path.parent.mkdir(parents=True, exist_ok=True)
        old = {slot: _try_read(_slot(path, slot)) for slot in _SLOTS}
        numbers = {slot: each.number if isinstance(each, Snapshot) else 0 for slot, each in old.items()}
        self._slots = sorted(_SLOTS, key=lambda slot: numbers[slot])
        self._files = {slot: os.open(_slot(path, slot), os.O_RDWR | os.O_CREAT, 0o644) for slot in _SLOTS}
        self.next_number = max(numbers.values()) + 1

    def write(self, content: bytes) -> None:
        """Write one whole snapshot. Raises OSError when the disk is full: the one before stays whole."""
        slot, done = self._slots[0], 0
        while done < len(content):
            done += os.pwrite(self._files[slot], content[done:], done)
        self._slots.reverse()
        self.next_number += 1

    def close(self) -> None:
        """Close the files; idempotent."""
        while self._files:
            os.close(self._files.popitem()[1])


def read_snapshot(path: Path) -> Snapshot:
    """The newest whole snapshot. Raises SnapshotError."""
    found = [_try_read(_slot(path, slot)) for slot in _SLOTS]
    whole = [each for each in found if isinstance(each, Snapshot)]
    if whole:
        return max(whole, key=lambda snapshot: snapshot.number)
    hint = "without it the simulated world is gone; run the mission again"
    raise SnapshotError(f"{path}: the plant's state cannot be used: {found[0]}; {hint}")


def _slot(path: Path, slot: str) -> Path:
    return path.with_name(path.name + slot)


def _try_read(path: Path) -> Snapshot | str:
    """The snapshot in one file, or why there is none."""
    try:
        return decoded(path.read_bytes())
    except OSError as error:
        return error.strerror or str(error)
    except ValueError as error:
        return str(error)
