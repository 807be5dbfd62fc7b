"""Many boxes on one thing become one: the surest of each class, and the surer of two classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class SuppressionOptions:
    """Which of many boxes stay.

    Boxes of one class that overlap by more than `same_class` (shared area / area of both) are one thing. So are boxes
    of two classes over `other_class`, when the surer of the two has at least `sure_score`. Of more than
    `most_candidates` boxes in a picture the surest are looked at, and `most_kept` of those that stay are told. What a
    thing may be as well is told by boxes of other classes that overlap its own by more than `alternative`.
    """

    same_class: float = 0.45
    other_class: float = 0.6
    sure_score: float = 0.5
    alternative: float = 0.55
    most_candidates: int = 1000
    most_kept: int = 300


@dataclass(frozen=True)
class Candidates:
    """Boxes (N, 4) of (u0, v0, u1, v1), their scores (N,) and the indices (N,) of their classes, the surest first."""

    boxes: Floats
    scores: Floats
    classes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.scores)

    def at(self, rows: NDArray[np.int64]) -> Candidates:
        """Those of some rows."""
        return Candidates(self.boxes[rows], self.scores[rows], self.classes[rows])

    def from_score(self, threshold: float) -> Candidates:
        """Those with at least a score."""
        return self.at(np.flatnonzero(self.scores >= threshold))


def candidates_of(boxes: Floats, scores: Floats, threshold: float, most: int) -> Candidates:
    """Boxes (A, 4) of which a class has at least the threshold, by scores (A, K); `most` of them, the surest first.

    What is not finite, or has no area, is none. Equal scores keep their order.
    """
    rows, classes = np.nonzero(scores >= threshold)
    found = boxes[rows]
    sound = np.isfinite(found).all(axis=1) & (found[:, 2:] > found[:, :2]).all(axis=1)
    found, rows, classes = found[sound], rows[sound], classes[sound]
    values = scores[rows, classes]
    order = np.argsort(-values, kind="stable")[:most]
    return Candidates(found[order], values[order], classes[order].astype(np.int64))


def suppress(candidates: Candidates, options: SuppressionOptions) -> Candidates:
    """The candidates without those that a surer one stands for.

    Greedy, after the usual non-maximum suppression: the surest stays, what it stands for goes, and so on.
    """
    if not len(candidates):
        return candidates
    return candidates.at(_standing(_replaced_by(candidates, options))[: options.most_kept])


def apart(boxes: Floats, overlap: float) -> NDArray[np.int64]:
    """Rows of boxes (N, 4), the surest first, that share no more than `overlap` with a surer one that stays."""
    return _standing(_overlaps(boxes, boxes) > overlap)


def _standing(replaced: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows that stay, when each that stays takes away those later ones (N, N) that it replaces."""
    alive = np.ones(len(replaced), dtype=bool)
    for k in range(len(replaced)):
        if alive[k]:
            alive[k + 1 :] &= ~replaced[k, k + 1 :]
    return np.flatnonzero(alive)


def _replaced_by(candidates: Candidates, options: SuppressionOptions) -> NDArray[np.bool_]:
    """(N, N): whether the one of the row stands for the one of the column, if that is less sure."""
    shared = _overlaps(candidates.boxes, candidates.boxes)
    same = candidates.classes[:, None] == candidates.classes[None, :]
    sure = (candidates.scores >= options.sure_score)[:, None]
    return np.asarray(np.where(same, shared > options.same_class, sure & (shared > options.other_class)))


def detections_of(
    candidates: Candidates, class_names: Sequence[str], threshold: float, options: SuppressionOptions
) -> tuple[Detection, ...]:
    """What is told of candidates in a picture: those from a score on that stay, with what else they may be."""
    candidates = candidates.at(np.flatnonzero((candidates.boxes[:, 2:] > candidates.boxes[:, :2]).all(axis=1)))
    kept = suppress(candidates.from_score(threshold), options)
    rows = zip(
        kept.classes.tolist(),
        kept.scores.tolist(),
        kept.boxes.astype(np.float64).tolist(),
        alternatives_of(kept, candidates, options),
        strict=True,
    )
    return tuple(
        Detection(
            class_names[which], score, (u0, v0, u1, v1), tuple((class_names[k], s) for k, s in alternatives.items())
        )
        for which, score, (u0, v0, u1, v1), alternatives in rows
    )


def alternatives_of(kept: Candidates, candidates: Candidates, options: SuppressionOptions) -> list[dict[int, float]]:
    """For each of those kept, the other classes that it may be with their best scores on the same thing."""
    alike = _overlaps(kept.boxes, candidates.boxes) > options.alternative
    alike &= kept.classes[:, None] != candidates.classes[None, :]
    alternatives: list[dict[int, float]] = [{} for _ in range(len(kept))]
    for row, column in np.argwhere(alike).tolist():
        alternatives[row].setdefault(int(candidates.classes[column]), float(candidates.scores[column]))
    return alternatives


def _overlaps(first: Floats, second: Floats) -> Floats:
    """Shared area / area of both together (N, M)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    areas, others = ((boxes[:, 2:] - boxes[:, :2]).prod(axis=1) for boxes in (first, second))
    return np.asarray(shared / (areas[:, None] + others[None, :] - shared), dtype=np.float32)
