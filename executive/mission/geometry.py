"""Points and outlines in the plane."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

__all__ = ["Point", "distance_m", "inside"]

Point = tuple[float, float]


def inside(polygon: Sequence[Point], point: Point) -> bool:
    """Whether (x, y) lies within the outline."""
    return bool(shapely.contains_xy(shapely.Polygon(polygon), *point))


def distance_m(polygon: Sequence[Point], point: Point) -> float:
    """How far (x, y) lies outside the outline; 0 within it."""
    return float(shapely.distance(shapely.Polygon(polygon), shapely.Point(point)))
