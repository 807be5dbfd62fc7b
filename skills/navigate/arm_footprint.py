"""The footprint of a robot with its arm and the held object, projected onto the floor."""

import math
from itertools import pairwise

import numpy as np
from pydrake.math import RigidTransform

from skills.api import SkillContext
from skills.footprint import Footprint
from skills.manipulation.arm.kinematics import ArmModel, arm_model
from skills.robot import FloatArray

LINK_RADIUS_M = 0.06
_APART_M = 0.06
"""Distance between the discs along a link."""
_TOLERANCE_M = 0.02
"""Largest overhang of discs that still count as part of the body."""
_CHANGED_M = 0.05
"""Growth from which on a path must be planned again."""


class ArmFootprint:
    """The body's footprint, extended by discs where the arm or the held object overhangs it.

    The stowed arm counts as part of the body. Heights are ignored, so an arm above an obstacle counts as in collision.
    At the robot's present pose, discs shrink so that none overlaps an obstacle in the costmap.
    """

    def __init__(self, context: SkillContext) -> None:
        capabilities = context.robot.capabilities()
        self._context, self._body = context, Footprint.of(capabilities)
        has_arm = capabilities.arm is not None and capabilities.description
        self._model = arm_model(capabilities) if has_arm else None
        self._gripper = capabilities.gripper
        self._box = np.array([np.min(capabilities.footprint_m, axis=0), np.max(capabilities.footprint_m, axis=0)])
        if self._model is not None:
            stowed = _link_discs(self._model, self._model.stowed_rad, self._tip_m)
            self._box[0] = np.minimum(self._box[0], np.min(stowed[:, :2] - stowed[:, 2:], axis=0))
            self._box[1] = np.maximum(self._box[1], np.max(stowed[:, :2] + stowed[:, 2:], axis=0))

    @property
    def _tip_m(self) -> float:
        """Distance (m) from the hand's origin to its last disc, along the fingers."""
        return 0.0 if self._gripper is None else max(0.0, self._gripper.tip_x_m - LINK_RADIUS_M)

    def now(self) -> Footprint:
        """The footprint at the arm's present joint angles."""
        if self._model is None or (q_rad := self._q_rad(self._model)) is None:
            return self._body
        arm = self._outside(_link_discs(self._model, q_rad, self._tip_m))
        held = self._outside(self._held_discs(self._model, q_rad))
        discs = self._clipped(np.vstack([arm, held]))
        if len(discs) == 0:
            return self._body
        return self._body.with_discs(discs, "the object that it carries" if len(held) else "its arm")

    def outgrows(self, planned: Footprint) -> bool:
        """Returns whether the robot now reaches noticeably beyond the footprint for which a path was planned."""
        now = self.now()
        if now is self._body:
            return False
        new, old = now.discs[len(self._body.discs) :], planned.discs
        apart = np.linalg.norm(new[:, None, :2] - old[None, :, :2], axis=2) + new[:, None, 2] - old[None, :, 2]
        return bool(np.any(np.min(apart, axis=1) > _CHANGED_M))

    def _held_discs(self, model: ArmModel, q_rad: FloatArray) -> FloatArray:
        """Discs under the held object; an object of unknown size counts as the largest that the gripper can hold."""
        if self._gripper is None or not self._context.robot.gripper().holding:
            return np.empty((0, 3))
        X_BH, corners_H = model.X_BH(q_rad), self._context.payload.corners_H
        if corners_H is not None:
            return _box_discs(X_BH, corners_H)
        middle = X_BH @ np.array([self._gripper.grip_x_m, 0.0, 0.0])
        return np.array([[middle[0], middle[1], self._gripper.length_m - self._gripper.grip_x_m]])

    def _q_rad(self, model: ArmModel) -> FloatArray | None:
        """The arm's joint angles; None while they are unknown."""
        positions = self._context.robot.joints().position_rad
        q_rad = np.array([positions[name] for name in model.names])
        return q_rad if np.all(np.isfinite(q_rad)) else None

    def _outside(self, discs: FloatArray) -> FloatArray:
        """The discs that overhang the body with its stowed arm."""
        low, high = discs[:, :2] - discs[:, 2:], discs[:, :2] + discs[:, 2:]
        out = np.any((low < self._box[0] - _TOLERANCE_M) | (high > self._box[1] + _TOLERANCE_M), axis=1)
        return np.asarray(discs[out])

    def _clipped(self, discs: FloatArray) -> FloatArray:
        """The discs, shrunk to the costmap's clearance at the robot's pose."""
        if len(discs) == 0:
            return discs
        pose = self._context.pose()
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        centres_W = discs[:, :2] @ np.array([[c, s], [-s, c]]) + (pose.x_m, pose.y_m)
        radii = np.minimum(discs[:, 2], self._context.costmap.clearance_m(centres_W) - 0.01)
        return np.column_stack([discs[:, :2], radii])[radii > 0.01]


def _link_discs(model: ArmModel, q_rad: FloatArray, tip_m: float) -> FloatArray:
    """Discs along the arm from the shoulder to the fingers."""
    points = np.vstack([model.points_B(q_rad), model.X_BH(q_rad) @ np.array([tip_m, 0.0, 0.0])])
    lines = [(a[:2], b[:2], 2 + int(np.linalg.norm(b[:2] - a[:2]) / _APART_M)) for a, b in pairwise(points)]
    centres = np.vstack([np.linspace(start, end, count) for start, end, count in lines])
    return np.column_stack([centres, np.full(len(centres), LINK_RADIUS_M)])


def _box_discs(X_BH: RigidTransform, corners_H: FloatArray) -> FloatArray:
    """Discs over the bounding box of corner points, which is cut into nearly cubic parts."""
    low, high = corners_H.min(axis=0), corners_H.max(axis=0)
    counts = np.maximum(1, np.ceil((high - low) / max(float(np.sort(high - low)[1]), 2.0 * _APART_M))).astype(int)
    half = 0.5 * (high - low) / counts
    axes = [low[k] + half[k] * (2.0 * np.arange(counts[k]) + 1.0) for k in range(3)]
    middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    rotation = X_BH.rotation().matrix()
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    radius = float(np.max(np.linalg.norm((signs * half @ rotation.T)[:, :2], axis=1)))
    centres = (middles @ rotation.T + X_BH.translation())[:, :2]
    return np.column_stack([centres, np.full(len(centres), radius)])
