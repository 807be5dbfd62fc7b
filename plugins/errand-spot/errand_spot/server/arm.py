"""Motions of the arm's joints: joint moves, named postures, stop. `ArmMotion` is the base of those of the hand, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Final

import numpy as np
from bosdyn.api import arm_command_pb2, basic_command_pb2
from scipy.interpolate import PchipInterpolator

from errand_spot.messages import InvalidRequestError, duration, points_of
from errand_spot.server.computer import Computer, Solver
from errand_spot.server.refusals import soon, times_of
from skills.robot import ArmTrajectory, CommandState, FloatArray

Status = basic_command_pb2.RobotCommandFeedbackStatus
JOINTS: Final = ("sh0", "sh1", "el0", "el1", "wr0", "wr1")
READY_RAD: Final = (0.0, -0.9, 1.8, 0.0, -0.9, 0.0)
CARRY_RAD: Final = (0.0, -2.6, 2.2, 0.0, 0.4, 0.0)
"""Named postures of the arm; the robot's own are near these."""
USUAL_RAD_S: Final = 1.5
_FASTEST_RAD_S: Final = 3.6
_LEAST_S: Final = 0.2
_SETTLING_S, _STILL_RAD_S, _NEAR_RAD = 1.0, 0.05, 0.1
_SLACK_RAD: Final = 0.02
_STEPS: Final = 20
_SAMPLE_S: Final = 0.05


class ArmMotion:
    """Motion of the arm, with its feedback. Other threads read `feedback`, which is replaced whole."""

    field: ClassVar[str]
    """Field of the feedback."""
    going: ClassVar[int]
    complete: ClassVar[int]
    stalled: ClassVar[int]
    """Statuses within that field: before the goal, at it, and stalled."""

    def __init__(self) -> None:
        self.status: int = Status.STATUS_PROCESSING
        self.command: Any = None
        self._joints: Sequence[str] = ()
        self._goal_rad, self._ends_s = np.zeros(0), 0.0
        self.feedback = self._made(self.going)

    def begin(self, computer: Computer) -> None:
        """Starts it."""

    def tick(self, computer: Computer) -> None:
        """Reports whether the arm is at its goal, nearly there and held back by its load, or stalled."""
        if self.command is not None and self.status == Status.STATUS_PROCESSING:
            self.feedback = self._made(self._progress(computer))

    def _progress(self, computer: Computer) -> int:
        """Status within the field, by the robot's command status and its joints."""
        state, joints = computer.robot.command_status(self.command).state, computer.snapshot.joints
        if state is CommandState.DONE:
            return self.complete
        if state is not CommandState.RUNNING:
            return self.stalled
        moves = max(abs(joints.velocity_rad_s[name]) for name in self._joints) > _STILL_RAD_S
        if moves or computer.clock.now() - self._ends_s < _SETTLING_S:
            return self.going
        near = np.abs(computer.arm_rad(joints) - self._goal_rad).max() < _NEAR_RAD
        return self.complete if near else self.stalled

    def end(self, status: int) -> None:
        """Ends it with a status."""
        self.status = status
        made = arm_command_pb2.ArmCommand.Feedback()
        made.CopyFrom(self.feedback)
        made.status = status
        self.feedback = made

    def _made(self, progress: int) -> Any:
        """The message of a status within the field."""
        made = arm_command_pb2.ArmCommand.Feedback(status=self.status)
        getattr(made, self.field).status = progress
        return made

    def _follow(self, computer: Computer, times_s: Sequence[float], positions_rad: Sequence[FloatArray]) -> None:
        """Follows postures at times since now, slower where a joint would be too fast."""
        solver = computer.solver
        assert solver is not None
        trajectory = smooth(np.clip(computer.arm_rad(), solver.lower_rad, solver.upper_rad), times_s, positions_rad)
        assert computer.capabilities.arm is not None
        self._joints, self._goal_rad = computer.capabilities.arm.joint_names, trajectory.positions_rad[-1]
        self._ends_s = computer.clock.now() + float(trajectory.times_s[-1])
        until_s = computer.forever()
        self.command = computer.robot.move_arm(trajectory, until_s=until_s, lease=computer.lease)


def smooth(start_rad: FloatArray, times_s: Sequence[float], positions_rad: Sequence[FloatArray]) -> ArmTrajectory:
    """Returns a trajectory through postures at times; it is late where a joint would be too fast, then catches up.

    Between the postures it follows monotone cubic curves (Fritsch and Carlson, 1980).
    """
    times = np.maximum.accumulate([0.0, *times_s]) + 1e-4 * np.arange(len(times_s) + 1)
    postures = np.array([start_rad, *positions_rad])
    if len(times_s) == 1:  # eased in and out
        shares = np.linspace(0.0, 1.0, _STEPS + 1)
        eased = shares**2 * (3.0 - 2.0 * shares)
        sampled, samples = shares * times[-1], start_rad + np.outer(eased, postures[-1] - start_rad)
    else:
        sampled = np.linspace(0.0, times[-1], max(_STEPS, int(times[-1] / _SAMPLE_S)) + 1)
        samples = PchipInterpolator(times, postures)(sampled)
    passed_s = [0.0]
    needed_s = np.abs(np.diff(samples, axis=0)).max(axis=1) / _FASTEST_RAD_S + 1e-4
    for at_s, least_s in zip(sampled[1:], needed_s, strict=True):
        passed_s.append(max(at_s, passed_s[-1] + least_s))
    return ArmTrajectory(np.array(passed_s) * max(1.0, _LEAST_S / passed_s[-1]), samples)


