"""What was looked for and found, in words."""

from __future__ import annotations

from collections.abc import Sequence

from skills.api import ObjectObservation, Surface

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def wanted(classes: Sequence[str], attributes: Sequence[str]) -> str:
    """ "red coke or red beer"."""
    return " or ".join(" ".join((*attributes, name)) for name in classes)


def surface_names(surfaces: Sequence[Surface]) -> str:
    """ "the kitchen table or the counter"."""
    return " or ".join(f"the {surface.name}" for surface in surfaces)


def describe(seen: ObjectObservation) -> str:
    """ "a red coke on the kitchen table at (1.00, 2.00, 0.80), score 0.90"."""
    x, y, z = seen.position_W
    place = f" on the {seen.surface}" if seen.surface else ""
    return f"a {seen.thing}{place} at ({x:.2f}, {y:.2f}, {z:.2f}), score {seen.score:.2f}"


def counted(found: Sequence[ObjectObservation], surfaces: Sequence[Surface]) -> str:
    """ "there are two wrenches on the bench"; each kind of object is counted for itself."""
    kinds = list(dict.fromkeys(str(seen.thing) for seen in found))
    numbers = {kind: sum(str(seen.thing) == kind for seen in found) for kind in kinds}
    told = " and ".join(numbered(count, kind) for kind, count in numbers.items())
    places = dict.fromkeys(seen.surface for seen in found if seen.surface)
    where = " and ".join(f"the {name}" for name in places) or surface_names(surfaces)
    return f"there {'is' if len(found) == 1 else 'are'} {told} on {where}"


def numbered(count: int, kind: str) -> str:
    """ "no hammer", "one hammer", "two hammers"."""
    word = _NUMBERS[count] if count < len(_NUMBERS) else str(count)
    return f"{word} {kind if count == 1 else plural(kind)}"


def plural(name: str) -> str:
    """More than one of it; "beer" and "coke" take an s as in "two beers"."""
    if name.endswith("person"):
        return f"{name.removesuffix('person')}people"
    return f"{name}es" if name.endswith(("ch", "sh", "s", "x")) else f"{name}s"
