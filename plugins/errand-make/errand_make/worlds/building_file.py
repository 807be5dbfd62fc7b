"""Contents of a building file of Open-RMF's traffic editor, and the frame of each level in the building."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from errand_make.worlds.rooms import Point
from skills.inputs.errors import suggestion
from skills.inputs.yaml_source import YamlSource

HINT: Final = "save the building again in the traffic editor"
_USUAL_SCALE_M: Final = 0.05
"""Metres of a pixel that the traffic editor assumes."""
_MOST_APART: Final = 1.05
"""Largest ratio of the scales that two measurements give without a warning."""
EDGES: Final = ("walls", "doors", "lanes", "measurements")


@dataclass(frozen=True)
class LevelFrame:
    """Frame of a level's drawing in the building: `factor` turns and scales points x + iy, then `shift_m` moves them.

    The y of a drawing points up here.
    """

    factor: complex
    shift_m: complex = 0.0

    def point(self, x: float, y: float) -> Point:
        """Point of the drawing in the building (m)."""
        moved = self.factor * complex(x, y) + self.shift_m
        return moved.real, moved.imag


def level_frame(source: YamlSource, name: str, scale_m: float | None, notes: list[str]) -> LevelFrame:
    """Frame of a level drawn in pixels, as the building tools of Open-RMF compute it.

    The reference level has the mean scale of its measurements. Another level is turned, scaled and moved so that its
    fiducials meet those of the same names there. `scale_m` is the length of its pixel, in place of measurements.
    Raises InputError.
    """
    levels = building_levels(source)
    reference = source.data.get("reference_level_name", next(iter(levels)))
    if reference not in levels:
        what = f"there is no level '{reference}' for the reference of the others"
        raise source.error(("reference_level_name",), what, suggestion(str(reference), list(levels)))
    if name == reference:
        return LevelFrame(scale_m or _measured_scale(source, name, notes))
    own, there = _fiducials(source, name), _fiducials(source, reference)
    pairs = [(point, other) for known, point in there for each, other in own if each == known]
    spans = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.combinations(pairs, 2)]
    if not spans:
        what = f"level {name} has {len(pairs)} fiducials in common with the reference level {reference}, and needs 2"
        notes.append(f"{what}: its coordinates count from the corner of its own drawing")
        return LevelFrame(scale_m or _measured_scale(source, name, notes))
    if not all(a and b for a, b in spans):
        path = ("levels", name, "fiducials")
        raise source.error(path, f"two fiducials of level {name} or {reference} are at one point", "move one of them")
    share = sum(abs(b) / abs(a) for a, b in spans) / len(spans)
    turn = cmath.phase(sum((a * b.conjugate()) / abs(a * b) for a, b in spans))
    reference_m = scale_m * share if scale_m else _measured_scale(source, reference, notes)
    factor = cmath.rect(reference_m / share, turn)
    return LevelFrame(factor, sum(reference_m * a - factor * b for a, b in pairs) / len(pairs))


def _fiducials(source: YamlSource, name: str) -> list[tuple[str, complex]]:
    """Names and points of a level's fiducials, y up. Raises InputError."""
    path, found = ("levels", name), list[tuple[str, complex]]()
    for n, each in enumerate(listed(source, path, building_levels(source)[name], "fiducials")):
        if not (isinstance(each, list) and len(each) == 3 and all(map(_is_number, each[:2]))):
            raise source.error((*path, "fiducials", n), f"fiducial {n} is not [x, y, name]", HINT)
        found.append((str(each[2]), complex(each[0], -each[1])))
    return found


def building_levels(source: YamlSource) -> dict[str, Any]:
    """Levels of a building by name. Raises InputError for a file without any."""
    if source.data is None:
        raise source.error((), "the building file is empty", HINT)
    if not isinstance(source.data, dict):
        raise source.error((), "it is no building of Open-RMF: a building begins with the key levels", HINT)
    levels = source.data.get("levels")
    if not levels:
        raise source.error(("levels",), "the building has no levels", HINT)
    if not isinstance(levels, dict):
        raise source.error(("levels",), "the levels of the building have no names", HINT)
    return levels


