"""Points from one LiDAR revolution in the levelled body frame F, and the filter for the robot's own points.

Frame F is on the floor below the body's origin: x along the body's heading, z straight up. It differs from the body
frame by height, roll and pitch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skills.compiled import Triple, compiled
from skills.geometry import relative_pose
from skills.robot import Capabilities, FloatArray, Joints, Pose2D, Robot, Scan

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

_MOVED_M = 0.02
_MOVED_RAD = 0.02
_BODY_M = 0.3  # LiDAR returns nearer than this are the robot's own


def scan_of_points(
    points_L: FloatArray, rings: FloatArray, columns: int, stamp_s: float, X_BL: RigidTransform, X_OB: RigidTransform
) -> Scan:
    """Returns points (N, 3) in the lidar frame as a revolution; the nearest of a ray counts.

    `rings` are the elevations (rad), evenly spaced. Points nearer than 0.3 m are left out.
    """
    far_m = np.linalg.norm(points_L, axis=1)
    points_L, far_m = points_L[far_m > _BODY_M], far_m[far_m > _BODY_M]
    above_rad = np.arcsin(np.clip(points_L[:, 2] / far_m, -1.0, 1.0)) - rings[0]
    ring = np.rint(above_rad / (rings[1] - rings[0])).astype(int)
    turns = np.arctan2(points_L[:, 1], points_L[:, 0]) / (2.0 * np.pi) + 0.5
    inside = (ring >= 0) & (ring < len(rings))
    ranges: NDArray[np.float32] = np.full((len(rings), columns), np.inf, dtype=np.float32)
    ray = ring[inside], np.rint(turns[inside] * columns).astype(int) % columns
    np.minimum.at(ranges, ray, far_m[inside].astype(np.float32))
    ranges[np.isinf(ranges)] = np.nan
    azimuths_rad = np.arange(columns) / columns * 2.0 * np.pi - np.pi
    return Scan(stamp_s, ranges, rings, azimuths_rad, X_BL, X_OB)


class ArmShape:
    """The arm as line segments, from the robot's description and joint angles."""

    def __init__(self, capabilities: Capabilities) -> None:
        if capabilities.arm is None:
            raise ValueError("ArmShape: the robot has no arm")
        self._names = capabilities.arm.joint_names
        self._hand_m = 0.0 if capabilities.gripper is None else capabilities.gripper.length_m
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant

        self._plant = MultibodyPlant(0.0)
        Parser(self._plant).AddModelsFromString(capabilities.description, "urdf")
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self._body = self._plant.GetFrameByName("body")
        joints = [self._plant.GetJointByName(name) for name in self._names]
        self._numbers = [joint.position_start() for joint in joints]
        self._links = [joint.frame_on_child() for joint in joints]
        self._q = self._plant.GetPositions(self._context)

    def points_B(self, joints: Joints) -> FloatArray:
        """The arm's joints in order and the tip of the hand, (joints + 1, 3) in the body frame."""
        self._q[self._numbers] = [joints.position_rad[name] for name in self._names]
        self._plant.SetPositions(self._context, self._q)
        poses = [link.CalcPose(self._context, self._body) for link in self._links]
        return np.array([*(pose.translation() for pose in poses), poses[-1] @ np.array([self._hand_m, 0.0, 0.0])])


