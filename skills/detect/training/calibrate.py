"""Scores that mean something: 0.5 becomes the score of each class at which precision and recall are best together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.detect.scoring_labels import LabelledPicture, large_enough
from skills.detect.scoring_matching import match
from skills.detection import Detection

__all__ = ["best_threshold", "score_offsets"]

Floats = NDArray[np.float64]
FEWEST_LABELS: Final = 20
_LIMITS: Final = (0.05, 0.95)


def score_offsets(
    pictures: Sequence[LabelledPicture], found: Sequence[Sequence[Detection]], class_names: Sequence[str]
) -> tuple[float, ...]:
    """What to add to each class's logit, so that 0.5 is its best threshold; 0 where labels are few.

    `found` are the detections of each picture, also those of low score.
    """
    return tuple(_offset(pictures, found, name) for name in class_names)


def _offset(pictures: Sequence[LabelledPicture], found: Sequence[Sequence[Detection]], name: str) -> float:
    judged = [_judged(picture, ones, name) for picture, ones in zip(pictures, found, strict=True)]
    labels = sum(count for _, _, count in judged)
    if labels < FEWEST_LABELS:
        return 0.0
    scores, right = (np.concatenate([one[k] for one in judged]) for k in (0, 1))
    threshold = min(max(best_threshold(scores, right.astype(bool), labels), _LIMITS[0]), _LIMITS[1])
    return float(-np.log(threshold / (1.0 - threshold)))


def _judged(picture: LabelledPicture, found: Sequence[Detection], name: str) -> tuple[Floats, Floats, int]:
    """Scores of a class's detections in a picture, whether each is right, and how many labels count."""
    own = [one for one in found if one.class_name == name]
    labels = [label for label in picture.labels if label.class_name == name]
    result = match(
        np.array([one.box for one in own], dtype=np.float64).reshape(-1, 4),
        np.array([one.score for one in own], dtype=np.float64),
        np.array([label.box for label in labels], dtype=np.float64).reshape(-1, 4),
        crowd=np.array([label.crowd for label in labels], dtype=bool),
        passed=np.array([not label.counts for label in labels], dtype=bool),
        small=np.array([not large_enough(one.box) for one in own], dtype=bool),
        at=(0.5,),
    )
    kept = ~result.passed[0]
    return result.scores[kept], result.found[0][kept].astype(np.float64), result.counting


def best_threshold(scores: Floats, right: NDArray[np.bool_], labels: int) -> float:
    """The score from which on detections give the highest harmonic mean of precision and recall.

    Halfway to the next lower score, so that small changes do not matter. 0.5 when nothing is right.
    """
    if not right.any():
        return 0.5
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(right[order])
    means = 2.0 * hits / (np.arange(1, len(hits) + 1) + labels)
    best = int(np.argmax(means))
    ranked = scores[order]
    return float((ranked[best] + ranked[min(best + 1, len(ranked) - 1)]) / 2)
