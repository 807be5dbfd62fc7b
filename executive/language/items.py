"""The sentence as a row of items: verbs, noun phrases with their prepositions, and small words.

Attachment of prepositions is where parsers err most; the row keeps the order of the words, and the verbs decide later
which place plays which role."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from executive.language.lexicon import Lexicon, PrepositionRole, VerbKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token

__all__ = [
    "LONGEST",
    "Adverb",
    "Being",
    "Chunk",
    "Correction",
    "Item",
    "Negation",
    "Outside",
    "Row",
    "Separator",
    "Unknown",
    "Verb",
    "Whether",
    "command_position",
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


LONGEST: Final = 6
"""So many words has the longest phrase of the dictionaries."""


@dataclass
class Row:
    """The words of a sentence, its noun phrases by their first word, and the next word to be read.

    Words in `silent` are passed over.
    """

    tokens: Sequence[Token]
    phrases: Mapping[int, Phrase]
    words: Lexicon
    at: int = 0
    silent: set[int] = field(default_factory=set)

    def match(self, phrases: Container[tuple[str, ...]]) -> tuple[str, ...] | None:
        """The longest of the phrases that stands here."""
        for length in range(LONGEST, 0, -1):
            piece = self.tokens[self.at : self.at + length]
            spoken = tuple(t.word for t in piece)
            if len(piece) == length and spoken in phrases:
                return spoken
        return None

    def phrase_at(self, start: int) -> Phrase | None:
        """The noun phrase that begins at `start`, also when what came before took its first words."""
        whole = self.phrases.get(start)
        if whole is not None:
            return whole
        cut = next((p for first, p in self.phrases.items() if first < start < first + len(p.tokens)), None)
        return None if cut is None else Phrase(tuple(t for t in cut.tokens if t.index >= start))

    def take(self, count: int) -> str:
        """The next words, which are then read."""
        self.at += count
        return " ".join(t.text for t in self.tokens[self.at - count : self.at])

    def ahead(self, count: int = 1) -> Sequence[Token]:
        """The `count` words behind the next one, fewer at the end."""
        return self.tokens[self.at + 1 : self.at + 1 + count]


def command_position(items: Sequence[Item]) -> bool:
    """Whether a command may begin behind these items."""
    return not items or isinstance(items[-1], Separator)
