"""Base class of simulated robots with a head that pans and tilts and a gripper of one or two fingers, or without."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydrake.systems.framework import Context

from plant.robots.command_table import HeadGoal, Part, Velocity
from plant.robots.commanded_robot import CommandedRobot
from plant.robots.robot_kind import RobotBody
from plant.robots.sensor_suite import SensorSuite
from plant.robots.servos import ActuatedJoints, GripperTolerances, gripper_set_point
from plant.sensors.proprioception import GripperNoise
from skills.robot import BaseKind, CommandState, FloatArray, GripperKind

_HEAD_ARRIVED_RAD, _HEAD_STILL_RAD_S = 0.01, 0.05
_HEAD_SPEED_SHARE = 0.8
"""Share of the head's top speed that its weak motors can follow."""
_TOLERANCES = {
    GripperKind.PARALLEL: GripperTolerances(arrived=0.002, stall_rate=0.004),
    GripperKind.HINGED: GripperTolerances(arrived=0.03, stall_rate=0.03),
}
_NOISES = {GripperKind.PARALLEL: GripperNoise(opening=0.0003, closed=0.004), GripperKind.HINGED: GripperNoise()}
_MOVES = {GripperKind.PARALLEL: 0.004, GripperKind.HINGED: 0.05}
"""Rates of fingers (m/s, rad/s) beyond which they feel no force."""
FINGER_GAINS = {GripperKind.PARALLEL: (2e4, 200.0), GripperKind.HINGED: (60.0, 0.8)}
"""Gains (p, d) of the fingers' servos."""


class JointIndex(ActuatedJoints):
    """Joints of head, arm and fingers by the robot's capabilities; `shares` are how far fingers go for an opening."""

    def __init__(self, body: RobotBody, speeds: Mapping[str, float]) -> None:
        """`speeds` are the limits of joints (rad/s, m/s) by name."""
        super().__init__(body.plant, body.instance)
        can = body.kind.capabilities()
        fingers = () if can.gripper is None else can.gripper.finger_joints
        self.head = self.numbers(() if can.head is None else can.head.joint_names)
        self.arm = self.numbers(() if can.arm is None else can.arm.joint_names)
        self.fingers, self.shares = self.numbers([name for name, _ in fingers]), np.array([each for _, each in fingers])
        self.kind = GripperKind.PARALLEL if can.gripper is None else can.gripper.kind
        self.lever = 1.0 if can.gripper is None or self.kind is GripperKind.PARALLEL else can.gripper.depth_m
        fastest = np.array([speeds.get(name, 0.0) for name in self.names])
        self.fastest_arm_rad_s, self.head_rad_s = fastest[self.arm], _HEAD_SPEED_SHARE * fastest[self.head]
        self.finger_rates = fastest[self.fingers]

    def opening(self, joints: FloatArray) -> float:
        """Opening of the gripper for joint positions, or its rate for joint rates. 0 without a gripper."""
        return float(np.mean(joints[self.fingers] / self.shares)) if len(self.shares) else 0.0


class JointedSensors(SensorSuite):
    """Sensors of a robot whose fingers slide or turn."""

    _index: JointIndex

    def _gripper_feels(self, positions: FloatArray, rates: FloatArray, efforts: FloatArray) -> tuple[float, float]:
        """Opening of the gripper, and the force of each finger on an object between them."""
        index = self._index
        opening, fingers = index.opening(positions), index.fingers
        if not len(fingers) or float(np.abs(rates[fingers]).max()) > _MOVES[index.kind]:
            return opening, 0.0
        return opening, max(0.0, -float((efforts[fingers] * np.sign(index.shares)).mean())) / index.lever


class JointedRobot(CommandedRobot, saved=("_finger_goals", "_head", "_head_goal")):
    """Robot with a head that pans and tilts, and a gripper of one or two fingers, or without them."""

    _index: JointIndex

    def __init__(self, body: RobotBody, index: JointIndex, sensors: SensorSuite, context: Context) -> None:
        """Takes over the robot at the state of the plant's `context`, at time 0."""
        super().__init__(body, index, sensors, context, _TOLERANCES[index.kind])
        joints = self._joints()
        self._finger_goals = joints[index.fingers]
        self._head = self._head_goal = joints[index.head]

    def _fingers_at(self, joints: FloatArray, rates: FloatArray) -> tuple[float, float]:
        index = self._index
        return index.opening(joints), abs(index.opening(rates))

    def _desired(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> FloatArray:
        self._follow_head(joints, rates)
        desired = np.zeros(2 * len(joints))
        self._set_fingers(desired, joints[self._index.fingers], dt_s)
        self._ramp_head(desired, dt_s)
        return desired

    def _hold_still(self, part: Part) -> None:
        super()._hold_still(part)
        if part is Part.HEAD:
            self._head_goal = self._head

    def _drive_refusal(self, velocity: Velocity) -> str | None:
        if velocity.vy == 0.0 or self._capabilities.base_kind is BaseKind.OMNIDIRECTIONAL:
            return None
        return f"drive: two wheels cannot drive sideways, as {velocity.vy:.2f} m/s asks for"

    def _follow_head(self, joints: FloatArray, rates: FloatArray) -> None:
        goal, head = self._goal(Part.HEAD, HeadGoal), self._index.head
        if goal is None:
            return
        self._head_goal = np.array(goal.angles_rad)
        there = float(np.abs(joints[head] - self._head_goal).max()) < _HEAD_ARRIVED_RAD
        if there and float(np.abs(rates[head]).max()) < _HEAD_STILL_RAD_S:
            self._commands.finish(Part.HEAD, CommandState.DONE)

    def _set_fingers(self, desired: FloatArray, now: FloatArray, dt_s: float) -> None:
        """Sets the set points of the fingers, at their speed and with at most the goal's force."""
        goal, index = self._gripper.goal, self._index
        most = index.finger_rates * dt_s
        moved = self._finger_goals + np.clip(goal.opening * index.shares - self._finger_goals, -most, most)
        lead = goal.force_n * index.lever / FINGER_GAINS[index.kind][0]
        pairs = zip(moved.tolist(), now.tolist(), strict=True)
        self._finger_goals = np.array([gripper_set_point(*pair, lead) for pair in pairs])
        desired[index.fingers] = self._finger_goals

    def _ramp_head(self, desired: FloatArray, dt_s: float) -> None:
        index = self._index
        most_rad = index.head_rad_s * dt_s
        step_rad = np.clip(self._head_goal - self._head, -most_rad, most_rad)
        self._head = self._head + step_rad
        desired[index.head], desired[index.rates_of(index.head)] = self._head, step_rad / dt_s


def gripper_noise(body: RobotBody) -> GripperNoise:
    """Noise of the gripper's readings, by the unit of its opening."""
    gripper = body.kind.capabilities().gripper
    return _NOISES[GripperKind.PARALLEL if gripper is None else gripper.kind]
