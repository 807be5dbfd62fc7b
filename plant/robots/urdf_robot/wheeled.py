"""A robot from a URDF that stands on wheels: two are driven, casters slide."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from plant.robots.robot_kind import LocomotionLimits, PlacedRobot, SensorOptions
from plant.robots.servos import Velocity, clip
from plant.robots.urdf_robot.description import Description
from plant.robots.urdf_robot.robot import UrdfBody, UrdfIndex, UrdfRobot, UrdfSensors
from plant.saved_state import Stateful
from skills.robot import FloatArray, Pose2D, quantities

_MEAN_AHEAD = 0.75
"""Mean fraction of a control period's distance at the ends of its two plant steps."""


@dataclass(frozen=True)
class WheelLimits(LocomotionLimits):
    """Limits of two driven wheels that carry a base; the motors alone could accelerate it by 2.6 m/s^2.

    `lead_rad`: largest difference between a wheel's set point and its position when it cannot follow.
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
    """Two wheels of equal radius at y = +- `half_track_m`, the left one first."""

    radius_m: float
    half_track_m: float

    def rates(self, speed_m_s: float, turn_rate_rad_s: float) -> FloatArray:
        """Wheel rates (2,), rad/s, for a forward speed and a turn rate of the base."""
        across = self.half_track_m * turn_rate_rad_s
        return np.array([speed_m_s - across, speed_m_s + across]) / self.radius_m

    def travel(self, turned_rad: FloatArray) -> tuple[float, float]:
        """Forward distance (m) and turn (rad) of the base for wheel rotations (2,) in rad, without slip."""
        left_m, right_m = (self.radius_m * turned_rad).tolist()
        return (left_m + right_m) / 2.0, (right_m - left_m) / (2.0 * self.half_track_m)


class WheelServos(Stateful, saved=("_speed", "_turn_rate", "_due_rad")):
    """Servos of the wheels: set points for a commanded velocity; at rest they hold the wheels."""

    def __init__(self, axle: Axle, now_rad: FloatArray, limits: WheelLimits) -> None:
        """`now_rad` are the positions of the wheels (2,)."""
        self._axle, self._limits = axle, limits
        self._speed = self._turn_rate = 0.0
        self.goal_rad, self.rate_rad_s, self._due_rad = now_rad.copy(), np.zeros(2), now_rad.copy()

    def follow(self, wanted: Velocity, now_rad: FloatArray, dt_s: float, *, stopping: bool) -> None:
        """Sets the wheels for the next dt_s: ramps to the commanded speed and turn rate, faster when `stopping`."""
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
    """Odometer: pose of the base relative to its start, from the wheel encoders, which do not measure slip."""

    def __init__(self, axle: Axle, now_rad: FloatArray) -> None:
        """`now_rad` are the positions of the wheels (2,); the base is at the origin."""
        self._axle, self._last_rad = axle, now_rad.copy()
        self.pose = Pose2D(0.0, 0.0, 0.0)

    def count(self, now_rad: FloatArray) -> None:
        """Adds the arc that the base has driven since the last call; `now_rad` are the positions of the wheels (2,)."""
        ahead_m, turn_rad = self._axle.travel(now_rad - self._last_rad)
        self._last_rad = now_rad.copy()
        middle = self.pose.yaw_rad + turn_rad / 2.0
        self.pose = Pose2D(
            self.pose.x_m + ahead_m * math.cos(middle),
            self.pose.y_m + ahead_m * math.sin(middle),
            math.remainder(self.pose.yaw_rad + turn_rad, math.tau),
        )


class WheeledBody(UrdfBody):
    """Bodies and joints of a robot that stands on wheels and casters."""

    def __init__(self, plant: MultibodyPlant, robot: PlacedRobot, description: Description) -> None:
        """Adds the robot to `plant` (before Finalize)."""
        super().__init__(plant, robot, description)
        can, self.axle = description.capabilities, Axle(*description.assembly.axle())
        limits = robot.locomotion if isinstance(robot.locomotion, WheelLimits) else WheelLimits()
        self.limits = replace(
            limits,
            speed_m_s=min(limits.speed_m_s, can.max_speed_m_s),
            turn_rate_rad_s=min(limits.turn_rate_rad_s, can.max_turn_rate_rad_s),
        )

    def _place_base(self, context: Context, pose: Pose2D, height_m: float) -> None:
        self.plant.SetFreeBodyPose(context, self.base, pose.transform(height_m))


class WheeledIndex(UrdfIndex):
    """Joints of a robot with wheels; `wheels` are the driven ones, the left one first."""

    def __init__(self, body: WheeledBody) -> None:
        super().__init__(body)
        wheels = body.description.file.base.wheels
        assert wheels is not None
        self.wheels = self.numbers(wheels.joints)


class WheeledSensors(UrdfSensors, saved=("_odometer",)):
    """Sensors of a robot with wheels, whose encoders measure the odometry."""

    def __init__(self, body: WheeledBody, joints: WheeledIndex, options: SensorOptions) -> None:
        """Mounts the sensors on `body`."""
        self._joints = joints
        wheels_rad = body.plant.GetPositions(options.context)[joints.positions[joints.wheels]]
        self._odometer = WheelOdometer(body.axle, np.asarray(wheels_rad, dtype=np.float64))
        super().__init__(body, joints, options)

    def count_wheels(self, wheels_rad: FloatArray) -> None:
        """Updates the odometer from the wheels (2,) in each control period, more often than the sensors are updated."""
        self._odometer.count(wheels_rad)

    def _reckoned(self, X_WB: RigidTransform) -> RigidTransform:
        """Pose from the wheel encoders, at the height of the lift, with the true tilt of the body."""
        positions = np.asarray(self._body.plant.GetPositions(self._context)[self._joints.positions])
        self._odometer.count(positions[self._joints.wheels])
        pose, rpy = self._odometer.pose, RollPitchYaw(X_WB.rotation())
        height_m = self._file.base.height + float(positions[self._joints.lift].sum())
        tilted = RollPitchYaw(rpy.roll_angle(), rpy.pitch_angle(), pose.yaw_rad)
        return RigidTransform(tilted, np.array([pose.x_m, pose.y_m, height_m]))


class WheeledRobot(UrdfRobot, saved=("_wheels",)):
    """Robot driven by wheels."""

    _index: WheeledIndex

    def __init__(self, body: WheeledBody, options: SensorOptions) -> None:
        """Takes over the robot at the state of `options.context`, at time 0."""
        index = WheeledIndex(body)
        self._encoders = WheeledSensors(body, index, options)
        super().__init__(body, index, self._encoders, options)
        self._wheels = WheelServos(body.axle, self._joints()[index.wheels], body.limits)

    def _drive(self, wanted: Velocity | None, joints: FloatArray, desired: FloatArray, dt_s: float) -> None:
        index, wheels = self._index, self._wheels
        self._encoders.count_wheels(joints[index.wheels])
        wheels.follow(wanted or Velocity(), joints[index.wheels], dt_s, stopping=wanted is None)
        desired[index.wheels], desired[index.rates_of(index.wheels)] = wheels.goal_rad, wheels.rate_rad_s
