"""What a recogniser of speech is to the rest: sound goes in, readings with their likelihoods come out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from executive.speech.sound import Samples
from executive.speech.vocabulary import Vocabulary

__all__ = ["Recogniser", "Recognition", "Transcript"]


@dataclass(frozen=True)
class Transcript:
    """What may have been said, and its log likelihood given the sound (natural logarithm, of the whole text)."""

    text: str
    likelihood: float


class Recognition(Protocol):
    """One sound as it was recognised."""

    @property
    def transcripts(self) -> Sequence[Transcript]:
        """The readings, likeliest first; none when nothing was said."""
        ...

    def more(self) -> Iterator[Sequence[Transcript]]:
        """The readings of further searches, each slower than the one before; each set has its likeliest first."""
        ...

    def unprompted(self) -> str:
        """What is heard when no names are expected, by a quick search; empty for nothing."""
        ...

    def likelihoods(self, texts: Sequence[str]) -> Sequence[float]:
        """The log likelihood of each text given the sound, when no names are expected.

        They can be compared with each other, not with those of `transcripts`.
        """
        ...


class Recogniser(Protocol):
    """Turns sound into text; the same sound and vocabulary give the same text."""

    def transcribe(self, sound: Samples, vocabulary: Vocabulary) -> Recognition:
        """Recognise at most 30 s of sound at RATE_HZ."""
        ...

    def draft(self, sound: Samples, vocabulary: Vocabulary) -> str:
        """A quick first reading of a sentence that is still being spoken."""
        ...
