"""Points and outlines in the plane."""

from __future__ import annotations

from collections.abc import Sequence


def inside(polygon: Sequence[tuple[float, float]], point: tuple[float, float]) -> bool:
    """True when (x, y) lies within the outline."""
    x, y = point
    crossings = 0
    for (x1, y1), (x2, y2) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if (y1 > y) != (y2 > y):
            crossings += x < x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return crossings % 2 == 1
