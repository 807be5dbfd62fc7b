"""Points and outlines in the plane."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import shapely

__all__ = ["Point", "distance_m", "inside"]

Point = tuple[float, float]


def inside(polygon: Sequence[Point], point: Point) -> bool:
    """Whether (x, y) lies within the outline."""
    return bool(shapely.contains_xy(_outline(tuple(polygon)), *point))


def distance_m(polygon: Sequence[Point], point: Point) -> float:
    """How far (x, y) lies outside the outline; 0 within it."""
    return float(shapely.distance(_outline(tuple(polygon)), shapely.Point(point)))


@functools.lru_cache(maxsize=256)
def _outline(polygon: tuple[Point, ...]) -> shapely.Polygon:
    """The outline; rooms are asked for again and again while a mission is compiled."""
    return shapely.Polygon(polygon)
