"""Points of one LiDAR revolution, thinned out and cut to a band of heights, in the levelled body frame.

The levelled frame F stands at the body's origin on the floor: x along the body's heading, z straight up from the
floor. It differs from the body frame by height, roll and pitch, so planar matching may leave these out.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RotationMatrix

from skills.estimate.compiled import compiled
from skills.robot import FloatArray, Pose2D, Scan


def scan_points(scan: Scan, *, azimuths: int, heights_m: tuple[float, float], max_range_m: float) -> FloatArray:
    """Returns (N, 5) of a scan in frame F: x, y, height above the floor (m), ring and azimuth index in the scan.

    About `azimuths` columns of the scan are used, evenly spaced; kept are returns nearer than max_range_m whose height
    lies in heights_m.
    """
    stride = max(1, len(scan.azimuths_rad) // azimuths)
    ranges = np.ascontiguousarray(scan.ranges_m[:, ::stride])
    angles = np.ascontiguousarray(scan.azimuths_rad[::stride])
    rotation, translation = sensor_pose(scan)
    limits = (heights_m[0], heights_m[1], max_range_m)
    return _select(ranges, scan.elevations_rad, angles, rotation, translation, limits, stride)


def placed_points(points_F: FloatArray, X_WF: Pose2D) -> FloatArray:
    """Points of the levelled body frame in the world, (N, 3)."""
    c, s = math.cos(X_WF.yaw_rad), math.sin(X_WF.yaw_rad)
    x, y = points_F[:, 0], points_F[:, 1]
    return np.column_stack([X_WF.x_m + c * x - s * y, X_WF.y_m + s * x + c * y, points_F[:, 2]])


def outside_discs(points_W: FloatArray, discs_W: FloatArray) -> NDArray[np.bool_]:
    """Which of the points (N, 2 or more columns) lie in none of the discs, rows of x, y and radius (m, same frame)."""
    offsets = np.linalg.norm(points_W[:, None, :2] - discs_W[None, :, :2], axis=2)
    outside: NDArray[np.bool_] = (offsets > discs_W[:, 2]).all(axis=1)
    return outside


def sensor_pose(scan: Scan) -> tuple[FloatArray, FloatArray]:
    """Rotation (3, 3) and position (3,) of the LiDAR in frame F."""
    yaw = Pose2D.from_transform(scan.X_OB).yaw_rad
    R_FB = RotationMatrix.MakeZRotation(-yaw) @ scan.X_OB.rotation()
    p_FL = R_FB.multiply(scan.X_BL.translation()) + np.array([0.0, 0.0, scan.X_OB.translation()[2]])
    return np.ascontiguousarray((R_FB @ scan.X_BL.rotation()).matrix()), p_FL


@compiled
def _select(
    ranges: NDArray[np.float32],
    elevations: FloatArray,
    azimuths: FloatArray,
    rotation: FloatArray,
    translation: FloatArray,
    limits: tuple[float, float, float],
    stride: int,
) -> FloatArray:
    """The loop of `scan_points`."""
    points = np.empty((ranges.size, 5))
    count = 0
    cosines, sines = np.cos(elevations), np.sin(elevations)
    for j in range(azimuths.shape[0]):
        ca, sa = math.cos(azimuths[j]), math.sin(azimuths[j])
        for i in range(elevations.shape[0]):
            r = float(ranges[i, j])
            if not r < limits[2]:
                continue
            across = r * cosines[i]
            x, y, z = across * ca, across * sa, r * sines[i]
            height = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]
            if limits[0] <= height <= limits[1]:
                points[count, 0] = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]
                points[count, 1] = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]
                points[count, 2] = height
                points[count, 3] = i
                points[count, 4] = j * stride
                count += 1
    return points[:count].copy()
