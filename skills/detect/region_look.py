"""A second look at places that the first network found: what is there, and where exactly."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from onnxruntime import InferenceSession

from skills.detect.regions import CHIP_PX, Regions, chip_map, mapped
from skills.detect.scales import Scales, halved

__all__ = ["looked_again"]

Picture = NDArray[np.uint8]
Floats = NDArray[np.float32]


def looked_again(
    session: InferenceSession, letterbox: Picture, regions: Regions, *, mirrored: bool
) -> tuple[Floats, Floats]:
    """Boxes (R, 4) in pixels of the letterbox (480, 640, 3), and scores (R, K), of what the second network sees.

    With `mirrored`, the means of what it sees in each chip and in its mirror image.
    """
    if not len(regions):
        return regions.boxes, np.zeros_like(regions.logits)
    ways = (False, True) if mirrored else (False,)
    scales, boxes = Scales(letterbox, halved(letterbox)), np.tile(regions.boxes, (len(ways), 1))
    maps = np.stack([chip_map(box, mirrored=way) for way in ways for box in regions.boxes])
    given = {
        "chips": np.stack([scales.cut(to_chip, (CHIP_PX, CHIP_PX)) for to_chip in maps]),
        "regions": mapped(boxes, maps),
        "logits": np.tile(regions.logits, (len(ways), 1)),
    }
    found, scores = session.run(["boxes", "scores"], given)
    found = mapped(found, np.stack([cv2.invertAffineTransform(to_chip) for to_chip in maps]))
    return _mean(found, len(ways)), _mean(scores, len(ways))


def _mean(rows: Floats, ways: int) -> Floats:
    """The mean (R, M) over the ways in which each region was looked at, of rows (ways R, M)."""
    return np.asarray(rows.reshape(ways, -1, rows.shape[1]).mean(axis=0), dtype=np.float32)
