"""Average precision over ranked detections, as COCO reckons it, and precision and recall at one score.

Source: Lin et al., "Microsoft COCO: Common Objects in Context", ECCV 2014, and its tool pycocotools: precision is
read at 101 recalls from its envelope, and averaged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.detect.scoring_matching import Matches

__all__ = ["Counts", "average_precision", "counts_at"]

RECALLS: Final = np.linspace(0.0, 1.0, 101)
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Counts:
    """Right and wrong detections from some score on, and how many labels there are to find."""

    right: int
    wrong: int
    labels: int

    @property
    def precision(self) -> float | None:
        """Share of detections that are right; None where there are none."""
        return self.right / (self.right + self.wrong) if self.right + self.wrong else None

    @property
    def recall(self) -> float | None:
        """Share of labels that are found; None where there are none."""
        return self.right / self.labels if self.labels else None

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.right + other.right, self.wrong + other.wrong, self.labels + other.labels)


def average_precision(matches: Sequence[Matches]) -> Floats | None:
    """Average precision at each of the T overlaps, over all pictures of a class; None where no label counts."""
    counting = sum(one.counting for one in matches)
    if not counting:
        return None
    scores = np.concatenate([one.scores for one in matches])
    order = np.argsort(-scores, kind="stable")
    found = np.concatenate([one.found for one in matches], axis=1)[:, order]
    judged = ~np.concatenate([one.passed for one in matches], axis=1)[:, order]
    return np.array(
        [_area(np.cumsum(hit & own), np.cumsum(~hit & own), counting) for hit, own in _pairs(found, judged)]
    )


def _pairs(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    return list(zip(first, second, strict=True))


def _area(right: NDArray[np.int64], wrong: NDArray[np.int64], counting: int) -> float:
    """Mean of the envelope of precision at 101 recalls; right and wrong are running counts (D,)."""
    if not len(right):
        return 0.0
    precision = right / (right + wrong + np.spacing(1.0))
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    places = np.searchsorted(right / counting, RECALLS, side="left")
    reached = places < len(right)
    return float(np.sum(envelope[places[reached]]) / len(RECALLS))


def counts_at(matches: Sequence[Matches], least_score: float, overlap: int = 0) -> Counts:
    """Right, wrong and labels with the detections from least_score on, at the overlap of that index."""
    sure = [one.scores >= least_score for one in matches]
    right = sum(int(np.sum(m.found[overlap] & ~m.passed[overlap] & s)) for m, s in zip(matches, sure, strict=True))
    wrong = sum(int(np.sum(~m.found[overlap] & ~m.passed[overlap] & s)) for m, s in zip(matches, sure, strict=True))
    return Counts(right, wrong, sum(m.counting for m in matches))
