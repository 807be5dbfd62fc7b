"""The simulated Fetch behind the Robot protocol, and its sensors: wheel odometry, planar LiDAR, head camera."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.robots.command_table import HeadGoal, Part, Velocity
from plant.robots.commanded_robot import CommandedRobot
from plant.robots.fetch.description import (
    HAND_LINK,
    HEAD_CAMERA,
    HEAD_JOINTS,
    HEAD_LINK,
    LIFT_JOINT,
    arm_joint_names,
    fetch_facts,
    head_camera,
)
from plant.robots.fetch.model import FINGER_GAIN_N_M, FetchModel, JointIndex
from plant.robots.fetch.wheels import Axle, WheelOdometer, WheelServos
from plant.robots.robot_kind import SensorOptions
from plant.robots.servos import GripperTolerances, gripper_set_point
from plant.sensors.lidar import LidarSpec
from plant.sensors.proprioception import GripperNoise
from plant.sensors.suite import LidarMount, SensorSuite
from skills.robot import CommandId, CommandState, FloatArray, Lease

_GRIPPER_MOVES_M_S = 0.004
_GRIPPER_NOISE = GripperNoise(opening=0.0003, closed=0.004)
_LIDAR_SIGMA_M = 0.015


def axle() -> Axle:
    """Axle of Fetch's driven wheels."""
    wheel = fetch_facts()["wheel"]
    return Axle(wheel["radius"], wheel["offset"][1])


class FetchSensors(SensorSuite, saved=("_odometer",)):
    """Sensors of one Fetch."""

    def __init__(self, model: FetchModel, joints: JointIndex, options: SensorOptions) -> None:
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
            gripper_noise=_GRIPPER_NOISE,
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

    def _gripper_feels(self, positions: FloatArray, rates: FloatArray, efforts: FloatArray) -> tuple[float, float]:
        """Distance between the fingers, and the force of each finger on an object between them."""
        fingers = self._joints.fingers
        opening = float(positions[fingers].sum())
        if float(np.abs(rates[fingers]).max()) > _GRIPPER_MOVES_M_S:
            return opening, 0.0
        return opening, max(0.0, -float(efforts[fingers].mean()))

    def _X_BL(self) -> RigidTransform:
        """Pose of the LiDAR, which stays with the base when the lift moves the body frame."""
        height_m = fetch_facts()["lift"]["height"] + self.joints.position_rad[LIFT_JOINT]
        return RigidTransform(self._p_BaseL - [0.0, 0.0, height_m])

    def _frames_of_links(self) -> Mapping[str, tuple[str, RigidTransform]]:
        X_BH, X_BHead = self._X_BLinks((*arm_joint_names(), *HEAD_JOINTS), (HAND_LINK, HEAD_LINK))
        return {HAND_LINK: ("hand", X_BH), HEAD_LINK: ("head", X_BHead)}


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


_GRIPPER_TOLERANCES = GripperTolerances(arrived=0.002, stall_rate=0.004)
_LIFT_ARRIVED_M = 0.01
_HEAD_ARRIVED_RAD, _HEAD_STILL_RAD_S = 0.01, 0.05
_HEAD_SPEED_SHARE = 0.8
"""Share of the head's top speed that its weak motors can follow."""


@dataclass(frozen=True)
class _LiftGoal:
    height_m: float


class FetchRobot(CommandedRobot, saved=("_fingers_m", "_wheels", "_head", "_head_goal", "_lift", "_lift_goal")):
    """One Fetch: turns the commands of the lease's holder into set points of the plant's servos."""

    _index: JointIndex

    def __init__(self, model: FetchModel, options: SensorOptions) -> None:
        """Takes over the robot at the state of `options.context`, at time 0."""
        index = JointIndex(model.plant, model.instance)
        self._encoders = FetchSensors(model, index, options)
        super().__init__(model, index, self._encoders, options.context, _GRIPPER_TOLERANCES)
        joints = self._joints()
        self._fingers_m = joints[index.fingers]
        self._wheels = WheelServos(axle(), joints[index.wheels], model.limits)
        self._head = self._head_goal = joints[index.head]
        self._lift = self._lift_goal = float(joints[index.lift])
        facts = fetch_facts()
        self._lift_down_m, self._lift_m_s = facts["lift"]["height"], facts["lift"]["velocity"]
        self._head_rad_s = _HEAD_SPEED_SHARE * np.array([part["velocity"] for part in facts["head"]])
        self._finger_m_s = facts["finger"]["velocity"]

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
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, "the robot lowers its torso")
        return command

    # -- inside ---------------------------------------------------------------------------------------------------

    def _drive_refusal(self, velocity: Velocity) -> str | None:
        if velocity.vy == 0.0:
            return None
        return f"drive: two wheels cannot drive sideways, as {velocity.vy:.2f} m/s asks for"

    def _fingers_at(self, joints: FloatArray, rates: FloatArray) -> tuple[float, float]:
        fingers = self._index.fingers
        return float(joints[fingers].sum()), float(np.abs(rates[fingers]).sum())

    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        index = self._index
        self._encoders.count_wheels(joints[index.wheels])
        self._follow_drive(joints, dt_s)
        self._follow_lift(joints)
        self._follow_head(joints, rates)
        desired = np.zeros(2 * len(joints))
        desired[index.wheels], desired[index.rates_of(index.wheels)] = self._wheels.goal_rad, self._wheels.rate_rad_s
        self._fingers(desired, joints[index.fingers], dt_s)
        self._ramp_lift_and_head(desired, dt_s)
        return desired

    def _hold_still(self, part: Part) -> None:
        super()._hold_still(part)
        if part is Part.POSTURE:
            self._lift_goal = self._lift
        if part is Part.HEAD:
            self._head_goal = self._head

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

    def _follow_head(self, joints: FloatArray, rates: FloatArray) -> None:
        goal, head = self._goal(Part.HEAD, HeadGoal), self._index.head
        if goal is None:
            return
        self._head_goal = np.array(goal.angles_rad)
        there = float(np.abs(joints[head] - self._head_goal).max()) < _HEAD_ARRIVED_RAD
        if there and float(np.abs(rates[head]).max()) < _HEAD_STILL_RAD_S:
            self._commands.finish(Part.HEAD, CommandState.DONE)

    def _fingers(self, desired: FloatArray, now_m: FloatArray, dt_s: float) -> None:
        """Sets the set points of the fingers, at their speed and with at most the goal's force."""
        goal, most_m = self._gripper.goal, self._finger_m_s * dt_s
        self._fingers_m = self._fingers_m + np.clip(goal.opening / 2.0 - self._fingers_m, -most_m, most_m)
        lead_m = goal.force_n / FINGER_GAIN_N_M
        self._fingers_m = np.array(
            [gripper_set_point(*pair, lead_m) for pair in zip(self._fingers_m.tolist(), now_m.tolist(), strict=True)]
        )
        desired[self._index.fingers] = self._fingers_m

    def _ramp_lift_and_head(self, desired: FloatArray, dt_s: float) -> None:
        index, most_m, most_rad = self._index, self._lift_m_s * dt_s, self._head_rad_s * dt_s
        step_m = min(max(self._lift_goal - self._lift, -most_m), most_m)
        step_rad = np.clip(self._head_goal - self._head, -most_rad, most_rad)
        self._lift, self._head = self._lift + step_m, self._head + step_rad
        desired[index.lift], desired[len(index.names) + index.lift] = self._lift, step_m / dt_s
        desired[index.head], desired[index.rates_of(index.head)] = self._head, step_rad / dt_s
