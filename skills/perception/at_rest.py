"""Whether what a camera sees about a point is at rest: depth pictures, taken a moment apart, agree."""

from __future__ import annotations

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.perception.point_cloud import camera_pose_W
from skills.robot import FloatArray, Image

APART_S: Final = (0.4, 0.25)
"""How long after the picture before the next ones are taken, at least."""
LEAST_CHANGED: Final = 24
"""So many pixels change where something moves; at rest, noise changes fewer."""
_TOLERANCE_M, _PER_M = 0.008, 0.008
_AROUND_PX, _NEAREST_M = 5, 0.1


def at_rest(first: Image, second: Image, X_WO: RigidTransform, p_W: FloatArray, within_m: float) -> bool:
    """Returns whether two pictures of a still camera show the same about a point p_W (3,) of the world."""
    return changed_pixels(first, second, X_WO, p_W, within_m) < LEAST_CHANGED


def changed_pixels(first: Image, second: Image, X_WO: RigidTransform, p_W: FloatArray, within_m: float) -> int:
    """How many depth pixels differ about a point by more than noise and than pixels beside them explain."""
    lens, (x, y, z) = second.depth_intrinsics, camera_pose_W(second, X_WO).inverse() @ p_W
    if z < _NEAREST_M or first.depth_m.shape != second.depth_m.shape:
        return 0
    half_px = within_m / z * np.array([lens.fx, lens.fy])
    middle = np.array([lens.cx + lens.fx * x / z, lens.cy + lens.fy * y / z])
    (left, top), (right, bottom) = (np.clip(middle + side * half_px, 0, None).astype(int) for side in (-1.0, 1.0))
    before, after = (image.depth_m[top:bottom, left:right] for image in (first, second))
    if before.size == 0:
        return 0
    tolerance_m = _TOLERANCE_M + _PER_M * z
    differs = _differs(before, after, tolerance_m) | _differs(after, before, tolerance_m)
    near = (np.abs(before - z) < within_m) | (np.abs(after - z) < within_m)
    seen = (before > 0.0) & (after > 0.0)
    return int(np.count_nonzero(differs & near & seen))


def _differs(depth_m: NDArray[np.float32], other_m: NDArray[np.float32], tolerance_m: float) -> NDArray[np.bool_]:
    """Where a depth is beyond all that another picture shows there and right beside, holes left out."""
    kernel = np.ones((_AROUND_PX, _AROUND_PX), np.uint8)
    least = cv2.erode(np.where(other_m > 0.0, other_m, np.float32(np.inf)), kernel)
    most = cv2.dilate(other_m, kernel)
    return np.asarray((depth_m < least - tolerance_m) | (depth_m > most + tolerance_m))
