"""Which detection of a picture finds which label, at several overlaps at once.

After COCO's evaluation (Lin et al., "Microsoft COCO: Common Objects in Context", ECCV 2014, and its tool pycocotools):
the surest detection chooses first, labels that count before those to be passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Matches", "box_areas", "match", "overlaps"]

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Matches:
    """How D detections of one class in one picture fit its G labels, at T overlaps; the surest detection first.

    `found` (T, D) tells which detections are on a label, `passed` (T, D) which count neither for nor against;
    `label_found` (T, G) is which detection found each label, -1 for none. `counting` is how many labels count.
    """

    scores: Floats
    found: Flags
    passed: Flags
    label_found: NDArray[np.int64]
    counting: int


def box_areas(boxes: Floats) -> Floats:
    """Areas (N,) of boxes (N, 4); nothing for boxes turned inside out."""
    return np.asarray(np.prod(np.clip(boxes[:, 2:] - boxes[:, :2], 0.0, None), axis=1))


def overlaps(boxes: Floats, labels: Floats, crowd: Flags) -> Floats:
    """Shared area / area of both together (D, G); for crowd regions (G,) shared area / area of the detection."""
    corners = np.maximum(boxes[:, None, :2], labels[None, :, :2]), np.minimum(boxes[:, None, 2:], labels[None, :, 2:])
    shared = np.prod(np.clip(corners[1] - corners[0], 0.0, None), axis=2)
    own, theirs = box_areas(boxes)[:, None], box_areas(labels)[None, :]
    whole = np.where(crowd[None, :], own, own + theirs - shared)
    return np.asarray(np.divide(shared, whole, out=np.zeros_like(shared), where=whole > 0.0))


def match(
    boxes: Floats, scores: Floats, labels: Floats, *, crowd: Flags, passed: Flags, small: Flags, at: Sequence[float]
) -> Matches:
    """Match detections (D, 4) with labels (G, 4) at the overlaps `at` (T,).

    Labels of crowds and those `passed` (G,) over take detections away without a point for or against. Detections that
    are `small` (D,) are passed over when they are on nothing.
    """
    order = np.argsort(-scores, kind="stable")
    shared = overlaps(boxes[order], labels, crowd)
    floors = np.minimum(np.asarray(at), 1.0 - 1e-10)
    skipped = crowd | passed
    taken_by = np.full((len(floors), len(labels)), -1, dtype=np.int64)
    chosen = np.full((len(floors), len(order)), -1, dtype=np.int64)
    for k in range(len(order) if len(labels) else 0):
        free = (taken_by < 0) | crowd[None, :]
        fits = free & (shared[k][None, :] >= floors[:, None])
        best = _best(fits & ~skipped, shared[k])
        best = np.where(best >= 0, best, _best(fits & skipped, shared[k]))
        chosen[:, k] = best
        rows = np.flatnonzero(best >= 0)
        taken_by[rows, best[rows]] = order[k]
    found = chosen >= 0
    over = np.where(found, skipped[chosen], small[order][None, :]) if len(labels) else _rows(small[order], len(floors))
    return Matches(scores[order], found, over, taken_by, int(np.count_nonzero(~skipped)))


def _best(fits: Flags, shared: Floats) -> NDArray[np.int64]:
    """For each row of fits (T, G) the label that is shared most, the last of equals; -1 where none fits."""
    values = np.where(fits, shared[None, :], -1.0)[:, ::-1]
    best = values.shape[1] - 1 - np.argmax(values, axis=1)
    return np.where(fits.any(axis=1), best, -1)


def _rows(flags: Flags, count: int) -> Flags:
    return np.repeat(flags[None, :], count, axis=0)
