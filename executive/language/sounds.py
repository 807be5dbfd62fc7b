"""How words sound, and which known word one sounds most like.

A word becomes a row of sounds by a table of rules from letters to sounds (`letter_sounds.yaml`; the form of the rules
is that of Elovitz, Johnson, McHugh and Shore, "Letter-to-sound rules for automatic translation of English text to
phonetics", 1976, with far fewer of them), and two rows are compared by an edit distance whose substitutions cost the
less the more alike two sounds are.

The sounds: p b t d k g f v s z h m n l r w y as in print, T (thin), S (ship), C (chip), J (jam), N (sing); the vowels
i (bit, beat), e (bet, bait), a (bat), V (but), o (pot, boat), u (boot), @ (the), and A (buy), W (now), Y (boy).
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from types import MappingProxyType
from typing import Final

from executive.language.lexicon import read_table

__all__ = ["SoundMatch", "change_cost", "drop_cost", "nearest_by_sound", "sound_distance", "sounds_of"]


@dataclass(frozen=True)
class SoundMatch:
    """A known name and how far it sounds from what was heard: 0 the same, 1 nothing in common."""

    name: str
    distance: float


def nearest_by_sound(words: str, vocabulary: Iterable[str]) -> SoundMatch | None:
    """The name in `vocabulary` that `words` (one or several) sound most like; the first of equals.

    Up to about 0.2 is a likely mishearing. None when there is nothing to compare.
    """
    heard = words.lower().split()
    names = list(vocabulary)
    exact = next((name for name in names if name.lower().split() == heard), None)
    if exact is not None:
        return SoundMatch(exact, 0.0)
    matches = (SoundMatch(name, sound_distance(words, name)) for name in names)
    return min(matches, key=lambda match: match.distance, default=None)


def sound_distance(first: str, second: str) -> float:
    """How different two words or groups of words sound, from 0 to 1; spaces between words make no sound."""
    a, b = sounds_of(first), sounds_of(second)
    return min(_edit_cost(a, b) / max(len(a), len(b)), 1.0) if a and b else 1.0


@lru_cache(maxsize=4096)
def sounds_of(words: str) -> str:
    """The sounds of one or several words, a character each; what is no Latin letter makes none."""
    return "".join(_word_sounds(word) for word in _plain(words[:_MAX_LETTERS]).split())


def _word_sounds(word: str) -> str:
    sounds, at = "", 0
    while at < len(word):
        letters, sound = _rule_at(word, at)
        sounds, at = sounds + sound, at + letters
    return re.sub(r"(.)\1+", r"\1", sounds)


def _plain(words: str) -> str:
    """Lower-case letters and spaces, accents taken off."""
    letters = unicodedata.normalize("NFKD", words.lower())
    return re.sub(r"[^a-z ]", "", re.sub(r"[-_\s]", " ", letters))


@dataclass(frozen=True)
class _Rule:
    left: re.Pattern[str]
    letters: re.Pattern[str]
    sounds: str


@cache
def _rules() -> Mapping[str, Sequence[_Rule]]:
    """The rules by their first letter."""
    return {letter: tuple(_rule(*row) for row in rows) for letter, rows in read_table("letter_sounds.yaml").items()}


def _rule(left: str, letters: str, right: str, sounds: str) -> _Rule:
    return _Rule(re.compile(rf"(?:{left})$"), re.compile(rf"(?:{letters})(?={right})"), sounds)


def _rule_at(word: str, at: int) -> tuple[int, str]:
    """How many letters the rule that fits takes, and their sounds."""
    for rule in _rules()[word[at]]:
        found = rule.letters.match(word, at)
        if found and rule.left.search(word[:at]):
            return max(found.end() - at, 1), rule.sounds
    return 1, ""


def _edit_cost(a: str, b: str) -> float:
    """The least cost of changing one row of sounds into the other."""
    above = [0.0]
    for sound in b:
        above.append(above[-1] + drop_cost(sound))
    for mine in a:
        row = [above[0] + drop_cost(mine)]
        for at, other in enumerate(b):
            change = above[at] + change_cost(mine, other)
            row.append(min(change, above[at + 1] + drop_cost(mine), row[-1] + drop_cost(other)))
        above = row
    return above[-1]


def drop_cost(sound: str) -> float:
    """What it costs to leave a sound out, from 0 to 1."""
    return _WEAK.get(sound, _VOWEL_DROP if sound in _VOWELS else _CONSONANT_DROP)


def change_cost(a: str, b: str) -> float:
    """What it costs to say one sound for another, from 0 to 1."""
    if a == b:
        return 0.0
    if a in _VOWELS and b in _VOWELS:
        (x, y), (other_x, other_y) = _VOWELS[a], _VOWELS[b]
        return min(0.15 + 0.6 * float(((x - other_x) ** 2 + (y - other_y) ** 2) ** 0.5), 0.8)
    return _ALIKE.get(frozenset((a, b)), 1.0)


_MAX_LETTERS: Final = 200
_VOWEL_DROP: Final = 0.5
_CONSONANT_DROP: Final = 0.8
_WEAK: Final = MappingProxyType({"@": 0.35, "r": 0.4, "h": 0.4, "w": 0.5, "y": 0.4})
"""What is lost easily."""

_VOWELS: Final = MappingProxyType(
    {
        "i": (0.0, 1.0),
        "e": (0.0, 0.55),
        "a": (0.15, 0.1),
        "V": (0.6, 0.35),
        "o": (0.9, 0.35),
        "u": (1.0, 1.0),
        "@": (0.5, 0.55),
        "A": (0.35, 0.25),
        "W": (0.6, 0.2),
        "Y": (0.7, 0.6),
    }
)
"""Where a vowel is spoken: how far back and how high, from 0 to 1."""

_ALIKE: Final = MappingProxyType(
    {
        frozenset(pair): cost
        for pairs, cost in (
            (("nN", "sz"), 0.2),
            (("pb", "td", "kg", "fv", "CJ"), 0.3),
            (("mn", "Tf", "yi", "mN"), 0.35),
            (("sS", "SC", "Ts", "Tt", "Td", "zS", "Tv"), 0.4),
            (("lr", "wv", "wr", "Ct", "Jd", "bv", "wl", "JS", "Cs", "Jz"), 0.5),
            (("fp", "pt", "tk", "bd", "dg", "pk", "bg"), 0.6),
        )
        for pair in pairs
    }
)
"""Consonants that are taken for each other."""
