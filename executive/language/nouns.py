"""Classifies nouns by how near their meaning is to examples of each kind.

The examples are in nouns.yaml by kind. Linear discriminant analysis on word vectors classifies a noun that is no
example; `errand_train.nouns` learns its weights.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Final

import numpy as np
import numpy.typing as npt

from executive.language.lexicon import read_table

FloatArray = npt.NDArray[np.float64]
VectorOf = Callable[[str], FloatArray | None]
"""Maps a word to its vector; None for an unknown word."""
WEIGHTS_FILE: Final = "noun_weights.npz"
"""Weights that ship with this module."""
_MODIFIER_WEIGHT: Final = 0.3
_MARGIN: Final = 2.0


class NounKind(enum.Enum):
    """Kind of object, place or person that a noun means."""

    THING = "thing"  # an object that can be found, and mostly taken
    PLACE = "place"  # where one can go, or where objects are stored
    PERSON = "person"  # somebody, animals included
    VEHICLE = "vehicle"  # where objects can be brought to, and which is not carried
    ELSEWHERE = "elsewhere"  # a place out of reach
    ABSTRACT = "abstract"  # nothing that a hand can hold

    @property
    def within_reach(self) -> bool:
        """Returns whether a robot in a house can handle or reach what a noun of this kind means."""
        return self not in (NounKind.ELSEWHERE, NounKind.ABSTRACT)


@cache
def noun_examples() -> Mapping[str, NounKind]:
    """Returns the shipped examples: each noun, or pair of nouns, with its kind."""
    table = read_table("nouns.yaml").items()
    kinds = [(NounKind(kind), noun) for kind, fields in table for nouns in fields.values() for noun in nouns]
    return {noun: kind for kind, noun in reversed(kinds)}


@dataclass(frozen=True)
class NounKinds:
    """Classifier of nouns; `weights`, of shape (dimensions + 1, kinds), give the scores, the last row as constants."""

    examples: Mapping[str, NounKind]
    vector_of: VectorOf
    weights: FloatArray

    @classmethod
    def load(cls, vector_of: VectorOf) -> NounKinds:
        """Loads the weights of noun_weights.npz, which `python -m errand_train.nouns` writes."""
        with resources.files(__package__).joinpath(WEIGHTS_FILE).open("rb") as file, np.load(file) as stored:
            return cls(noun_examples(), vector_of, stored["weights"])

    def kind(self, words: Sequence[str], *, lemma: str) -> NounKind | None:
        """Kind of a noun, the last of `words`, whose dictionary form is `lemma`; in doubt one within reach."""
        *before, noun = words
        pairs = [f"{before[-1]} {form}" for form in (noun, lemma)] if before else []
        known = next((form for form in (*pairs, noun, lemma) if form in self.examples), None)
        if known is not None:
            return self.examples[known]
        scores = self.scores(words)
        return None if scores is None else list(NounKind)[int(np.argmax(scores))]

    def scores(self, words: Sequence[str]) -> FloatArray | None:
        """Score of each kind for a noun; the words before the noun weigh less."""
        vector = self.vector_of(words[-1])
        if vector is None:
            return None
        before = [v for v in map(self.vector_of, words[:-1]) if v is not None]
        if before:
            vector = vector + _MODIFIER_WEIGHT * np.mean(before, axis=0)
            vector = vector / np.linalg.norm(vector)
        doubt = np.array([_MARGIN * kind.within_reach for kind in NounKind])
        scores: FloatArray = np.append(vector, 1.0) @ self.weights + doubt
        return scores
