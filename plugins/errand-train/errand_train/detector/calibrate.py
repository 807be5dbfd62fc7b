"""Calibration of scores: an offset makes 0.5 the threshold with the best F1 score of each class."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from errand_train.detector.matching import Evaluation, evaluate
from errand_train.detector.scoring_labels import LabelledPicture
from skills.api import Detection

Floats = NDArray[np.float64]
FEWEST_LABELS: Final = 20
_LIMITS: Final = (0.05, 0.95)


def score_offsets(
    pictures: Sequence[LabelledPicture], found: Sequence[Sequence[Detection]], class_names: Sequence[str]
) -> tuple[float, ...]:
    """Offset of each class's logit that makes 0.5 its best threshold; 0 where labels are few.

    `found` are the detections of each picture, low scores included.
    """
    evaluation = evaluate(pictures, found, class_names)
    return tuple(_offset(evaluation, name) for name in class_names)


def _offset(evaluation: Evaluation, name: str) -> float:
    labels = sum(label.counts for label in evaluation.labels if label.class_name == name)
    if labels < FEWEST_LABELS:
        return 0.0
    kept = [one for one in evaluation.matches(name) if not one.passed]
    scores = np.array([one.detection.score for one in kept])
    right = np.array([one.label is not None for one in kept], dtype=bool)
    threshold = min(max(best_threshold(scores, right, labels), _LIMITS[0]), _LIMITS[1])
    return float(-np.log(threshold / (1.0 - threshold)))


def best_threshold(scores: Floats, right: NDArray[np.bool_], labels: int) -> float:
    """Threshold with the highest harmonic mean of precision and recall.

    The threshold lies halfway to the next lower score, so that small changes do not matter; 0.5 when no detection is
    right.
    """
    if not right.any():
        return 0.5
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(right[order])
    means = 2.0 * hits / (np.arange(1, len(hits) + 1) + labels)
    best = int(np.argmax(means))
    ranked = scores[order]
    return float((ranked[best] + ranked[min(best + 1, len(ranked) - 1)]) / 2)
