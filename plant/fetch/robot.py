"""The simulated Fetch behind the Robot protocol."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context

from plant.control.arm import ArmServos
from plant.control.commands import Part
from plant.control.gripper import Closing, GripperServo, GripperTolerances, gripper_set_point
from plant.control.robot import CommandedRobot
from plant.fetch.capabilities import fetch_capabilities
from plant.fetch.model import FINGER_GAIN_N_M, FetchModel
from plant.fetch.sensing import FetchSensors, axle
from plant.fetch.wheels import WheelServos
from plant.kept import State
from plant.models.fetch.description import fetch_facts
from skills.robot import ArmTrajectory, CommandId, CommandState, FloatArray, Lease

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


class FetchRobot(CommandedRobot):
    """One Fetch: takes commands under a lease and turns them into set points of the plant's servos."""

    def __init__(self, model: FetchModel, sensors: FetchSensors, context: Context) -> None:
        """Take over the robot as it stands in the plant's `context` at time 0."""
        super().__init__(model.name, fetch_capabilities(), sensors)
        self._model, self._context, self._encoders = model, context, sensors
        self._index = index = model.index()
        joints = self._joint_positions()
        self._arm = ArmServos(index, index.arm, index.fastest_arm_rad_s, joints)
        self._gripper = GripperServo(float(joints[index.fingers].sum()), _GRIPPER_TOLERANCES)
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
        """Drive at a speed ahead (m/s) and a turn rate (rad/s) until the clock reads until_s; never sideways."""
        if not all(math.isfinite(value) for value in (vx, vy, wz)):
            return self._commands.refuse(f"drive: velocity ({vx}, {vy}, {wz}) is not finite")
        if vy != 0.0:
            return self._commands.refuse(f"drive: two wheels cannot drive sideways, as {vy:.2f} m/s asks for")
        return self._begin(Part.VELOCITY, _Wanted(vx, wz), until_s, lease)

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Lift the torso until the body frame is at a height above the floor; it does not pitch."""
        low, high = self._capabilities.height_range_m
        if not (low <= height_m <= high and pitch_rad == 0.0):
            return self._commands.refuse(
                f"stand: height {height_m:.2f} m must lie in [{low:.2f}, {high:.2f}] "
                f"and pitch {pitch_rad:.2f} rad must be 0"
            )
        return self._begin(Part.POSTURE, _LiftGoal(height_m), until_s, lease)

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lower the torso; driving stops."""
        command = self._begin(Part.POSTURE, _LiftGoal(self._capabilities.height_range_m[0]), until_s, lease)
        if self._runs(command):
            self._commands.finish(Part.VELOCITY, CommandState.STOPPED, "the robot lowers its torso")
        return command

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follow a joint trajectory; done when its end is reached and the arm is still."""
        reason = self._arm.refusal(trajectory)
        return self._commands.refuse(reason) if reason else self._begin(Part.ARM, trajectory, until_s, lease)

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turn the head to a pan (positive to the left) and a tilt (positive looks down)."""
        head = self._capabilities.head
        assert head is not None
        (left, right), (up, down) = head.pan_range_rad, head.tilt_range_rad
        if not (left <= pan_rad <= right and up <= tilt_rad <= down):
            return self._commands.refuse(
                f"point_head: pan {pan_rad:.2f} rad must lie in [{left}, {right}] "
                f"and tilt {tilt_rad:.2f} rad in [{up}, {down}]"
            )
        return self._begin(Part.HEAD, _HeadGoal((pan_rad, tilt_rad)), until_s, lease)

    # -- called by the simulation ---------------------------------------------------------------------------------

    def control(self, now_s: float, dt_s: float) -> None:
        """Command all servos for the next dt_s of simulated time."""
        self._now_s = now_s
        self._expire()
        plant, index, joints = self._model.plant, self._index, self._joint_positions()
        rates = plant.GetVelocities(self._context)[index.velocities]
        self._encoders.count_wheels(joints[index.wheels])
        self._follow_up(joints, rates, dt_s)
        desired = np.zeros(2 * len(joints))
        desired[index.arm], desired[index.rates_of(index.arm)] = self._arm.goal_rad, self._arm.rate_rad_s
        desired[index.wheels], desired[index.rates_of(index.wheels)] = self._wheels.goal_rad, self._wheels.rate_rad_s
        self._fingers(desired, joints[index.fingers], dt_s)
        self._ramp_lift_and_head(desired, dt_s)
        gravity = plant.CalcGravityGeneralizedForces(self._context)[index.velocities]
        instance = self._model.instance
        plant.get_desired_state_input_port(instance).FixValue(self._context, desired)
        feed_forward = np.minimum(np.maximum(-gravity, -index.efforts), index.efforts)
        plant.get_actuation_input_port(instance).FixValue(self._context, feed_forward)

    def state(self) -> State:
        """What the robot itself keeps: servos and sensors. Commands and leases do not outlive its computer."""
        return {
            "arm_hold": None if self._commands.running(Part.ARM) is not None else self._arm.goal_rad.tolist(),
            "gripper": self._gripper.state(),
            "fingers": self._fingers_m.tolist(),
            "wheels": self._wheels.state(),
            "head": [self._head.tolist(), self._head_goal.tolist()],
            "lift": [self._lift, self._lift_goal],
            "sensors": self._sensors.state(),
        }

    def restore(self, state: State, now_s: float) -> None:
        """Power up in such a state: nobody has the lease, no command runs, the gripper keeps its clamp.

        An arm that was moving holds where it is; a base that was moving slows down.
        """
        self._forget_commands(now_s)
        self._arm.restore(state["arm_hold"], self._joint_positions())
        self._gripper.restore(state["gripper"])
        self._fingers_m = np.array(state["fingers"])
        self._wheels.restore(state["wheels"])
        self._head, self._head_goal = (np.array(angles) for angles in state["head"])
        self._lift, self._lift_goal = state["lift"]
        self._sensors.restore(state["sensors"], now_s)

    # -- inside ---------------------------------------------------------------------------------------------------

    def _hold_still(self, part: Part) -> None:
        """Make where a part is the place where it stays; a gripper that clamps something goes on clamping."""
        index, joints = self._index, self._joint_positions()
        if part is Part.ARM:
            self._arm.hold(joints)
        if part is Part.GRIPPER:
            rates = self._model.plant.GetVelocities(self._context)[index.velocities]
            self._gripper.halt(float(joints[index.fingers].sum()), float(np.abs(rates[index.fingers]).sum()))
        if part is Part.POSTURE:
            self._lift_goal = self._lift
        if part is Part.HEAD:
            self._head_goal = self._head

    def _follow_up(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> None:
        self._follow_drive(joints, dt_s)
        self._follow_arm(joints, rates)
        self._follow_gripper(joints, rates, dt_s)
        self._follow_lift(joints)
        self._follow_head(joints, rates)

    def _follow_drive(self, joints: FloatArray, dt_s: float) -> None:
        active = self._commands.running(Part.VELOCITY)
        wanted = active.payload if active is not None and isinstance(active.payload, _Wanted) else _Wanted(0.0, 0.0)
        velocity = (wanted.speed_m_s, wanted.turn_rate_rad_s)
        self._wheels.follow(velocity, joints[self._index.wheels], dt_s, stopping=active is None)

    def _follow_arm(self, joints: FloatArray, rates: FloatArray) -> None:
        active = self._commands.running(Part.ARM)
        trajectory = active.payload if active is not None and isinstance(active.payload, ArmTrajectory) else None
        elapsed_s = 0.0 if active is None else self._now_s - active.since_s
        if self._arm.follow(trajectory, elapsed_s, joints, rates):
            self._commands.finish(Part.ARM, CommandState.DONE)

    def _follow_gripper(self, joints: FloatArray, rates: FloatArray, dt_s: float) -> None:
        fingers = self._index.fingers
        closing = self._gripper.follow(float(joints[fingers].sum()), float(np.abs(rates[fingers]).sum()), dt_s)
        if closing is not Closing.MOVING:
            reason = "" if closing is Closing.ARRIVED else "stopped by an object in the gripper"
            self._commands.finish(Part.GRIPPER, CommandState.DONE, reason)

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
        """Set points of the fingers: they go at their speed, and push with no more than the goal's force."""
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

    def _joint_positions(self) -> FloatArray:
        positions: FloatArray = self._model.plant.GetPositions(self._context)[self._index.positions]
        return positions
