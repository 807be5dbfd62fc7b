"""Parses spoken numbers, durations, times of day and fractions."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from executive.language.lexicon import lexicon
from executive.language.templates import page

_PAGE: Final = page("amounts")
_DOZEN: Final = "dozen"
_TENS: Final = range(20, 100, 10)


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


def number_of_word(word: str) -> int | None:
    """Whole number below 1000 in one word or in digits."""
    return int(word) if word.isdecimal() and len(word) < 4 else lexicon().numbers.get(word)


def number_of_words(words: Sequence[str]) -> int | None:
    """Whole number in one or two words: "4", "twenty one", "two dozen"; None for other words."""
    first, *rest = map(number_of_word, words or [""])
    if first is None or not rest:
        return first
    if len(rest) > 1 or rest[0] is None:
        return None
    added = first + rest[0] if first in _TENS and 0 < rest[0] < 10 else None
    return first * rest[0] if words[1] == _DOZEN else added


def parse_number(text: str) -> float | None:
    """Parses a number in digits or words."""
    if re.fullmatch(r"\s*\d+(?:\.\d+)?\s*", text):
        return float(text)
    number = number_of_words(text.lower().replace("-", " ").split())
    return None if number is None else float(number)


def parse_times(text: str) -> int | None:
    """Parses "three times" or "twice"; None for any text but whole numbers from 1 to 100."""
    match = _PAGE["times"].fullmatch(text)
    number = None if match is None else parse_number(match["count"])
    return int(number) if number is not None and number == int(number) and 1 <= number <= 100 else None


def parse_seconds(text: str) -> float | None:
    """Parses a duration (s); None for any other text."""
    match = _PAGE["seconds"].fullmatch(text)
    count = None if match is None else parse_number(match["count"])
    if match is None or count is None:
        return None
    return (count + float(match["half"] or 0)) * float(match["unit"] or 1) or None


def parse_share(text: str) -> float | None:
    """Parses a fraction from 0 to 1, such as "thirty percent" or "half"."""
    match = _PAGE["share"].fullmatch(text)
    number = None if match is None else parse_number(match["count"])
    return number / 100 if number is not None and 0 < number <= 100 else None


def parse_time(text: str) -> TimeOfDay | None:
    """Parses a time of day; "one" to "six" without more words are in the afternoon."""
    match = _PAGE["time"].fullmatch(text.replace("o' clock", "o'clock"))
    if match is None:
        return None
    said, _, minutes = match["hour"].replace(".", ":").partition(":")
    hour, minute, half = parse_number(said), parse_number(match["minute"] or minutes or "0"), match["daytime"]
    if hour is None or minute is None or minute >= 60 or hour not in (range(1, 13) if half else range(25)):
        return None
    taken = not (half or match["sure"] or said.startswith("0")) and hour in range(1, 12)
    after_noon = hour in _AFTER_NOON["open" if taken else half]
    minutes_past = 60.0 * (hour % 12 + 12 * after_noon) + float(f"{match['side']}{minute}")
    return TimeOfDay(60.0 * minutes_past % 86400.0, taken)


_AFTER_NOON: Final = {"am": range(0), "pm": range(1, 13), "night": range(6, 12), "": range(12, 24), "open": range(1, 7)}
"""Hours after noon, by the half of the day that is said."""
