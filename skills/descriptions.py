"""Descriptions of objects in words, and the union of objects from several searches."""

import math
from collections.abc import Iterable, Sequence

from skills.api import ObjectObservation, Surface
from skills.inputs.errors import with_article
from skills.world_model import PERSON, ObjectKind

SAME_WITHIN_M = 0.12
_TALL_M = 0.06
"""Height from which on an object of this size stands rather than lies."""
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def wanted_names(classes: Sequence[str], attributes: Sequence[str]) -> str:
    """Names the wanted objects: "red coke or red beer"."""
    return " or ".join(str(ObjectKind(name, tuple(attributes))) for name in classes)


def surface_names(surfaces: Sequence[Surface]) -> str:
    """Names surfaces: "the kitchen table or the counter"."""
    return " or ".join(f"the {surface.name}" for surface in surfaces)


def describe(seen: ObjectObservation) -> str:
    """Describes an object: "a red coke on the kitchen table, score 0.90"; without a surface gives its position (m)."""
    x, y, z = seen.position_W
    place = f"on the {seen.surface}" if seen.surface else f"at ({x:.2f}, {y:.2f}, {z:.2f})"
    return f"{with_article(str(seen.kind))} {place}, score {seen.score:.2f}"


def describe_unknown(seen: ObjectObservation) -> str:
    """Describes an object that nothing recognises: "something 24 cm tall stands on the kitchen counter"."""
    length_m, _, height_m = seen.size_m
    size = f"{100 * height_m:.0f} cm tall stands" if height_m >= _TALL_M else f"{100 * length_m:.0f} cm long lies"
    return f"something {size} on the {seen.surface}"


def count_sentence(found: Sequence[ObjectObservation], surfaces: Sequence[Surface], *, at_least: bool = False) -> str:
    """Counts objects by kind: "there are two wrenches on the bench", or "there are at least two wrenches ..."."""
    kinds = list(dict.fromkeys(str(seen.kind) for seen in found))
    numbers = {kind: sum(str(seen.kind) == kind for seen in found) for kind in kinds}
    counts = " and ".join(count_of(count, kind) for kind, count in numbers.items())
    places = dict.fromkeys(seen.surface for seen in found if seen.surface)
    where = " and ".join(f"the {name}" for name in places) or surface_names(surfaces)
    be = f"there {'is' if len(found) == 1 else 'are'}{' at least' if at_least else ''}"
    return f"{be} {counts} {'in' if kinds == [PERSON] else 'on'} {where}"


def count_of(count: int, kind: str) -> str:
    """Number with its noun: "no hammer", "one hammer", "two hammers"."""
    word = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    return f"{word} {kind if count == 1 else plural(kind)}"


def plural(name: str) -> str:
    """Plural of a class name; "beer" and "coke" take an s as in "two beers"."""
    if name.endswith(PERSON):
        return f"{name.removesuffix('person')}people"
    if name.endswith("y") and name[-2:-1] not in "aeiou":
        return f"{name[:-1]}ies"
    return f"{name}es" if name.endswith(("ch", "sh", "s", "x")) else f"{name}s"


def distinct_objects(looks: Iterable[Sequence[ObjectObservation]]) -> tuple[ObjectObservation, ...]:
    """Different objects from several searches, in the order in which they were seen.

    Two observations of one class within `SAME_WITHIN_M` are one object. The nearest pairs match first, one to one, so
    that two objects that stand close together remain two.
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
