"""A second look at places that the first network found: what is there, and where exactly."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from onnxruntime import InferenceSession

from skills.detect.regions import CHIP_PX, Regions, chip_map, mapped
from skills.detect.scales import Scales, halved

__all__ = ["chips_about", "looked_again"]

Picture = NDArray[np.uint8]
Floats = NDArray[np.float32]


def looked_again(
    session: InferenceSession, letterbox: Picture, regions: Regions, *, mirrored_from: float | None
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) in pixels of the letterbox (480, 640, 3), and scores (R, K), of what the second network sees.

    Where that is something with at least the score `mirrored_from`, the means of what it sees in the chip and in its
    mirror image; nowhere for None.
    """
    if not len(regions):
        return regions.boxes, np.zeros_like(regions.logits)
    scales = Scales(letterbox, halved(letterbox))
    found, scores = _seen(session, scales, regions, mirrored=False)
    rows = np.flatnonzero(scores.max(axis=1) >= mirrored_from) if mirrored_from is not None else np.empty(0, np.int64)
    if len(rows):
        boxes, others = _seen(session, scales, Regions(regions.boxes[rows], regions.logits[rows]), mirrored=True)
        found[rows] = 0.5 * (found[rows] + boxes)
        scores[rows] = 0.5 * (scores[rows] + others)
    return found, scores


def chips_about(scales: Scales, regions: Regions, *, mirrored: bool = False) -> dict[str, NDArray[Any]]:
    """What the second network is given: chips about regions or their mirror images, regions in them, and logits."""
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
