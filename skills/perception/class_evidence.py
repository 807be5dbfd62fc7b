"""Probability of each class for one object, by Bayes' rule from the scores and the shapes of all its views.

A detector's score is taken for the probability that the box shows the class, and divided by the class's share among the
boxes. The errors of several views of one object are alike, so each view counts by a part of its logarithm. The shape is
the same in each view: its mean counts once. Only classes with a faint score or more in some view compete, next to
`ANY_OBJECT`, which stands for all objects that the detector does not know.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Final

import numpy as np

from skills.class_forms import ANY_OBJECT
from skills.detection import Detection
from skills.robot import FloatArray

SURE_SCORE: Final = 0.5
"""Least score of a detection that begins a track, and that a class needs to be recognised."""
FAINT_SCORE: Final = 0.3
"""Least score of a detection that supports a track, and that lets a class compete."""
NEW_IN_A_VIEW: Final = 0.5
"""Fraction of a view's evidence that is new; 1 would be views with independent errors."""
_LEAST_SCORE: Final = 0.017
"""Score that stands for none: a class without a score is a tenth as frequent in views of its objects as in others."""
MOST_SURE: Final = 0.97
"""Highest score that counts as a probability."""
_SHARE: Final = 0.07
"""Share of each class among the objects that the detector judges."""
_OTHERS: Final = 0.43
"""Share of the objects of no class."""
_LEAST_OTHERS: Final = 0.03
_LEAST: Final = 1e-3


@dataclass(frozen=True)
class ClassEvidence:
    """Evidence for the classes `names`, with `ANY_OBJECT` among them.

    `scores` (C,) are the sums of the logarithms of likelihoods by the detector's scores, `shapes` (C,) those by the
    shapes in `shape_views` views, `best` (C,) the highest scores.
    """

    names: tuple[str, ...]
    scores: FloatArray
    shapes: FloatArray
    best: FloatArray
    shape_views: int = 0

    @classmethod
    def none(cls, class_names: Sequence[str]) -> ClassEvidence:
        """Evidence for an object that nobody has seen yet."""
        names = tuple(dict.fromkeys((*class_names, ANY_OBJECT)))
        return cls(names, np.zeros(len(names)), np.zeros(len(names)), np.zeros(len(names)))

    def add(self, seen: Detection, shape: Mapping[str, float] | None) -> ClassEvidence:
        """Adds a detection, or a segment without a label, and the likelihoods of the classes by its shape, if known."""
        given = dict(seen.alternatives) | {seen.class_name: seen.score}
        score = np.array([0.0 if name == ANY_OBJECT else given.get(name, 0.0) for name in self.names])
        is_other = np.array([name == ANY_OBJECT for name in self.names])
        likelihood = np.clip(score, _LEAST_SCORE, MOST_SURE) / _SHARE
        likelihood[is_other] = max(1.0 - float(score.sum()), _LEAST_OTHERS) / _OTHERS
        shapes = np.array([shape.get(name, 1.0) for name in self.names]) if shape else np.ones(len(self.names))
        return replace(
            self,
            scores=self.scores + NEW_IN_A_VIEW * np.log(likelihood),
            shapes=self.shapes + np.log(shapes),
            best=np.maximum(self.best, score),
            shape_views=self.shape_views + (shape is not None),
        )

    def is_sure(self, name: str) -> bool:
        """Returns whether some view gave a class a sure score."""
        return bool(self.best[self.names.index(name)] >= SURE_SCORE)

    @cached_property
    def probabilities(self) -> Mapping[str, float]:
        """Probability of each class that competes; a little for the others."""
        competes = (self.best >= FAINT_SCORE) | np.array([name == ANY_OBJECT for name in self.names])
        return self._normalised(np.where(competes, 0.0, -np.inf))

    @cached_property
    def possible(self) -> Mapping[str, float]:
        """Probability of each class if all compete: what the object may be although no view says so."""
        return self._normalised(np.zeros(len(self.names)))

    def _normalised(self, prior: FloatArray) -> Mapping[str, float]:
        log = self.scores + self.shapes / max(self.shape_views, 1) + prior
        p = np.exp(log - log.max())
        return MappingProxyType(dict(zip(self.names, np.maximum(p / p.sum(), _LEAST).tolist(), strict=True)))
