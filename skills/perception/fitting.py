"""Shapes fitted to points: level planes, circles, rectangles, and bounding boxes of objects."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from skills.robot import FloatArray

_PLANE_FEWEST_POINTS = 40
_PLANE_STEEPEST = 0.035
_PLANE_LEAST_NOISE_M = 0.001
_CIRCLE_STEPS = 30


@dataclass(frozen=True)
class LevelPlane:
    """A nearly level plane z = height_m + slope . ((x, y) - origin); noise_m is the standard deviation of its points.

    The z axis of its frame points up.
    """

    origin: tuple[float, float]
    height_m: float
    slope: tuple[float, float]
    noise_m: float

    @classmethod
    def fit(
        cls, points: FloatArray, height_m: float, *, noise_m: float, band_m: float, sigmas: float, steps: int
    ) -> LevelPlane:
        """Fits a plane near a height to points (N, 3) by trimmed least squares.

        Starts with `noise_m`; each of the `steps` uses the points within `sigmas` times the noise, but at least within
        band_m.
        """
        x, y = points[:, :2].mean(axis=0)
        plane = cls((float(x), float(y)), height_m, (0.0, 0.0), noise_m)
        for _ in range(steps):
            plane = plane._refined(points, max(band_m, sigmas * plane.noise_m)) or plane
        return plane

    def z(self, xy: FloatArray) -> FloatArray:
        """Height of the plane at points (..., 2)."""
        return np.asarray(self.height_m + (xy - np.array(self.origin)) @ np.array(self.slope))

    def _refined(self, points: FloatArray, band_m: float) -> LevelPlane | None:
        """The plane through the points (N, 3) within band_m; None for too few points, or a slope beyond 2 degrees."""
        near = points.compress(np.abs(points[:, 2] - self.z(points[:, :2])) < band_m, axis=0)
        if len(near) < _PLANE_FEWEST_POINTS:
            return None
        design = np.column_stack([np.ones(len(near)), near[:, :2] - np.array(self.origin)])
        (height, slope_x, slope_y), *_ = np.linalg.lstsq(design, near[:, 2], rcond=None)
        if np.hypot(slope_x, slope_y) > _PLANE_STEEPEST:
            height, slope_x, slope_y = np.median(near[:, 2]), 0.0, 0.0
        fitted = replace(self, height_m=float(height), slope=(float(slope_x), float(slope_y)))
        noise_m = 1.48 * float(np.median(np.abs(near[:, 2] - fitted.z(near[:, :2]))))
        return replace(fitted, noise_m=max(noise_m, _PLANE_LEAST_NOISE_M))


@dataclass(frozen=True)
class SeenShape:
    """Upright bounding box: centre (x, y) in W, length >= width, height above its surface (m), yaw of the length.

    `round` is True when its outline from above fits a circle.
    """

    centre: tuple[float, float]
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float
    round: bool


def measure(points_W: FloatArray, plane_m: FloatArray, p_WC: FloatArray) -> SeenShape:
    """Fits a shape to an object's points (N, 3) seen from p_WC; plane_m (N,) is the surface's height below each."""
    above = points_W[:, 2] - plane_m
    height = float(np.percentile(above, 98))
    if height > 0.06:
        body = points_W[(above > 0.15 * height) & (above < 0.6 * height), :2]
        circle = fit_circle(body, p_WC) if len(body) >= 12 else None
        if circle is not None:
            x, y, radius = circle
            return SeenShape((x, y), 2 * radius, 2 * radius, height, 0.0, True)
    upper = points_W[above > 0.3 * height, :2]  # without the points that the noise of the surface touches
    upper = upper if len(upper) >= 8 else points_W[:, :2]
    (x, y), length, width, yaw = fit_rectangle(without_strays(upper))
    return SeenShape((float(x), float(y)), length, width, height, yaw, False)


def fit_circle(xy: FloatArray, p_WC: FloatArray, largest_m: float = 0.09) -> tuple[float, float, float] | None:
    """Fits centre and radius, at most largest_m, to the visible front (N, 2) of a round object; None if not round."""
    view = np.mean(xy, axis=0) - p_WC[:2]
    distance = float(np.linalg.norm(view))
    view = view / max(distance, 1e-6)
    across = xy @ np.array([-view[1], view[0]])
    left, right = np.percentile(across, [1, 99])
    radius = 0.5 * (right - left)
    if not 0.008 < radius < largest_m:
        return None
    near = float(np.percentile(xy @ view, 4))
    guess = (near + radius) * view + 0.5 * (left + right) * np.array([-view[1], view[0]])

    centre = _fit_centre(xy, radius, guess)
    off = np.abs(np.linalg.norm(xy - centre, axis=1) - radius)
    spread = float(np.median(off))
    if spread > 0.003 + 0.003 * distance or np.linalg.norm(centre - guess) > 0.5 * radius + 0.01:
        return None
    return float(centre[0]), float(centre[1]), float(radius)


def _fit_centre(xy: FloatArray, radius: float, guess: FloatArray, scale_m: float = 0.004) -> FloatArray:
    """Fits the centre of a circle with a given radius to points (N, 2) with the soft L1 loss.

    Gauss-Newton with iteratively reweighted least squares (Holland and Welsch, 1977); importing SciPy's solver would
    take longer than all fits of a mission.
    """
    centre = guess
    for _ in range(_CIRCLE_STEPS):
        off = xy - centre
        distance = np.maximum(np.linalg.norm(off, axis=1), 1e-9)
        towards, error = off / distance[:, None], distance - radius
        weighted = towards / np.sqrt(1.0 + (error / scale_m) ** 2)[:, None]
        step = np.linalg.solve(weighted.T @ towards + 1e-9 * np.eye(2), weighted.T @ error)
        centre = centre + step
        if float(np.abs(step).max()) < 1e-6:
            break
    return np.asarray(centre)


def fit_rectangle(xy: FloatArray) -> tuple[FloatArray, float, float, float]:
    """Fits the smallest rectangle around points (N, 2): centre, length, width, yaw of the length in [-pi/2, pi/2)."""
    middle = xy.mean(axis=0)
    (x, y), (first, second), angle_deg = cv2.minAreaRect((xy - middle).astype(np.float32))
    yaw = math.radians(angle_deg) + (0.0 if first >= second else 0.5 * math.pi)
    yaw = (yaw + 0.5 * math.pi) % math.pi - 0.5 * math.pi
    return middle + [x, y], float(max(first, second)), float(min(first, second)), yaw


def without_strays(xy: FloatArray, cell_m: float = 0.006) -> FloatArray:
    """Points in grid cells that hold at least two, or all points when fewer than eight remain."""
    columns, rows = np.floor((xy - xy.min(axis=0)) / cell_m).astype(np.int64).T
    cells = rows * (columns.max() + 1) + columns
    dense = xy[np.bincount(cells)[cells] >= 2]
    return dense if len(dense) >= 8 else xy
