"""Letterbox: pictures of any size in the one size that the detector's networks take, boxes back, and crops of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.robot import Picture

WIDTH_PX: Final = 640
HEIGHT_PX: Final = 480
PADDING: Final = 114
_HALF_BELOW: Final = 0.7
"""Scale of a crop below which it is sampled from the halved picture, against aliasing."""

Boxes = NDArray[np.float32]


@dataclass(frozen=True)
class Letterbox:
    """Placement of a picture of width_px x height_px in the letterbox: from the upper left corner, scaled by scale_xy.

    Both scales differ only by the rounding to whole pixels. Boxes are (N, 4) rows of (u0, v0, u1, v1): edges in
    pixels, so that a whole picture is (0, 0, width, height).
    """

    width_px: int
    height_px: int

    @property
    def inside_px(self) -> tuple[int, int]:
        """Width and height of the part that shows the picture; the rest, at right or bottom, is padding."""
        scale = min(WIDTH_PX / self.width_px, HEIGHT_PX / self.height_px)
        return max(1, round(self.width_px * scale)), max(1, round(self.height_px * scale))

    @property
    def scale_xy(self) -> tuple[float, float]:
        """Letterbox pixels per pixel of the picture, across and down."""
        width, height = self.inside_px
        return width / self.width_px, height / self.height_px

    def to_picture(self, boxes: NDArray[np.floating]) -> Boxes:
        """Converts boxes from the letterbox to the picture's pixels, clipped to the picture."""
        found = np.asarray(boxes, dtype=np.float32).reshape(-1, 4) / np.array(self.scale_xy * 2, dtype=np.float32)
        limits = np.array([self.width_px, self.height_px] * 2, dtype=np.float32)
        return np.asarray(np.clip(found, 0.0, limits), dtype=np.float32)


def letterbox(picture: Picture) -> tuple[Picture, Letterbox]:
    """Scales a picture (H, W, 3) RGB or (H, W) grey with its aspect, and pads it to (480, 640, 3) RGB.

    Raises ValueError for anything but such a picture.
    """
    filled = np.empty((HEIGHT_PX, WIDTH_PX, 3), dtype=np.uint8)
    return filled, fill_letterbox(picture, filled)


def fill_letterbox(picture: Picture, into: Picture) -> Letterbox:
    """Writes the letterbox of a picture `into` an array (480, 640, 3), such as one of a batch. Raises ValueError."""
    check_picture(picture)
    placed = Letterbox(width_px=picture.shape[1], height_px=picture.shape[0])
    width, height = placed.inside_px
    into[height:] = PADDING
    into[:height, width:] = PADDING
    resized = _resized(picture, width, height)
    into[:height, :width] = resized if resized.ndim == 3 else cv2.cvtColor(resized, cv2.COLOR_GRAY2RGB)
    return placed


def check_picture(picture: Picture) -> None:
    """Raises ValueError unless a picture is a non-empty array of uint8, (H, W, 3) or (H, W)."""
    if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8:
        raise ValueError(f"a picture is an array of uint8, not {getattr(picture, 'dtype', type(picture).__name__)}")
    if picture.ndim not in (2, 3) or (picture.ndim == 3 and picture.shape[2] != 3) or not picture.size:
        raise ValueError(f"a picture is (H, W, 3) or (H, W), not {picture.shape}")


def _resized(picture: Picture, width: int, height: int) -> Picture:
    """Averages pixels where the result is smaller, and interpolates where it is larger."""
    rows, columns = picture.shape[:2]
    if (columns, rows) == (width, height):
        return picture
    smaller = width < columns or height < rows
    scaled = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
    return np.asarray(scaled, dtype=np.uint8)


@dataclass(frozen=True)
class Scales:
    """A picture `full` (H, W, 3) and its `half`, from which small crops are sampled."""

    full: Picture
    half: Picture

    def warp(self, affine: NDArray[np.floating], size_px: tuple[int, int]) -> Picture:
        """Warps the picture by an affine map (2, 3) of pixel edges into (width, height), with padding."""
        picture, to_crop = self.full, affine.astype(np.float64)
        if np.sqrt(abs(np.linalg.det(to_crop[:, :2]))) < _HALF_BELOW:
            picture, to_crop = self.half, to_crop @ np.diag([2.0, 2.0, 1.0])
        return warp(picture, to_crop, size_px)


def warp(picture: Picture, affine: NDArray[np.floating], size_px: tuple[int, int]) -> Picture:
    """Warps a picture by an affine map (2, 3) of pixel edges into (width, height), with padding."""
    to_crop = affine.astype(np.float64)
    to_crop[:, 2] += to_crop[:, :2] @ (0.5, 0.5) - 0.5
    grey = (PADDING, PADDING, PADDING)
    crop = cv2.warpAffine(picture, to_crop, size_px, flags=cv2.INTER_LINEAR, borderValue=grey)
    return np.asarray(crop, dtype=np.uint8)


def halve(picture: Picture) -> Picture:
    """Scales a picture (H, W, 3) of even sides to half its size."""
    half = cv2.resize(picture, (picture.shape[1] // 2, picture.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half, dtype=np.uint8)
