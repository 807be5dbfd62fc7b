"""Chooses among hypotheses for a sound: the likeliest that makes sense, otherwise a hypothesis corrected by sound.

Words that fit nowhere become known words of similar sound ("ranch" -> wrench). The search begins at the transcripts,
tries the least audible change first, and changes only words that the sentence reader rejects, or their neighbours. The
likelihood of the sound decides among the sentences that then make sense, and may reject all.

The recogniser expects the robot's name, and therefore hears it easily ("Hey Oliver" -> Hey Alice). Recognition without
any expected name serves as a second opinion.
"""

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
"""Largest log likelihood by which another reading of the recogniser may be behind the first."""
_CORRECTED_READING: Final = 8.0
"""The same for a reading corrected by sound, where the recogniser expects no names."""
_MOST_CORRECTED: Final = 4
_PER_SOUND: Final = 3.0
"""Log likelihood of one changed sound."""


@dataclass(frozen=True)
class Interpretation(Generic[Meaning]):
    """Chosen reading and its meaning."""

    text: str
    meaning: Meaning


def interpret(
    recognition: Recognition, read: Callable[[str], Reading[Meaning]], alikes: SoundAlikes
) -> Interpretation[Meaning] | None:
    """Chooses the likeliest hypothesis that fits, or the likeliest of all if none fits; None if nothing was said.

    If the likeliest hypothesis must not be corrected (the robot was not called), no other hypothesis is tried.
    """
    transcripts = recognition.transcripts
    if not transcripts:
        return None
    text = remove_repetitions(transcripts[0].text)
    heard = [Candidate(text, 0.0, read(text))]
    if not heard[0].reading.correctable or heard[0].reading.fits:
        return Interpretation(text, heard[0].reading.meaning)
    fitting = _fitting(recognition, heard, read, alikes)
    best = _likeliest(recognition, heard[0], fitting) or heard[0]
    return Interpretation(best.text, best.reading.meaning)


def _fitting(
    recognition: Recognition,
    heard: list[Candidate[Meaning]],
    read: Callable[[str], Reading[Meaning]],
    alikes: SoundAlikes,
) -> list[Candidate[Meaning]]:
    """Hypotheses that fit: from the first search, else from wider searches, else from corrections by sound."""
    likeliest = recognition.transcripts[0].likelihood
    heard = _read(recognition.transcripts, likeliest, heard, read)
    searches = recognition.more()
    while not any(one.reading.fits for one in heard) and (readings := next(searches, None)) is not None:
        heard = _read(readings, likeliest, heard, read)
    fitting = [one for one in heard if one.reading.fits]
    return fitting or corrections([one for one in heard if one.reading.correctable], read, alikes, most=_MOST_CORRECTED)


