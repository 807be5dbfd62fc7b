"""The simulated Fetch behind the Robot protocol."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context

from plant.control.command_table import Part
from plant.control.robot import CommandedRobot
from plant.control.servos import GripperTolerances, gripper_set_point
from plant.fetch.model import FINGER_GAIN_N_M, FetchModel, JointIndex
from plant.fetch.sensing import FetchSensors, axle
from plant.fetch.wheels import WheelServos
from plant.models.fetch.description import fetch_facts
from skills.robot import CommandId, CommandState, FloatArray, Lease

_GRIPPER_TOLERANCES = GripperTolerances(arrived=0.002, stall_rate=0.004)
_LIFT_ARRIVED_M = 0.01
_HEAD_ARRIVED_RAD, _HEAD_STILL_RAD_S = 0.01, 0.05
_HEAD_SPEED_SHARE = 0.8
"""Of the head's top speed, so that its weak motors follow."""


@dataclass(frozen=True)
class _Wanted:
    """A velocity of the base: m/s ahead, rad/s."""

    speed_m_s: float
    turn_rate_rad_s: float


@dataclass(frozen=True)
class _HeadGoal:
    angles_rad: tuple[float, float]


@dataclass(frozen=True)
class _LiftGoal:
    height_m: float


class FetchRobot(CommandedRobot, keeps=("_fingers_m", "_wheels", "_head", "_head_goal", "_lift", "_lift_goal")):
    """One Fetch: takes commands under a lease and turns them into set points of the plant's servos."""

    _index: JointIndex

    def __init__(self, model: FetchModel, sensors: FetchSensors, context: Context) -> None:
        """Takes over the robot as it stands in the plant's `context` at time 0."""
        super().__init__(model, model.index(), sensors, context, _GRIPPER_TOLERANCES)
        self._encoders, index, joints = sensors, self._index, self._joints()
        self._fingers_m = joints[index.fingers]
        self._wheels = WheelServos(axle(), joints[index.wheels], model.limits)
        self._head = self._head_goal = joints[index.head]
        self._lift = self._lift_goal = float(joints[index.lift])
        facts = fetch_facts()
        self._lift_down_m, self._lift_m_s = facts["lift"]["height"], facts["lift"]["velocity"]
        self._head_rad_s = _HEAD_SPEED_SHARE * np.array([part["velocity"] for part in facts["head"]])
        self._finger_m_s = facts["finger"]["velocity"]

    # -- act ------------------------------------------------------------------------------------------------------

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a speed ahead (m/s) and a turn rate (rad/s) until the clock reads until_s; never sideways."""
        if not all(math.isfinite(value) for value in (vx, vy, wz)):
            return self._commands.refuse(f"drive: velocity ({vx}, {vy}, {wz}) is not finite")
        if vy != 0.0:
            return self._commands.refuse(f"drive: two wheels cannot drive sideways, as {vy:.2f} m/s asks for")
        return self._begin(Part.VELOCITY, _Wanted(vx, wz), until_s, lease)

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

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turns the head to a pan (positive to the left) and a tilt (positive looks down)."""
        head = self._capabilities.head
        assert head is not None
        (left, right), (up, down) = head.pan_range_rad, head.tilt_range_rad
        if not (left <= pan_rad <= right and up <= tilt_rad <= down):
            return self._commands.refuse(
                f"point_head: pan {pan_rad:.2f} rad must lie in [{left}, {right}] "
                f"and tilt {tilt_rad:.2f} rad in [{up}, {down}]"
            )
        return self._begin(Part.HEAD, _HeadGoal((pan_rad, tilt_rad)), until_s, lease)

    # -- inside ---------------------------------------------------------------------------------------------------

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
        active = self._commands.running(Part.VELOCITY)
        wanted = active.payload if active is not None and isinstance(active.payload, _Wanted) else _Wanted(0.0, 0.0)
        velocity = (wanted.speed_m_s, wanted.turn_rate_rad_s)
        self._wheels.follow(velocity, joints[self._index.wheels], dt_s, stopping=active is None)

    def _follow_lift(self, joints: FloatArray) -> None:
        active = self._commands.running(Part.POSTURE)
        if active is None or not isinstance(active.payload, _LiftGoal):
            return
        self._lift_goal = active.payload.height_m - self._lift_down_m
        if abs(float(joints[self._index.lift]) - self._lift_goal) < _LIFT_ARRIVED_M:
            self._commands.finish(Part.POSTURE, CommandState.DONE)

    def _follow_head(self, joints: FloatArray, rates: FloatArray) -> None:
        active, head = self._commands.running(Part.HEAD), self._index.head
        if active is None or not isinstance(active.payload, _HeadGoal):
            return
        self._head_goal = np.array(active.payload.angles_rad)
        there = float(np.abs(joints[head] - self._head_goal).max()) < _HEAD_ARRIVED_RAD
        if there and float(np.abs(rates[head]).max()) < _HEAD_STILL_RAD_S:
            self._commands.finish(Part.HEAD, CommandState.DONE)

    def _fingers(self, desired: FloatArray, now_m: FloatArray, dt_s: float) -> None:
        """Sets points of the fingers: they go at their speed, and push with no more than the goal's force."""
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
