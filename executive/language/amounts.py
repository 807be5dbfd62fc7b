"""Parses spoken numbers, durations, times of day and fractions."""

import re
from dataclasses import dataclass
from typing import Final

from executive.language.lexicon import Patterns, any_of, lexicon

_WORDS: Final = any_of(word for word in lexicon().numbers if word not in ("couple", "dozen"))
_NUMBER: Final = rf"(?:\d+(?:\.\d+)?|(?:{_WORDS})(?:[ -](?:{_WORDS}))?)"
_FORMS: Final = Patterns("amounts.yaml", words={"number": _NUMBER})
AMOUNTS: Final = {name: _FORMS.text(name) for name in ("span", "times", "share")}
"""Patterns of amounts for other tables."""
_NAMED: Final = {"noon": 12, "midday": 12, "midnight": 0}
_UNITS_S: Final = {"s": 1.0, "m": 60.0, "h": 3600.0}
_SPANS_S: Final = {
    **{"half hour": 1800.0, "hour": 3600.0, "minute": 60.0, "other minute": 120.0},
    **{"quarter": 900.0, "three quarters of an hour": 2700.0},
}


@dataclass(frozen=True)
class TimeOfDay:
    """Time of day (s after midnight); `taken` is True if the speaker left open whether it is before or after noon."""

    seconds: float
    taken: bool = False

    @property
    def text(self) -> str:
        """Text such as "14:30"."""
        return f"{int(self.seconds // 3600):02d}:{int(self.seconds % 3600 // 60):02d}"

    def notes(self, said: str) -> tuple[str, ...]:
        """Note on the half of the day that was chosen, if the speaker left it open."""
        return (f"I take '{said}' as {self.text}",) if self.taken else ()


def parse_number(text: str) -> float | None:
    """Parses a number in digits or words."""
    words = text.lower().replace("-", " ").split()
    if len(words) == 1 and re.fullmatch(r"\d+(?:\.\d+)?", words[0]):
        return float(words[0])
    numbers = [lexicon().numbers.get(word) for word in words]
    if not numbers or any(number is None for number in numbers) or len(numbers) > 2:
        return None
    first, *rest = (number for number in numbers if number is not None)
    if rest and not (first in range(20, 100, 10) and 0 < rest[0] < 10):
        return None
    return float(first + sum(rest))


def parse_times(text: str) -> int | None:
    """Parses "three times" or "twice"; None for any text but whole numbers from 1 to 100."""
    words = re.sub(r" in a row$", "", text.lower())
    if words == "twice" or words == "a couple of times":
        return 2
    number = parse_number(re.sub(r" times$", "", words))
    return int(number) if number is not None and number == int(number) and 1 <= number <= 100 else None


def parse_seconds(text: str) -> float | None:
    """Parses a duration (s); None for any other text."""
    words = re.sub(r"^(?:a )?quarter(?: of an)? hour$", "quarter", text.lower().strip())
    if words in _SPANS_S:
        return _SPANS_S[words]
    match = re.fullmatch(r"(half an?|a couple of|.+?) ?(and a half )?([smh])[a-z]*( and a half)?", words)
    if match is None:
        return None
    count = {"a": 1.0, "an": 1.0, "half a": 0.5, "half an": 0.5, "a couple of": 2.0}.get(
        match[1], parse_number(match[1])
    )
    half = 0.5 if match[2] or match[4] else 0.0
    return None if count is None or count + half <= 0 else (count + half) * _UNITS_S[match[3]]


def parse_share(text: str) -> float | None:
    """Parses a fraction from 0 to 1, such as "thirty percent" or "half"."""
    words = text.lower().strip()
    if words.startswith("half"):
        return 0.5
    number = parse_number(re.sub(r" ?percent$", "", words))
    return number / 100 if number is not None and 0 < number <= 100 else None


def parse_time(text: str) -> TimeOfDay | None:
    """Parses a time of day; "one" to "six" without more words are in the afternoon."""
    words = " ".join(text.lower().replace("o' clock", "o'clock").split())
    if words in _NAMED:
        return TimeOfDay(3600.0 * _NAMED[words])
    for pattern in (_FORMS.clock, _FORMS.relative, _FORMS.full):
        match = pattern.fullmatch(words)
        if match is not None and (found := _time(match, words)) is not None:
            return found
    return None


def _time(match: re.Match[str], words: str) -> TimeOfDay | None:
    groups = match.groupdict()
    hour, minute = parse_number(groups["hour"]), parse_number(groups.get("minute") or "0")
    if groups.get("part"):
        part = groups["part"]
        minute = 30.0 if part == "half" else 15.0 if part.endswith("quarter") else parse_number(part)
        if minute is not None and groups["side"] in ("to", "before"):
            minute = -minute
            if part == "half":
                return None
    if hour is None or minute is None or not (0 <= hour <= 24 and abs(minute) < 60 and hour == int(hour)):
        return None
    half = (groups["half"] or "").replace(".", "")
    if half and not 1 <= hour <= 12:
        return None
    sure = hour > 12 or hour == 0 or words.startswith("0") or bool(half)
    if half in ("pm", "in the afternoon", "in the evening", "this afternoon", "this evening"):
        hour = hour % 12 + 12
    elif half in ("am", "in the morning", "this morning"):
        hour = hour % 12
    elif half == "at night":
        hour = hour % 12 + 12 if hour >= 6 and hour != 12 else hour % 12
    elif half:
        return None
    elif not sure and hour <= 6:
        hour += 12
    return TimeOfDay((3600.0 * hour + 60.0 * minute) % 86400.0, taken=not sure and hour != 12)
