"""Points and outlines in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["Point", "distance_m", "inside"]

Point = tuple[float, float]


def inside(polygon: Sequence[Point], point: Point) -> bool:
    """Whether (x, y) lies within the outline: a ray to the right crosses it an odd number of times."""
    x, y = point
    edges = zip(polygon, (*polygon[1:], polygon[0]), strict=True)
    crossings = ((y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1) for (x1, y1), (x2, y2) in edges)
    return sum(crossings) % 2 == 1


def distance_m(polygon: Sequence[Point], point: Point) -> float:
    """How far (x, y) lies outside the outline; 0 within it."""
    if inside(polygon, point):
        return 0.0
    return min(_to_edge_m(point, start, end) for start, end in zip(polygon, (*polygon[1:], polygon[0]), strict=True))


def _to_edge_m(point: Point, start: Point, end: Point) -> float:
    (px, py), (ax, ay), (bx, by) = point, start, end
    length2 = (bx - ax) ** 2 + (by - ay) ** 2
    share = 0.0 if length2 == 0.0 else ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length2
    share = min(1.0, max(0.0, share))
    return math.hypot(px - ax - share * (bx - ax), py - ay - share * (by - ay))
