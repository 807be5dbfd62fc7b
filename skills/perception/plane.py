"""A nearly level plane on which objects rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skills.robot import FloatArray

__all__ = ["LevelPlane"]


@dataclass(frozen=True)
class LevelPlane:
    """What an object rests on: z = height_m + slope . ((x, y) - origin); noise_m is the spread of its points.

    In whichever frame with z upwards its points were given.
    """

    origin: tuple[float, float]
    height_m: float
    slope: tuple[float, float]
    noise_m: float

    def z(self, xy: FloatArray) -> FloatArray:
        """Height of the plane at (..., 2) places."""
        return np.asarray(self.height_m + (xy - np.array(self.origin)) @ np.array(self.slope))
