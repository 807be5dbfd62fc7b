"""Quantities: numbers with unit and range, checked by one mechanism wherever a user can type them.

Each quantity is a `float` or `int` with a `Quantity` annotation. `number_of` checks pydantic models, the options of
components and skills, and the options of the command line; its `QuantityError` names the range and the likely mistake.
A field's name ends in its unit. Code that constructs the same dataclass is not checked.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, get_args, get_origin

from annotated_types import GroupedMetadata

if TYPE_CHECKING:
    from pydantic_core.core_schema import CoreSchema

MOST_DIGITS: Final = 100
LARGEST: Final = 10**300
DURATION_FORM: Final = 'seconds, or as in "2 min", "1 h 30 min" or "PT5M"'
DURATION_PATTERN: Final = r"^(\d+(\.\d+)?[ ]?[a-z]+,?[ ]?(and )?)+$|^P[0-9.DTHMS]+$"
"""JSON-schema pattern of a duration given as text, for editors."""
_MOST_LETTERS: Final = 60
_UNIT_WORDS: Final = {
    0.001: ("ms", "millisecond", "milliseconds"),
    1.0: ("s", "sec", "secs", "second", "seconds"),
    60.0: ("m", "min", "mins", "minute", "minutes"),
    3600.0: ("h", "hr", "hrs", "hour", "hours"),
    86400.0: ("d", "day", "days"),
}
_UNITS_S: Final[Mapping[str, float]] = MappingProxyType({word: s for s, words in _UNIT_WORDS.items() for word in words})
_DIGITS: Final = r"\d+(?:\.\d+)?"
_SEVERAL: Final = re.compile(rf"(?:{_DIGITS}\s*[a-z]+(?:\s*,?\s*(?:and\s+)?))+")
_ONE: Final = re.compile(rf"({_DIGITS})\s*([a-z]+)")
_PLAIN: Final = re.compile(rf"[+-]?{_DIGITS}(?:e[+-]?\d+)?")
_ISO: Final = re.compile(
    rf"p(?=[\dt])(?:(?P<d>{_DIGITS})d)?(?:t(?=\d)(?:(?P<h>{_DIGITS})h)?(?:(?P<m>{_DIGITS})m)?(?:(?P<s>{_DIGITS})s)?)?"
)


def seconds_in(text: str) -> float | None:
    """Returns the duration in seconds that a text states; None when the text is no duration or repeats a unit."""
    words = " ".join(text.split()).lower()
    if not words or len(words) > _MOST_LETTERS:
        return None
    if _PLAIN.fullmatch(words) and not re.match(r"[+-]?0\d", words):
        return float(words)
    if (iso := _ISO.fullmatch(words)) is not None:
        return sum(float(number) * _UNITS_S[unit] for unit, number in iso.groupdict(default="0").items())
    if not _SEVERAL.fullmatch(words):
        return None
    parts = _ONE.findall(words)
    units = [_UNITS_S.get(unit) for _, unit in parts]
    if len(set(units)) < len(units):
        return None
    found = [float(number) * unit for (number, _), unit in zip(parts, units, strict=True) if unit is not None]
    return sum(found) if len(found) == len(parts) else None


class QuantityError(ValueError):
    """Error of a value that is no number or out of range: `what` it should be, and a `hint` at the likely mistake."""

    def __init__(self, what: str, hint: str) -> None:
        super().__init__(f"{what}; {hint}")
        self.what, self.hint = what, hint


@dataclass(frozen=True)
class Quantity:
    """Annotation of a number with its range and unit; `mistake`, if given, replaces the computed hint."""

    ge: float | None = None
    gt: float | None = None
    le: float | None = None
    lt: float | None = None
    unit: str = ""
    mistake: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], CoreSchema]) -> CoreSchema:
        """Returns a schema that checks a field by `number_of` and states the range in its JSON schema."""
        from pydantic_core import core_schema

        hint = Annotated[source, self]

        def checked(value: Any) -> float:
            return number_of(value, hint)

        limits = bounds(hint)
        whole, real = core_schema.int_schema(**limits), core_schema.float_schema(**limits)
        number: CoreSchema = whole if source is int else real
        if self.unit != "s":
            return core_schema.no_info_before_validator_function(checked, number)
        written = core_schema.union_schema([number, core_schema.str_schema(pattern=DURATION_PATTERN)])
        return core_schema.no_info_before_validator_function(checked, number, json_schema_input_schema=written)


Coordinate = Annotated[
    float, Quantity(ge=-10_000.0, le=10_000.0, unit="m", mistake="subtract the same from all places")
]
"""Coordinate x or y of the world frame."""
Length = Annotated[float, Quantity(gt=0.0, le=100.0, unit="m")]
"""Size, reach or resolution."""
Margin = Annotated[float, Quantity(ge=0.0, le=10.0, unit="m")]
"""Distance that may be zero."""
Height = Annotated[float, Quantity(ge=-1.0, le=3.0, unit="m")]
"""Height above the floor."""
TopHeight = Annotated[float, Quantity(gt=0.0, le=3.0, unit="m")]
"""Height of a surface above the floor."""
Opening = Annotated[float, Quantity(gt=0.0, le=10.0, unit="m")]
"""Clear width of a door."""
Angle = Annotated[float, Quantity(ge=-2.0 * math.pi, le=2.0 * math.pi, unit="rad")]
"""Heading or signed turn."""
Turn = Annotated[float, Quantity(gt=0.0, le=math.pi, unit="rad")]
"""Turn or tolerance without a sign."""
Speed = Annotated[float, Quantity(gt=0.0, le=3.0, unit="m/s")]
"""Speed of the base or the hand."""
TurnRate = Annotated[float, Quantity(gt=0.0, le=6.0, unit="rad/s")]
"""Turn rate of the base or a joint."""
Acceleration = Annotated[float, Quantity(gt=0.0, le=20.0, unit="m/s^2")]
TurnAcceleration = Annotated[float, Quantity(gt=0.0, le=50.0, unit="rad/s^2")]
Duration = Annotated[float, Quantity(gt=0.0, le=86_400.0, unit="s")]
"""Period or time limit."""
Delay = Annotated[float, Quantity(ge=0.0, le=86_400.0, unit="s")]
"""Wait that may be zero."""
LongDuration = Annotated[float, Quantity(gt=0.0, le=604_800.0, unit="s")]
"""Limit of a whole run."""
Wait = Annotated[float, Quantity(ge=0.0, le=1e9, unit="s")]
"""Time for which a page or a queue is served."""
Share = Annotated[float, Quantity(ge=0.0, le=1.0)]
"""Fraction of a whole: a charge, a score."""
Cosine = Annotated[float, Quantity(ge=-1.0, le=1.0)]
"""Component of a unit vector."""
Factor = Annotated[float, Quantity(gt=0.0, le=1_000.0)]
"""Gain or weight."""
Force = Annotated[float, Quantity(gt=0.0, le=2_000.0, unit="N")]
Torque = Annotated[float, Quantity(gt=0.0, le=2_000.0, unit="N m")]
Mass = Annotated[float, Quantity(gt=0.0, le=100.0, unit="kg")]
TagNumber = Annotated[int, Quantity(ge=0, le=586)]
"""Number of an AprilTag in the family 36h11."""
TagSize = Annotated[float, Quantity(gt=0.0, le=2.0, unit="m")]
"""Side of a tag's black square."""
Count = Annotated[int, Quantity(ge=1, le=100_000)]
"""Number of items, at least one."""
Tries = Annotated[int, Quantity(ge=0, le=1_000)]
"""Number of tries, perhaps none."""
Seed = Annotated[int, Quantity(ge=0, le=2**31 - 1)]
"""Seed of a world's objects and of all noise."""
Port = Annotated[int, Quantity(ge=0, le=65_535)]
"""Port of this machine; 0 takes a free one."""
Number = Annotated[float, Quantity()]
"""Number without limits: a value in a mission."""
Whole = Annotated[int, Quantity()]
"""Whole number without limits: a value in a mission."""

