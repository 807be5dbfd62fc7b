"""Proposals: boxes of a picture in which a network expects something, and the crop about each.

All is in pixels of the letterbox. A refinement network sees the picture anew at each proposal, enlarged or made smaller
to one size (after Girshick, "Fast R-CNN", 2015, but without shared features); a classifier network judges what that
one made of it (after Cai and Vasconcelos, "Cascade R-CNN", 2018).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.perception.detector.suppression import apart

CROP_PX: Final = 128
OBJECT_PX: Final = 84.0
LEAST_SIDE_PX: Final = 20.0
_LOWEST: Final = 1e-4

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class ProposalOptions:
    """Which boxes are proposals.

    Of the `most_candidates` surest boxes of whatever class, with at least `least_score`, those that overlap a surer
    one by no more than `same`; `most` of them. Where the network behind gives at least the score `mirrored_from`, it
    sees the mirror image too.
    """

    least_score: float = 0.01
    same: float = 0.6
    most: int = 12
    most_candidates: int = 250
    mirrored_from: float | None = 0.3


CLASSIFIED: Final = ProposalOptions(least_score=0.05, same=1.0, most=12, mirrored_from=None)
"""What the classifier network judges of what the refinement network sees."""


@dataclass(frozen=True)
class Proposals:
    """Boxes (R, 4) of (u0, v0, u1, v1), and logits (R, K) of the classes that a network gives each."""

    boxes: Floats
    logits: Floats

    def __len__(self) -> int:
        return len(self.boxes)


def proposals_of(boxes: Floats, scores: Floats, options: ProposalOptions) -> Proposals:
    """The proposals among boxes (A, 4) with scores (A, K) of a network, the surest first."""
    rows = rows_of(boxes, scores, options)
    return Proposals(boxes[rows], logits_of(scores[rows]))


def rows_of(boxes: Floats, scores: Floats, options: ProposalOptions) -> NDArray[np.int64]:
    """Which of boxes (A, 4) with scores (A, K) are proposals, the surest first.

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


def crop_map(box: NDArray[np.floating], *, mirrored: bool = False) -> Floats:
    """The affine map (2, 3) of the letterbox that brings a box (4,) to its crop, in which it takes about two thirds.

    What is very small is shown smaller. A crop may be `mirrored` from left to right.
    """
    u0, v0, u1, v1 = (float(value) for value in box)
    scale = OBJECT_PX / max(u1 - u0, v1 - v0, LEAST_SIDE_PX)
    linear = np.diag([-scale if mirrored else scale, scale])
    shift = CROP_PX / 2 - linear @ (np.array([u0 + u1, v0 + v1]) / 2)
    return np.concatenate([linear, shift[:, None]], axis=1).astype(np.float32)


def mapped(boxes: NDArray[np.floating], affine: NDArray[np.floating]) -> Floats:
    """Boxes (N, 4) under an affine map (2, 3) or maps (N, 2, 3): those that hold their corners."""
    u0, v0, u1, v1 = np.asarray(boxes, dtype=np.float64).T
    corners = np.stack([np.stack([u0, u1, u0, u1], axis=1), np.stack([v0, v0, v1, v1], axis=1)], axis=1)
    moved = affine[..., :2] @ corners + affine[..., 2:]
    return np.concatenate([moved.min(axis=2), moved.max(axis=2)], axis=1).astype(np.float32)
