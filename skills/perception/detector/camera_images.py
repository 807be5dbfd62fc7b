"""Detection in camera images, first turned upright and brightened like the detector's training pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import cv2
import numpy as np

from skills.detection import Detection, Detections, Detector
from skills.robot import Clock, Image, NoImageError, Picture, Robot

LEAST_ROLL_DEG: Final = 120.0
"""Roll from upright, either way, beyond which a picture counts as upside down."""
DETECTION_LATENCY_S: Final = 0.3
"""Time for five views of a picture and the positions of the objects, on two processor cores."""
OLDEST_PICTURE_S: Final = 0.5
"""Age from which on a picture is older than the look."""
_DARK_MEAN, _DARK_SPREAD = 6.0, 4.0
_DIM_MEAN, _BRIGHT_MEAN, _MOST_GAIN = 70.0, 100.0, 8.0
_DOWN_IS_UP = -float(np.cos(np.radians(LEAST_ROLL_DEG)))


def fresh_image(robot: Robot, clock: Clock, source: str, name: str) -> Image:
    """Takes a picture with a camera. Raises NoImageError when there is none, or only an old one."""
    asked_s, image = clock.now(), robot.image(source)
    if image.stamp_s < asked_s - OLDEST_PICTURE_S:
        raise NoImageError(f"the {name} camera gives only a picture that is {asked_s - image.stamp_s:.1f} s old")
    return image


def detect_in_image(detector: Detector, image: Image, least_score: float | None = None) -> Detections:
    """Detects the objects in an image, in several views if the detector can, with scores from `least_score` on."""
    picture = _prepared(image, image.grey if image.colour is None else image.colour)
    return detector.detect_with_depth(image, _as_taken(image, detector.detect_in_views(picture, least_score)))


def detect_class_in_grey(detector: Detector, images: Sequence[Image], class_name: str) -> list[Detections]:
    """Detects the objects of one class in each grey image."""
    found = detector.detect_class([_prepared(image, image.grey) for image in images], class_name)
    return [_as_taken(image, ones) for image, ones in zip(images, found, strict=True)]


def rotate_180(picture: Picture) -> Picture:
    """Rotates a picture (H, W) or (H, W, 3) by half a turn."""
    return np.ascontiguousarray(picture[::-1, ::-1])


def rotate_boxes_180(found: Sequence[Detection], width_px: int, height_px: int) -> Detections:
    """Rotates the boxes of detections by half a turn in a picture of width_px x height_px."""
    boxes = [
        (width_px - u1, height_px - v1, width_px - u0, height_px - v0) for u0, v0, u1, v1 in (x.box for x in found)
    ]
    return tuple(replace(one, box=box) for one, box in zip(found, boxes, strict=True))


def turn_upright(image: Image, found: Sequence[Detection]) -> tuple[Picture, Detections]:
    """Rotates an image's picture by quarter turns until its top is up, and the boxes of its detections with it."""
    picture = image.grey if image.colour is None else image.colour
    up_C = image.frames.pose(image.camera_frame).rotation().matrix()[2]
    for _ in range(round(float(np.arctan2(up_C[0], -up_C[1])) / (np.pi / 2.0)) % 4):
        width, picture = picture.shape[1], np.rot90(picture)
        boxes = [(v0, width - u1, v1, width - u0) for u0, v0, u1, v1 in (one.box for one in found)]
        found = [replace(one, box=box) for one, box in zip(found, boxes, strict=True)]
    return np.ascontiguousarray(picture), tuple(found)


def brighten(picture: Picture) -> Picture:
    """Brightens a dim picture (H, W) or (H, W, 3) by up to eight times; returns any other picture unchanged."""
    mean = float(picture.mean())
    if mean >= _DIM_MEAN:
        return picture
    gain = min(_BRIGHT_MEAN / max(mean, 1.0), _MOST_GAIN)
    return np.asarray(cv2.convertScaleAbs(picture, alpha=gain), dtype=np.uint8)


def is_dark(image: Image) -> bool:
    """Returns whether a picture is entirely black."""
    return bool(image.grey.mean() < _DARK_MEAN and image.grey.std() < _DARK_SPREAD)


def lacks_depth(image: Image) -> bool:
    """Returns whether an image that should have depth has none at all."""
    return image.depth_m.size > 0 and not bool(np.any(image.depth_m > 0.0))


def is_upside_down(image: Image) -> bool:
    """Returns whether the lower edge of the picture is up in the world."""
    R_OC = image.frames.pose(image.camera_frame).rotation().matrix()
    return bool(R_OC[2, 1] > _DOWN_IS_UP)


def _prepared(image: Image, picture: Picture) -> Picture:
    """Turns a picture upright and brightens it."""
    return brighten(rotate_180(picture) if is_upside_down(image) else picture)


def _as_taken(image: Image, found: Detections) -> Detections:
    """Converts detections of the upright picture to the picture as the camera took it."""
    if not is_upside_down(image):
        return found
    height, width = image.grey.shape
    return rotate_boxes_180(found, width, height)
