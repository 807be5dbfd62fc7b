"""Kinematics of an arm with shoulder yaw, two parallel pitch joints and a spherical roll-pitch-roll wrist.

All poses are in the body frame B; the hand frame H is the last arm link, x along the fingers, y along the
gripper's hinge. The chain is read from the robot's own URDF. The inverse is solved in closed form, every branch and no
seeds, or by the solver that the robot's capabilities bring.
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.geometry import wrap
from skills.robot import Capabilities, FloatArray, InverseKinematics

_EXPECTED_AXES = ((0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0))


@dataclass(frozen=True)
class ChainJoint:
    """One revolute joint: X_PF is its frame in the parent link, limits in rad, `child` the link that it moves."""

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
    solver: InverseKinematics | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Arm joint names from the shoulder on."""
        return tuple(joint.name for joint in self.joints)

    @property
    def hand_link(self) -> str:
        """Name of the last arm link."""
        return self.joints[-1].child

    @property
    def lower_rad(self) -> FloatArray:
        """Lower joint limits (J,)."""
        return np.array([joint.lower_rad for joint in self.joints])

    @property
    def upper_rad(self) -> FloatArray:
        """Upper joint limits (J,)."""
        return np.array([joint.upper_rad for joint in self.joints])

    @property
    def p_BS(self) -> FloatArray:
        """The shoulder in the body frame (3,), m."""
        return np.asarray(self.joints[0].X_PF.translation())

    def X_BH(self, q_rad: FloatArray) -> RigidTransform:
        """Pose of the hand for joint angles q_rad (J,)."""
        rotation, positions = self._chain(q_rad)
        return RigidTransform(RotationMatrix.ProjectToRotationMatrix(rotation), positions[-1])

    def points_B(self, q_rad: FloatArray) -> FloatArray:
        """Where the joints are, from the shoulder on, (J, 3) in the body frame; the last is the hand's origin."""
        return np.array(self._chain(q_rad)[1])

    def _chain(self, q_rad: FloatArray) -> tuple[NDArray[np.float64], list[FloatArray]]:
        """Rotation of the hand, and the place of each joint."""
        rotation, position, positions = np.eye(3), np.zeros(3), []
        for joint, angle in zip(self.joints, q_rad, strict=True):
            position = position + rotation @ joint.X_PF.translation()
            rotation = rotation @ joint.X_PF.rotation().matrix() @ _axis_rotation(joint.axis, float(angle))
            positions.append(position)
        return rotation, positions

    def within_limits(self, q_rad: FloatArray, margin_rad: float = 0.0) -> bool:
        """Whether q_rad keeps margin_rad from every limit."""
        return bool(np.all(q_rad >= self.lower_rad + margin_rad) and np.all(q_rad <= self.upper_rad - margin_rad))

    def inverse(self, X_BH: RigidTransform, margin_rad: float = 0.03) -> tuple[FloatArray, ...]:
        """All joint angles that put the hand at X_BH and keep margin_rad from the limits; empty when out of reach."""
        solutions = self._closed_form(X_BH) if self.solver is None else self.solver(X_BH)
        return tuple(q for q in solutions if self.within_limits(q, margin_rad))

    def _closed_form(self, X_BH: RigidTransform) -> list[FloatArray]:
        """Every branch of an arm with shoulder yaw, two pitch joints and a spherical wrist."""
        solutions = []
        for q_arm in self._arm_branches(X_BH.translation() - self.p_BS):
            R_BE = _axis_rotation((0, 0, 1), q_arm[0]) @ _axis_rotation((0, 1, 0), q_arm[1] + q_arm[2])
            for q_wrist in _wrist_branches(R_BE.T @ X_BH.rotation().matrix()):
                solutions.append(wrap(np.array([*q_arm, *q_wrist])))
        return solutions

    def nearest_inverse(
        self, X_BH: RigidTransform, q_near_rad: FloatArray, margin_rad: float = 0.03
    ) -> FloatArray | None:
        """The inverse solution nearest to q_near_rad, or None when out of reach."""
        solutions = self.inverse(X_BH, margin_rad)
        return min(solutions, key=lambda q: float(np.max(np.abs(q - q_near_rad))), default=None)

    def _arm_branches(self, p_SW: FloatArray) -> list[tuple[float, float, float]]:
        """Angles of the first three joints that put the wrist at p_SW from the shoulder."""
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


