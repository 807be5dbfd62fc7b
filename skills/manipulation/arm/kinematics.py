"""Kinematics of an arm, read from the robot's URDF.

All poses are in the body frame B; the hand frame H is that of the last arm link, x along the fingers, z along the
closing direction. Two families have closed-form inverse kinematics, which need no seed: one has a shoulder yaw, two
parallel pitch joints and a spherical roll-pitch-roll wrist; the other has seven joints (see `SevenJoints`). Other arms
are solved by iteration (see `AnyJoints`), or by the solver in the robot's capabilities.
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.geometry import wrap
from skills.manipulation.arm.clearance import place_links
from skills.manipulation.arm.inverse_kinematics import AXES, JOINTS, AnyJoints, SevenJoints
from skills.robot import Capabilities, FloatArray, InverseKinematics

_EXPECTED_AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0))


@dataclass(frozen=True)
class ChainJoint:
    """Revolute joint: X_PF is its frame in the parent link, limits in rad, `child` the link that it moves.

    The limits of a continuous joint are infinite.
    """

    name: str
    child: str
    X_PF: RigidTransform
    axis: tuple[float, float, float]
    lower_rad: float
    upper_rad: float


@dataclass(frozen=True)
class ArmModel:
    """Forward and inverse kinematics of the arm."""

    joints: tuple[ChainJoint, ...]
    stowed_rad: FloatArray
    closed_form: bool = True
    solver: InverseKinematics | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arm's joints from the shoulder on."""
        return tuple(joint.name for joint in self.joints)

    @property
    def hand_link(self) -> str:
        """Name of the last arm link."""
        return self.joints[-1].child

    @cached_property
    def lower_rad(self) -> FloatArray:
        """Lower joint limits (J,)."""
        return np.array([joint.lower_rad for joint in self.joints])

    @cached_property
    def upper_rad(self) -> FloatArray:
        """Upper joint limits (J,)."""
        return np.array([joint.upper_rad for joint in self.joints])

    @cached_property
    def endless(self) -> NDArray[np.bool_]:
        """Mask (J,) of the continuous joints."""
        return np.isinf(self.upper_rad)

    @property
    def p_BS(self) -> FloatArray:
        """Position (3,) of the shoulder in the body frame, m."""
        return np.asarray(self.joints[0].X_PF.translation())

    def X_BH(self, q_rad: FloatArray) -> RigidTransform:
        """Pose of the hand at joint angles q_rad (J,)."""
        R_BL, p_BL = self.links(q_rad)
        return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_BL[-1]), p_BL[-1])

    def points_B(self, q_rad: FloatArray) -> FloatArray:
        """Positions (J, 3) of the joints in the body frame, from the shoulder on."""
        return self.links(q_rad)[1][1:]

    @cached_property
    def frames(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Axes (J, 3) of the joints, and the joints' frames in their parent links: R_PF (J, 3, 3) and p_PF (J, 3)."""
        X_PF = np.array([joint.X_PF.GetAsMatrix34() for joint in self.joints])
        axes = np.array([joint.axis for joint in self.joints], dtype=float)
        return axes, np.ascontiguousarray(X_PF[:, :, :3]), np.ascontiguousarray(X_PF[:, :, 3])

    def links(self, q_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Poses of the body and of the links in the body frame: R_BL (J + 1, 3, 3) and p_BL (J + 1, 3)."""
        R_BL, p_BL = np.empty((len(self.joints) + 1, 3, 3)), np.empty((len(self.joints) + 1, 3))
        place_links(R_BL, p_BL, np.ascontiguousarray(q_rad, dtype=float).reshape(len(self.joints)), *self.frames)
        return R_BL, p_BL

    def within_limits(self, q_rad: FloatArray, margin_rad: float = 0.0) -> bool:
        """Returns whether every joint in q_rad is at least margin_rad away from its limits."""
        return bool(np.all(q_rad >= self.lower_rad + margin_rad) and np.all(q_rad <= self.upper_rad - margin_rad))

    def turned_near(self, q_rad: FloatArray, q_near_rad: FloatArray) -> FloatArray:
        """Returns the same posture with continuous joints within half a turn of q_near_rad; both (J,)."""
        if not self.endless.any():
            return q_rad
        turned = q_rad + math.tau * np.round((q_near_rad - q_rad) / math.tau)
        return np.where(self.endless, turned, q_rad)

    def off_rad(self, q_rad: FloatArray, q_other_rad: FloatArray) -> float:
        """Largest joint difference between two postures; full turns of continuous joints do not count."""
        return float(np.max(np.abs(self.turned_near(q_rad, q_other_rad) - q_other_rad)))

    def inverse(self, X_BH: RigidTransform, margin_rad: float = 0.03) -> tuple[FloatArray, ...]:
        """Returns joint angles that put the hand at X_BH, margin_rad inside the limits; empty when out of reach.

        For the family with six joints these are all solutions, for other arms a selection.
        """
        if self._own is not None:
            return tuple(self._own.solutions(X_BH, margin_rad))
        if self.solver is None:
            return tuple(self._closed_form(X_BH, margin_rad))
        return tuple(q for q in self.solver(X_BH) if self.within_limits(q, margin_rad))

    def reaches(self, X_BH: RigidTransform, margin_rad: float = 0.03) -> bool:
        """Returns whether joint angles exist that put the hand at X_BH, margin_rad inside the limits."""
        if self._own is not None:
            return self._own.reaches(X_BH, margin_rad)
        if self.solver is None:
            return any(True for _ in self._closed_form(X_BH, margin_rad))
        return bool(self.inverse(X_BH, margin_rad))

    @cached_property
    def _own(self) -> SevenJoints | AnyJoints | None:
        """Solver for an arm outside the family with six joints; None for an arm in that family."""
        if self.solver is not None or (self.closed_form and len(self.joints) != JOINTS):
            return None
        if not self.closed_form:
            return AnyJoints(*self.frames, self.lower_rad, self.upper_rad)
        x, _, z = np.array([joint.X_PF.translation() for joint in self.joints]).T
        return SevenJoints(
            self.p_BS,
            *(float(x[1]), float(z[1])),
            *(float(x[2] + x[3]), float(x[4] + x[5]), float(x[6])),
            _roll(self.joints[-1].X_PF.rotation()),
            self.lower_rad,
            self.upper_rad,
        )

    def _closed_form(self, X_BH: RigidTransform, margin_rad: float) -> Iterator[FloatArray]:
        """Yields the IK solutions of an arm with shoulder yaw, two pitch joints and a spherical wrist."""
        R_BH, p_SW = X_BH.rotation().matrix(), X_BH.translation() - self.p_BS
        lower, upper = (self.lower_rad + margin_rad).tolist(), (self.upper_rad - margin_rad).tolist()
        for q_arm in self._arm_branches(p_SW):
            if not _all_between(lower, map(wrap, q_arm), upper):
                continue
            R_BE = RotationMatrix.MakeZRotation(q_arm[0]) @ RotationMatrix.MakeYRotation(q_arm[1] + q_arm[2])
            for q_wrist in _wrist_branches(R_BE.matrix().T @ R_BH):
                q_rad = [wrap(angle) for angle in (*q_arm, *q_wrist)]
                if _all_between(lower, q_rad, upper):
                    yield np.array(q_rad)

    def nearest_inverse(
        self, X_BH: RigidTransform, q_near_rad: FloatArray, margin_rad: float = 0.03
    ) -> FloatArray | None:
        """Returns the IK solution nearest to q_near_rad; None when X_BH is out of reach."""
        if self._own is not None:
            return self._own.nearest(X_BH, q_near_rad, margin_rad)
        solutions = self.inverse(X_BH, margin_rad)
        return min(solutions, key=lambda q: float(np.max(np.abs(q - q_near_rad))), default=None)

    def _arm_branches(self, p_SW: FloatArray) -> list[tuple[float, float, float]]:
        """IK solutions of the first three joints that put the wrist at p_SW, relative to the shoulder."""
        upper = float(self.joints[2].X_PF.translation()[0])
        fore_x, _, fore_z = self.joints[3].X_PF.translation()
        fore, bend = math.hypot(fore_x, fore_z), math.atan2(fore_z, fore_x)
        radius, yaw = math.hypot(p_SW[0], p_SW[1]), math.atan2(p_SW[1], p_SW[0])
        cosine = (radius**2 + p_SW[2] ** 2 - upper**2 - fore**2) / (2 * upper * fore)
        if abs(cosine) > 1.0:
            return []
        branches = []
        for (turn, sign), elbow in itertools.product(((0.0, 1.0), (math.pi, -1.0)), (1.0, -1.0)):
            fold = elbow * math.acos(cosine)
            pitch = math.atan2(p_SW[2], sign * radius) - math.atan2(
                fore * math.sin(fold), upper + fore * math.cos(fold)
            )
            branches.append((yaw + turn, -pitch, bend - fold))
        return branches


def _all_between(lower: Iterable[float], values: Iterable[float], upper: Iterable[float]) -> bool:
    """Returns whether all values are within the limits; there may be fewer values than limits."""
    return all(low <= value <= high for value, low, high in zip(values, lower, upper, strict=False))


def _wrist_branches(R: NDArray[np.float64]) -> list[tuple[float, float, float]]:
    """Solutions for roll, pitch and roll whose product is R; at the singularity the first roll is zero."""
    sine = math.hypot(R[0, 1], R[0, 2])
    if sine < 1e-6:
        return [(0.0, 0.0 if R[0, 0] > 0 else math.pi, math.atan2(R[2, 1], R[1, 1]))]
    return [
        (
            math.atan2(sign * R[1, 0], -sign * R[2, 0]),
            math.atan2(sign * sine, R[0, 0]),
            math.atan2(sign * R[0, 1], sign * R[0, 2]),
        )
        for sign in (1.0, -1.0)
    ]


def _roll(R: RotationMatrix) -> float:
    """Angle of a rotation about x."""
    return math.atan2(R.matrix()[2, 1], R.matrix()[1, 1])


def _floats(text: str) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in text.split())
    return x, y, z


def _read_joint(element: ElementTree.Element) -> ChainJoint:
    """Reads a ChainJoint from a URDF joint element."""
    origin, limit, child, axis = (element.find(tag) for tag in ("origin", "limit", "child", "axis"))
    xyz = _floats(origin.get("xyz", "0 0 0")) if origin is not None else (0.0, 0.0, 0.0)
    rpy = _floats(origin.get("rpy", "0 0 0")) if origin is not None else (0.0, 0.0, 0.0)
    endless = element.get("type") == "continuous"
    if child is None or axis is None or (limit is None and not endless):
        raise ValueError(f"URDF joint {element.get('name')}: it needs <limit>, <child> and <axis>")
    lower, upper = (
        (limit.get("lower", "0"), limit.get("upper", "0")) if limit is not None and not endless else ("-inf", "inf")
    )
    x, y, z = _floats(axis.get("xyz", "1 0 0"))
    length = math.hypot(x, y, z)
    return ChainJoint(
        name=element.get("name", ""),
        child=child.get("link", ""),
        X_PF=RigidTransform(RollPitchYaw(np.array(rpy)), np.array(xyz)),
        axis=(x / length, y / length, z / length),
        lower_rad=float(lower),
        upper_rad=float(upper),
    )


def _has_closed_form(joints: tuple[ChainJoint, ...]) -> bool:
    """Returns whether the closed form for six joints applies to the chain."""
    axes = tuple(joint.axis for joint in joints)
    offsets = [joint.X_PF.translation() for joint in joints]
    turns = [joint.X_PF.rotation() for joint in joints]
    if len(joints) == JOINTS:  # a turn of the hand about the last axis makes no other arm
        turns[-1] = turns[-1].MakeXRotation(-_roll(turns[-1])) @ turns[-1]
    if any(not turn.IsNearlyIdentity(1e-6) for turn in turns):
        return False
    if len(joints) == JOINTS:
        aside = [offsets[1][1], *(p for k in range(2, JOINTS) for p in offsets[k][1:])]
        return axes == AXES and np.allclose(aside, 0, atol=1e-6)
    if axes != _EXPECTED_AXES:
        return False
    at_one_point = all(np.allclose(offsets[k], 0, atol=1e-6) for k in (1, 4, 5))
    return at_one_point and np.allclose([offsets[2][1], offsets[2][2], offsets[3][1]], 0, atol=1e-6)


@lru_cache(maxsize=4)
def _read_model(description: str, names: tuple[str, ...], stowed: tuple[float, ...]) -> ArmModel:
    robot = ElementTree.fromstring(description.replace("drake:", "drake-"))  # the prefix is often left undeclared
    elements = {element.get("name"): element for element in robot.findall("joint")}
    missing = [name for name in names if name not in elements]
    if missing:
        raise ValueError(f"URDF of the robot: no joint {', '.join(missing)}")
    joints = tuple(_read_joint(elements[name]) for name in names)
    return ArmModel(joints, np.array(stowed), _has_closed_form(joints))


def arm_model(capabilities: Capabilities) -> ArmModel:
    """Builds the arm model from a robot's capabilities. Raises ValueError when the robot has no arm."""
    if capabilities.arm is None:
        raise ValueError("the robot has no arm")
    names, stowed, solver = capabilities.arm.joint_names, capabilities.arm.stowed_rad, capabilities.arm.inverse
    model = _read_model(capabilities.description, names, stowed[: len(names)])
    return model if solver is None else replace(model, solver=solver)
