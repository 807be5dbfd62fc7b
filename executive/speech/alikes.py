"""Which known phrases sound like some words: all of them compared at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from executive.language.sounds import change_cost, drop_cost, sounds_of

__all__ = ["Alike", "SoundAlikes"]

Costs = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Alike:
    """A known phrase that sounds like some words, and how far from them: about 1 for each changed sound."""

    phrase: str
    cost: float
    name: bool


class SoundAlikes:
    """Finds the known phrases that sound like some words: `names` of things and places, and other words."""

    def __init__(self, names: Iterable[str], others: Iterable[str] = ()) -> None:
        kinds = {**dict.fromkeys(others, False), **dict.fromkeys(names, True)}
        self._phrases = tuple((phrase, name) for phrase, name in kinds.items() if sounds_of(phrase))
        self._words = frozenset(word for phrase, _ in self._phrases for word in phrase.lower().split())
        sounds = [sounds_of(phrase) for phrase, _ in self._phrases]
        letters = sorted(set("".join(sounds)))
        self._code = {letter: number for number, letter in enumerate(letters)}
        self._letters = letters
        self._lengths = np.array([len(s) for s in sounds], int)
        self._sounds = np.zeros((len(sounds), max(map(len, sounds), default=0)), int)
        for row, its in enumerate(sounds):
            self._sounds[row, : len(its)] = [self._code[letter] for letter in its]
        self._drops = np.array([drop_cost(letter) for letter in letters])
        self.of = lru_cache(maxsize=4096)(self._of)

    def knows(self, word: str) -> bool:
        """Whether the word is one of the phrases or stands in one."""
        return word.lower() in self._words

    def _of(self, words: str) -> tuple[Alike, ...]:
        """The phrases that sound like `words`, the nearest first; not the very same words."""
        heard = sounds_of(words)
        if not heard or not self._phrases:
            return ()
        costs = self._costs(heard)
        near = np.flatnonzero(costs <= min(_PART_CHANGED * len(heard) + _ALWAYS_CHANGED, _MOST_COST))
        found = [Alike(*self._phrases[n][:1], float(costs[n]), self._phrases[n][1]) for n in near]
        same = words.lower()
        nearest = sorted((a for a in found if a.phrase.lower() != same), key=lambda alike: alike.cost)
        return tuple(nearest[:_MOST_ALIKES])

    def _costs(self, heard: str) -> Costs:
        """The edit cost between some sounds and those of every phrase, column by column of the table for all."""
        changes = np.array([[change_cost(mine, other) for other in self._letters] for mine in heard])
        count, longest = self._sounds.shape
        above = np.zeros((longest + 1, count))
        above[1:] = np.cumsum(self._drops[self._sounds], axis=1).T
        for mine, change in zip(heard, changes, strict=True):
            dropped = drop_cost(mine)
            row = np.empty_like(above)
            row[0] = above[0] + dropped
            for at in range(longest):
                other = self._sounds[:, at]
                kept = np.minimum(above[at] + change[other], above[at + 1] + dropped)
                row[at + 1] = np.minimum(kept, row[at] + self._drops[other])
            above = row
        costs: Costs = above[self._lengths, np.arange(count)]
        return costs


_PART_CHANGED: Final = 0.4
_ALWAYS_CHANGED: Final = 0.6
_MOST_COST: Final = 3.5
_MOST_ALIKES: Final = 8
