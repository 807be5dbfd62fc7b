"""The simulated Fetch behind the Robot protocol, and its sensors: wheel odometry, planar LiDAR, head camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.robots.command_table import Part, Velocity
from plant.robots.fetch.description import HEAD_CAMERA, LIFT_JOINT, fetch_facts, head_camera
from plant.robots.fetch.model import Axle, FetchJoints, FetchModel, WheelOdometer, WheelServos
from plant.robots.jointed_robot import JointedRobot, JointedSensors, gripper_noise
from plant.robots.robot_kind import SensorOptions
from plant.robots.sensor_suite import LidarMount
from plant.sensors.lidar import LidarSpec
from skills.robot import CommandCause, CommandId, CommandState, FloatArray, Lease

_LIDAR_SIGMA_M = 0.015


def axle() -> Axle:
    """Axle of Fetch's driven wheels."""
    wheel = fetch_facts()["wheel"]
    return Axle(wheel["radius"], wheel["offset"][1])


class FetchSensors(JointedSensors, saved=("_odometer",)):
    """Sensors of one Fetch."""

    def __init__(self, model: FetchModel, joints: FetchJoints, options: SensorOptions) -> None:
        """Mounts the sensors on `model`."""
        self._joints, facts = joints, fetch_facts()
        self._p_BaseL = np.array(facts["lidar"]["xyz"])
        wheels_rad = model.plant.GetPositions(options.context)[joints.positions[joints.wheels]]
        self._odometer = WheelOdometer(axle(), np.asarray(wheels_rad, dtype=np.float64))
        super().__init__(
            model,
            joints,
            options,
            lidar=LidarMount(model.base, RigidTransform(self._p_BaseL), lidar_spec(), 1.0 / facts["lidar"]["rate"]),
            cameras={HEAD_CAMERA: head_camera()},
            runtime_s=facts["capabilities"]["runtime"],
            gripper_noise=gripper_noise(model),
        )

    def count_wheels(self, wheels_rad: FloatArray) -> None:
        """Counts the turns of the wheels (2,) in each control period, more often than readings are taken."""
        self._odometer.count(wheels_rad)

    def _reckoned(self, X_WB: RigidTransform) -> RigidTransform:
        """Pose by the wheel encoders, at the height of the lift, with the true tilt of the body."""
        plant = self._body.plant
        positions = np.asarray(plant.GetPositions(self._context)[self._joints.positions])
        self._odometer.count(positions[self._joints.wheels])
        pose, rpy = self._odometer.pose, RollPitchYaw(X_WB.rotation())
        height_m = fetch_facts()["lift"]["height"] + float(positions[self._joints.lift])
        tilted = RollPitchYaw(rpy.roll_angle(), rpy.pitch_angle(), pose.yaw_rad)
        return RigidTransform(tilted, np.array([pose.x_m, pose.y_m, height_m]))

    def _X_BL(self) -> RigidTransform:
        """Pose of the LiDAR, which stays with the base when the lift moves the body frame."""
        height_m = fetch_facts()["lift"]["height"] + self.joints.position_rad[LIFT_JOINT]
        return RigidTransform(self._p_BaseL - [0.0, 0.0, height_m])


def lidar_spec() -> LidarSpec:
    """Specification of the planar LiDAR: one ring ahead and to the sides."""
    lidar = fetch_facts()["lidar"]
    return LidarSpec(
        rings=1,
        half_fov_rad=0.0,
        azimuth_step_rad=math.tau / lidar["points_per_turn"],
        min_range_m=lidar["range"][0],
        max_range_m=lidar["range"][1],
        sigma_m=_LIDAR_SIGMA_M,
        columns=lidar["points"],
    )


_LIFT_ARRIVED_M = 0.01


@dataclass(frozen=True)
class _LiftGoal:
    height_m: float


class FetchRobot(JointedRobot, saved=("_wheels", "_lift", "_lift_goal")):
    """One Fetch: turns the commands of the lease's holder into set points of the plant's servos."""

    _index: FetchJoints

    def __init__(self, model: FetchModel, options: SensorOptions) -> None:
        """Takes over the robot at the state of `options.context`, at time 0."""
        index = FetchJoints(model)
        self._encoders = FetchSensors(model, index, options)
        super().__init__(model, index, self._encoders, options.context)
        joints, lift = self._joints(), fetch_facts()["lift"]
        self._wheels = WheelServos(axle(), joints[index.wheels], model.limits)
        self._lift = self._lift_goal = float(joints[index.lift])
        self._lift_down_m, self._lift_m_s = lift["height"], lift["velocity"]

    # -- act ------------------------------------------------------------------------------------------------------

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Lifts the torso until the body frame is at a height above the floor; it does not pitch."""
        low, high = self._capabilities.height_range_m
        if not (low <= height_m <= high and pitch_rad == 0.0):
            return self._commands.refuse(
                f"stand: height {height_m:.2f} m must lie in [{low:.2f}, {high:.2f}] "
                f"and pitch {pitch_rad:.2f} rad must be 0"
            )
        return self._begin(Part.POSTURE, _LiftGoal(height_m), until_s, lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the torso; driving stops."""
        command = self._begin(Part.POSTURE, _LiftGoal(self._capabilities.height_range_m[0]), until_s, lease)
        if self._runs(command):
            self._commands.finish(
                Part.VELOCITY, CommandState.STOPPED, "the robot lowers its torso", CommandCause.STOPPED
            )
        return command

    # -- inside ---------------------------------------------------------------------------------------------------

    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        index = self._index
        self._encoders.count_wheels(joints[index.wheels])
        self._follow_drive(joints, dt_s)
        self._follow_lift(joints)
        desired = super()._desired(joints, rates, dt_s)
        desired[index.wheels], desired[index.rates_of(index.wheels)] = self._wheels.goal_rad, self._wheels.rate_rad_s
        self._ramp_lift(desired, dt_s)
        return desired

    def _hold_still(self, part: Part) -> None:
        super()._hold_still(part)
        if part is Part.POSTURE:
            self._lift_goal = self._lift

    def _follow_drive(self, joints: FloatArray, dt_s: float) -> None:
        wanted, wheels_rad = self._goal(Part.VELOCITY, Velocity), joints[self._index.wheels]
        self._wheels.follow(wanted or Velocity(), wheels_rad, dt_s, stopping=wanted is None)

    def _follow_lift(self, joints: FloatArray) -> None:
        goal = self._goal(Part.POSTURE, _LiftGoal)
        if goal is None:
            return
        self._lift_goal = goal.height_m - self._lift_down_m
        if abs(float(joints[self._index.lift]) - self._lift_goal) < _LIFT_ARRIVED_M:
            self._commands.finish(Part.POSTURE, CommandState.DONE)

    def _ramp_lift(self, desired: FloatArray, dt_s: float) -> None:
        index, most_m = self._index, self._lift_m_s * dt_s
        step_m = min(max(self._lift_goal - self._lift, -most_m), most_m)
        self._lift += step_m
        desired[index.lift], desired[len(index.names) + index.lift] = self._lift, step_m / dt_s
