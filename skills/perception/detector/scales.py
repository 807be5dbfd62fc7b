"""Parts of a picture at another size and place, cut out without grain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.perception.detector.letterbox import PADDING
from skills.robot import Picture

_HALF_BELOW: Final = 0.7


@dataclass(frozen=True)
class Scales:
    """A picture `full` (H, W, 3), and the same at half its size, from which what is to be small is cut."""

    full: Picture
    half: Picture

    def cut(self, affine: NDArray[np.floating], size_px: tuple[int, int]) -> Picture:
        """What an affine map (2, 3) of pixel edges brings into a canvas of (width, height), with padding."""
        picture, to_canvas = self.full, affine.astype(np.float64)
        if np.sqrt(abs(np.linalg.det(to_canvas[:, :2]))) < _HALF_BELOW:
            picture, to_canvas = self.half, to_canvas @ np.diag([2.0, 2.0, 1.0])
        return cut_out(picture, to_canvas, size_px)


def cut_out(picture: Picture, affine: NDArray[np.floating], size_px: tuple[int, int]) -> Picture:
    """What an affine map (2, 3) of a picture's pixel edges brings into a canvas of (width, height), with padding."""
    to_canvas = affine.astype(np.float64)
    to_canvas[:, 2] += to_canvas[:, :2] @ (0.5, 0.5) - 0.5
    grey = (PADDING, PADDING, PADDING)
    cut = cv2.warpAffine(picture, to_canvas, size_px, flags=cv2.INTER_LINEAR, borderValue=grey)
    return np.asarray(cut, dtype=np.uint8)


def halved(picture: Picture) -> Picture:
    """A picture (H, W, 3) of even sides at half its size."""
    half = cv2.resize(picture, (picture.shape[1] // 2, picture.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(half, dtype=np.uint8)
