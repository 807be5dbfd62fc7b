"""A nearly level plane on which objects rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skills.robot import FloatArray

_FEWEST_POINTS = 40
_STEEPEST = 0.035
_LEAST_NOISE_M = 0.001


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

    def refined(self, points: FloatArray, band_m: float) -> LevelPlane | None:
        """One step of trimmed least squares by points (N, 3) within band_m of the plane; None where they are too few.

        Slopes beyond 2 degrees are taken for clutter and dropped.
        """
        kept = points[np.abs(points[:, 2] - self.z(points[:, :2])) < band_m]
        if len(kept) < _FEWEST_POINTS:
            return None
        design = np.column_stack([np.ones(len(kept)), kept[:, :2] - np.array(self.origin)])
        (height, slope_x, slope_y), *_ = np.linalg.lstsq(design, kept[:, 2], rcond=None)
        if np.hypot(slope_x, slope_y) > _STEEPEST:
            height, slope_x, slope_y = np.median(kept[:, 2]), 0.0, 0.0
        fitted = replace(self, height_m=float(height), slope=(float(slope_x), float(slope_y)))
        noise_m = 1.48 * float(np.median(np.abs(kept[:, 2] - fitted.z(kept[:, :2]))))
        return replace(fitted, noise_m=max(noise_m, _LEAST_NOISE_M))
