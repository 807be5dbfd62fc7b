"""Parses spoken numbers, durations, times of day and fractions."""

import re
from dataclasses import dataclass
from typing import Final

from executive.language.lexicon import lexicon
from executive.language.templates import page

_AMOUNTS: Final = page("amounts")


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
    match = _AMOUNTS["times"].fullmatch(text)
    number = None if match is None else parse_number(match["count"])
    return int(number) if number is not None and number == int(number) and 1 <= number <= 100 else None


def parse_seconds(text: str) -> float | None:
    """Parses a duration (s); None for any other text."""
    match = _AMOUNTS["seconds"].fullmatch(text)
    count = None if match is None else parse_number(match["count"])
    if match is None or count is None:
        return None
    return (count + float(match["half"] or 0)) * float(match["unit"] or 1) or None


def parse_share(text: str) -> float | None:
    """Parses a fraction from 0 to 1, such as "thirty percent" or "half"."""
    match = _AMOUNTS["share"].fullmatch(text)
    number = None if match is None else parse_number(match["count"])
    return number / 100 if number is not None and 0 < number <= 100 else None


def parse_time(text: str) -> TimeOfDay | None:
    """Parses a time of day; "one" to "six" without more words are in the afternoon."""
    match = _AMOUNTS["time"].fullmatch(text.replace("o' clock", "o'clock"))
    if match is None:
        return None
    said, _, minutes = match["hour"].replace(".", ":").partition(":")
    hour, minute = parse_number(said), parse_number(match["minute"] or minutes or "0")
    if hour is None or minute is None or not (0 <= hour <= 24 and minute < 60 and hour == int(hour)):
        return None
    half = match["daytime"]
    if half and not 1 <= hour <= 12:
        return None
    sure = bool(half or match["sure"]) or hour > 12 or hour == 0 or said.startswith("0")
    if half == "pm" or (half == "night" and hour >= 6 and hour != 12):
        hour = hour % 12 + 12
    elif half:
        hour %= 12
    elif not sure and hour <= 6:
        hour += 12
    minute *= -1 if match["side"] else 1
    return TimeOfDay((3600.0 * hour + 60.0 * minute) % 86400.0, taken=not sure and hour != 12)
