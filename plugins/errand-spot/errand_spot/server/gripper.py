"""Motions of the gripper."""

from __future__ import annotations

from typing import Any, Final

from bosdyn.api import gripper_command_pb2

from errand_spot.messages import finite, points_of
from errand_spot.server.arm import Status
from errand_spot.server.computer import Computer
from plant.robots.spot.description import spot_facts
from skills.robot import CommandState

_OPENS: Final = 0.05


class Claw:
    """Opens or closes the gripper. Its feedback is replaced whole."""

    def __init__(self, request: Any, widest: float, most_force_n: float) -> None:
        """Takes a trajectory of angles, of which the last is the goal: 0 closed, negative open (rad)."""
        points = points_of(request.trajectory, "claw_gripper_command.trajectory")
        goal = finite(points[-1].point, "claw_gripper_command.trajectory.point")
        self._opening = min(max(-goal, 0.0), widest)
        torque = request.maximum_torque.value if request.HasField("maximum_torque") else 5.5
        force = finite(torque, "claw_gripper_command.maximum_torque") / float(spot_facts()["gripper"]["tip_radius"])
        self._force_n = min(max(force, 1.0), most_force_n)
        self.status: int = Status.STATUS_PROCESSING
        self._command: Any = None
        self.feedback = self._made(gripper_command_pb2.ClawGripperCommand.Feedback.STATUS_IN_PROGRESS)

    def begin(self, computer: Computer) -> None:
        """Starts to move. A gripper that opens holds nothing, whatever clients have said."""
        if self._opening > computer.snapshot.gripper.opening + _OPENS:
            computer.grip.holding = None
        until_s = computer.forever()
        self._command = computer.robot.set_gripper(self._opening, self._force_n, until_s=until_s, lease=computer.lease)

    def tick(self, computer: Computer) -> None:
        """Reports whether the gripper is at its goal, or presses on an object."""
        if self._command is None or self.status != Status.STATUS_PROCESSING:
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
