"""Writes noun_weights.npz again after nouns.yaml has changed: `python -m executive.language.learn_nouns`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from executive.language.nouns import WEIGHTS_FILE, NounKinds, noun_examples
from executive.language.parser import load_parser

__all__ = ["learned_nouns"]


def learned_nouns() -> NounKinds:
    """The kinds of nouns, learned from the examples and the word vectors of the parser."""
    return NounKinds.learn(noun_examples(), load_parser().vector)


if __name__ == "__main__":
    np.savez_compressed(Path(__file__).with_name(WEIGHTS_FILE), weights=learned_nouns().weights)