def _likeliest(
    recognition: Recognition, first: Candidate[Meaning], fitting: list[Candidate[Meaning]]
) -> Candidate[Meaning] | None:
    """Likeliest candidate given the sound; None if it is much less likely than the first hypothesis.

    The recogniser's own hypotheses keep their order.
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
    """Reads in order the transcripts that are not much less likely than the best one."""
    heard = [*heard]
    for transcript in transcripts:
        text, behind = remove_repetitions(transcript.text), max(best - transcript.likelihood, 0.0)
        same = [text.rstrip(" .?!").lower() == other.text.rstrip(" .?!").lower() for other in heard]
        if behind > _OTHER_READING or any(same):
            continue
        heard.append(Candidate(text, behind / _PER_SOUND, read(text)))
    return heard


def remove_repetitions(text: str) -> str:
    """Removes repetitions from a text.

    Keeps words once that the speaker repeats after a restart ("grab the, grab the cup"), and removes a pronoun that
    repeats a relative pronoun ("Robin, which he is in the hall").
    """
    once = re.sub(r"\b(\w+(?:[ ']\w+){1,9})[ ,.;]+(?=\1\b)", "", text, flags=re.IGNORECASE)
    return re.sub(r",?\s+(?:which|who|that)\s+(?:he|she|they)\s+(is|are)\b", r" who \1", once, flags=re.IGNORECASE)


@dataclass(frozen=True)
class Reading(Generic[Meaning]):
    """Meaning of a sentence, and whether it fits; if not, the suspect words (empty: any word is suspect).

    A hypothesis that is not `correctable` must not be changed.
    """

    meaning: Meaning
    fits: bool
    suspects: tuple[str, ...] = ()
    correctable: bool = True


@dataclass(frozen=True)
class Candidate(Generic[Meaning]):
    """Sentence with its meaning and its distance in sound from the transcript (0: equal, 1: about one changed sound).

    `changes` is the number of changed groups of words.
    """

    text: str
    cost: float
    reading: Reading[Meaning]
    changes: int = 0


def corrections(
    heard: Sequence[Candidate[Meaning]], read: Callable[[str], Reading[Meaning]], alikes: SoundAlikes, *, most: int = 3
) -> list[Candidate[Meaning]]:
    """Searches for up to `most` sentences that fit and sound like a heard sentence, the most similar first."""
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
    """Sentences with one group of words changed, and the cost of the change."""
    for start, end in _spans(len(words), _blamed(words, suspects)):
        known = sum(alikes.knows(_bare(word)) for word in words[start:end])
        for alike, other in _replaced(words, start, end, alikes):
            yield alike.cost + _PER_CHANGE + _PER_KNOWN_WORD * known, other


def _replaced(
    words: tuple[str, ...], start: int, end: int, alikes: SoundAlikes
) -> Iterator[tuple[Alike, tuple[str, ...]]]:
    """Sentences in which a known phrase of similar sound replaces a group of words."""
    tail = re.sub(r".*[\w']", "", words[end - 1])
    for alike in alikes.nearest(" ".join(map(_bare, words[start:end]))):
        before = words[:start]
        last = before[-1].lower() if before else ""
        if alike.name or not (last in _BEFORE_NAMES or is_attribute(last)):  # only a name stands behind these
            if before and alike.phrase.split()[0] in _PREPOSITIONS:  # no comma parts it from what stands before
                before = (*before[:-1], before[-1].rstrip(","))
            yield alike, (*before, *f"{alike.phrase}{tail}".split(), *words[end:])


def _blamed(words: Sequence[str], suspects: Sequence[str]) -> set[int]:
    """Positions of the suspect words and of articles between them; all positions if no word is suspect.

    If the words of a suspect name are not adjacent, each word is suspect by itself.
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
    """Positions from the first to the last word of a name, wherever its words are adjacent."""
    places = set[int]()
    for first in range(len(plain) - len(parts) + 1):
        found = plain[first : first + len(parts)]
        if parts and [word for _, word in found] == parts:
            places |= set(range(found[0][0], found[-1][0] + 1))
    return places


def _spans(count: int, blamed: set[int]) -> Iterator[tuple[int, int]]:
    """Groups of one to three successive words that contain a suspect word."""
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
"""Log likelihood by which another opening must exceed the one with the name, when no names are expected."""
_OTHER_WHOLE: Final = 10.0
"""The same for the whole text."""
_OPENING_WORDS: Final = 4


def choose_opening(recognition: Recognition, text: str, names: Collection[str], calls: Callable[[str], bool]) -> str:
    """Replaces the robot's name if the opening is much likelier without expected names and then calls no robot.

    `calls` returns whether a text calls one of the robots `names`. Only the opening is replaced, because the names
    after it are recognised better when they are expected. A text without a name among its first words stays the same.
    """
    words = text.split()
    bare = [re.sub(r"\W", "", word).lower() for word in words[:_OPENING_WORDS]]
    called = {name.lower() for name in names}
    at = next((number for number, word in enumerate(bare) if word in called), None)
    if at is None:
        return text
    unprompted = recognition.unprompted_text()
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
