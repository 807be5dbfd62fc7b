"""Picture files of people: what can be read is read, and of the rest it is told why not and what to do."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from skills.files.errors import InputError
from skills.robot import Picture

__all__ = ["MOST_PIXELS", "read_picture", "write_picture"]

MOST_PIXELS: Final = 64_000_000
"""What is larger is refused before it fills the memory; `executive.cli` tells OpenCV the same limit."""


_PNG_HEAD: Final = b"\x89PNG\r\n\x1a\n"
_LIMIT_NAME: Final = "MAX_IMAGE_PIXELS"
_JPEG_SIZES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


def read_picture(file: Path) -> Picture:
    """A picture file as (H, W, 3) RGB uint8: grey, 16 bits and others are converted, transparency is dropped.

    Raises InputError for what cannot be read, is damaged or has more than 64 million pixels.
    """
    content = _content(file)
    width, height = _size(content)
    if width * height > MOST_PIXELS:
        raise _too_large(file, f"{width} x {height}")
    try:
        picture = _decoded(content)
    except cv2.error as error:
        raise _too_large(file, "too many") if _LIMIT_NAME in str(error) else _unreadable(file, content) from error
    if picture is None:
        raise _unreadable(file, content)
    return picture


def write_picture(file: Path, picture: Picture) -> None:
    """Write (H, W, 3) RGB in the form that the name's ending tells. Raises InputError when that does not work."""
    encoded, content = cv2.imencode(file.suffix, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.tobytes() if encoded else b"")
    except OSError as error:
        hint = "name a folder in which files can be written"
        raise InputError(f"cannot write it ({error.strerror})", hint=hint, file=file) from error


def _too_large(file: Path, pixels: str) -> InputError:
    most = f"{MOST_PIXELS // 1_000_000} million are the most that is read"
    return InputError(f"it has {pixels} pixels, and {most}", hint="make it smaller", file=file)


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except IsADirectoryError as error:
        raise InputError("it is a folder", hint=f"name the pictures in it, such as {file}/*.png", file=file) from error
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", hint="name a picture file", file=file) from error


def _decoded(content: bytes) -> Picture | None:
    """The picture, or None for what is none."""
    if not content:
        return None
    with _silent():
        picture = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_COLOR_RGB)
    return None if picture is None else np.asarray(picture, dtype=np.uint8)


@contextmanager
def _silent() -> Iterator[None]:
    """OpenCV keeps its own words on damaged files to itself."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def _unreadable(file: Path, content: bytes) -> InputError:
    if not content:
        return InputError("it is empty", hint="name a picture file", file=file)
    if cv2.haveImageReader(str(file)):
        return InputError("the picture is damaged or cut off", hint="copy or make it anew", file=file)
    return InputError("it is no picture", hint="name a file in PNG, JPEG, WebP, TIFF or BMP", file=file)


def _size(content: bytes) -> tuple[int, int]:
    """Width and height as a PNG's or JPEG's head tells them; (0, 0) for others, which OpenCV checks itself."""
    if content.startswith(_PNG_HEAD) and len(content) >= 24:
        width, height = struct.unpack(">II", content[16:24])
        return int(width), int(height)
    return _jpeg_size(content) if content.startswith(b"\xff\xd8") else (0, 0)


def _jpeg_size(content: bytes) -> tuple[int, int]:
    """Width and height from the first frame's head; segments are marked 0xff, kind, length."""
    place = 2
    while place + 9 <= len(content) and content[place] == 0xFF:
        kind = content[place + 1]
        if kind in _JPEG_SIZES:
            height, width = struct.unpack(">HH", content[place + 5 : place + 9])
            return int(width), int(height)
        place += 1 if kind == 0xFF else 2 + int.from_bytes(content[place + 2 : place + 4], "big")
    return 0, 0
