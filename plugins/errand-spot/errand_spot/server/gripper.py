"""Motions of the gripper."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from bosdyn.api import basic_command_pb2, gripper_command_pb2

from errand_spot.messages import InvalidRequestError, points_of
from errand_spot.server.computer import Computer
from errand_spot.server.refusals import times_of
from plant.robots.spot.description import spot_facts
from skills.robot import CommandState

Status: Final = basic_command_pb2.RobotCommandFeedbackStatus
_OPENS, _SLACK_RAD = 0.05, 0.02


class Claw:
    """Opens or closes the gripper. Its feedback is replaced whole."""

    _command: Any

    def __init__(self, request: Any, widest: float, most_force_n: float, now_s: float) -> None:
        """Takes a trajectory of angles at times: 0 closed, negative open (rad)."""
        field = "claw_gripper_command.trajectory"
        angles = [each.point for each in points_of(request.trajectory, field)]
        for angle in angles:
            if not -widest - _SLACK_RAD <= angle <= _SLACK_RAD:
                raise InvalidRequestError(f"{field}.point is {angle:.3f}; it must be {-widest:.3f} to 0")
        self._times_s, self._begun_s = [0.0, *times_of(request.trajectory, now_s, field)], 0.0
        self._openings = [0.0, *(min(max(-angle, 0.0), widest) for angle in angles)]
        torque = request.maximum_torque.value if request.HasField("maximum_torque") else 5.5
        force = torque / float(spot_facts()["gripper"]["tip_radius"])
        self._force_n = min(max(force, 1.0), most_force_n)
        self.status: int = Status.STATUS_PROCESSING
        self._command, self._given = None, -1.0
        self.feedback = self._made(gripper_command_pb2.ClawGripperCommand.Feedback.STATUS_IN_PROGRESS)

    def begin(self, computer: Computer) -> None:
        """Starts to move. A gripper that opens holds nothing, whatever clients have said."""
        self._openings[0], self._begun_s = computer.snapshot.gripper.opening, computer.clock.now()
        if max(self._openings) > self._openings[0] + _OPENS:
            computer.grip.holding = None
        self._move(computer)

    def _move(self, computer: Computer) -> bool:
        """Moves on in time; returns whether it moves to the last angle."""
        since_s, until_s = computer.clock.now() - self._begun_s, computer.forever()
        goal = self._openings[-1] if since_s >= self._times_s[-1] else np.interp(since_s, self._times_s, self._openings)
        if goal != self._given:
            self._given, force_n = float(goal), self._force_n
            self._command = computer.robot.set_gripper(self._given, force_n, until_s=until_s, lease=computer.lease)
        return since_s >= self._times_s[-1]

    def tick(self, computer: Computer) -> None:
        """Reports whether the gripper is at its goal, or presses on an object."""
        if self._command is None or self.status != Status.STATUS_PROCESSING or not self._move(computer):
            return
        part = gripper_command_pb2.ClawGripperCommand.Feedback
        status = computer.robot.command_status(self._command)
        if status.state is CommandState.DONE:
            self.feedback = self._made(part.STATUS_APPLYING_FORCE if status.reason else part.STATUS_AT_GOAL)
        elif status.state is not CommandState.RUNNING:
            self.feedback = self._made(part.STATUS_UNKNOWN)

    def end(self, status: int) -> None:
        """Ends it with a status."""
        self.status = status
        self.feedback = self._made(self.feedback.claw_gripper_feedback.status)

    def _made(self, status: int) -> Any:
        made = gripper_command_pb2.GripperCommand.Feedback(status=self.status)
        made.claw_gripper_feedback.status = status
        return made
