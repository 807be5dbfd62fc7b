"""Camera images in the form in which a detector was trained: upright and bright enough.

Spot's right camera hangs upside down; its pictures are turned first. What is dim is made brighter, as a camera's
automatic exposure would.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import cv2
import numpy as np

from skills.api import Detection, Detector
from skills.perception.detector.augmentation import DetectsClass, DetectsInViews
from skills.robot import Image, Picture

LEAST_ROLL_DEG: Final = 120.0
"""A picture that is turned by more than this from upright, either way, stands on its head."""


def turned(picture: Picture) -> Picture:
    """A picture (H, W) or (H, W, 3) turned by half a turn."""
    return np.ascontiguousarray(picture[::-1, ::-1])


def turned_back(found: Sequence[Detection], width_px: int, height_px: int) -> tuple[Detection, ...]:
    """What was found in a turned picture of a size, with boxes in the picture as it was taken."""

    def back(one: Detection) -> Detection:
        u0, v0, u1, v1 = one.box
        return replace(one, box=(width_px - u1, height_px - v1, width_px - u0, height_px - v0))

    return tuple(back(one) for one in found)


DETECTION_LATENCY_S: Final = 0.3
"""Up to five views of a picture, and where the objects are, on two processor cores."""
_DARK_MEAN, _DARK_SPREAD = 6.0, 4.0
_DIM_MEAN, _BRIGHT_MEAN, _MOST_GAIN = 70.0, 100.0, 8.0
_DOWN_IS_UP = -float(np.cos(np.radians(LEAST_ROLL_DEG)))

Found = tuple[Detection, ...]


def detections_in(detector: Detector, image: Image, least_score: float | None = None) -> Found:
    """What the detector finds in an image, in several views if it can; then from `least_score` on, where given."""
    picture = _prepared(image, image.grey if image.colour is None else image.colour)
    if isinstance(detector, DetectsInViews):
        return _turned_back(image, detector.detect_in_views(picture, least_score))
    return _turned_back(image, detector.detect([picture])[0])


def found_in_grey(detector: Detector, images: Sequence[Image], class_name: str) -> list[Found]:
    """The objects of one class in each grey image; by a quick look, if the detector has one."""
    pictures = [_prepared(image, image.grey) for image in images]
    if isinstance(detector, DetectsClass):
        found = detector.detect_class(pictures, class_name)
    else:
        found = [tuple(one for one in ones if one.class_name == class_name) for ones in detector.detect(pictures)]
    return [_turned_back(image, ones) for image, ones in zip(images, found, strict=True)]


def is_dark(image: Image) -> bool:
    """Returns whether nobody could see anything in a picture: it is black all over."""
    return bool(image.grey.mean() < _DARK_MEAN and image.grey.std() < _DARK_SPREAD)


def without_depth(image: Image) -> bool:
    """Returns whether an image for which depth was asked has none anywhere."""
    return image.depth_m.size > 0 and not bool(np.any(image.depth_m > 0.0))


def on_its_head(image: Image) -> bool:
    """Returns whether what is below in the picture is above in the world."""
    R_OC = image.frames.pose(image.camera_frame).rotation().matrix()
    return bool(R_OC[2, 1] > _DOWN_IS_UP)


def brightened(picture: Picture) -> Picture:
    """A picture (H, W) or (H, W, 3) whose mean is low, up to eight times as bright; any other as it is."""
    mean = float(picture.mean())
    if mean >= _DIM_MEAN:
        return picture
    gain = min(_BRIGHT_MEAN / max(mean, 1.0), _MOST_GAIN)
    return np.asarray(cv2.convertScaleAbs(picture, alpha=gain), dtype=np.uint8)


def _prepared(image: Image, picture: Picture) -> Picture:
    """The picture upright and bright enough."""
    return brightened(turned(picture) if on_its_head(image) else picture)


def _turned_back(image: Image, found: Found) -> Found:
    """Detections of an upright picture with their boxes in the picture as it was taken."""
    if not on_its_head(image):
        return found
    height, width = image.grey.shape
    return turned_back(found, width, height)
