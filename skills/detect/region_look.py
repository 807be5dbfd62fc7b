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


def looked_again(session: InferenceSession, letterbox: Picture, regions: Regions) -> tuple[Floats, Floats]:
    """Boxes (R, 4) in pixels of the letterbox (480, 640, 3), and scores (R, K), of what the second network sees."""
    if not len(regions):
        return regions.boxes, np.zeros_like(regions.logits)
    scales = Scales(letterbox, halved(letterbox))
    maps = np.stack([chip_map(box) for box in regions.boxes])
    given = {
        "chips": np.stack([scales.cut(to_chip, (CHIP_PX, CHIP_PX)) for to_chip in maps]),
        "regions": mapped(regions.boxes, maps),
        "logits": regions.logits,
    }
    boxes, scores = session.run(["boxes", "scores"], given)
    return mapped(boxes, np.stack([cv2.invertAffineTransform(to_chip) for to_chip in maps])), scores
