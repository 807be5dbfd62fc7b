"""One picture looked through."""

from __future__ import annotations

from skills.api import Detection, Detector
from skills.detect.careful_detector import LooksCarefully
from skills.robot import Image

DETECTION_LATENCY_S = 0.15
"""Detection, and where the things are."""
_DARK_MEAN, _DARK_SPREAD = 6.0, 4.0


def detections_in(detector: Detector, image: Image) -> tuple[Detection, ...]:
    """What the detector finds in a picture, looking carefully if it can."""
    picture = image.grey if image.colour is None else image.colour
    return detector.detect_carefully(picture) if isinstance(detector, LooksCarefully) else detector.detect([picture])[0]


def is_dark(image: Image) -> bool:
    """Whether nobody could see anything in a picture: it is black all over."""
    return bool(image.grey.mean() < _DARK_MEAN and image.grey.std() < _DARK_SPREAD)
