"""One picture of surfaces, examined: detections in 3D, each object that depth shows with a label or without."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from skills.api import Detection, Detector, LocalisationEstimate
from skills.detect.selection import DetectInputs, seen_again
from skills.perception.class_evidence import FAINT_SCORE, SURE_SCORE
from skills.perception.detection_3d import Detection3D, detections_3d
from skills.perception.detector.camera_images import detect_in_image, is_upside_down, rotate_180
from skills.perception.model_matching import identified, segment_picture
from skills.perception.object_model import ObjectModel
from skills.perception.point_cloud import camera_pose_W
from skills.perception.surface_segmentation import (
    Cluster,
    is_cut_off,
    labelled_clusters,
    segment_3d,
    segment_surfaces,
)
from skills.robot import Image, Picture

_MARGIN = 0.3
"""Margin of a picture of a single object, as a fraction of its longer side."""
_OTHER_SIDE_M = 0.1
"""Distance between two camera positions from which on they show an object differently."""
_MOST_VIEWS, _LONGEST_PX, _AROUND_PX = 6, 128, 2
"""Number of views of an unknown object, their longer side, and their transparent border."""


@dataclass(frozen=True)
class Look:
    """One picture with the robot's pose, and the detections with and without a position.

    Detections may have low scores; those with a position include objects without a label. `clusters` are the points of
    each of them, None where depth shows no cluster of its own.
    """

    image: Image
    localisation: LocalisationEstimate
    detections: tuple[Detection, ...]
    detections_3d: tuple[Detection3D, ...]
    clusters: tuple[Cluster | None, ...]


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
    sure = tuple(each for each in placed if each.detection.score >= SURE_SCORE)
    again = None if any(each.class_name in inputs.classes for each in sure) else inputs.seen_before
    labels = placed if again is None and not any(name in own for name in inputs.classes) else sure
    pairs = labelled_clusters(image, place, views, labels, inputs.surfaces)
    loose = [cluster for cluster, label in pairs if label is None]
    segments = identified(loose, image, place, own) if own else tuple(segment_3d(c, image, place) for c in loose)
    if not own and again is not None:
        segments = seen_again(again, segments)
    shapes, p_WC = detector.shapes, camera_pose_W(image, place.X_WO).translation()
    cluster_of = {id(label): cluster for cluster, label in pairs} | dict(zip(map(id, segments), loose, strict=True))
    every = (*placed, *segments)
    clusters = tuple(cluster_of.get(id(each)) for each in every)
    shaped = tuple(
        replace(each, is_segmented=True, shape=None if shapes is None else shapes.likelihoods(cluster.features(p_WC)))
        if cluster is not None
        else each
        for each, cluster in zip(every, clusters, strict=True)
    )
    return Look(image, place, found, shaped, clusters)


@dataclass
class UnknownObject:
    """Pictures of an object that nothing recognises.

    `picture` is the last one, with a margin. `views` are upright, transparent around the object, and from different
    camera positions, each with its detection.
    """

    picture: Picture = field(default_factory=lambda: np.zeros((1, 1, 3), np.uint8))
    views: list[tuple[Picture, Detection3D]] = field(default_factory=list)

    def add(self, look: Look, detected: Detection3D) -> None:
        """Takes a picture, and a view if it shows the whole object from another side; keeps the largest views."""
        self.picture = cut_out(look.image, detected)
        known = any(np.linalg.norm(detected.eye_W - one.eye_W) < _OTHER_SIDE_M for _, one in self.views)
        cluster = next(c for c, one in zip(look.clusters, look.detections_3d, strict=True) if one is detected)
        if known or cluster is None or is_cut_off(cluster, look.image):
            return
        view = segment_picture(cluster, look.image, camera_pose_W(look.image, look.localisation.X_WO))
        self.views.append((rotate_180(view) if is_upside_down(look.image) else view, detected))
        self.views = sorted(self.views, key=lambda each: -max(each[0].shape))[:_MOST_VIEWS]

    def facts(self) -> dict[str, Any]:
        """Views as PNG files in base64, and the median position and size, for the log; empty without views."""
        if not self.views:
            return {}
        values = {key: [getattr(one, key) for _, one in self.views] for key in ("position_W", "size_m")}
        medians = {key: np.round(np.median(each, axis=0), 4).tolist() for key, each in values.items()}
        return {"views": [base64.b64encode(_png(view)).decode() for view, _ in self.views], **medians}


def _png(view: Picture) -> bytes:
    """Encodes a view (H, W, 4) as PNG, with a transparent border."""
    scale = min(1.0, _LONGEST_PX / max(view.shape[:2]))
    width, height = (max(1, round(scale * side)) for side in view.shape[1::-1])
    small = cv2.resize(view, (width, height), interpolation=cv2.INTER_AREA)
    small[small[..., 3] < 128] = 0
    framed = cv2.copyMakeBorder(small, *4 * (_AROUND_PX,), cv2.BORDER_CONSTANT)
    return cv2.imencode(".png", cv2.cvtColor(framed, cv2.COLOR_RGBA2BGRA))[1].tobytes()


def cut_out(image: Image, detected: Detection3D) -> Picture:
    """Part of a picture that shows a detected object, upright, with a margin."""
    picture = image.grey if image.colour is None else image.colour
    u0, v0, u1, v1 = detected.detection.box
    margin_px = _MARGIN * max(u1 - u0, v1 - v0)
    left, top = (max(0, int(low - margin_px)) for low in (u0, v0))
    part = picture[top : int(v1 + margin_px), left : int(u1 + margin_px)]
    return rotate_180(part) if is_upside_down(image) else np.ascontiguousarray(part)
