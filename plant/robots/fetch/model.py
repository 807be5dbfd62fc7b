"""Fetch in a MultibodyPlant: its model, the servos and odometry of its wheels, gains, and indices of its joints."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from plant.robots.command_table import Velocity
from plant.robots.fetch.description import (
    BASE_LINK,
    FINGERS,
    HEAD_JOINTS,
    LIFT_JOINT,
    WHEELS,
    fetch_facts,
    fetch_urdf,
)
from plant.robots.jointed_robot import FINGER_GAINS, JointIndex
from plant.robots.robot_kind import LocomotionLimits, PlacedRobot, RobotBody
from plant.robots.servos import clip
from plant.saved_state import Stateful
from skills.robot import FloatArray, GripperKind, Pose2D, quantities

_GAINS = {
    **dict.fromkeys(WHEELS, (20.0, 15.0)),
    LIFT_JOINT: (4e4, 3e3),
    **dict.fromkeys(HEAD_JOINTS, (20.0, 1.5)),
    "shoulder_pan": (900.0, 45.0),
    "shoulder_lift": (1500.0, 75.0),
    "upperarm_roll": (900.0, 45.0),
    "elbow_flex": (900.0, 45.0),
    "forearm_roll": (300.0, 12.0),
    "wrist_flex": (300.0, 12.0),
    "wrist_roll": (100.0, 4.0),
    **dict.fromkeys(FINGERS, FINGER_GAINS[GripperKind.PARALLEL]),
}
_MEAN_AHEAD = 0.75
"""Mean share of a control period's distance at the ends of its two plant steps."""


@dataclass(frozen=True)
class WheelLimits(LocomotionLimits):
    """Limits of two driven wheels that bear a base; the motors alone could accelerate it by 2.6 m/s^2.

    `lead_rad` is the greatest distance of a wheel's set point from a wheel that cannot follow.
    """

    speed_m_s: quantities.Speed = 1.0
    turn_rate_rad_s: quantities.TurnRate = 1.8
    acceleration_m_s2: quantities.Acceleration = 1.0
    turn_acceleration_rad_s2: quantities.TurnAcceleration = 2.5
    stop_deceleration_m_s2: quantities.Acceleration = 2.0
    stop_turn_deceleration_rad_s2: quantities.TurnAcceleration = 6.0
    lead_rad: quantities.Angle = 0.15


@dataclass(frozen=True)
class Axle:
    """Two wheels of a radius at y = +- `half_track_m`, the left one first."""

    radius_m: float
    half_track_m: float

    def rates(self, speed_m_s: float, turn_rate_rad_s: float) -> FloatArray:
        """Wheel rates (2,), rad/s, for a speed ahead and a turn rate of the base."""
        across = self.half_track_m * turn_rate_rad_s
        return np.array([speed_m_s - across, speed_m_s + across]) / self.radius_m

    def travel(self, turned_rad: FloatArray) -> tuple[float, float]:
        """Distance ahead (m) and turn (rad) of the base for turns (rad) of the wheels (2,) without slip."""
        left_m, right_m = (self.radius_m * turned_rad).tolist()
        return (left_m + right_m) / 2.0, (right_m - left_m) / (2.0 * self.half_track_m)


