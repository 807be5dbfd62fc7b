"""Pictures of cameras that hang upside down, turned by half a turn before they are looked at, and boxes turned back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from skills.detection import Detection
from skills.robot import Picture

LEAST_ROLL_DEG: Final = 120.0
"""A picture that is turned by more than this from upright, either way, stands on its head."""


def turned(picture: Picture) -> Picture:
    """A picture (H, W) or (H, W, 3) turned by half a turn."""
    return np.ascontiguousarray(picture[::-1, ::-1])


def turned_back(found: Sequence[Detection], width_px: int, height_px: int) -> tuple[Detection, ...]:
    """What was found in a turned picture of a size, with boxes in the picture as it was taken."""

    def back(one: Detection) -> Detection:
        u0, v0, u1, v1 = one.box
        return replace(one, box=(width_px - u1, height_px - v1, width_px - u0, height_px - v0))

    return tuple(back(one) for one in found)
