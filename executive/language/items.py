"""The sentence as a row of items: verbs, noun phrases with their prepositions, and small words.

Attachment of prepositions is where parsers err most; the row keeps the order of the words, and the verbs decide later
which place plays which role.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from executive.language.lexicon import PrepositionRole, VerbKind
from executive.language.phrases import Phrase

__all__ = [
    "Adverb",
    "Being",
    "Chunk",
    "Correction",
    "Item",
    "Negation",
    "Outside",
    "Separator",
    "Unknown",
    "Verb",
    "Whether",
    "spoken_words",
]


@dataclass(frozen=True)
class Verb:
    """A verb that the robot understands, with its particles."""

    text: str
    kinds: frozenset[VerbKind]


@dataclass(frozen=True)
class Chunk:
    """A noun phrase with the preposition before it; `role` is None for a bare one."""

    phrase: Phrase
    preposition: str = ""
    role: PrepositionRole | None = None

    @property
    def spoken(self) -> str:
        """All words as spoken."""
        return f"{self.preposition} {self.phrase.spoken}".strip()


@dataclass(frozen=True)
class Adverb:
    """ "Here" or "there"."""

    here: bool

    @property
    def word(self) -> str:
        """The word as spoken."""
        return "here" if self.here else "there"


@dataclass(frozen=True)
class Being:
    """A form of "to be" as spoken; `existential` with "there", `asked` when it stands before its subject.

    `teller` is somebody who did something with a thing, so that it is where it is ("Anna left her umbrella");
    `narrated` says that it is any verb by which something is told ("somebody spilled milk on the floor"), and
    `topic` is the thing that it is told of ("the ball rolled under the sofa").
    """

    text: str
    existential: bool
    asked: bool
    teller: Phrase | None = None
    narrated: bool = False
    topic: Phrase | None = None


@dataclass(frozen=True)
class Whether:
    """ "If" or "whether"."""


@dataclass(frozen=True)
class Separator:
    """A comma, "and", "or", "then"."""

    word: str


@dataclass(frozen=True)
class Unknown:
    """A word that nothing accounts for."""

    word: str


@dataclass(frozen=True)
class Outside:
    """A verb that the robot does not know; what follows belongs to it."""

    word: str


@dataclass(frozen=True)
class Negation:
    """ "Not" and its kin: the speaker leaves out what follows."""

    word: str


@dataclass(frozen=True)
class Correction:
    """ "No", "I mean": what follows takes the place of what was said; a `soft` one may also mean nothing."""

    word: str
    soft: bool


Item = Verb | Chunk | Adverb | Being | Whether | Separator | Unknown | Outside | Negation | Correction


def spoken_words(items: Iterable[Item]) -> str:
    """The words of the items as spoken, small words left out."""
    words = (
        item.spoken if isinstance(item, Chunk) else getattr(item, "word", getattr(item, "text", ""))
        for item in items
        if not isinstance(item, Separator)
    )
    return " ".join(filter(None, words))