class WheelServos(Stateful, saved=("_speed", "_turn_rate", "_due_rad")):
    """Servos of the wheels: set points for a wanted velocity; at rest they hold the wheels."""

    def __init__(self, axle: Axle, now_rad: FloatArray, limits: WheelLimits) -> None:
        """The wheels (2,) stand at `now_rad`."""
        self._axle, self._limits = axle, limits
        self._speed = self._turn_rate = 0.0
        self.goal_rad, self.rate_rad_s, self._due_rad = now_rad.copy(), np.zeros(2), now_rad.copy()

    def follow(self, wanted: Velocity, now_rad: FloatArray, dt_s: float, *, stopping: bool) -> None:
        """Sets the wheels for the next dt_s: ramps to the wanted speed ahead and turn rate, faster when `stopping`."""
        limits = self._limits
        most = limits.stop_deceleration_m_s2 if stopping else limits.acceleration_m_s2
        turn = limits.stop_turn_deceleration_rad_s2 if stopping else limits.turn_acceleration_rad_s2
        self._speed += clip(clip(wanted.vx, limits.speed_m_s) - self._speed, most * dt_s)
        self._turn_rate += clip(clip(wanted.wz, limits.turn_rate_rad_s) - self._turn_rate, turn * dt_s)
        self.rate_rad_s = self._axle.rates(self._speed, self._turn_rate)
        self._due_rad = now_rad + np.clip(self._due_rad - now_rad, -limits.lead_rad, limits.lead_rad)
        self.goal_rad = self._due_rad + _MEAN_AHEAD * self.rate_rad_s * dt_s
        self._due_rad = self._due_rad + self.rate_rad_s * dt_s


class WheelOdometer(Stateful, saved=("pose", "_last_rad")):
    """Odometer: pose of the base since the beginning, by the wheel encoders, which do not notice slip."""

    def __init__(self, axle: Axle, now_rad: FloatArray) -> None:
        """The wheels (2,) stand at `now_rad`, the base at the origin."""
        self._axle, self._last_rad = axle, now_rad.copy()
        self.pose = Pose2D(0.0, 0.0, 0.0)

    def count(self, now_rad: FloatArray) -> None:
        """Adds the arc that the base has driven since the last count; the wheels (2,) stand at `now_rad`."""
        ahead_m, turn_rad = self._axle.travel(now_rad - self._last_rad)
        self._last_rad = now_rad.copy()
        middle = self.pose.yaw_rad + turn_rad / 2.0
        self.pose = Pose2D(
            self.pose.x_m + ahead_m * math.cos(middle),
            self.pose.y_m + ahead_m * math.sin(middle),
            math.remainder(self.pose.yaw_rad + turn_rad, math.tau),
        )


class FetchModel(RobotBody):
    """Bodies and joints of Fetch in a plant; it stands on wheels and casters, and its fingers are coupled."""

    def __init__(self, plant: MultibodyPlant, robot: PlacedRobot) -> None:
        """Adds the robot to `plant` (before Finalize)."""
        super().__init__(plant, robot, fetch_urdf(), _GAINS)
        self.limits = robot.locomotion if isinstance(robot.locomotion, WheelLimits) else WheelLimits()
        self.base = plant.GetBodyByName(BASE_LINK, self.instance)
        left, right = (plant.GetJointByName(finger, self.instance) for finger in FINGERS)
        plant.AddCouplerConstraint(left, right, 1.0)

    def opening(self, context: Context) -> float:
        """Distance between the fingers (m)."""
        positions = self.plant.GetPositions(context)
        joints = (self.plant.GetJointByName(finger, self.instance) for finger in FINGERS)
        return sum(float(positions[joint.position_start()]) for joint in joints)

    def place(self, context: Context, pose: Pose2D | None = None) -> None:
        """Sets the robot on its wheels, the torso at its height for travelling and the arm stowed."""
        facts = fetch_facts()
        self.set_joints(context, {**facts["stowed"], LIFT_JOINT: facts["capabilities"]["travelling_lift"]})
        self.plant.SetFreeBodyPose(context, self.base, (pose or self.robot.start).transform())


class FetchJoints(JointIndex):
    """Joints of Fetch: those of head, arm and fingers, the wheels, and the lift."""

    def __init__(self, body: RobotBody) -> None:
        facts = fetch_facts()
        speeds = {part["link"]: part["velocity"] for part in (*facts["arm"], *facts["head"])}
        super().__init__(body, {**speeds, **dict.fromkeys(FINGERS, facts["finger"]["velocity"])})
        self.wheels, self.lift = self.numbers(WHEELS), self.names.index(LIFT_JOINT)