_UNIT: Final = re.compile(r"_(m|rad|s|n|m_s|rad_s|kg|deg)$")
_WORDS: Final[Mapping[str, str]] = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
_OTHERS: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "": {"%": 0.01},
        "m": {"mm": 0.001, "cm": 0.01, "km": 1000.0},
        "rad": {"degrees": math.pi / 180.0},
        "rad/s": {"degrees/s": math.pi / 180.0},
        "m/s": {"km/h": 1.0 / 3.6},
        "kg": {"g": 0.001},
        "s": {"ms": 0.001},
    }
)
"""Units that people write in place of a quantity's own unit, with the conversion factor to that unit."""
_SPELLED: Final[Mapping[str, str]] = {
    "deg": "degrees",
    "degree": "degrees",
    "\N{DEGREE SIGN}": "degrees",
    "percent": "%",
}
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_WITH_UNIT: Final = re.compile(r"([+-]?\d+(?:\.\d+)?)\s*(\D{1,10})")
_CLOCK: Final = re.compile(r"(\d{1,2}):(\d\d)")
_COMMA: Final = re.compile(r"[+-]?\d+,\d+")
_COUNTED: Final = (
    "zero",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
)


def number_of(value: Any, hint: Any) -> float:
    """Returns the number that a file gives for a quantity. A duration may be a text with units.

    Raises QuantityError when the value is no number, is not finite, is not whole although the quantity is, or is out of
    range.
    """
    whole = base_type(hint) is int
    wanted = "should be a whole number" if whole else "should be a number"
    if isinstance(value, str):
        seconds = seconds_in(value) if _unit(hint) == "s" else None
        if seconds is None:
            form = f", {DURATION_FORM}" if _unit(hint) == "s" else ""
            raise QuantityError(f"{wanted}{form}", correction(value, hint) or f"it reads {display_text(value)} now")
        value = seconds
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise QuantityError(wanted, f"it reads {display_text(value)} now")
    if isinstance(value, float) and not math.isfinite(value):
        raise QuantityError("should be a finite number", f"it reads {display_text(value)} now")
    if isinstance(value, int) and abs(value) > LARGEST:
        raise QuantityError("should be a smaller number", f"it reads {display_text(value)} now")
    if not in_range(value, hint):
        meant = unit_hint(value, hint)
        now = f"it reads {display_text(value)} now{f'; {meant}' if meant else ''}"
        raise QuantityError(f"should be {range_text(hint)}", now)
    if whole and isinstance(value, float):
        hint_at = f"write {int(value)}" if value.is_integer() else f"it reads {display_text(value)} now"
        raise QuantityError(wanted, hint_at)
    return int(value) if whole else float(value)


