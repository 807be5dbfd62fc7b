"""Guarded reading of picture files: checks the number of pixels in the header before decoding."""

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.inputs.errors import InputError
from skills.inputs.outside import native_stderr_dropped, read_bytes

MOST_PIXELS: Final = 64_000_000
"""Limit that keeps a picture from filling the memory; `executive.cli` sets the same limit in OpenCV."""
MOST_BYTES: Final = 200_000_000
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_WIDE_HEADS: Final = (b"II", b"MM", b"PF", b"Pf", b"#?")  # of TIFF, PFM and HDR, whose values may be float
_BYTE: Final = 255
_LIMIT_NAME: Final = "MAX_IMAGE_PIXELS"
_JPEG_SIZES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_SPACE: Final = rb"(?:\s|#[^\n\r]*[\n\r])+"
_PNM: Final = re.compile(rb"P([2356])" + (_SPACE + rb"(\d{1,9})") * 3 + rb"\s")
_ANY_PNM: Final = re.compile(rb"P[1-6]" + (_SPACE + rb"(\d{1,9})") * 2)
_COMMENT: Final = re.compile(rb"#[^\n\r]*")
_NUMBERS: Final = re.compile(rb"[\d\s]*")
_TRANSPARENT_GREY: Final = b"tRNS"
_PHONES: Final = frozenset(b"ftyp" + brand for brand in (b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1"))
"""Begin of HEIC files, behind their first length."""
_HINT: Final = "name a file in PNG, JPEG, WebP, TIFF or BMP"


def read_pixels(file: Path, *, flags: int = cv2.IMREAD_UNCHANGED, most_pixels: int = MOST_PIXELS) -> NDArray[Any]:
    """Reads the pixels of a picture file as OpenCV decodes them.

    Raises:
        InputError: it cannot be read, is damaged or no picture, or has more than `most_pixels`.
    """
    return _decoded(_content(file, most_pixels), file, flags)


def check_picture(file: Path, *, most_pixels: int = MOST_PIXELS) -> None:
    """Checks a picture file that a library will read. Raises InputError as `read_pixels`, except for damage."""
    content = _content(file, most_pixels)
    if _size(content) == (0, 0):
        raise _unreadable(file, content)


@dataclass(frozen=True)
class Brightness:
    """Brightness (H, W) of a picture from 0 to 1, the mean of its colours, and opacity (None without transparency).

    `more_bytes` counts the bytes that follow the last pixel of a PGM or PPM.
    """

    shares: NDArray[np.float64]
    opacity: NDArray[np.float64] | None = None
    more_bytes: int = 0


def read_brightness(file: Path, *, most_pixels: int) -> Brightness:
    """Reads the brightness and opacity of a picture.

    The values of a PGM or PPM are divided by the maximum in its header.

    Raises:
        InputError: as `read_pixels`.
    """
    content = _content(file, most_pixels)
    head = _PNM.match(content)
    if head is not None:
        return _pnm_brightness(content, head, file)
    pixels = _decoded(content, file, cv2.IMREAD_UNCHANGED)
    shares = pixels.astype(np.float64) / np.iinfo(pixels.dtype).max
    if shares.ndim == 2:
        return Brightness(shares, _grey_opacity(content, shares))
    return Brightness(np.asarray(shares[..., :3].mean(axis=2)), shares[..., 3] if shares.shape[2] == 4 else None)


def _grey_opacity(content: bytes, shares: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Opacity of a grey PNG with one transparent grey, which OpenCV ignores; None for other pictures."""
    at = content.find(_TRANSPARENT_GREY, 0, content.find(b"IDAT")) + len(_TRANSPARENT_GREY)
    if not content.startswith(_PNG) or at < len(_PNG) or len(content) < at + 2:
        return None
    grey = int.from_bytes(content[at : at + 2], "big") / ((1 << content[24]) - 1)
    return np.where(np.abs(shares - grey) < 1e-6, 0.0, 1.0)


def _pnm_brightness(content: bytes, head: re.Match[bytes], file: Path) -> Brightness:
    """Brightness of a PGM or PPM picture."""
    kind = head[1]
    columns, rows, most = (int(number) for number in head.groups()[1:])
    count = rows * columns * (3 if kind in b"36" else 1)
    if not 0 < most < 65_536:
        raise InputError(f"its greatest value is {most}", hint="save it with one from 1 to 65535", file=file)
    values, more = _numbers(content[head.end() :]) if kind in b"23" else _raw(content, head.end(), count, most)
    if len(values) < count:
        what = f"its head says {columns} x {rows} pixels, {count} values, and it has {len(values)}"
        raise InputError(what, hint="save it again", file=file)
    more += len(values) - count
    shares = np.clip(values[:count] / most, 0.0, 1.0).reshape(rows, columns, -1)
    return Brightness(np.asarray(shares.mean(axis=2)), more_bytes=more)


def _numbers(body: bytes) -> tuple[NDArray[np.float64], int]:
    """Numbers at the start of a text, and the number of bytes that follow them."""
    text = _COMMENT.sub(b"", body)
    found = _NUMBERS.match(text)
    numbers = b"" if found is None else found[0]
    return np.array(numbers.split(), dtype=np.float64), len(text) - len(numbers)


def _raw(content: bytes, start: int, count: int, most: int) -> tuple[NDArray[np.float64], int]:
    """Values of one or two bytes from `start` on, and the number of bytes after them, except white space."""
    kind = np.dtype(np.uint8 if most < 256 else ">u2")
    needed = count * kind.itemsize
    if len(content) - start == needed + 1 and content[start - 1 : start + 1] == b"\r\n":
        start += 1
    body = content[start : start + needed]
    values = np.frombuffer(body[: len(body) // kind.itemsize * kind.itemsize], kind).astype(np.float64)
    return values, len(content[start + needed :].strip())


def _content(file: Path, most_pixels: int) -> bytes:
    content = read_bytes(file, most_bytes=MOST_BYTES, hint="name a picture file")
    width, height = _size(content)
    if width * height > most_pixels:
        raise _too_large(file, f"{width} x {height}", most_pixels)
    return content


def _decoded(content: bytes, file: Path, flags: int) -> NDArray[Any]:
    try:
        with _silent():
            if content[:2] in _WIDE_HEADS or (content.startswith(_PNG) and content[24:25] == b"\x10"):
                content = _narrowed(content, file)
            pixels = cv2.imdecode(np.frombuffer(content, np.uint8), flags) if content else None
    except cv2.error as error:
        large = _LIMIT_NAME in str(error)
        raise (_too_large(file, "too many", MOST_PIXELS) if large else _unreadable(file, content)) from error
    if pixels is None:
        raise _unreadable(file, content)
    return np.asarray(pixels)


def _narrowed(content: bytes, file: Path) -> bytes:
    """Picture of 8 bits a value of one with float, signed or 32-bit values; white is 1, else 255, else the greatest.

    One of 16 bits that fills only the lower eight is one of 8 bits. Raises InputError for one without any number.
    """
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.dtype == np.uint8 or (pixels.dtype == np.uint16 and pixels.max() > _BYTE):
        return content
    if pixels.dtype == np.uint16:
        return bytes(cv2.imencode(".png", pixels.astype(np.uint8))[1])
    if not np.isfinite(pixels).any():
        raise InputError("none of its values is a number", hint="save it again", file=file)
    values = np.nan_to_num(pixels.astype(np.float64), posinf=0.0, neginf=0.0)
    least, most = min(float(values.min()), 0.0), float(values.max())
    white = next((full for full in (1.0, 255.0) if least == 0.0 and most <= full), most)
    return bytes(cv2.imencode(".png", np.rint(255.0 / max(white - least, 1e-300) * (values - least)))[1])


def _too_large(file: Path, pixels: str, most_pixels: int) -> InputError:
    what = f"it has {pixels} pixels, and {most_pixels // 1_000_000} million are the most that is read"
    return InputError(what, hint="make it smaller", file=file)


@contextmanager
def _silent() -> Iterator[None]:
    """Silences OpenCV and the libraries below it, which write to the process's stderr about damaged files."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        with native_stderr_dropped():
            yield
    finally:
        cv2.utils.logging.setLogLevel(level)


def _unreadable(file: Path, content: bytes) -> InputError:
    if not content:
        return InputError("it is empty", hint="name a picture file", file=file)
    if cv2.haveImageReader(str(file)):
        return InputError("the picture is damaged or cut off", hint="copy or make it again", file=file)
    if content[4:12] in _PHONES:
        hint = f"save it as JPEG: heif-convert {file.name} {file.stem}.jpg"
        return InputError("it is HEIC, as phones take photographs", hint=hint, file=file)
    return InputError("it is no picture", hint=_HINT, file=file)


def _size(content: bytes) -> tuple[int, int]:
    """Width and height in the header of a PNG, JPEG, PNM or BMP; (0, 0) for others, which OpenCV checks itself."""
    if content.startswith(_PNG) and len(content) >= 24:
        width, height = struct.unpack(">II", content[16:24])
        return int(width), int(height)
    if content.startswith(b"\xff\xd8"):
        return _jpeg_size(content)
    if content.startswith(b"BM") and len(content) >= 26:
        width, height = struct.unpack("<ii", content[18:26])
        return abs(int(width)), abs(int(height))
    pnm = _ANY_PNM.match(content[:4096])
    return (0, 0) if pnm is None else (int(pnm[1]), int(pnm[2]))


def _jpeg_size(content: bytes) -> tuple[int, int]:
    """Width and height in the header of the first frame; segments begin with 0xff, kind, length."""
    place = 2
    while place + 9 <= len(content) and content[place] == 0xFF:
        kind = content[place + 1]
        if kind in _JPEG_SIZES:
            height, width = struct.unpack(">HH", content[place + 5 : place + 9])
            return int(width), int(height)
        place += 1 if kind == 0xFF else 2 + int.from_bytes(content[place + 2 : place + 4], "big")
    return 0, 0
