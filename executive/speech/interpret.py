"""Which of the readings of a sound was meant: the likeliest that makes sense, else one corrected by sound.

Words that fit nowhere become known words that sound alike ("ranch" -> wrench). The search goes from the transcripts
outwards, the change that is least to the ear first, and only changes words that the reader of the sentence found fault
with, or their neighbours. The sound itself decides which of the sentences that then make sense was meant, if any.

The recogniser is told the robot's name, and hears it readily for that ("Hey Oliver" -> Hey Alice). What it hears
without being told anything is another witness."""

from __future__ import annotations

import heapq
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Final, Generic, TypeVar

from executive.language.spelling import Alike, SoundAlikes
from executive.speech.recogniser import Recognition, Transcript
from executive.words.command import is_attribute

Meaning = TypeVar("Meaning")


_OTHER_READING: Final = 6.0
"""How many times e less likely another of the recogniser's own readings may be than the first."""
_CORRECTED_READING: Final = 8.0
"""The same for a reading corrected by sound; these are compared without telling the recogniser what to expect."""
_MOST_CORRECTED: Final = 4
_PER_SOUND: Final = 3.0
"""How much log likelihood a changed sound is worth."""


@dataclass(frozen=True)
class Interpretation(Generic[Meaning]):
    """What was heard in the end and what it means, and what the recogniser had made of it at first."""

    text: str
    meaning: Meaning
    first_text: str


def interpret(
    recognition: Recognition, read: Callable[[str], Reading[Meaning]], alikes: SoundAlikes
) -> Interpretation[Meaning] | None:
    """The likeliest reading that fits, or else the likeliest; None when nothing was said.

    Where the likeliest had better be left as it is (the robot was not called), no other is looked for.
    """
    transcripts = recognition.transcripts
    if not transcripts:
        return None
    first = transcripts[0]
    text = smoothed(first.text)
    heard = [Candidate(text, 0.0, read(text))]
    if not heard[0].reading.correctable or heard[0].reading.fits:
        return Interpretation(text, heard[0].reading.meaning, first.text)
    fitting = _fitting(recognition, heard, read, alikes)
    best = _likeliest(recognition, heard[0], fitting) or heard[0]
    return Interpretation(best.text, best.reading.meaning, first.text)


def _fitting(
    recognition: Recognition,
    heard: list[Candidate[Meaning]],
    read: Callable[[str], Reading[Meaning]],
    alikes: SoundAlikes,
) -> list[Candidate[Meaning]]:
    """The readings that fit: of the first search, or else of those after it, or else what is corrected by sound."""
    likeliest = recognition.transcripts[0].likelihood
    heard = _read(recognition.transcripts, likeliest, heard, read)
    searches = recognition.more()
    while not any(one.reading.fits for one in heard) and (readings := next(searches, None)) is not None:
        heard = _read(readings, likeliest, heard, read)
    fitting = [one for one in heard if one.reading.fits]
    return fitting or corrections([one for one in heard if one.reading.correctable], read, alikes, most=_MOST_CORRECTED)


def _likeliest(
    recognition: Recognition,
    first: Candidate[Meaning],
    fitting: list[Candidate[Meaning]],
) -> Candidate[Meaning] | None:
    """The one that is likeliest given the sound, if it is not much less likely than the first reading.

    The recogniser's own readings stand in their order.
    """
    if not fitting or not fitting[0].changes:
        return fitting[0] if fitting else None
    uncorrected, *likelihoods = recognition.likelihoods([first.text, *(one.text for one in fitting)])
    weighed = zip(likelihoods, fitting, strict=True)
    best, found = max(weighed, key=lambda pair: pair[0] - _PER_SOUND * pair[1].cost)
    return found if best >= uncorrected - _CORRECTED_READING else None


def _read(
    transcripts: Sequence[Transcript],
    best: float,
    heard: list[Candidate[Meaning]],
    read: Callable[[str], Reading[Meaning]],
) -> list[Candidate[Meaning]]:
    """Those heard and, read in order, those that are not much less likely than the best."""
    heard = [*heard]
    for transcript in transcripts:
        text, behind = smoothed(transcript.text), max(best - transcript.likelihood, 0.0)
        same = [text.rstrip(" .?!").lower() == other.text.rstrip(" .?!").lower() for other in heard]
        if behind > _OTHER_READING or any(same):
            continue
        heard.append(Candidate(text, behind / _PER_SOUND, read(text)))
    return heard


def smoothed(text: str) -> str:
    """The text as it was meant to be said.

    What a speaker said twice on starting anew stands once ("grab the, grab the cup"), and no pronoun repeats a
    relative one ("Robin, which he is in the hall").
    """
    anew = re.sub(r"\b(\w+(?:[ ']\w+){1,9})[ ,.;]+(?=\1\b)", "", text, flags=re.IGNORECASE)
    return re.sub(r",?\s+(?:which|who|that)\s+(?:he|she|they)\s+(is|are)\b", r" who \1", anew, flags=re.IGNORECASE)


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
        before = words[:start]
        last = before[-1].lower() if before else ""
        if alike.name or not (last in _BEFORE_NAMES or is_attribute(last)):  # only a name stands behind these
            if before and alike.phrase.split()[0] in _PREPOSITIONS:  # no comma parts it from what stands before
                before = (*before[:-1], before[-1].rstrip(","))
            yield alike, (*before, *f"{alike.phrase}{tail}".split(), *words[end:])


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


_OTHER_OPENING: Final = 7.0
"""How many times e likelier another opening must be than the one with the name, neither being expected."""
_OTHER_WHOLE: Final = 10.0
"""The same for all that was said."""
_OPENING_WORDS: Final = 4


def opening_as_heard(recognition: Recognition, text: str, names: Collection[str], calls: Callable[[str], bool]) -> str:
    """The text, or what is heard when no names are expected, where that is much likelier and calls nobody.

    `calls` tells of a text whether it calls one of the robots `names`. First only the opening is exchanged, since the
    names behind it are better heard when they are expected. A text without any name among its first words stays.
    """
    words = text.split()
    bare = [re.sub(r"\W", "", word).lower() for word in words[:_OPENING_WORDS]]
    called = {name.lower() for name in names}
    at = next((number for number, word in enumerate(bare) if word in called), None)
    if at is None:
        return text
    unprompted = recognition.unprompted()
    if not unprompted or calls(unprompted):
        return text
    behind = at + 1
    exchanged = " ".join([*unprompted.split()[:behind], *words[behind:]])
    if exchanged == text:
        return text
    named, opening, whole = recognition.likelihoods([text, exchanged, unprompted])
    if opening - named > _OTHER_OPENING:
        return exchanged
    return unprompted if whole - named > _OTHER_WHOLE else text
