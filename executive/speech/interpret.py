"""Which of the readings of a sound was meant: the likeliest one that makes sense, else one corrected by sound."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from executive.language.spelling import SoundAlikes
from executive.speech.recogniser import Recognition, Transcript
from executive.speech.sound_correction import Candidate, Reading, corrections

__all__ = ["Interpretation", "interpret"]

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
        if behind > _OTHER_READING or any(_same(text, other.text) for other in heard):
            continue
        heard.append(Candidate(text, behind / _PER_SOUND, read(text)))
    return heard


def _same(first: str, second: str) -> bool:
    return first.rstrip(" .?!").lower() == second.rstrip(" .?!").lower()


def smoothed(text: str) -> str:
    """The text as it was meant to be said.

    What a speaker said twice on starting anew stands once ("grab the, grab the cup"), and no pronoun repeats a
    relative one ("Robin, which he is in the hall").
    """
    anew = re.sub(r"\b(\w+(?:[ ']\w+){1,9})[ ,.;]+(?=\1\b)", "", text, flags=re.IGNORECASE)
    return re.sub(r",?\s+(?:which|who|that)\s+(?:he|she|they)\s+(is|are)\b", r" who \1", anew, flags=re.IGNORECASE)