class JointMove(ArmMotion):
    """Moves the joints through postures."""

    field = "arm_joint_move_feedback"
    complete = arm_command_pb2.ArmJointMoveCommand.Feedback.STATUS_COMPLETE
    going = arm_command_pb2.ArmJointMoveCommand.Feedback.STATUS_IN_PROGRESS
    stalled = arm_command_pb2.ArmJointMoveCommand.Feedback.STATUS_STALLED

    def __init__(self, request: Any, now_rad: FloatArray, now_s: float, solver: Solver) -> None:
        trajectory = request.trajectory
        points = points_of(trajectory, "arm_joint_move_command.trajectory")
        fastest = trajectory.maximum_velocity.value if trajectory.HasField("maximum_velocity") else USUAL_RAD_S
        given_s = times_of(trajectory, now_s, "arm_joint_move_command.trajectory")
        self._times_s, self._positions, before = list[float](), list[FloatArray](), now_rad
        self._slower = False
        limited = trajectory.HasField("maximum_velocity")
        timed = any(point.HasField("time_since_reference") for point in points)
        for point, at_s in zip(points, given_s, strict=True):
            goal = _joints(point.position, before, solver)
            fast_s = (self._times_s or [0.0])[-1] + 1.5 * float(np.abs(goal - before).max()) / fastest
            if not timed or (limited and at_s < fast_s):
                at_s, self._slower = fast_s, timed
            self._times_s.append(soon(at_s, "arm_joint_move_command.trajectory: a point"))
            self._positions.append(goal)
            before = goal
        while len(self._times_s) > 1 and self._times_s[0] <= 0.0:  # it is late: these have passed
            del self._times_s[0], self._positions[0]
        self._left_s = self._times_s[-1]
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to move."""
        self._follow(computer, self._times_s, self._positions)
        self._slower |= self._ends_s - computer.clock.now() > self._times_s[-1] + _LEAST_S

    def tick(self, computer: Computer) -> None:
        """Reports the state, and the time that is left."""
        self._left_s = max(self._ends_s - computer.clock.now(), 0.0)
        super().tick(computer)

    def _made(self, progress: int) -> Any:
        made, Part = super()._made(progress), arm_command_pb2.ArmJointMoveCommand.Feedback
        part = made.arm_joint_move_feedback
        part.planner_status = Part.PLANNER_STATUS_MODIFIED if self._slower else Part.PLANNER_STATUS_SUCCESS
        part.time_to_goal.CopyFrom(duration(self._left_s if progress == self.going else 0.0))
        return made


def _joints(message: Any, before: FloatArray, solver: Solver) -> FloatArray:
    """Joint angles of a message; omitted ones keep their value. Raises InvalidRequestError for one out of its range."""
    goal = before.copy()
    for k, (name, low, high) in enumerate(zip(JOINTS, solver.lower_rad, solver.upper_rad, strict=True)):
        if message.HasField(name):
            angle = getattr(message, name).value
            if not low - _SLACK_RAD <= angle <= high + _SLACK_RAD:
                raise InvalidRequestError(f"position.{name} is {angle:.3f} rad; it must be {low:.3f} to {high:.3f}")
            goal[k] = min(max(angle, low), high)
    return goal


class Named(ArmMotion):
    """Moves to a named posture: stow, ready or carry."""

    field = "named_arm_position_feedback"
    complete = arm_command_pb2.NamedArmPositionsCommand.Feedback.STATUS_COMPLETE
    going = arm_command_pb2.NamedArmPositionsCommand.Feedback.STATUS_IN_PROGRESS
    stalled = arm_command_pb2.NamedArmPositionsCommand.Feedback.STATUS_STALLED_HOLDING_ITEM

    def __init__(self, request: Any) -> None:
        names = arm_command_pb2.NamedArmPositionsCommand
        self._posture = {names.POSITIONS_READY: READY_RAD, names.POSITIONS_CARRY: CARRY_RAD}.get(request.position)
        if self._posture is None and request.position != names.POSITIONS_STOW:
            raise InvalidRequestError("named_arm_position_command.position is unknown")
        super().__init__()

    def begin(self, computer: Computer) -> None:
        """Starts to move, through the ready posture to fold or unfold; refuses to stow with an unstowable item."""
        if self._posture is None and not computer.grip.may_stow(computer.snapshot.gripper):
            self.feedback = self._made(self.stalled)
            return
        arm = computer.capabilities.arm
        assert arm is not None
        goal = np.array(self._posture or arm.stowed_rad)
        now = computer.arm_rad()
        middle = np.array([goal[0], -1.6, 2.3, 0.0, -0.7, 0.0])
        through = [middle, goal] if abs(now[2] - goal[2]) > 0.8 else [goal]
        ends = [1.5 * float(np.abs(b - a).max()) / USUAL_RAD_S for a, b in zip([now, *through], through, strict=False)]
        self._follow(computer, list(np.cumsum(ends)), through)


class ArmHalt(ArmMotion):
    """Holds the arm where it is."""

    field, going = "arm_stop_feedback", 0

    def begin(self, computer: Computer) -> None:
        """Holds the present posture."""
        now = computer.arm_rad()
        until_s = computer.clock.now() + 1.0
        computer.robot.move_arm(ArmTrajectory(np.array([0.1]), now[None]), until_s=until_s, lease=computer.lease)

    def _made(self, _progress: int) -> Any:
        made = arm_command_pb2.ArmCommand.Feedback(status=self.status)
        made.arm_stop_feedback.SetInParent()
        return made