@dataclass(frozen=True)
class SelfFilter:
    """Removes the robot's own points. `outline_m` is (x_min, x_max, y_min, y_max) of the body."""

    outline_m: tuple[float, float, float, float]
    arm: ArmShape | None = None
    body_margin_m: float = 0.08
    arm_radius_m: float = 0.2
    held_radius_m: float = 0.36

    @staticmethod
    def of(capabilities: Capabilities) -> SelfFilter:
        """Creates the filter for a robot; without the arm when the robot has none or describes none."""
        corners = np.array(capabilities.footprint_m)
        (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
        arm = ArmShape(capabilities) if capabilities.arm and capabilities.description else None
        return SelfFilter((float(x0), float(x1), float(y0), float(y1)), arm)

    def arm_F(self, robot: Robot, scan: Scan) -> FloatArray:
        """The arm's points (N, 3) at its present angles, in a scan's levelled body frame; empty without an arm."""
        if self.arm is None:
            return np.empty((0, 3))
        rotation, translation = scan.sensor_pose
        points_L = scan.X_BL.inverse().multiply(self.arm.points_B(robot.joints()).T)
        return np.asarray((rotation @ points_L).T + translation)

    def foreign(self, points_F: FloatArray, arm_F: FloatArray, *, holding: bool = False) -> NDArray[np.bool_]:
        """Returns whether each (x, y, z) row is not part of the robot.

        All points are in one frame with the body's axes; `arm_F` are the arm's points (`ArmShape`), perhaps none. Above
        the body only the body's margin counts, so that a person right in front of the stowed arm is seen. While
        `holding`, points near the hand count as the held object.
        """
        points, arm = (np.ascontiguousarray(each, dtype=np.float64) for each in (points_F, arm_F))
        margins = (self.body_margin_m, self.arm_radius_m, self.held_radius_m if holding else 0.0)
        return _foreign(points, arm, self.outline_m, margins)


@compiled
def segment_distance(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance from points (N, 3 or more columns) to the segment start-end."""
    along, distances = end - start, np.empty(points.shape[0])
    squared = max(along[0] * along[0] + along[1] * along[1] + along[2] * along[2], 1e-12)
    for n in range(points.shape[0]):
        x, y, z = points[n, 0] - start[0], points[n, 1] - start[1], points[n, 2] - start[2]
        share = min(max((x * along[0] + y * along[1] + z * along[2]) / squared, 0.0), 1.0)
        x, y, z = x - share * along[0], y - share * along[1], z - share * along[2]
        distances[n] = math.sqrt(x * x + y * y + z * z)
    return distances


def points_in_body_axes(points_W: FloatArray, X_WB: Pose2D) -> FloatArray:
    """World points (N, 3) in the axes of a planar pose; heights stay above the floor."""
    c, s = np.cos(X_WB.yaw_rad), np.sin(X_WB.yaw_rad)
    dx, dy = points_W[:, 0] - X_WB.x_m, points_W[:, 1] - X_WB.y_m
    return np.column_stack([c * dx + s * dy, -s * dx + c * dy, points_W[:, 2]])


def scan_points(
    scan: Scan, *, azimuths: int, heights_m: tuple[float, float], max_range_m: float, most: int = 1_000_000
) -> FloatArray:
    """Points (N, 5) from a scan in frame F: x, y, height above the floor (m), ring and azimuth index in the scan.

    Uses about `azimuths` evenly spaced columns of the scan, and returns within max_range_m at heights in heights_m; of
    these at most `most`, evenly sampled.
    """
    stride, limits = max(1, len(scan.azimuths_rad) // azimuths), (*heights_m, max_range_m)
    ranges_m = np.ascontiguousarray(scan.ranges_m)
    return _select(ranges_m, scan.elevations_rad, scan.azimuths_rad, *scan.sensor_pose, limits, stride, most)


def placed_points(points_F: FloatArray, X_WF: Pose2D) -> FloatArray:
    """Converts points in the levelled body frame to world points (N, 3)."""
    c, s = math.cos(X_WF.yaw_rad), math.sin(X_WF.yaw_rad)
    x, y = points_F[:, 0], points_F[:, 1]
    return np.column_stack([X_WF.x_m + c * x - s * y, X_WF.y_m + s * x + c * y, points_F[:, 2]])


def outside_discs(points_W: FloatArray, discs_W: FloatArray) -> NDArray[np.bool_]:
    """Mask of the points (N, 2 or more columns) outside all discs, rows of x, y and radius (m)."""
    if not len(discs_W):
        return np.ones(len(points_W), dtype=np.bool_)
    offsets = np.linalg.norm(points_W[:, None, :2] - discs_W[None, :, :2], axis=2)
    outside: NDArray[np.bool_] = (offsets > discs_W[:, 2]).all(axis=1)
    return outside


def has_moved(before: Scan, scan: Scan) -> bool:
    """Returns whether the robot moved between two scans, by odometry; if so, equal scans reveal a frozen LiDAR."""
    step = relative_pose(before.pose, scan.pose)
    return math.hypot(step.x_m, step.y_m) > _MOVED_M or abs(step.yaw_rad) > _MOVED_RAD


@compiled
def _foreign(
    points: FloatArray, arm: FloatArray, outline: tuple[float, float, float, float], margins: Triple
) -> NDArray[np.bool_]:
    """Compiled loop of `SelfFilter.foreign`; `margins` are those of the body, the arm and a held object, if any."""
    x0, x1, y0, y1 = outline
    margin, arm_radius, held_radius = margins
    foreign = np.empty(points.shape[0], dtype=np.bool_)
    for n in range(points.shape[0]):
        x, y = points[n, 0], points[n, 1]
        foreign[n] = not (x0 - margin < x < x1 + margin and y0 - margin < y < y1 + margin)
    segments = arm.shape[0] - 1
    for k in range(segments):
        start, end = arm[k], arm[k + 1]
        stowed = max(start[0], end[0]) < x1 + margin and abs(start[1]) < y1 and abs(end[1]) < y1
        radius = margin if stowed else arm_radius
        if k == segments - 1 and held_radius > 0.0:
            radius = held_radius
        foreign &= segment_distance(points, start, end) >= radius
    return foreign


@compiled
def _select(
    ranges: NDArray[np.float32],
    elevations: FloatArray,
    azimuths: FloatArray,
    rotation: FloatArray,
    translation: FloatArray,
    limits: Triple,
    stride: int,
    most: int,
) -> FloatArray:
    """Compiled loop of `scan_points`."""
    points = np.empty((elevations.shape[0] * (azimuths.shape[0] // stride + 1), 5))
    count = 0
    cosines, sines = np.cos(elevations), np.sin(elevations)
    for j in range(0, azimuths.shape[0], stride):
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
                points[count, 4] = j
                count += 1
    if count <= most:
        return points[:count].copy()
    step = (count - 1) / max(1, most - 1)
    for n in range(most - 1):
        points[n] = points[int(n * step)]
    points[most - 1] = points[count - 1]
    return points[:most].copy()
