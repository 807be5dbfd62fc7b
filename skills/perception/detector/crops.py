"""Crops of a picture about proposals, and what a network sees in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.perception.detector.proposals import (
    CROP_PX,
    ProposalOptions,
    Proposals,
    crop_map,
    mapped,
    proposals_of,
    rows_of,
)
from skills.perception.detector.scales import Scales

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

Floats = NDArray[np.float32]


def refined(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: ProposalOptions
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K) of what a network sees at the proposals among boxes (A, 4) with scores (A, K).

    Boxes are in pixels of the letterbox (480, 640, 3), of which `scales` are. Where the options ask for the mirror
    image too, the result is the mean of both.
    """
    proposals = proposals_of(boxes, scores, options)
    if not len(proposals):
        return proposals.boxes, np.zeros_like(proposals.logits)
    found, seen = _seen(session, scales, proposals, mirrored=False)
    if options.mirrored_from is None:
        return found, seen
    rows = np.flatnonzero(seen.max(axis=1) >= options.mirrored_from)
    if len(rows):
        again, others = _seen(session, scales, Proposals(proposals.boxes[rows], proposals.logits[rows]), mirrored=True)
        found[rows] = 0.5 * (found[rows] + again)
        seen[rows] = 0.5 * (seen[rows] + others)
    return found, seen


def classified(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: ProposalOptions
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K), with those that `options` choose replaced by what a network sees there."""
    rows = rows_of(boxes, scores, options)
    boxes, scores = boxes.copy(), scores.copy()
    boxes[rows], scores[rows] = refined(session, scales, boxes[rows], scores[rows], options)
    return boxes, scores


def crops_about(scales: Scales, proposals: Proposals, *, mirrored: bool = False) -> dict[str, NDArray[Any]]:
    """The inputs of such a network: crops about proposals or their mirror images, proposals in them, and logits."""
    maps = _maps(proposals, mirrored)
    return {
        "chips": np.stack([scales.cut(to_crop, (CROP_PX, CROP_PX)) for to_crop in maps]),
        "regions": mapped(proposals.boxes, maps),
        "logits": proposals.logits,
    }


def _maps(proposals: Proposals, mirrored: bool) -> Floats:
    return np.stack([crop_map(box, mirrored=mirrored) for box in proposals.boxes])


def _seen(session: InferenceSession, scales: Scales, proposals: Proposals, *, mirrored: bool) -> tuple[Floats, Floats]:
    """Boxes in the letterbox and scores of what is seen in crops about proposals, or in their mirror images."""
    found, scores = session.run(["boxes", "scores"], crops_about(scales, proposals, mirrored=mirrored))
    back = np.stack([cv2.invertAffineTransform(to_crop) for to_crop in _maps(proposals, mirrored)])
    return mapped(found, back), scores
