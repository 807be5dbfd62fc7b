"""One picture of surfaces, examined: detections in 3D, each object that depth shows with a label or without."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from skills.api import Detection, Detector, LocalisationEstimate
from skills.detect.selection import DetectInputs, seen_again
from skills.perception.class_evidence import FAINT_SCORE, SURE_SCORE
from skills.perception.detection_3d import Detection3D, detections_3d
from skills.perception.detector.camera_images import detect_in_image, is_upside_down, rotate_180
from skills.perception.model_matching import identified
from skills.perception.object_model import ObjectModel
from skills.perception.point_cloud import camera_pose_W
from skills.perception.surface_segmentation import labelled_clusters, segment_3d, segment_surfaces
from skills.robot import Image, Picture

_MARGIN = 0.3
"""Margin of a picture of a single object, as a fraction of its longer side."""


@dataclass(frozen=True)
class Look:
    """One picture with the robot's pose, and the detections with and without a position.

    Detections may have low scores; those with a position include objects without a label.
    """

    image: Image
    localisation: LocalisationEstimate
    detections: tuple[Detection, ...]
    detections_3d: tuple[Detection3D, ...]


def examine_image(
    image: Image,
    place: LocalisationEstimate,
    detector: Detector,
    inputs: DetectInputs,
    own: Mapping[str, ObjectModel],
    only_own: bool,
) -> Look:
    """Detections and segments of one picture: each segment on the surfaces has a label or is an `ANY_OBJECT`.

    Imported objects, `own`, are recognised by their models; with `only_own` nothing else is sought.
    """
    found = () if only_own else detect_in_image(detector, image, FAINT_SCORE)
    placed = detections_3d(image, place, found, inputs.surfaces)
    views = [view for view in segment_surfaces(image, place.X_WO, inputs.surfaces) if view is not None]
    own_sought = any(name in own for name in inputs.classes)
    labels = [each for each in placed if each.detection.score >= SURE_SCORE] if own_sought else placed
    pairs = labelled_clusters(image, place, views, labels, inputs.surfaces)
    loose = [cluster for cluster, label in pairs if label is None]
    segments = identified(loose, image, place, own) if own else tuple(segment_3d(c, image, place) for c in loose)
    if not own and inputs.seen_before is not None and not any(each.class_name in inputs.classes for each in placed):
        segments = seen_again(inputs.seen_before, segments)
    shapes, p_WC = detector.shapes, camera_pose_W(image, place.X_WO).translation()
    cluster_of = {id(label): cluster for cluster, label in pairs} | dict(zip(map(id, segments), loose, strict=True))
    shaped = tuple(
        replace(each, is_segmented=True, shape=None if shapes is None else shapes.likelihoods(cluster.features(p_WC)))
        if (cluster := cluster_of.get(id(each))) is not None
        else each
        for each in (*placed, *segments)
    )
    return Look(image, place, found, shaped)


def cut_out(image: Image, detected: Detection3D) -> Picture:
    """Part of a picture that shows a detected object, upright, with a margin."""
    picture = image.grey if image.colour is None else image.colour
    u0, v0, u1, v1 = detected.detection.box
    margin_px = _MARGIN * max(u1 - u0, v1 - v0)
    left, top = (max(0, int(low - margin_px)) for low in (u0, v0))
    part = picture[top : int(v1 + margin_px), left : int(u1 + margin_px)]
    return rotate_180(part) if is_upside_down(image) else np.ascontiguousarray(part)
