"""What is about places in pictures, kept as small compressed pictures, so that crops are cut without the whole ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.perception.detector.proposals import CROP_PX, crop_map
from skills.perception.detector.scales import Scales, cut_out, halved

__all__ = ["REACH_PX", "CropStore", "CropWriter", "written_crops"]

REACH_PX: Final = 108.0
"""How far from a place's middle, in pixels of its crop, is kept: as far as `changed_map` may show any of it."""
_PICTURES: Final = "chips.u8"
_INDEX: Final = "chips.npz"
_COLUMNS: Final = ("ends", "corners", "shrinks")
_HALF_BELOW: Final = 0.49
_QUALITY: Final = (
    cv2.IMWRITE_JPEG_QUALITY,
    95,
    cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
    cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
)

Picture = NDArray[np.uint8]
Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class CropStore:
    """R pictures, one after the other in `data`, of which each ends at one of `ends` (R,).

    `corners` (R, 2) tell where in the letterbox their upper left corners are, and `shrinks` (R,) how many of its pixels
    one of theirs is, 1 or 2.
    """

    data: Picture
    ends: Numbers
    corners: Numbers
    shrinks: Numbers

    def __len__(self) -> int:
        return len(self.ends)

    @staticmethod
    def are_in(folder: Path) -> bool:
        """Whether some were written to a folder."""
        return (folder / _INDEX).is_file()

    @staticmethod
    def read(folder: Path) -> CropStore:
        """What was written to a folder; pictures are mapped from their file."""
        with np.load(folder / _INDEX) as kept:
            index = {name: kept[name] for name in _COLUMNS}
        return CropStore(np.memmap(folder / _PICTURES, dtype=np.uint8, mode="r"), **index)

    def cut(self, row: int, affine: NDArray[np.floating]) -> Picture:
        """The crop (128, 128, 3) into which an affine map (2, 3) brings the letterbox; grey beyond what is kept."""
        begin = int(self.ends[row - 1]) if row else 0
        kept = cv2.imdecode(self.data[begin : int(self.ends[row])], cv2.IMREAD_COLOR_RGB)
        picture, shrink = np.asarray(kept, dtype=np.uint8), int(self.shrinks[row])
        to_letterbox = np.diag([float(shrink), float(shrink), 1.0])
        to_letterbox[:2, 2] = self.corners[row]
        local = affine.astype(np.float64) @ to_letterbox
        if shrink == 1:
            return Scales(picture, halved(picture)).cut(local, (CROP_PX, CROP_PX))
        return cut_out(picture, local, (CROP_PX, CROP_PX))


@contextmanager
def written_crops(folder: Path) -> Iterator[CropWriter]:
    """What writes them to a folder, picture by picture; they are there when it is left without an error."""
    fresh, index = folder / f".{_PICTURES}.new", folder / _INDEX
    try:
        with fresh.open("wb") as file:
            writer = CropWriter(file)
            yield writer
        index.unlink(missing_ok=True)
        fresh.replace(folder / _PICTURES)
        ends, corners, shrinks = (np.array(getattr(writer, name), dtype=np.int64) for name in _COLUMNS)
        np.savez(index, ends=ends, corners=corners, shrinks=shrinks)
    finally:
        fresh.unlink(missing_ok=True)


@dataclass(frozen=True)
class CropWriter:
    """Writes pictures to a file, one after the other; the rest as `CropStore` tells it."""

    file: BinaryIO
    ends: list[int] = field(default_factory=list)
    corners: list[tuple[int, int]] = field(default_factory=list)
    shrinks: list[int] = field(default_factory=list)

    def add(self, scales: Scales, boxes: NDArray[np.floating]) -> None:
        """Keep what is about boxes (R, 4) of a picture's letterbox."""
        for box in boxes:
            picture, corner, shrink = _about(scales, box)
            coded, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), _QUALITY)
            assert coded
            self.ends.append((self.ends[-1] if self.ends else 0) + len(data))
            self.corners.append(corner)
            self.shrinks.append(shrink)
            self.file.write(data.tobytes())


def _about(scales: Scales, box: NDArray[np.floating]) -> tuple[Picture, tuple[int, int], int]:
    """What is about a box (4,), the upper left corner in the letterbox, and how many of its pixels one is.

    Corners and sides are even, so that its half is the same as in the picture's half.
    """
    scale = float(crop_map(box)[0, 0])
    shrink = 2 if scale < _HALF_BELOW else 1
    picture = scales.half if shrink == 2 else scales.full
    height, width = picture.shape[:2]
    middle = np.array([box[0] + box[2], box[1] + box[3]], dtype=np.float64) / 2
    low = np.floor((middle - REACH_PX / scale) / shrink / 2).astype(int) * 2
    high = np.ceil((middle + REACH_PX / scale) / shrink / 2).astype(int) * 2
    u0, v0 = np.clip(low, 0, (width - 2, height - 2))
    u1, v1 = np.clip(high, (u0 + 2, v0 + 2), (width, height))
    return picture[v0:v1, u0:u1], (int(u0) * shrink, int(v0) * shrink), shrink
