"""Where a head turns to look at a point, and pictures without the robot's own arm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from skills.api import PlanningError
from skills.estimate.scan_points import segment_distance
from skills.robot import CameraCapabilities, FloatArray, HeadCapabilities, Image

_TURNS, _OFF_AXIS_RAD, _NEAREST_M = 6, 0.2, 0.25
_ARM_WITHIN_M, _ARM_RADIUS_M = 1.6, 0.1


def head_angles(head: HeadCapabilities, camera: CameraCapabilities, p_BT: FloatArray) -> tuple[float, float]:
    """Pan and tilt (rad) with which the head's camera looks at p_BT (3,), about so at the ends of their ranges.

    Raises PlanningError where the head does not turn as far, or the point is at the head itself.
    """
    pan_rad = math.atan2(p_BT[1] - head.p_BP_m[1], p_BT[0] - head.p_BP_m[0])
    tilt_rad = 0.0
    for _ in range(_TURNS):
        pan_rad, tilt_rad = (_within(pan_rad, head.pan_range_rad), _within(tilt_rad, head.tilt_range_rad))
        x, y, z = (head.X_BF(pan_rad, tilt_rad) @ camera.X_FC).inverse() @ p_BT
        off_rad = math.atan2(math.hypot(x, y), z)
        pan_rad, tilt_rad = pan_rad - math.atan2(x, max(z, _NEAREST_M)), tilt_rad + math.atan2(y, max(z, _NEAREST_M))
    if off_rad > _OFF_AXIS_RAD or math.hypot(x, y, z) < _NEAREST_M:
        raise PlanningError(f"the head does not turn to the point {np.round(p_BT, 2).tolist()} of the body")
    return _within(pan_rad, head.pan_range_rad), _within(tilt_rad, head.tilt_range_rad)


def _within(angle_rad: float, range_rad: tuple[float, float]) -> float:
    return min(max(angle_rad, range_rad[0]), range_rad[1])


def without_arm(image: Image, arm_B: Sequence[FloatArray], held_radius_m: float | None = None) -> Image:
    """The picture without depth where it shows the robot's own arm, a line of points (3,) in the body frame.

    About the last part of the line, where something is held, another radius counts.
    """
    lens, depth = image.depth_intrinsics, image.depth_m
    v, u = np.nonzero((depth > 0.0) & (depth < _ARM_WITHIN_M))
    z = depth[v, u].astype(np.float64)
    points_C = np.column_stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z])
    X_BC = image.frames.pose(image.camera_frame, "body")
    points_B = points_C @ X_BC.rotation().matrix().T + X_BC.translation()
    segments = list(pairwise(arm_B))
    radii_m = [_ARM_RADIUS_M] * (len(segments) - 1) + [held_radius_m or _ARM_RADIUS_M]
    own = np.zeros(len(points_B), dtype=bool)
    for (start, end), radius_m in zip(segments, radii_m, strict=True):
        own |= segment_distance(points_B, start, end) < radius_m
    kept = depth.copy()
    kept[v[own], u[own]] = 0.0
    return replace(image, depth_m=kept)
