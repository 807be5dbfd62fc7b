"""Picture files of people as RGB, and pictures for them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from skills.files.errors import InputError
from skills.files.pictures import read_pixels
from skills.robot import Picture

__all__ = ["read_picture", "write_picture"]


def read_picture(file: Path) -> Picture:
    """A picture file as (H, W, 3) RGB uint8: grey, 16 bits and others are converted, transparency is dropped.

    Raises InputError for what cannot be read, is damaged or has too many pixels.
    """
    if file.is_dir():
        raise InputError("it is a folder", hint=f"name the pictures in it, such as {file}/*.png", file=file)
    return np.asarray(read_pixels(file, flags=cv2.IMREAD_COLOR_RGB), dtype=np.uint8)


def write_picture(file: Path, picture: Picture) -> None:
    """Write (H, W, 3) RGB in the form that the name's ending tells. Raises InputError when that does not work."""
    encoded, content = cv2.imencode(file.suffix, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.tobytes() if encoded else b"")
    except OSError as error:
        hint = "name a folder in which files can be written"
        raise InputError(f"cannot write it ({error.strerror})", hint=hint, file=file) from error
