"""Places in a picture where something may be, as the first network's surest boxes tell, and a chip cut out about each.

All is in pixels of the letterbox. That a second network looks again at such places is after Girshick, "Fast R-CNN"
(2015); here it sees the picture anew, enlarged or made smaller to one size, and not the first one's features. That a
third one judges what the second one made of them is after Cai and Vasconcelos, "Cascade R-CNN" (2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.detect.suppression import apart

__all__ = ["CHIP_PX", "JUDGED", "RegionOptions", "Regions", "chip_map", "logits_of", "mapped", "regions_of", "rows_of"]

CHIP_PX: Final = 128
THING_PX: Final = 84.0
LEAST_SIDE_PX: Final = 20.0
_LOWEST: Final = 1e-4

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class RegionOptions:
    """Which boxes are places to look at again.

    Of the `most_candidates` surest boxes of whatever class, with at least `least_score`, those that overlap a surer
    one by no more than `same`; `most` of them. At each, the second network looks also at its mirror image where
    `mirrored` says so.
    """

    least_score: float = 0.01
    same: float = 0.6
    most: int = 12
    most_candidates: int = 250
    mirrored_from: float | None = 0.3


JUDGED: Final = RegionOptions(least_score=0.05, same=1.0, most=12, mirrored_from=None)
"""What a third network judges of what the second one sees."""


@dataclass(frozen=True)
class Regions:
    """Boxes (R, 4) of (u0, v0, u1, v1), and logits (R, K) of what the first network takes each for."""

    boxes: Floats
    logits: Floats

    def __len__(self) -> int:
        return len(self.boxes)


def regions_of(boxes: Floats, scores: Floats, options: RegionOptions) -> Regions:
    """The places that boxes (A, 4) and scores (A, K) of a network tell of, the surest first."""
    rows = rows_of(boxes, scores, options)
    return Regions(boxes[rows], logits_of(scores[rows]))


def rows_of(boxes: Floats, scores: Floats, options: RegionOptions) -> NDArray[np.int64]:
    """Which of boxes (A, 4) with scores (A, K) are places to look at again, the surest first.

    What is not finite, or has no area, is none.
    """
    best = scores.max(axis=1)
    rows = np.flatnonzero(best >= options.least_score)
    rows = rows[np.argsort(-best[rows], kind="stable")][: options.most_candidates]
    rows = rows[np.isfinite(boxes[rows]).all(axis=1) & (boxes[rows, 2:] > boxes[rows, :2]).all(axis=1)]
    return np.asarray(rows[apart(boxes[rows], options.same)[: options.most]], dtype=np.int64)


def logits_of(scores: Floats) -> Floats:
    """Logits of scores from 0 to 1, not below those of one in ten thousand."""
    sound = np.clip(scores, _LOWEST, 1.0 - _LOWEST)
    return np.asarray(np.log(sound / (1.0 - sound)), dtype=np.float32)


def chip_map(box: NDArray[np.floating], *, mirrored: bool = False) -> Floats:
    """The affine map (2, 3) of the letterbox that brings a box (4,) to its chip, in which it takes about two thirds.

    What is very small is shown smaller. A chip may be `mirrored` from left to right.
    """
    u0, v0, u1, v1 = (float(value) for value in box)
    scale = THING_PX / max(u1 - u0, v1 - v0, LEAST_SIDE_PX)
    linear = np.diag([-scale if mirrored else scale, scale])
    shift = CHIP_PX / 2 - linear @ (np.array([u0 + u1, v0 + v1]) / 2)
    return np.concatenate([linear, shift[:, None]], axis=1).astype(np.float32)


def mapped(boxes: NDArray[np.floating], affine: NDArray[np.floating]) -> Floats:
    """Boxes (N, 4) under an affine map (2, 3) or maps (N, 2, 3): those that hold their corners."""
    u0, v0, u1, v1 = np.asarray(boxes, dtype=np.float64).T
    corners = np.stack([np.stack([u0, u1, u0, u1], axis=1), np.stack([v0, v0, v1, v1], axis=1)], axis=1)
    moved = affine[..., :2] @ corners + affine[..., 2:]
    return np.concatenate([moved.min(axis=2), moved.max(axis=2)], axis=1).astype(np.float32)