def number_in(text: str, hint: Any) -> float:
    """Returns the number that a command-line word gives for a quantity. Raises QuantityError when `number_of` would."""
    words = text.strip()
    if _unit(hint) == "s" or not _NUMBER.fullmatch(words) or re.match(r"[+-]?0\d", words):
        finite = words.lower().lstrip("+-") not in ("inf", "nan", "infinity")
        return number_of(words if finite else math.nan, hint)
    if len(words) > MOST_DIGITS:
        what = f"is a number of {len(words)} digits (at most {MOST_DIGITS} are read)"
        raise QuantityError(what, "write a shorter one")
    return number_of(int(words) if re.fullmatch(r"[+-]?\d+", words) else float(words), hint)


def clock_text(value: Any) -> str:
    """Returns a time of day as "08:30". Raises QuantityError when the value is no time from 00:00 to 23:59."""
    match = _CLOCK.fullmatch(value.strip()) if isinstance(value, str) else None
    if match is not None and int(match[1]) < 24 and int(match[2]) < 60:
        return f"{int(match[1]):02d}:{match[2]}"
    hint = "write it as in '08:30'"
    if match is not None and (match[1], match[2]) == ("24", "00"):
        hint = "write '00:00' for midnight"
    elif isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 24:
        hint = f"write '{value:02d}:00'"
    raise QuantityError("should be a time of day from 00:00 to 23:59", f"it reads {display_text(value)} now; {hint}")


def clock_s(clock: str) -> float:
    """Returns the time of day of a text such as "08:30", in seconds after midnight."""
    hours, minutes = map(int, clock.split(":"))
    return 3600.0 * hours + 60.0 * minutes


