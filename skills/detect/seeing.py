"""One picture looked through."""

from __future__ import annotations

from collections.abc import Sequence

from pydrake.math import RigidTransform

from skills.api import Detection, Detector, Surface
from skills.detect.interim_segmentation import SurfaceDetector
from skills.detect.surface_view import view_surface
from skills.robot import Image

DETECTION_LATENCY_S = 0.15
"""Detection, and where the things are."""
_DARK_MEAN, _DARK_SPREAD = 6.0, 4.0


def detections_in(
    detector: Detector, image: Image, X_WO: RigidTransform, surfaces: Sequence[Surface]
) -> tuple[Detection, ...]:
    """What the detector finds in a picture."""
    if isinstance(detector, SurfaceDetector):
        views = (view_surface(image, X_WO, surface) for surface in surfaces)
        return detector.detect_on([view for view in views if view is not None])
    return detector.detect([image.grey if image.colour is None else image.colour])[0]


def is_dark(image: Image) -> bool:
    """Whether nobody could see anything in a picture: it is black all over."""
    return bool(image.grey.mean() < _DARK_MEAN and image.grey.std() < _DARK_SPREAD)
