"""Durations as people write them: `90 s`, `1 h 30 min`, `PT5M`, or a plain number of seconds."""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

__all__ = ["DURATION_FORM", "DURATION_PATTERN", "seconds_in"]

DURATION_FORM: Final = 'seconds, or as in "2 min", "1 h 30 min" or "PT5M"'
DURATION_PATTERN: Final = r"^(\d+(\.\d+)?[ ]?[a-z]+,?[ ]?(and )?)+$|^P[0-9.DTHMS]+$"
"""Pattern of a duration that is a text, for editors."""
_MOST_LETTERS: Final = 60
_SPELLED: Final = {
    0.001: ("ms", "millisecond", "milliseconds"),
    1.0: ("s", "sec", "secs", "second", "seconds"),
    60.0: ("m", "min", "mins", "minute", "minutes"),
    3600.0: ("h", "hr", "hrs", "hour", "hours"),
    86400.0: ("d", "day", "days"),
}
_UNITS_S: Final[Mapping[str, float]] = MappingProxyType({word: s for s, words in _SPELLED.items() for word in words})
_NUMBER: Final = r"\d+(?:\.\d+)?"
_SEVERAL: Final = re.compile(rf"(?:{_NUMBER}\s*[a-z]+(?:\s*,?\s*(?:and\s+)?))+")
_ONE: Final = re.compile(rf"({_NUMBER})\s*([a-z]+)")
_PLAIN: Final = re.compile(rf"[+-]?{_NUMBER}(?:e[+-]?\d+)?")
_ISO: Final = re.compile(
    rf"p(?=[\dt])(?:(?P<d>{_NUMBER})d)?(?:t(?=\d)(?:(?P<h>{_NUMBER})h)?(?:(?P<m>{_NUMBER})m)?(?:(?P<s>{_NUMBER})s)?)?"
)


def seconds_in(text: str) -> float | None:
    """Returns the seconds of a text; None where it is no duration. Each unit may stand once."""
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