def level_vertices(
    source: YamlSource, path: tuple[str | int, ...], part: Any
) -> Iterator[tuple[float, float, str, dict[str, Any]]]:
    """Coordinates, name and facts of each vertex. Raises InputError."""
    for n, each in enumerate(listed(source, path, part, "vertices")):
        numbers = each[:2] if isinstance(each, list) else []
        if len(numbers) < 2 or not all(map(_is_number, numbers)):
            raise source.error((*path, "vertices", n), f"vertex {n} has no x and y", HINT)
        name = each[3] if len(each) > 3 and each[3] is not None else ""
        yield float(numbers[0]), float(numbers[1]), " ".join(str(name).replace("_", " ").split()), _facts(each[4:])


def level_edges(
    source: YamlSource, path: tuple[str | int, ...], part: Any, key: str, count: int
) -> Iterator[tuple[int, int, dict[str, Any]]]:
    """The two vertices and the facts of each edge. Raises InputError."""
    for n, each in enumerate(listed(source, path, part, key)):
        ends = each[:2] if isinstance(each, list) else []
        if len(ends) < 2:
            raise source.error((*path, key, n), f"{key[:-1]} {n} does not begin with the numbers of 2 vertices", HINT)
        _check_vertices(source, (*path, key, n), f"{key[:-1]} {n}", ends, count)
        yield ends[0], ends[1], _facts(each[2:])


def level_floors(source: YamlSource, path: tuple[str | int, ...], part: Any, count: int) -> Iterator[list[int]]:
    """The vertices of each floor. Raises InputError."""
    for n, each in enumerate(listed(source, path, part, "floors")):
        corners = each.get("vertices") if isinstance(each, dict) else None
        if not isinstance(corners, list):
            raise source.error((*path, "floors", n), f"floor {n} has no list of vertices", HINT)
        _check_vertices(source, (*path, "floors", n), f"floor {n}", corners, count)
        if len(corners) > 2:
            yield corners


def _check_vertices(
    source: YamlSource, path: tuple[str | int, ...], what: str, numbers: Sequence[Any], count: int
) -> None:
    """Raises InputError for the first number that no vertex has."""
    for each in numbers:
        if type(each) is not int or not 0 <= each < count:
            known = f"the level has the vertices 0 to {count - 1}" if count else "the level has no vertices"
            hint = f"correct the number, or {HINT}"
            raise source.error(path, f"{what} names vertex {each!s:.40}, and {known}", hint)


def listed(source: YamlSource, path: tuple[str | int, ...], part: Any, key: str) -> list[Any]:
    """A list of a level; empty without it. Raises InputError."""
    found = part.get(key) if isinstance(part, dict) else None
    if found is not None and not isinstance(found, list):
        raise source.error((*path, key), f"{key} is no list", HINT)
    return found or []


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _facts(rest: Sequence[Any]) -> dict[str, Any]:
    """Values of the facts of a vertex or an edge, each written as [type, value]."""
    facts = rest[0] if rest and isinstance(rest[0], dict) else {}
    return {key: value[1] if isinstance(value, list) and len(value) == 2 else value for key, value in facts.items()}


def _measured_scale(source: YamlSource, name: str, notes: list[str]) -> float:
    """Metres of a level's pixel: the mean of its measurements; without any, that of the traffic editor.

    Notes say when there is none, or when two contradict each other.
    """
    path, part = ("levels", name), building_levels(source)[name]
    vertices, scales = list(level_vertices(source, path, part)), list[tuple[float, int]]()
    for n, (a, b, facts) in enumerate(level_edges(source, path, part, "measurements", len(vertices))):
        pixels, metres = math.dist(vertices[a][:2], vertices[b][:2]), facts.get("distance", 0.0)
        if pixels > 0.0 and _is_number(metres) and metres > 0.0:
            scales.append((metres / pixels, source.line((*path, "measurements", n))))
    if not scales:
        notes.append(f"no measurement gives its scale: a pixel counts as {_USUAL_SCALE_M:g} m (--scale sets another)")
        return _USUAL_SCALE_M
    mean_m = sum(scale for scale, _ in scales) / len(scales)
    (low, at), (high, other) = min(scales), max(scales)
    if high > _MOST_APART * low:
        each = f"a pixel is {low:.3g} m by line {at}, {high:.3g} m by line {other}"
        taken = f"their mean of {mean_m:.3g} m is taken: correct the wrong one, or give --scale"
        notes.append(f"its measurements contradict each other: {each}; {taken}")
    return mean_m
