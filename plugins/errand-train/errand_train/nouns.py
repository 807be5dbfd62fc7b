"""Learns the kinds of nouns: writes noun_weights.npz after nouns.yaml has changed (`python -m errand_train.nouns`).

Each kind is a Gaussian about the mean of its examples' word vectors, and all share one covariance, which is shrunk
towards a multiple of the identity since there are few examples for so many dimensions (Friedman, "Regularized
Discriminant Analysis", JASA 1989; Ledoit and Wolf, "A well-conditioned estimator for large-dimensional covariance
matrices", 2004).
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from executive.language.nouns import WEIGHTS_FILE, NounKind, NounKinds, VectorOf, noun_examples
from executive.language.parser import load_parser
from skills.robot import FloatArray

__all__ = ["learn_nouns"]

_SHRINKAGE: Final = 0.2


def learn_nouns(examples: Mapping[str, NounKind], vector_of: VectorOf) -> NounKinds:
    """Learns the kinds of nouns from examples; `vector_of` returns the unit vector of a word, or None."""
    single = ((vector_of(noun), kind) for noun, kind in examples.items() if " " not in noun)
    known = [(vector, kind) for vector, kind in single if vector is not None]
    vectors = np.array([vector for vector, _ in known])
    labels = np.array([list(NounKind).index(kind) for _, kind in known])
    return NounKinds(examples, vector_of, _discriminant(vectors, labels))


def _discriminant(vectors: FloatArray, labels: npt.NDArray[np.int_]) -> FloatArray:
    """Weights of a linear discriminant with shrunk covariance and equal priors."""
    means = np.array([vectors[labels == label].mean(axis=0) for label in range(len(NounKind))])
    spread = vectors - means[labels]
    covariance = spread.T @ spread / len(vectors)
    size = len(covariance)
    ball = np.trace(covariance) / size * np.eye(size)
    slopes = np.linalg.solve((1 - _SHRINKAGE) * covariance + _SHRINKAGE * ball, means.T)
    return np.vstack([slopes, -0.5 * np.sum(means.T * slopes, axis=0)])


if __name__ == "__main__":
    weights = learn_nouns(noun_examples(), load_parser().vector).weights
    file = Path(str(resources.files("executive.language") / WEIGHTS_FILE))
    np.savez_compressed(file, weights=weights)
