"""Types of ports and options: numbers with the range that a file may give them. A field's name ends in its unit.

Each is a `float` or `int` with bounds (`annotated_types`, which pydantic's `Field` gives as well): a mission file, a
stack file and their JSON schemas keep to them. Code that fills the same dataclass is not checked.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, get_args, get_origin

from annotated_types import GroupedMetadata, Interval, Unit

__all__ = ["bounds", "in_range", "range_text", "without_range", "without_unit"]

Coordinate = Annotated[float, Interval(ge=-10_000.0, le=10_000.0), Unit("m")]
"""x or y of the world frame."""
Length = Annotated[float, Interval(gt=0.0, le=100.0), Unit("m")]
"""A size, reach or resolution."""
Margin = Annotated[float, Interval(ge=0.0, le=10.0), Unit("m")]
"""A distance that may be none."""
Height = Annotated[float, Interval(ge=-1.0, le=3.0), Unit("m")]
"""Above the floor."""
Angle = Annotated[float, Interval(ge=-2.0 * math.pi, le=2.0 * math.pi), Unit("rad")]
"""A heading or a signed turn."""
Turn = Annotated[float, Interval(gt=0.0, le=math.pi), Unit("rad")]
"""A turn or a tolerance without a sign."""
Speed = Annotated[float, Interval(gt=0.0, le=3.0), Unit("m/s")]
"""Of the base or the hand."""
TurnRate = Annotated[float, Interval(gt=0.0, le=6.0), Unit("rad/s")]
"""Of the base or a joint."""
Acceleration = Annotated[float, Interval(gt=0.0, le=20.0), Unit("m/s^2")]
TurnAcceleration = Annotated[float, Interval(gt=0.0, le=50.0), Unit("rad/s^2")]
Duration = Annotated[float, Interval(gt=0.0, le=86_400.0), Unit("s")]
"""A period or a time limit."""
Delay = Annotated[float, Interval(ge=0.0, le=86_400.0), Unit("s")]
"""A wait that may be none."""
Share = Annotated[float, Interval(ge=0.0, le=1.0)]
"""A part of a whole: a charge, a score."""
Cosine = Annotated[float, Interval(ge=-1.0, le=1.0)]
"""A part of a direction of length 1."""
Factor = Annotated[float, Interval(gt=0.0, le=1_000.0)]
"""A gain or a weight."""
Force = Annotated[float, Interval(gt=0.0, le=2_000.0), Unit("N")]
Torque = Annotated[float, Interval(gt=0.0, le=2_000.0), Unit("N m")]
Count = Annotated[int, Interval(ge=1, le=100_000)]
"""How many, at least one."""
Tries = Annotated[int, Interval(ge=0, le=1_000)]
"""How often, perhaps never."""

_UNIT: Final = re.compile(r"_(m|rad|s|n|m_s|rad_s|kg|deg)$")
_WORDS: Final[Mapping[str, str]] = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}


def bounds(hint: Any) -> dict[str, Any]:
    """The bounds of an annotated type by the names that pydantic gives them: {"gt": 0.0, "le": 3.0}."""
    marks = list(_marks(hint))
    found = {name: getattr(mark, name, None) for name in _WORDS for mark in marks if hasattr(mark, name)}
    return {name: limit for name, limit in found.items() if limit is not None}


def _marks(hint: Any) -> Iterator[Any]:
    """The marks of an annotated type one by one; an interval and pydantic's `Field` hold several."""
    for mark in getattr(hint, "__metadata__", ()):
        if isinstance(mark, GroupedMetadata):
            yield from mark
        else:
            yield from getattr(mark, "metadata", (mark,))


def without_range(hint: Any) -> Any:
    """The type itself, where `hint` is an annotated one."""
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint


def without_unit(name: str) -> str:
    """A field's name without the unit that it ends in: "max_speed_m_s" is "max_speed"."""
    return _UNIT.sub("", name)


def in_range(value: float, hint: Any) -> bool:
    """Whether a number keeps the bounds of an annotated type; NaN keeps none."""
    return all(getattr(operator, name)(value, limit) for name, limit in bounds(hint).items())


def range_text(hint: Any) -> str:
    """The bounds in words, with the unit: "above 0 and at most 3 m/s"; empty without bounds."""
    limits = " and ".join(f"{_WORDS[name]} {limit:g}" for name, limit in bounds(hint).items())
    units = [mark.unit for mark in _marks(hint) if isinstance(mark, Unit)]
    return " ".join([limits, *units]) if limits else ""
