"""What was looked for and found: several looks counted as one, and told in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from skills.api import ObjectObservation, Surface
from skills.perception.class_forms import PERSON

SAME_WITHIN_M = 0.12
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def wanted(classes: Sequence[str], attributes: Sequence[str]) -> str:
    """ "red coke or red beer"."""
    return " or ".join(" ".join((*attributes, name)) for name in classes)


def surface_names(surfaces: Sequence[Surface]) -> str:
    """ "the kitchen table or the counter"."""
    return " or ".join(f"the {surface.name}" for surface in surfaces)


def describe(seen: ObjectObservation) -> str:
    """ "a red coke on the kitchen table, score 0.90"; where no surface is known, its position in the world (m)."""
    x, y, z = seen.position_W
    place = f"on the {seen.surface}" if seen.surface else f"at ({x:.2f}, {y:.2f}, {z:.2f})"
    return f"a {seen.kind} {place}, score {seen.score:.2f}"


def counted(found: Sequence[ObjectObservation], surfaces: Sequence[Surface]) -> str:
    """ "there are two wrenches on the bench"; each kind of object is counted for itself."""
    kinds = list(dict.fromkeys(str(seen.kind) for seen in found))
    numbers = {kind: sum(str(seen.kind) == kind for seen in found) for kind in kinds}
    told = " and ".join(numbered(count, kind) for kind, count in numbers.items())
    places = dict.fromkeys(seen.surface for seen in found if seen.surface)
    where = " and ".join(f"the {name}" for name in places) or surface_names(surfaces)
    return f"there {'is' if len(found) == 1 else 'are'} {told} {'in' if kinds == [PERSON] else 'on'} {where}"


def numbered(count: int, kind: str) -> str:
    """ "no hammer", "one hammer", "two hammers"."""
    word = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    return f"{word} {kind if count == 1 else plural(kind)}"


def plural(name: str) -> str:
    """More than one of it; "beer" and "coke" take an s as in "two beers"."""
    if name.endswith(PERSON):
        return f"{name.removesuffix('person')}people"
    return f"{name}es" if name.endswith(("ch", "sh", "s", "x")) else f"{name}s"


def told_apart(looks: Iterable[Sequence[ObjectObservation]]) -> tuple[ObjectObservation, ...]:
    """The different objects of several looks, those of the first look first.

    What a later look saw of the same class within `SAME_WITHIN_M` of a known object is that object; the nearest pairs
    are taken first and each object is in one pair only, so that two that stand close together stay two.
    """
    known: list[ObjectObservation] = []
    for look in looks:
        known += _new(known, look)
    return tuple(known)


def _new(known: Sequence[ObjectObservation], look: Sequence[ObjectObservation]) -> list[ObjectObservation]:
    pairs = sorted(
        (apart_m, k, n)
        for k, old in enumerate(known)
        for n, seen in enumerate(look)
        if old.kind.name == seen.kind.name and (apart_m := math.dist(old.position_W, seen.position_W)) < SAME_WITHIN_M
    )
    paired_old, paired_new = set[int](), set[int]()
    for _, k, n in pairs:
        if k not in paired_old and n not in paired_new:
            paired_old.add(k)
            paired_new.add(n)
    return [seen for n, seen in enumerate(look) if n not in paired_new]
