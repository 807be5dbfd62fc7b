"""The row of words while it is read from left to right: where the reader stands, and what stands there."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from executive.language.items import Item, Separator
from executive.language.lexicon import Lexicon
from executive.language.phrases import Phrase
from executive.language.tokens import Token

__all__ = ["LONGEST", "Row", "command_position"]

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
