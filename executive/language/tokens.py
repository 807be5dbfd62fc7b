"""Words with their place in the sentence and in the tree of dependencies."""

from __future__ import annotations

from dataclasses import dataclass

from executive.language.nouns import NounKind
from executive.words.command import is_attribute, may_be_attribute

__all__ = ["Token"]


@dataclass(frozen=True)
class Token:
    """A word with its place in the sentence and in the tree.

    `start` is its first character in the text, `pos` the universal part of speech, `tag` the Penn tag, `head` the
    index of the word that it depends on (its own for the root), `relation` how (nsubj, obj, iobj, prep, obl, ...),
    `entity` what a known name is part of (PERSON), `kind` what kind of thing it would stand for as a noun,
    and `known` whether the world knows the name.
    """

    index: int
    start: int
    text: str
    lemma: str
    pos: str
    tag: str
    head: int
    relation: str
    entity: str = ""
    kind: NounKind | None = None
    known: bool = False

    @property
    def word(self) -> str:
        """The text in lower case."""
        return self.text.lower()

    @property
    def adjective(self) -> bool:
        """Whether it can be an attribute of a thing ("red", "heaviest")."""
        return is_attribute(self.text) or (self.pos in ("ADJ", "ADV") and may_be_attribute(self.text))