def _axis_rotation(axis: tuple[float, ...], angle_rad: float) -> NDArray[np.float64]:
    """Rotation matrix about one of the coordinate axes."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    if axis[2]:
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    if axis[1]:
        return np.array([[c, 0, s], [0, 1.0, 0], [-s, 0, c]])
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def _wrist_branches(R: NDArray[np.float64]) -> list[tuple[float, float, float]]:
    """Roll, pitch, roll angles whose product is R; at the singularity the first roll is zero."""
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


def _floats(text: str) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in text.split())
    return x, y, z


def _read_joint(element: ElementTree.Element) -> ChainJoint:
    """A ChainJoint from a URDF joint element."""
    origin, limit, child, axis = (element.find(tag) for tag in ("origin", "limit", "child", "axis"))
    xyz = _floats(origin.get("xyz", "0 0 0")) if origin is not None else (0.0, 0.0, 0.0)
    rpy = _floats(origin.get("rpy", "0 0 0")) if origin is not None else (0.0, 0.0, 0.0)
    if limit is None or child is None or axis is None:
        raise ValueError(f"URDF joint {element.get('name')}: it needs <limit>, <child> and <axis>")
    return ChainJoint(
        name=element.get("name", ""),
        child=child.get("link", ""),
        X_PF=RigidTransform(RollPitchYaw(np.array(rpy)), np.array(xyz)),
        axis=_floats(axis.get("xyz", "1 0 0")),
        lower_rad=float(limit.get("lower", "0")),
        upper_rad=float(limit.get("upper", "0")),
    )


def _check_structure(joints: tuple[ChainJoint, ...]) -> None:
    """Raise ValueError when the closed-form inverse does not fit the chain."""
    axes = tuple(tuple(round(a) for a in joint.axis) for joint in joints)
    offsets = [joint.X_PF.translation() for joint in joints]
    turned = any(not joint.X_PF.rotation().IsNearlyIdentity(1e-6) for joint in joints)
    straight = all(np.allclose(offsets[k], 0, atol=1e-6) for k in (1, 4, 5)) and np.allclose(
        [offsets[2][1], offsets[2][2], offsets[3][1]], 0, atol=1e-6
    )
    if axes != _EXPECTED_AXES or turned or not straight:
        raise ValueError(f"arm {[joint.name for joint in joints]}: not a z-y-y arm with an x-y-x wrist; axes {axes}")


@lru_cache(maxsize=4)
def _read_model(
    description: str,
    names: tuple[str, ...],
    stowed: tuple[float, ...],
    closed_form: bool,
) -> ArmModel:
    robot = ElementTree.fromstring(description.replace("drake:", "drake-"))  # the prefix is often left undeclared
    elements = {element.get("name"): element for element in robot.findall("joint")}
    missing = [name for name in names if name not in elements]
    if missing:
        raise ValueError(f"URDF of the robot: no joint {', '.join(missing)}")
    joints = tuple(_read_joint(elements[name]) for name in names)
    if closed_form:
        _check_structure(joints)
    return ArmModel(joints, np.array(stowed))


def arm_model(capabilities: Capabilities) -> ArmModel:
    """The arm described by a robot's capabilities.

    Raises ValueError when it has none, or one of another structure that brings no solver of its own.
    """
    if capabilities.arm is None or capabilities.gripper is None:
        raise ValueError("the robot has no arm with a gripper")
    names, stowed, solver = capabilities.arm.joint_names, capabilities.arm.stowed_rad, capabilities.arm.inverse
    model = _read_model(capabilities.description, names, stowed[: len(names)], solver is None)
    return replace(model, solver=solver)
