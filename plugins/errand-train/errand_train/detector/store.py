"""Decoded pictures on disk at the network's size and at half of it, so that no epoch decodes them again."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_train.detector.labels import TrainingDataError, TrainingPicture
from skills.perception.detector.boxes import HEIGHT_PX, WIDTH_PX, Scales, fill_letterbox, halve

Picture = NDArray[np.uint8]
_FULL: Final = "full.u8"
_HALF: Final = "half.u8"
_DONE: Final = "pictures.txt"


@dataclass(frozen=True)
class PictureStore:
    """Letterboxed pictures `full` (N, 480, 640, 3) and `half` (N, 240, 320, 3), RGB, mapped from files."""

    full: Picture
    half: Picture

    def scales(self, index: int) -> Scales:
        """Letterbox and half of a picture, by its number."""
        return Scales(self.full[index], self.half[index])


def read_picture(file: Path) -> Picture:
    """Reads a picture (H, W, 3) of a data set, RGB. Raises TrainingDataError."""
    found = cv2.imread(str(file), cv2.IMREAD_COLOR_RGB)
    if found is None:
        raise TrainingDataError(f"{file}: is no picture, or damaged", hint="render the data set again")
    return np.asarray(found, dtype=np.uint8)


def read_scales(file: Path) -> Scales:
    """Reads the letterbox of a picture, RGB, and its half. Raises TrainingDataError."""
    filled = np.empty((HEIGHT_PX, WIDTH_PX, 3), dtype=np.uint8)
    fill_letterbox(read_picture(file), filled)
    return Scales(filled, halve(filled))


def open_store(folder: Path, pictures: Sequence[TrainingPicture]) -> PictureStore:
    """Opens the store of pictures in a folder; fills it if it holds other pictures. Raises TrainingDataError."""
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256("\n".join(str(picture.file) for picture in pictures).encode()).hexdigest()
    done = folder / _DONE
    if not done.is_file() or done.read_text() != digest:
        done.unlink(missing_ok=True)
        _fill(_mapped(folder, len(pictures), "w+"), pictures)
        done.write_text(digest)
    return _mapped(folder, len(pictures), "r")


def _mapped(folder: Path, count: int, mode: str) -> PictureStore:
    def array(name: str, shrink: int) -> Picture:
        shape = (count, HEIGHT_PX // shrink, WIDTH_PX // shrink, 3)
        return np.memmap(folder / name, dtype=np.uint8, mode=mode, shape=shape)  # type: ignore[call-overload, no-any-return]

    return PictureStore(array(_FULL, 1), array(_HALF, 2))


def _fill(store: PictureStore, pictures: Sequence[TrainingPicture]) -> None:
    for k, picture in enumerate(pictures):
        scales = read_scales(picture.file)
        store.full[k], store.half[k] = scales.full, scales.half
