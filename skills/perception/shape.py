"""The size and place of an object from the side of it that was seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from skills.robot import FloatArray

_FIT_STEPS = 30


@dataclass(frozen=True)
class SeenShape:
    """A box about an object: centre (x, y) in W, length >= width, height above its surface (m), yaw of the length.

    `round` says that its outline from above fits a circle.
    """

    centre: tuple[float, float]
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float
    round: bool


def measure(points_W: FloatArray, plane_m: FloatArray, p_WC: FloatArray) -> SeenShape:
    """Shape of the points (N, 3) of one object, seen from p_WC; plane_m (N,) is the surface's height below each."""
    above = points_W[:, 2] - plane_m
    height = float(np.percentile(above, 98))
    if height > 0.06:
        body = points_W[(above > 0.15 * height) & (above < 0.6 * height), :2]
        circle = circle_seen(body, p_WC) if len(body) >= 12 else None
        if circle is not None:
            x, y, radius = circle
            return SeenShape((x, y), 2 * radius, 2 * radius, height, 0.0, True)
    (x, y), length, width, yaw = smallest_rectangle(without_strays(_upper(points_W, above, height)))
    return SeenShape((float(x), float(y)), length, width, height, yaw, False)


def _upper(points_W: FloatArray, above: FloatArray, height: float) -> FloatArray:
    """Points (x, y) without the lowest, where the object meets the noise of its surface."""
    kept = points_W[above > 0.3 * height, :2]
    return kept if len(kept) >= 8 else points_W[:, :2]


def circle_seen(xy: FloatArray, p_WC: FloatArray, largest_m: float = 0.09) -> tuple[float, float, float] | None:
    """Centre and radius, at most largest_m, of the seen front (N, 2) of a round object; None when it is not round."""
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

    centre = _nearest_centre(xy, radius, guess)
    off = np.abs(np.linalg.norm(xy - centre, axis=1) - radius)
    spread = float(np.median(off))
    if spread > 0.003 + 0.003 * distance or np.linalg.norm(centre - guess) > 0.5 * radius + 0.01:
        return None
    return float(centre[0]), float(centre[1]), float(radius)


def _nearest_centre(xy: FloatArray, radius: float, guess: FloatArray, scale_m: float = 0.004) -> FloatArray:
    """Centre of the circle of a radius nearest to points (N, 2), those far off it counting little (soft L1 loss).

    Gauss-Newton with iteratively reweighted least squares (Holland and Welsch, 1977); SciPy's solver would take
    longer to import than all fits of a mission.
    """
    centre = guess
    for _ in range(_FIT_STEPS):
        off = xy - centre
        distance = np.maximum(np.linalg.norm(off, axis=1), 1e-9)
        towards, error = off / distance[:, None], distance - radius
        weighted = towards / np.sqrt(1.0 + (error / scale_m) ** 2)[:, None]
        step = np.linalg.solve(weighted.T @ towards + 1e-9 * np.eye(2), weighted.T @ error)
        centre = centre + step
        if float(np.abs(step).max()) < 1e-6:
            break
    return np.asarray(centre)


def smallest_rectangle(xy: FloatArray) -> tuple[FloatArray, float, float, float]:
    """The smallest rectangle about points (N, 2): middle, length, width, yaw of the length in [-pi/2, pi/2)."""
    middle = xy.mean(axis=0)
    (x, y), (first, second), angle_deg = cv2.minAreaRect((xy - middle).astype(np.float32))
    yaw = math.radians(angle_deg) + (0.0 if first >= second else 0.5 * math.pi)
    yaw = (yaw + 0.5 * math.pi) % math.pi - 0.5 * math.pi
    return middle + [x, y], float(max(first, second)), float(min(first, second)), yaw


def without_strays(xy: FloatArray, cell_m: float = 0.006) -> FloatArray:
    """Points whose grid cell holds at least two of them, or all when that leaves too few."""
    columns, rows = np.floor((xy - xy.min(axis=0)) / cell_m).astype(np.int64).T
    cells = rows * (columns.max() + 1) + columns
    kept = xy[np.bincount(cells)[cells] >= 2]
    return kept if len(kept) >= 8 else xy