def display_text(value: Any) -> str:
    """Returns a value for an error message: text in quotes, `true`, `nothing`, `a list`; shortened to fit a line."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return _digits(value)
    if isinstance(value, str):
        return f"'{value[:60]}...'" if len(value) > 60 else f"'{value}'"
    return (
        "a mapping" if isinstance(value, Mapping) else "a list" if isinstance(value, list | tuple) else "another kind"
    )


def _digits(value: float) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value).replace("inf", ".inf").replace("nan", ".nan")
    if isinstance(value, int):
        return str(value) if abs(value) < 10**15 else "a number too large to show"
    return f"{value:.6g}"


def correction(text: str, hint: Any) -> str | None:
    """Returns a hint at the correction of a text that gives no number; None without one."""
    words = text.strip()
    if len(words) > MOST_DIGITS:
        return "write a shorter one"
    if _COMMA.fullmatch(words):
        return f"write {words.replace(',', '.')}, with a point"
    if re.fullmatch(r"0\d+", words):
        return f"write {int(words)}, without the zero before it"
    if _NUMBER.fullmatch(words):
        return f"write {float(words):g}, without quotes"
    if re.fullmatch(r"\d+:\d\d(?::\d\d)?", words) and _unit(hint) == "s":
        return f"write as in '1 h 30 min': {display_text(words)} could be hours or minutes"
    if words.lower() in _COUNTED:
        return f"write {_COUNTED.index(words.lower())}"
    match = _WITH_UNIT.fullmatch(words)
    unit = "" if match is None else _SPELLED.get(match[2].strip().lower(), match[2].strip().lower())
    size = 1.0 if unit and unit == _unit(hint) else _OTHERS.get(_unit(hint), {}).get(unit)
    if match is not None and size is not None:
        return f"write {float(match[1]) * size:.3g} for {words}"
    return None


def unit_hint(value: float, hint: Any) -> str:
    """Returns a hint with the value converted to the quantity's unit; empty when no conversion fits the range."""
    quantity = quantity_of(hint)
    if quantity is not None and quantity.mistake:
        return quantity.mistake
    if abs(value) > 1e15:
        return ""
    sizes = _OTHERS.get(_unit(hint), {}) if base_type(hint) is float else {}
    meant = {unit: value * size for unit, size in sizes.items() if in_range(value * size, hint)}
    choices = [f"{number:.3g} for {value:g} {unit}" for unit, number in meant.items()]
    return f"write {' or '.join(choices)}" if choices else ""


def quantity_of(hint: Any) -> Quantity | None:
    """Returns the `Quantity` of an annotated type; None when it has none."""
    return next((mark for mark in _marks(hint) if isinstance(mark, Quantity)), None)


def _unit(hint: Any) -> str:
    quantity = quantity_of(hint)
    return "" if quantity is None else quantity.unit


def bounds(hint: Any) -> dict[str, Any]:
    """Bounds of an annotated type, under pydantic's names: {"gt": 0.0, "le": 3.0}."""
    marks = list(_marks(hint))
    found = {name: getattr(mark, name, None) for name in _WORDS for mark in marks if hasattr(mark, name)}
    return {name: limit for name, limit in found.items() if limit is not None}


def _marks(hint: Any) -> Iterator[Any]:
    """Yields the annotations of a type one by one; unpacks an interval and pydantic's `Field`, which hold several."""
    for mark in getattr(hint, "__metadata__", ()):
        if not isinstance(mark, Quantity) and isinstance(mark, GroupedMetadata):
            yield from mark
        else:
            yield from getattr(mark, "metadata", (mark,))


def base_type(hint: Any) -> Any:
    """Returns the type without its annotation."""
    return get_args(hint)[0] if get_origin(hint) is Annotated else hint


def unitless_name(name: str) -> str:
    """Returns a field's name without its unit suffix: "max_speed_m_s" becomes "max_speed"."""
    return _UNIT.sub("", name)


def in_range(value: float, hint: Any) -> bool:
    """Returns whether a number is within the bounds of an annotated type; NaN never is."""
    return all(getattr(operator, name)(value, limit) for name, limit in bounds(hint).items())


def range_text(hint: Any) -> str:
    """Returns the bounds in words, with the unit: "from 0 to 1", "above 0 and at most 3 m/s"; empty without bounds."""
    limits = {name: _limit(limit) for name, limit in bounds(hint).items()}
    if limits.keys() == {"ge", "le"}:
        words = f"from {limits['ge']} to {limits['le']}"
    else:
        words = " and ".join(f"{_WORDS[name]} {limit}" for name, limit in limits.items())
    return " ".join(filter(None, [words, _unit(hint)])) if limits else ""


def _limit(limit: float) -> str:
    return str(int(limit)) if float(limit).is_integer() and abs(limit) < 1e12 else f"{limit:.4g}"
