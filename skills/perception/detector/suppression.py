"""Non-maximum suppression: many boxes on one object become one detection with alternative classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.detection import Detection

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class SuppressionOptions:
    """Overlaps (intersection over union) at which boxes are one object, and limits of their number.

    Boxes of one class that overlap by more than `same_class` are one object. So are boxes of two classes that overlap
    by more than `other_class`, if the better one has at least `sure_score`. Boxes of other classes that overlap a
    detection by more than `alternative` are its alternatives. At most `most_candidates` boxes of a picture are
    considered, and `most_kept` of them become detections.
    """

    same_class: float = 0.45
    other_class: float = 0.6
    sure_score: float = 0.5
    alternative: float = 0.55
    most_candidates: int = 1000
    most_kept: int = 300


@dataclass(frozen=True)
class Candidates:
    """Boxes (N, 4) of (u0, v0, u1, v1), their scores (N,) and the indices (N,) of their classes, best first."""

    boxes: Floats
    scores: Floats
    classes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.scores)

    def at(self, rows: NDArray[np.int64]) -> Candidates:
        """Candidates at some rows."""
        return Candidates(self.boxes[rows], self.scores[rows], self.classes[rows])

    def from_score(self, threshold: float) -> Candidates:
        """Candidates with at least a score."""
        return self.at(np.flatnonzero(self.scores >= threshold))


def select_candidates(boxes: Floats, scores: Floats, threshold: float, most: int) -> Candidates:
    """Selects the `most` best pairs of box (A, 4) and class whose scores (A, K) reach the threshold.

    Leaves out boxes that are not finite or have no area. Equal scores keep their order.
    """
    rows, classes = np.nonzero(scores >= threshold)
    sound = are_sound(boxes[rows])
    rows, classes = rows[sound], classes[sound]
    values = scores[rows, classes]
    order = np.argsort(-values, kind="stable")[:most]
    return Candidates(boxes[rows[order]], values[order], classes[order].astype(np.int64))


def are_sound(boxes: Floats) -> NDArray[np.bool_]:
    """Returns which boxes (N, 4) are finite and have an area."""
    return np.asarray(np.isfinite(boxes).all(axis=1) & (boxes[:, 2:] > boxes[:, :2]).all(axis=1))


def suppress(candidates: Candidates, options: SuppressionOptions) -> Candidates:
    """Removes the candidates that a better one represents: greedy non-maximum suppression."""
    shared = overlaps(candidates.boxes, candidates.boxes)
    same = candidates.classes[:, None] == candidates.classes[None, :]
    sure = (candidates.scores >= options.sure_score)[:, None]
    replaced = np.where(same, shared > options.same_class, sure & (shared > options.other_class))
    return candidates.at(_greedy_rows(replaced)[: options.most_kept])


def select_distinct(boxes: Floats, overlap: float) -> NDArray[np.int64]:
    """Selects the rows of boxes (N, 4), best first, that overlap no better selected one by more than `overlap`."""
    return _greedy_rows(overlaps(boxes, boxes) > overlap)


def _greedy_rows(replaced: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows that stay when each row that stays removes the later ones that it replaces (N, N)."""
    alive = np.ones(len(replaced), dtype=bool)
    for k in range(len(replaced)):
        if alive[k]:
            alive[k + 1 :] &= ~replaced[k, k + 1 :]
    return np.flatnonzero(alive)


def detections_from(
    candidates: Candidates, class_names: Sequence[str], threshold: float, options: SuppressionOptions
) -> tuple[Detection, ...]:
    """Detections of a picture: candidates from the threshold on after suppression, with their alternatives."""
    candidates = candidates.at(np.flatnonzero((candidates.boxes[:, 2:] > candidates.boxes[:, :2]).all(axis=1)))
    selected = suppress(candidates.from_score(threshold), options)
    rows = zip(
        selected.classes.tolist(),
        selected.scores.tolist(),
        selected.boxes.astype(np.float64).tolist(),
        alternative_scores(selected, candidates, options),
        strict=True,
    )
    return tuple(
        Detection(
            class_names[which], score, (u0, v0, u1, v1), tuple((class_names[k], s) for k, s in alternatives.items())
        )
        for which, score, (u0, v0, u1, v1), alternatives in rows
    )


def alternative_scores(
    selected: Candidates, candidates: Candidates, options: SuppressionOptions
) -> list[dict[int, float]]:
    """Best scores of the other classes on the object of each selected candidate, by class."""
    alike = overlaps(selected.boxes, candidates.boxes) > options.alternative
    alike &= selected.classes[:, None] != candidates.classes[None, :]
    alternatives: list[dict[int, float]] = [{} for _ in range(len(selected))]
    for row, column in np.argwhere(alike).tolist():
        alternatives[row].setdefault(int(candidates.classes[column]), float(candidates.scores[column]))
    return alternatives


def overlaps(first: Floats, second: Floats) -> Floats:
    """Intersection over union (N, M) of boxes (N, 4) with boxes (M, 4)."""
    low = np.maximum(first[:, None, :2], second[None, :, :2])
    high = np.minimum(first[:, None, 2:], second[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    areas, others = ((boxes[:, 2:] - boxes[:, :2]).prod(axis=1) for boxes in (first, second))
    return np.asarray(shared / (areas[:, None] + others[None, :] - shared), dtype=np.float32)
