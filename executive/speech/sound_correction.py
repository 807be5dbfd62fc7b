"""Corrects what was heard by sound: words that fit nowhere become known words that sound alike ("ranch" -> wrench).

The search goes from the transcripts outwards, the change that is least to the ear first, and only changes words that
the reader of the sentence found fault with, or their neighbours. Which of the sentences that then make sense was
meant, and whether any, the sound itself decides (see `interpret.py`).
"""

from __future__ import annotations

import heapq
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Final, Generic, TypeVar

from executive.language.spelling import Alike, SoundAlikes
from executive.words.command import is_attribute

__all__ = ["Candidate", "Reading", "corrections"]

Meaning = TypeVar("Meaning")


@dataclass(frozen=True)
class Reading(Generic[Meaning]):
    """What a sentence means, whether that fits, and else the words that are to blame (none: any may be).

    One that is not `correctable` is better left as it was heard.
    """

    meaning: Meaning
    fits: bool
    suspects: tuple[str, ...] = ()
    correctable: bool = True


@dataclass(frozen=True)
class Candidate(Generic[Meaning]):
    """A sentence, what it means, and how far it sounds from what was heard (0 the same, about 1 a changed sound).

    `changes` counts the groups of words that were changed.
    """

    text: str
    cost: float
    reading: Reading[Meaning]
    changes: int = 0


def corrections(
    heard: Sequence[Candidate[Meaning]], read: Callable[[str], Reading[Meaning]], alikes: SoundAlikes, *, most: int = 3
) -> list[Candidate[Meaning]]:
    """At most so many sentences that fit and sound like one of those that were heard, the likest first."""
    order = count()
    known = {candidate.text: candidate.reading for candidate in heard}
    queue = [(candidate.cost, next(order), 0, tuple(candidate.text.split())) for candidate in heard]
    heapq.heapify(queue)
    seen, found = {words for *_, words in queue}, list[Candidate[Meaning]]()
    for _ in range(_MOST_READINGS):
        if not queue or len(found) == most:
            break
        cost, _, changes, words = heapq.heappop(queue)
        sentence = " ".join(words)
        reading = known.get(sentence) or read(sentence)
        if reading.fits:
            found.append(Candidate(sentence, cost, reading, changes))
        elif changes < _MOST_CHANGES:
            for more, changed in _changed(words, reading.suspects, alikes):
                if changed not in seen and cost + more <= _MOST_COST:
                    seen.add(changed)
                    heapq.heappush(queue, (cost + more, next(order), changes + 1, changed))
    return found


def _changed(
    words: tuple[str, ...], suspects: Sequence[str], alikes: SoundAlikes
) -> Iterator[tuple[float, tuple[str, ...]]]:
    """The sentences with one group of words changed, and the cost of that."""
    for start, end in _spans(len(words), _blamed(words, suspects)):
        known = sum(alikes.knows(_bare(word)) for word in words[start:end])
        for alike, other in _replaced(words, start, end, alikes):
            yield alike.cost + _PER_CHANGE + _PER_KNOWN_WORD * known, other


def _replaced(
    words: tuple[str, ...], start: int, end: int, alikes: SoundAlikes
) -> Iterator[tuple[Alike, tuple[str, ...]]]:
    """The sentences with a known phrase of like sound in the place of those words."""
    tail = re.sub(r".*[\w']", "", words[end - 1])
    for alike in alikes.of(" ".join(map(_bare, words[start:end]))):
        if _stands(words[:start], alike):
            yield alike, (*_before(words[:start], alike), *f"{alike.phrase}{tail}".split(), *words[end:])


def _before(words: tuple[str, ...], alike: Alike) -> tuple[str, ...]:
    """The words before a phrase; no comma parts a preposition from them."""
    joins = bool(words) and alike.phrase.split()[0] in _PREPOSITIONS
    return (*words[:-1], words[-1].rstrip(",")) if joins else words


def _stands(before: Sequence[str], alike: Alike) -> bool:
    """Whether the phrase may stand behind these words: behind an article, a number or an adjective only a name may."""
    last = before[-1].lower() if before else ""
    return alike.name or not (last in _BEFORE_NAMES or is_attribute(last))


def _blamed(words: Sequence[str], suspects: Sequence[str]) -> set[int]:
    """The positions of the words to blame, articles between them included; all when none is named.

    Where the words of a suspect do not stand together, each is to blame for itself.
    """
    bare = [(at, _bare(word).lower()) for at, word in enumerate(words)]
    plain = [(at, word) for at, word in bare if word not in _ARTICLES]
    blamed = set[int]()
    for suspect in suspects:
        parts = [part for part in map(str.lower, map(_bare, suspect.split())) if part not in _ARTICLES]
        together = _together(plain, parts)
        blamed |= together or {at for at, word in plain if word in parts}
    return blamed or set(range(len(words)))


def _together(plain: Sequence[tuple[int, str]], parts: Sequence[str]) -> set[int]:
    """All positions from the first to the last of the parts, wherever they stand one after another."""
    places = set[int]()
    for first in range(len(plain) - len(parts) + 1):
        found = plain[first : first + len(parts)]
        if parts and [word for _, word in found] == parts:
            places |= set(range(found[0][0], found[-1][0] + 1))
    return places


def _spans(count: int, blamed: set[int]) -> Iterator[tuple[int, int]]:
    """Groups of one to three of so many words, at least one of them to blame."""
    for length in range(1, _MOST_WORDS + 1):
        for start in range(count - length + 1):
            if blamed & set(range(start, start + length)):
                yield start, start + length


def _bare(word: str) -> str:
    return re.sub(r"['’]s$", "", word.strip(" ,.;:!?\"'"))


_MOST_WORDS: Final = 3
_MOST_CHANGES: Final = 3
_MOST_READINGS: Final = 32
_MOST_COST: Final = 4.5
_PER_CHANGE: Final = 0.3
_PER_KNOWN_WORD: Final = 0.4
_PREPOSITIONS: Final = frozenset({"to", "from", "on", "in", "at"})
_ARTICLES: Final = frozenset({"the", "a", "an"})
_BEFORE_NAMES: Final = _ARTICLES | {"my", "two", "three", "four", "five"}
