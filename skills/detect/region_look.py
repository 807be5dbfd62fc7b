"""Another look at places that a network found: what is there, and where exactly."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from onnxruntime import InferenceSession

from skills.detect.regions import CHIP_PX, RegionOptions, Regions, chip_map, mapped, regions_of, rows_of
from skills.detect.scales import Scales

__all__ = ["chips_about", "judged", "looked_again"]

Floats = NDArray[np.float32]


def looked_again(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: RegionOptions
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K) of what a network sees at the places that boxes (A, 4) and scores (A, K) tell of.

    Boxes are in pixels of the letterbox (480, 640, 3), of which `scales` are. Where it looks at the mirror image too,
    the means of what it sees in both.
    """
    regions = regions_of(boxes, scores, options)
    if not len(regions):
        return regions.boxes, np.zeros_like(regions.logits)
    found, seen = _seen(session, scales, regions, mirrored=False)
    if options.mirrored_from is None:
        return found, seen
    rows = np.flatnonzero(seen.max(axis=1) >= options.mirrored_from)
    if len(rows):
        again, others = _seen(session, scales, Regions(regions.boxes[rows], regions.logits[rows]), mirrored=True)
        found[rows] = 0.5 * (found[rows] + again)
        seen[rows] = 0.5 * (seen[rows] + others)
    return found, seen


def judged(
    session: InferenceSession, scales: Scales, boxes: Floats, scores: Floats, options: RegionOptions
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) and scores (R, K), with those of the places that `options` choose as a network sees them."""
    rows = rows_of(boxes, scores, options)
    boxes, scores = boxes.copy(), scores.copy()
    boxes[rows], scores[rows] = looked_again(session, scales, boxes[rows], scores[rows], options)
    return boxes, scores


def chips_about(scales: Scales, regions: Regions, *, mirrored: bool = False) -> dict[str, NDArray[Any]]:
    """What such a network is given: chips about regions or their mirror images, regions in them, and logits."""
    maps = _maps(regions, mirrored)
    return {
        "chips": np.stack([scales.cut(to_chip, (CHIP_PX, CHIP_PX)) for to_chip in maps]),
        "regions": mapped(regions.boxes, maps),
        "logits": regions.logits,
    }


def _maps(regions: Regions, mirrored: bool) -> Floats:
    return np.stack([chip_map(box, mirrored=mirrored) for box in regions.boxes])


def _seen(session: InferenceSession, scales: Scales, regions: Regions, *, mirrored: bool) -> tuple[Floats, Floats]:
    """Boxes in the letterbox and scores of what is seen in chips about regions, or in their mirror images."""
    found, scores = session.run(["boxes", "scores"], chips_about(scales, regions, mirrored=mirrored))
    back = np.stack([cv2.invertAffineTransform(to_chip) for to_chip in _maps(regions, mirrored)])
    return mapped(found, back), scores
