"""The planar floating base that replaces the legs below Spot's body: five joints with effort limits.

World -> prismatic x -> prismatic y -> revolute yaw -> prismatic height -> revolute pitch -> weld -> body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    Joint,
    JointActuator,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import Context

from plant.robots.robot_kind import LocomotionLimits
from plant.robots.servos import Velocity, clip
from plant.saved_state import Stateful
from skills.robot import FloatArray, Pose2D, quantities


@dataclass(frozen=True)
class FloatingBaseLimits(LocomotionLimits):
    """Limits of a planar floating base that carries the body; forces in N, torques in N m."""

    speed_m_s: quantities.Speed = 1.6
    turn_rate_rad_s: quantities.TurnRate = 2.0
    acceleration_m_s2: quantities.Acceleration = 2.0
    turn_acceleration_rad_s2: quantities.TurnAcceleration = 4.0
    stop_deceleration_m_s2: quantities.Acceleration = 5.0
    stop_turn_deceleration_rad_s2: quantities.TurnAcceleration = 12.0
    posture_speed_m_s: quantities.Speed = 0.25
    pitch_rate_rad_s: quantities.TurnRate = 0.6
    force_n: quantities.Force = 250.0
    torque_nm: quantities.Torque = 120.0
    lift_n: quantities.Force = 900.0
    pitch_torque_nm: quantities.Torque = 250.0
    lead_m: quantities.Length = 0.02


_AXES = ("x", "y", "yaw", "height", "pitch")
_FALL_M_S2 = 2.0
"""Acceleration of a body that falls onto legs without power, which brake it."""
_GAINS = {"x": (8e3, 2e3), "y": (8e3, 2e3), "yaw": (2e3, 4e2), "height": (6e4, 3e3), "pitch": (8e3, 4e2)}


class FloatingBase(Stateful, saved=("_velocity", "_target", "_posture", "_drop_m_s")):
    """Floating base of one robot: drives the body to a velocity and a posture with limited force and acceleration."""

    def __init__(
        self, plant: MultibodyPlant, name: str, body: RigidBody, limits: FloatingBaseLimits, *, heavier: float = 1.0
    ) -> None:
        """Adds the joints to `plant` (before Finalize); the last joint carries `body`.

        Forces and gains are for a Spot; `heavier` multiplies them.
        """
        self._plant, self._limits, self._heavier = plant, limits, heavier
        self.instance: ModelInstanceIndex = plant.AddModelInstance(f"{name}_floating_base")
        self._joints = self._add_joints(name, body)
        self._velocity = Velocity()
        self._target = [0.0] * 5
        self._posture, self._drop_m_s = (0.0, 0.0), 0.0

    def _add_joints(self, name: str, body: RigidBody) -> Sequence[Joint]:
        directions = {"x": (1, 0, 0), "y": (0, 1, 0), "yaw": (0, 0, 1), "height": (0, 0, 1), "pitch": (0, 1, 0)}
        limits, heavier, inertia = self._limits, self._heavier, SpatialInertia.SolidSphereWithMass(0.05, 0.05)
        efforts = (limits.force_n, limits.force_n, limits.torque_nm, limits.lift_n, limits.pitch_torque_nm)
        parent: RigidBody = self._plant.world_body()
        joints: list[Joint] = []
        for axis, effort in zip(_AXES, efforts, strict=True):
            link = f"{name}_floating_base_{axis}"
            child = body if axis == _AXES[-1] else self._plant.AddRigidBody(link, self.instance, inertia)
            frames = [self._add_frame(f"{link}_{end}", each) for end, each in (("F", parent), ("M", child))]
            kind = RevoluteJoint if axis in ("yaw", "pitch") else PrismaticJoint
            joint, (p, d) = self._plant.AddJoint(kind(link, *frames, np.array(directions[axis], float))), _GAINS[axis]
            actuator: JointActuator = self._plant.AddJointActuator(link, joint, heavier * effort)
            actuator.set_controller_gains(PdControllerGains(p=heavier * p, d=heavier * d))
            joints.append(joint)
            parent = child
        return joints

    def _add_frame(self, name: str, body: RigidBody) -> Frame:
        return self._plant.AddFrame(FixedOffsetFrame(name, body.body_frame(), RigidTransform(), self.instance))

    @property
    def velocity(self) -> Velocity:
        """Present commanded velocity, after the acceleration limit."""
        return self._velocity

    @property
    def posture(self) -> tuple[float, float]:
        """Present commanded height and pitch, after the speed limits."""
        return self._posture

    def pose(self, positions: FloatArray) -> list[float]:
        """Pose (x, y, yaw, height, pitch) in the plant's positions."""
        return list(map(float, positions[self._places]))

    @cached_property
    def _places(self) -> list[int]:
        """Indices of the joints in the plant's positions; after Finalize."""
        return [joint.position_start() for joint in self._joints]

    def place(self, context: Context, pose: Pose2D, height_m: float) -> None:
        """Sets the body's pose at the start of a run."""
        values = (pose.x_m, pose.y_m, pose.yaw_rad, height_m, 0.0)
        positions = self._plant.GetPositions(context)
        positions[self._places] = values
        self._plant.SetPositions(context, positions)
        self._plant.get_actuation_input_port(self.instance).FixValue(context, np.zeros(len(_AXES)))
        self._target = [*values]
        self._posture = (height_m, 0.0)

    def control(
        self,
        context: Context,
        state: Sequence[float],
        wanted: Velocity,
        posture: Sequence[float],
        dt_s: float,
        *,
        stopping: bool,
        falls: bool = False,
    ) -> None:
        """Commands the joints for the next dt_s: ramps to `wanted` (body frame) and to the posture (height, pitch).

        `state` is (x, y, yaw, height, pitch). A `stopping` robot brakes harder than its usual acceleration. One
        that `falls` drops ever faster.
        """
        limits = self._limits
        v = self._velocity = self._ramp(wanted, dt_s, stopping=stopping)
        c, s = math.cos(state[2]), math.sin(state[2])
        rates = (c * v.vx - s * v.vy, s * v.vx + c * v.vy, v.wz)
        planar = zip(self._target[:3], rates, state[:3], strict=True)
        ahead = [now + clip(target + rate * dt_s - now, limits.lead_m) for target, rate, now in planar]
        self._drop_m_s = self._drop_m_s + _FALL_M_S2 * dt_s if falls else 0.0
        most = (max(limits.posture_speed_m_s, self._drop_m_s) * dt_s, limits.pitch_rate_rad_s * dt_s)
        move = [clip(goal - now, step) for goal, now, step in zip(posture, self._posture, most, strict=True)]
        self._posture = (self._posture[0] + move[0], self._posture[1] + move[1])
        self._target = [*ahead, *self._posture]
        desired = np.array([*self._target, *rates, move[0] / dt_s, move[1] / dt_s])
        self._plant.get_desired_state_input_port(self.instance).FixValue(context, desired)

    def _ramp(self, wanted: Velocity, dt_s: float, *, stopping: bool) -> Velocity:
        limits, now = self._limits, self._velocity
        speed = math.hypot(wanted.vx, wanted.vy)
        scale = min(1.0, limits.speed_m_s / speed) if speed else 1.0
        change_x, change_y = scale * wanted.vx - now.vx, scale * wanted.vy - now.vy
        size = math.hypot(change_x, change_y)
        most = (limits.stop_deceleration_m_s2 if stopping else limits.acceleration_m_s2) * dt_s
        share = min(1.0, most / size) if size else 0.0
        turn_rate = limits.stop_turn_deceleration_rad_s2 if stopping else limits.turn_acceleration_rad_s2
        turn = clip(clip(wanted.wz, limits.turn_rate_rad_s) - now.wz, turn_rate * dt_s)
        return Velocity(now.vx + share * change_x, now.vy + share * change_y, now.wz + turn)
