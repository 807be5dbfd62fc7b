"""Which points belong to the robot itself: its body's outline, its arm as it stands now, and what the hand holds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skills.robot import Capabilities, FloatArray, Joints, Pose2D


class ArmShape:
    """The arm as line segments, from the robot's own description and joint angles."""

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
        self._joints = [self._plant.GetJointByName(name) for name in self._names]

    def points_B(self, joints: Joints) -> FloatArray:
        """The arm's joints in order and the tip beyond the hand, (joints + 1, 3) in the body frame."""
        q = self._plant.GetPositions(self._context)
        for name, joint in zip(self._names, self._joints, strict=True):
            q[joint.position_start()] = joints.position_rad[name]
        self._plant.SetPositions(self._context, q)
        poses = [joint.frame_on_child().CalcPose(self._context, self._body) for joint in self._joints]
        tip = poses[-1] @ np.array([self._hand_m, 0.0, 0.0])
        return np.array([*(pose.translation() for pose in poses), tip])


@dataclass(frozen=True)
class SelfFilter:
    """Tells foreign points from the robot's own. `outline_m` is (x_min, x_max, y_min, y_max) of the body."""

    outline_m: tuple[float, float, float, float]
    arm: ArmShape | None = None
    body_margin_m: float = 0.08
    arm_radius_m: float = 0.2
    held_radius_m: float = 0.36

    @staticmethod
    def of(capabilities: Capabilities) -> SelfFilter:
        """The filter of a robot; its arm is left out when the robot has none or describes none."""
        corners = np.array(capabilities.footprint_m)
        (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
        arm = ArmShape(capabilities) if capabilities.arm and capabilities.description else None
        return SelfFilter((float(x0), float(x1), float(y0), float(y1)), arm)

    def foreign(self, points_F: FloatArray, arm_F: FloatArray, *, holding: bool = False) -> NDArray[np.bool_]:
        """Returns whether each (x, y, z) row is none of the robot's.

        All are given in one frame with the body's axes; `arm_F` holds the arm's points (`ArmShape`) and may be empty.
        While `holding`, what is about the hand counts as the thing in it.
        """
        x0, x1, y0, y1 = self.outline_m
        m = self.body_margin_m
        x, y = points_F[:, 0], points_F[:, 1]
        own = (x > x0 - m) & (x < x1 + m) & (y > y0 - m) & (y < y1 + m)
        segments = list(pairwise(arm_F))
        for index, (start, end) in enumerate(segments, start=1):
            radius_m = self.held_radius_m if holding and index == len(segments) else self.arm_radius_m
            own |= segment_distance(points_F[:, :3], start, end) < radius_m
        return np.asarray(~own)


def segment_distance(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance of (N, 3) points from the segment start-end."""
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[:, None] * along, axis=1))


def in_body_axes(points_W: FloatArray, X_WB: Pose2D) -> FloatArray:
    """World points (N, 3) as seen from a planar pose; heights stay above the floor."""
    c, s = np.cos(X_WB.yaw_rad), np.sin(X_WB.yaw_rad)
    dx, dy = points_W[:, 0] - X_WB.x_m, points_W[:, 1] - X_WB.y_m
    return np.column_stack([c * dx + s * dy, -s * dx + c * dy, points_W[:, 2]])
