"""Which of the readings of a sound was meant: the likeliest one that makes sense, mended by sound where none does."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from executive.speech.alikes import SoundAlikes
from executive.speech.recogniser import Recognition, Transcript
from executive.speech.repair import Reading, Repair, repairs

__all__ = ["Interpretation", "interpret"]

Meaning = TypeVar("Meaning")

_OTHER_READING: Final = 6.0
"""How many times e less likely another of the recogniser's own readings may be than the first."""
_MENDED_READING: Final = 9.0
"""The same for a reading mended by sound; these are compared without telling the recogniser what to expect."""
_MOST_MENDED: Final = 4
_PER_SOUND: Final = 2.0
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
    heard = [Repair(smoothed(first.text), 0.0, read(smoothed(first.text)))]
    if heard[0].reading.mendable:
        heard = _searched(recognition, heard, read, alikes)
    best = next((one for one in heard if one.reading.fits), heard[0])
    return Interpretation(best.text, best.reading.meaning, first.text)


def _searched(
    recognition: Recognition,
    heard: list[Repair[Meaning]],
    read: Callable[[str], Reading[Meaning]],
    alikes: SoundAlikes,
) -> list[Repair[Meaning]]:
    """The readings, and where the first does not fit, the others up to one that does, or else that mended by sound."""
    likeliest = recognition.transcripts[0].likelihood
    if not heard[-1].reading.fits:
        heard = _read(recognition.transcripts, likeliest, heard, read)
    more = recognition.more()
    while not heard[-1].reading.fits and (readings := next(more, None)) is not None:
        heard = _read(readings, likeliest, heard, read)
    if not heard[-1].reading.fits:
        repair = _mended(recognition, [one for one in heard if one.reading.mendable], read, alikes)
        return heard if repair is None else [*heard, repair]
    return heard


def _read(
    transcripts: Sequence[Transcript],
    best: float,
    heard: list[Repair[Meaning]],
    read: Callable[[str], Reading[Meaning]],
) -> list[Repair[Meaning]]:
    """Those heard and, read in order, those that are not much less likely than the best, up to one that fits."""
    heard = [*heard]
    for transcript in transcripts:
        text, behind = smoothed(transcript.text), max(best - transcript.likelihood, 0.0)
        if behind > _OTHER_READING or any(_same(text, other.text) for other in heard):
            continue
        heard.append(Repair(text, behind / _PER_SOUND, read(text)))
        if heard[-1].reading.fits:
            break
    return heard


def _mended(
    recognition: Recognition,
    heard: Sequence[Repair[Meaning]],
    read: Callable[[str], Reading[Meaning]],
    alikes: SoundAlikes,
) -> Repair[Meaning] | None:
    """The likeliest of the sentences that fit and sound like one of the readings, if it is likely at all."""
    fitting = repairs(heard, read, alikes, most=_MOST_MENDED)
    if not fitting:
        return None
    unmended, *likelihoods = recognition.likelihoods([heard[0].text, *(repair.text for repair in fitting)])
    weighed = zip(likelihoods, fitting, strict=True)
    best, repair = max(weighed, key=lambda pair: pair[0] - _PER_SOUND * pair[1].cost)
    return repair if best >= unmended - _MENDED_READING else None


def _same(first: str, second: str) -> bool:
    return first.rstrip(" .?!").lower() == second.rstrip(" .?!").lower()


def smoothed(text: str) -> str:
    """The text as it was meant to be said.

    What a speaker said twice on starting anew stands once ("grab the, grab the cup"), and no pronoun repeats a
    relative one ("Robin, which he is in the hall").
    """
    anew = re.sub(r"\b(\w+(?:[ ']\w+){1,9})[ ,.;]+(?=\1\b)", "", text, flags=re.IGNORECASE)
    return re.sub(r",?\s+(?:which|who|that)\s+(?:he|she|they)\s+(is|are)\b", r" who \1", anew, flags=re.IGNORECASE)
