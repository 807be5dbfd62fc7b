"""Surveyed grids of collision shapes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from errand_make.shapes import Box, Cylinder, Shape
from errand_make.worlds.rooms import FREE, OCCUPIED, UNKNOWN, Bools, Grid
from skills.robot import FloatArray

DRAWN = frozenset({"low_scan"})
"""Grids that the robots get as well, where they have mapped the others themselves."""


@dataclass(frozen=True)
class Placement:
    """A shape whose model stands at (x, y) on the floor with a yaw (rad)."""

    shape: Shape
    x: float
    y: float
    yaw_rad: float


def rasterise(
    shapes: Iterable[Placement],
    band_m: tuple[float, float],
    outline_m: tuple[float, float],
    resolution_m: float = 0.025,
    margin_m: float = 0.5,
) -> Grid:
    """Rasterises shapes that reach into the height band: cells with their centre in one are occupied, those outside
    the walls are unknown."""
    size = [round((length + 2 * margin_m) / resolution_m) for length in outline_m]
    x = (np.arange(size[0]) + 0.5) * resolution_m - margin_m
    y = (np.arange(size[1]) + 0.5) * resolution_m - margin_m
    points = np.stack(np.meshgrid(x, y), axis=-1)
    inside = np.all((points > 0) & (points < outline_m), axis=-1)
    cells = np.where(inside, FREE, UNKNOWN).astype(np.uint8)
    for placed in shapes:
        if _reaches(placed.shape, band_m):
            low, high = _bounds(placed)
            rows, columns = (slice(*np.searchsorted(axis, (low[k], high[k]))) for k, axis in ((1, y), (0, x)))
            cells[rows, columns][covers(placed, points[rows, columns])] = OCCUPIED
    return Grid(cells, (-margin_m, -margin_m), resolution_m)


def _half_height(shape: Shape) -> float:
    if isinstance(shape, Box):
        return shape.size[2] / 2
    if isinstance(shape, Cylinder):
        return shape.length / 2
    raise TypeError(f"furniture is made of boxes and cylinders, not of {type(shape).__name__}")


def _reaches(shape: Shape, band_m: tuple[float, float]) -> bool:
    if shape.rpy[:2] != (0.0, 0.0):
        raise ValueError(f"{shape} does not stand upright")
    half = _half_height(shape)
    return shape.p[2] + half > band_m[0] and shape.p[2] - half < band_m[1]


def _bounds(placed: Placement) -> tuple[FloatArray, FloatArray]:
    """Corners (x, y) of a square that holds the shape seen from above."""
    shape = placed.shape
    assert isinstance(shape, Box | Cylinder)
    half = shape.radius if isinstance(shape, Cylinder) else np.hypot(*shape.size[:2]) / 2
    centre = _turn(np.array(shape.p[:2]), placed.yaw_rad) + np.array([placed.x, placed.y])
    return centre - half, centre + half


def covers(placed: Placement, points: FloatArray) -> Bools:
    """Returns which points (..., 2) lie inside the shape seen from above."""
    offset = points - np.array([placed.x, placed.y])
    in_model = _turn(offset, -placed.yaw_rad) - np.array(placed.shape.p[:2])
    local = _turn(in_model, -placed.shape.rpy[2])
    if isinstance(placed.shape, Box):
        return np.asarray(np.all(np.abs(local) <= np.array(placed.shape.size[:2]) / 2 + 1e-9, axis=-1))
    assert isinstance(placed.shape, Cylinder)
    return np.asarray(np.sum(local**2, axis=-1) <= placed.shape.radius**2)


def _turn(points: FloatArray, yaw_rad: float) -> FloatArray:
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))
