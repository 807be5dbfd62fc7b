"""Answers of the API to commands, as states and causes of the Robot protocol."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from bosdyn.api import arm_command_pb2, basic_command_pb2, gripper_command_pb2, robot_command_pb2

from skills.robot import CommandCause, CommandState, CommandStatus

Answer = robot_command_pb2.RobotCommandResponse
Progress = basic_command_pb2.RobotCommandFeedbackStatus
CAUSES: Final[Mapping[int, CommandCause]] = {
    Answer.STATUS_INVALID_REQUEST: CommandCause.INVALID,
    Answer.STATUS_UNSUPPORTED: CommandCause.UNSUPPORTED,
    Answer.STATUS_EXPIRED: CommandCause.LATE,
    Answer.STATUS_TOO_DISTANT: CommandCause.INVALID,
    Answer.STATUS_NOT_POWERED_ON: CommandCause.UNPOWERED,
    Answer.STATUS_BEHAVIOR_FAULT: CommandCause.FAULT,
    Answer.STATUS_UNKNOWN_FRAME: CommandCause.INVALID,
}
"""Causes by the answer to a command; any other answer is a refusal."""


def status_of(feedback: Any, part: str) -> CommandStatus:
    """The protocol's status of the part of a command, by its feedback."""
    field = {"arm": "arm_command_feedback", "gripper": "gripper_command_feedback"}.get(
        part, "mobility_command_feedback"
    )
    given = getattr(feedback, field)
    if given.status == Progress.STATUS_COMMAND_TIMED_OUT:
        return CommandStatus(CommandState.DONE)
    if given.status == Progress.STATUS_COMMAND_OVERRIDDEN:
        return CommandStatus(CommandState.STOPPED, "replaced by another command", CommandCause.STOPPED)
    if given.status == Progress.STATUS_ROBOT_FROZEN:
        return CommandStatus(CommandState.STOPPED, "the robot is frozen", CommandCause.STOPPED)
    if part == "arm":
        return _arm_status(given)
    if part == "gripper":
        part_status, Claw = given.claw_gripper_feedback.status, gripper_command_pb2.ClawGripperCommand.Feedback
        if part_status == Claw.STATUS_AT_GOAL:
            return CommandStatus(CommandState.DONE)
        if part_status == Claw.STATUS_APPLYING_FORCE:
            return CommandStatus(CommandState.DONE, "stopped by an object in the gripper")
        return CommandStatus(CommandState.RUNNING)
    standing = given.stand_feedback.status == basic_command_pb2.StandCommand.Feedback.STATUS_IS_STANDING
    sitting = given.sit_feedback.status == basic_command_pb2.SitCommand.Feedback.STATUS_IS_SITTING
    return CommandStatus(CommandState.DONE if standing or sitting else CommandState.RUNNING)


def _arm_status(given: Any) -> CommandStatus:
    Move = arm_command_pb2.ArmJointMoveCommand.Feedback
    moved = given.arm_joint_move_feedback
    if given.HasField("arm_stop_feedback") or moved.status == Move.STATUS_COMPLETE:
        return CommandStatus(CommandState.DONE)
    if moved.status == Move.STATUS_STALLED:
        return CommandStatus(CommandState.STOPPED, "the arm is stalled", CommandCause.BLOCKED)
    return CommandStatus(CommandState.RUNNING)
