"""Geometry of points and outlines in the plane."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from skills.inputs.errors import InputError
from skills.inputs.yaml_source import KeyPath, YamlSource
from skills.quantities import Coordinate

if TYPE_CHECKING:
    import shapely

Point = tuple[float, float]
Corner = tuple[Coordinate, Coordinate]
"""Corner of an outline in a file."""
Polygon = Annotated[tuple[Corner, ...], Field(min_length=3)]
"""Outline in a file."""
_NEAR_M: Final = 4.0
"""Distance of doors and surfaces from their rooms, and of viewpoints from their surfaces, at most."""


@dataclass(frozen=True)
class Side:
    """Side of an outline, with its distance (m) from a given line."""

    ends: tuple[Point, Point]
    off_m: float


def inside(polygon: Sequence[Point], point: Point) -> bool:
    """Returns whether (x, y) lies inside the outline."""
    import shapely

    return bool(shapely.contains_xy(_outline(tuple(polygon)), *point))


def area_m2(polygon: Sequence[Point]) -> float:
    """Area within the outline."""
    return float(_outline(tuple(polygon)).area)


def distance_m(polygon: Sequence[Point], point: Point) -> float:
    """Distance from (x, y) to the outline; 0 within it."""
    import shapely

    return float(shapely.distance(_outline(tuple(polygon)), shapely.Point(point)))


def unless_near(
    source: YamlSource, path: KeyPath, at: Point, name: str, outline: Sequence[Point] | None
) -> Iterator[InputError]:
    """Yields an error for a point that is far from an outline."""
    if outline is not None and (off_m := distance_m(outline, at)) > _NEAR_M:
        what = f"({at[0]:g}, {at[1]:g}) is {off_m:.1f} m from the {name}"
        yield source.error(path, what, f"correct it; {_NEAR_M:g} m at most")


def fits(outline: Sequence[Point], polygon: Sequence[Point], taken: Iterable[Sequence[Point]]) -> bool:
    """Returns whether an outline lies in a polygon and overlaps none of the `taken` outlines."""
    import shapely

    body = shapely.Polygon(outline)
    return bool(shapely.Polygon(polygon).covers(body)) and not any(body.intersects(shapely.Polygon(t)) for t in taken)


def nearest_side(polygon: Sequence[Point], middle: Point, length_m: float) -> Side:
    """Side of an outline that is nearest to both ends of a parallel line with this centre and length."""
    ends = zip(polygon, (*polygon[1:], polygon[0]), strict=True)
    return min((Side(pair, _ends_off_m(pair, middle, length_m)) for pair in ends), key=lambda side: side.off_m)


def _ends_off_m(side: tuple[Point, Point], middle: Point, length_m: float) -> float:
    """Sum of the distances between a side and both ends of a line parallel to it."""
    import shapely

    (x0, y0), (x1, y1) = side
    side_m = max(math.dist(*side), 1e-9)
    dx, dy = (0.5 * length_m * (b - a) / side_m for a, b in ((x0, x1), (y0, y1)))
    ends = (middle[0] - dx, middle[1] - dy), (middle[0] + dx, middle[1] + dy)
    return sum(float(shapely.distance(shapely.LineString(side), shapely.Point(end))) for end in ends)


@functools.lru_cache(maxsize=256)
def _outline(polygon: tuple[Point, ...]) -> shapely.Polygon:
    """Outline as a shapely polygon; cached, because the compiler asks for the same rooms repeatedly."""
    import shapely

    return shapely.Polygon(polygon)
