"""Pictures of any size in the one size that the detector's network takes, and boxes on the way back."""

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

Boxes = NDArray[np.float32]


@dataclass(frozen=True)
class Letterbox:
    """How a picture of width_px x height_px lies in the letterbox: from the upper left corner, scaled by scale_xy.

    Both scales are the same but for the rounding to whole pixels. Boxes are (N, 4) rows of (u0, v0, u1, v1): edges in
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
        """Letterbox pixels in a pixel of the picture, across and down."""
        width, height = self.inside_px
        return width / self.width_px, height / self.height_px

    def to_picture(self, boxes: NDArray[np.floating]) -> Boxes:
        """Boxes of the letterbox in the picture's pixels, clipped to it."""
        found = np.asarray(boxes, dtype=np.float32).reshape(-1, 4) / self._factors()
        limits = np.array([self.width_px, self.height_px] * 2, dtype=np.float32)
        return np.asarray(np.clip(found, 0.0, limits), dtype=np.float32)

    def _factors(self) -> Boxes:
        return np.array(self.scale_xy * 2, dtype=np.float32)


def letterbox(picture: Picture) -> tuple[Picture, Letterbox]:
    """A picture (H, W, 3) RGB or (H, W) grey as (480, 640, 3) RGB: scaled to fit with its aspect kept, then padded.

    Raises ValueError for what is no such picture.
    """
    filled = np.empty((HEIGHT_PX, WIDTH_PX, 3), dtype=np.uint8)
    return filled, fill_letterbox(picture, filled)


def fill_letterbox(picture: Picture, into: Picture) -> Letterbox:
    """The same, written `into` an array (480, 640, 3), such as one of a batch. Raises ValueError."""
    check_picture(picture)
    placed = Letterbox(width_px=picture.shape[1], height_px=picture.shape[0])
    width, height = placed.inside_px
    into[height:] = PADDING
    into[:height, width:] = PADDING
    into[:height, :width] = _coloured(_resized(picture, width, height))
    return placed


def check_picture(picture: Picture) -> None:
    """Raises ValueError for what is no picture: no array of uint8, neither (H, W, 3) nor (H, W), or empty."""
    if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8:
        raise ValueError(f"a picture is an array of uint8, not {getattr(picture, 'dtype', type(picture).__name__)}")
    if picture.ndim not in (2, 3) or (picture.ndim == 3 and picture.shape[2] != 3) or not picture.size:
        raise ValueError(f"a picture is (H, W, 3) or (H, W), not {picture.shape}")


def _resized(picture: Picture, width: int, height: int) -> Picture:
    """Scaled: averaged when smaller, interpolated when larger."""
    rows, columns = picture.shape[:2]
    if (columns, rows) == (width, height):
        return picture
    smaller = width < columns or height < rows
    scaled = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
    return np.asarray(scaled, dtype=np.uint8)


def _coloured(picture: Picture) -> Picture:
    """RGB; grey in all three channels."""
    return picture if picture.ndim == 3 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2RGB), dtype=np.uint8)
