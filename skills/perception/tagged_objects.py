"""Detector that recognises objects by the tags on them, beside all that another detector finds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from skills.detection import Detection, Detector, DetectorWrapper, box_overlap
from skills.perception.class_forms import class_form
from skills.perception.detector.camera_images import detect_in_image
from skills.perception.fiducials import SeenTag, find_tags
from skills.perception.object_segmentation import Box, Window, groups_in_picture, in_plane, level_planes, window_about
from skills.robot import Image
from skills.world_model import Tag

TAG_SCORE: Final = 0.97
_LEAST_OVERLAP: Final = 0.5
_BELOW_M: Final = 0.004
"""Distance by which the surface below an object lies at least below its tag."""


def with_tags(detector: Detector, tags: Iterable[Tag]) -> Detector:
    """Returns a detector that knows the objects with these tags, too; the same one where no object has a tag."""
    carried = {tag.id: tag for tag in tags if tag.on is not None and tag.p_W is None}
    return TagDetector(detector, tuple(carried.values())) if carried else detector


class TagDetector(DetectorWrapper):
    """Detector that adds the objects with known tags to the detections of another.

    A picture without depth locates no tag.
    """

    def __init__(self, detector: Detector, tags: Sequence[Tag]) -> None:
        super().__init__(detector)
        self._sizes_m = {tag.id: tag.size_m for tag in tags}
        self._classes = {tag.id: str(tag.on) for tag in tags}

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes of the other detector, and those of the tags."""
        return tuple(dict.fromkeys((*self._detector.class_names, *self._classes.values())))

    def detect_with_depth(self, image: Image, least_score: float | None = None) -> tuple[Detection, ...]:
        """Detects the objects in an image; a tag replaces what the other detector takes its object for."""
        others, tagged = detect_in_image(self._detector, image, least_score), list[Detection]()
        for seen in find_tags(image, self._sizes_m):
            name = self._classes[seen.id]
            tagged += _unless_same([Detection(name, TAG_SCORE, box_of_carrier(image, seen, name))], tagged)
        return (*tagged, *_unless_same(others, tagged))


def _unless_same(found: Iterable[Detection], known: Sequence[Detection]) -> list[Detection]:
    """Detections that are not about the same object as one of those known."""
    return [one for one in found if all(box_overlap(one.box, other.box) < _LEAST_OVERLAP for other in known)]


def box_of_carrier(image: Image, tag: SeenTag, class_name: str) -> Box:
    """Box of the object that carries a tag: the points that hang together with it above the surface below.

    Without depth it is the box of the tag.
    """
    (u0, v0), (u1, v1) = tag.corners.min(axis=0), tag.corners.max(axis=0)
    own = (float(u0), float(v0), float(u1), float(v1))
    reach_m, X_OC = class_form(class_name).length_m[1], image.frames.pose(image.camera_frame)
    p_CT = X_OC.inverse() @ tag.X_OT.translation()
    u, v, reach_px = 0.5 * (u0 + u1), 0.5 * (v0 + v1), reach_m * image.intrinsics.fx / p_CT[2]
    window = window_about(image, (u - reach_px, v - reach_px, u + reach_px, v + reach_px))
    if window is None:
        return own
    boxes = list(_boxes(window, tag, own, reach_m))
    return min(boxes, key=lambda box: (box[2] - box[0]) * (box[3] - box[1]), default=own)


def _boxes(window: Window, tag: SeenTag, own: Box, reach_m: float) -> Iterator[Box]:
    """Yields the box of the points around a tag, above each level plane below it, or above none."""
    near = window.valid & (np.linalg.norm(window.p_O - tag.X_OT.translation(), axis=-1) < reach_m)
    lowest_m = float(tag.X_OT.translation()[2])
    u0, v0, u1, v1 = own
    on_tag = (window.u >= u0) & (window.u <= u1) & (window.v >= v0) & (window.v <= v1)
    below = (plane for plane in level_planes(replace(window, inside=on_tag)) if plane.height_m < lowest_m - _BELOW_M)
    for plane in (*below, None):
        labels, _ = groups_in_picture(window, near & ~in_plane(window, plane))
        counts = np.bincount(labels[on_tag & (labels > 0)], minlength=1)
        if counts.sum() == 0:
            continue
        mask = labels == int(np.argmax(counts))
        yield (
            min(u0, float(window.u[mask].min())),
            min(v0, float(window.v[mask].min())),
            max(u1, float(window.u[mask].max())),
            max(v1, float(window.v[mask].max())),
        )
