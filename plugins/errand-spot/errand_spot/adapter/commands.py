"""Commands as messages of the API, and the sent commands with their progress by the robot's feedback."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Final

import numpy as np
from bosdyn.api import (
    arm_command_pb2,
    basic_command_pb2,
    geometry_pb2,
    gripper_command_pb2,
    mobility_command_pb2,
    robot_command_pb2,
)
from bosdyn.api.docking import docking_pb2
from bosdyn.api.spot import door_pb2
from bosdyn.client.frame_helpers import BODY_FRAME_NAME
from bosdyn.client.robot_command import RobotCommandBuilder
from bosdyn.geometry import EulerZXY

from errand_spot.adapter.readings import TIP_RADIUS_M
from errand_spot.adapter.statuses import trouble
from skills.robot import ArmTrajectory, CommandCause, CommandId, CommandState, CommandStatus, DoorHandle, FloatArray

FASTEST_M_S, FASTEST_RAD_S = 0.8, 1.0
_FASTEST_JOINT_RAD_S, _FASTEST_JOINT_RAD_S2 = 2.5, 15.0
_MOST_POINTS: Final = 250
_REMEMBERED: Final = 1000
_MOBILITY: Final = {"base", "posture", "dock", "door"}
"""Parts that are one command of the robot."""
_JOINTS: Final = ("sh0", "sh1", "el0", "el1", "wr0", "wr1")
_DONE, _RUNNING = CommandStatus(CommandState.DONE), CommandStatus(CommandState.RUNNING)
_Feedback: Final = basic_command_pb2.RobotCommandFeedbackStatus.Status
_Stand: Final = basic_command_pb2.StandCommand.Feedback
_Sit: Final = basic_command_pb2.SitCommand.Feedback
_Claw: Final = gripper_command_pb2.ClawGripperCommand.Feedback
_Dock: Final = docking_pb2.DockingCommandFeedbackResponse
_Door: Final = door_pb2.DoorCommand.Feedback
_Move: Final = arm_command_pb2.ArmJointMoveCommand.Feedback


def mobility_params(raised_m: float, pitch_rad: float, padding_m: float | None) -> Any:
    """Returns mobility parameters: posture, limits of speed, and the robot's own avoidance of obstacles.

    The body is `raised_m` above its usual height. The robot keeps `padding_m` from obstacles (None: its default).
    """
    params = RobotCommandBuilder.mobility_params(body_height=raised_m, footprint_R_body=EulerZXY(pitch=pitch_rad))
    for limit, sign in ((params.vel_limit.max_vel, 1.0), (params.vel_limit.min_vel, -1.0)):
        limit.linear.x = limit.linear.y = sign * FASTEST_M_S
        limit.angular = sign * FASTEST_RAD_S
    params.obstacle_params.disable_vision_body_obstacle_avoidance = False
    if padding_m is not None:
        params.obstacle_params.obstacle_avoidance_padding = padding_m
    return params


def drive(velocity: tuple[float, float, float], end_s: float, params: Any) -> Any:
    """Returns the command of a body-frame velocity (m/s, m/s, rad/s), slower if it is too fast, until a robot time."""
    vx, vy, wz = velocity
    share = min(1.0, FASTEST_M_S / max(math.hypot(vx, vy), 1e-9))
    wz = min(max(wz, -FASTEST_RAD_S), FASTEST_RAD_S)
    made = RobotCommandBuilder.synchro_velocity_command(share * vx, share * vy, wz, params=params)
    given = made.synchronized_command.mobility_command.se2_velocity_request
    given.end_time.FromNanoseconds(round(end_s * 1e9))
    return made


def arm_move(trajectory: ArmTrajectory, start_s: float) -> Any:
    """Returns the command of an arm trajectory that starts at a robot time."""
    made = arm_command_pb2.ArmJointMoveCommand.Request()
    keep = np.unique(np.linspace(0, len(trajectory.times_s) - 1, _MOST_POINTS).astype(int))
    for time_s, q in zip(trajectory.times_s[keep], trajectory.positions_rad[keep], strict=True):
        point = made.trajectory.points.add()
        point.time_since_reference.FromNanoseconds(round(max(0.0, float(time_s)) * 1e9))
        for joint, value in zip(_JOINTS, q, strict=True):
            getattr(point.position, joint).value = float(value)
    made.trajectory.maximum_velocity.value = _FASTEST_JOINT_RAD_S
    made.trajectory.maximum_acceleration.value = _FASTEST_JOINT_RAD_S2
    made.trajectory.reference_time.FromNanoseconds(round(start_s * 1e9))
    command = robot_command_pb2.RobotCommand()
    command.synchronized_command.arm_command.arm_joint_move_command.CopyFrom(made)
    return command


def claw(opening_rad: float, force_n: float) -> Any:
    """Returns the command of an opening of the gripper with at most a force at its tip."""
    made = gripper_command_pb2.ClawGripperCommand.Request()
    made.trajectory.points.add(point=-opening_rad)
    made.maximum_torque.value = force_n * TIP_RADIUS_M
    command = robot_command_pb2.RobotCommand()
    command.synchronized_command.gripper_command.claw_gripper_command.CopyFrom(made)
    return command


def halt(part: str | None) -> Any:
    """Returns the command to stop the base, the arm, or (None) both; the gripper keeps its clamp force."""
    command = robot_command_pb2.RobotCommand()
    if part is None or part in _MOBILITY:
        stop = mobility_command_pb2.MobilityCommand.Request(stop_request=basic_command_pb2.StopCommand.Request())
        command.synchronized_command.mobility_command.CopyFrom(stop)
    if part in (None, "arm", "door"):
        command.synchronized_command.arm_command.arm_stop_command.SetInParent()
    return command


@dataclass
class Sent:
    """A sent command: its number at the robot, its part, its last known status, and its end (our clock).

    `path_rad` (K, joints) is the arm's planned path.
    """

    number: int
    part: str
    status: CommandStatus = _RUNNING
    until_s: float = math.inf
    path_rad: FloatArray = field(default_factory=lambda: np.zeros((0, len(_JOINTS))))


class SentCommands:
    """The sent commands by their ids; threads may share it."""

    def __init__(self) -> None:
        self._lock, self._next = Lock(), 1
        self._sent: dict[CommandId, Sent] = {}

    def add(self, sent: Sent) -> CommandId:
        """Adds a command; it replaces the one of its part that runs."""
        with self._lock:
            if sent.status.state is CommandState.RUNNING:
                self._end(sent.part, "replaced by another command")
            number, self._next = CommandId(self._next), self._next + 1
            self._sent[number] = sent
            if len(self._sent) > _REMEMBERED:
                over = (each for each, it in self._sent.items() if it.status.state is not CommandState.RUNNING)
                del self._sent[next(over)]
            return number

    def note(self, state: CommandState, reason: str = "", cause: CommandCause = CommandCause.NONE) -> CommandId:
        """Adds a command that has ended already."""
        return self.add(Sent(0, "", CommandStatus(state, reason, cause)))

    def get(self, command: CommandId) -> Sent:
        """Returns a command. Raises KeyError for an unknown id."""
        with self._lock:
            if not 0 < command < self._next:
                raise KeyError(command)
            forgotten = CommandStatus(CommandState.STOPPED, "it was over long ago", CommandCause.STOPPED)
            return self._sent.get(command, Sent(0, "", forgotten))

    def running(self) -> list[Sent]:
        """Returns the commands that run."""
        with self._lock:
            return [sent for sent in self._sent.values() if sent.status.state is CommandState.RUNNING]

    def update(self, sent: Sent, status: CommandStatus) -> None:
        """Sets the status of a command that still runs."""
        with self._lock:
            if sent.status.state is CommandState.RUNNING:
                sent.status = status

    def stopped(self, part: str | None) -> None:
        """Notes that the command of a part, or of base and arm, was stopped."""
        with self._lock:
            for each in ("base", "arm") if part is None else (part,):
                self._end(each, "stopped by command")

    def _end(self, part: str, reason: str) -> None:
        for sent in self._sent.values():
            same = sent.part == part or {sent.part, part} <= _MOBILITY
            if same and sent.status.state is CommandState.RUNNING:
                sent.status = CommandStatus(CommandState.STOPPED, reason, CommandCause.STOPPED)


def status_of(feedback: Any, part: str) -> CommandStatus:
    """Returns the protocol's status of the part of a command, by the feedback of the robot."""
    given = getattr(feedback, f"{part if part in ('arm', 'gripper') else 'mobility'}_command_feedback")
    if given.status == _Feedback.Value("STATUS_COMMAND_TIMED_OUT"):
        return _DONE if part == "base" else _stopped(CommandCause.LATE, "expired before it was done")
    whole = _judged(_Feedback, given.status)
    parts = {"arm": _arm, "gripper": _gripper, "posture": _posture}
    return parts[part](given) if whole is _RUNNING and part in parts else whole


def docking_status(number: int) -> CommandStatus:
    """Returns the protocol's status of a command to dock or undock, by the number of its feedback."""
    return _DONE if number in (_Dock.STATUS_DOCKED, _Dock.STATUS_AT_PREP_POSE) else _judged(_Dock.Status, number)


def door_command(handle: DoorHandle) -> Any:
    """Builds the command that grasps a door's handle and opens the door; the ray ends 0.1 m behind the handle."""
    command = door_pb2.DoorCommand.Request()
    grasp = command.auto_grasp_command
    grasp.frame_name = BODY_FRAME_NAME
    x, y, z = handle.p_BH
    grasp.search_ray_start_in_frame.CopyFrom(geometry_pb2.Vec3(x=0.0, y=y, z=z))
    grasp.search_ray_end_in_frame.CopyFrom(geometry_pb2.Vec3(x=x + 0.1, y=y, z=z))
    sides, swings = door_pb2.DoorCommand.HingeSide, door_pb2.DoorCommand.SwingDirection
    grasp.hinge_side = sides.Value(f"HINGE_SIDE_{'LEFT' if handle.hinge_left else 'RIGHT'}")
    grasp.swing_direction = swings.Value(f"SWING_DIRECTION_{'PULL' if handle.pull else 'PUSH'}")
    return command


def door_status(number: int) -> CommandStatus:
    """Returns the protocol's status of a door command, by the number of its feedback."""
    return _judged(_Door.Status, number, _Door.STATUS_COMPLETED)


def _stopped(cause: CommandCause, reason: str) -> CommandStatus:
    return CommandStatus(CommandState.STOPPED, reason, cause)


def _judged(statuses: Any, number: int, *done: int) -> CommandStatus:
    """Returns the status of an enumeration's number: done, stopped by a trouble, or running."""
    wrong = trouble(statuses.DESCRIPTOR, number)
    if wrong is not None:
        return _stopped(wrong.cause, wrong.text)
    return _DONE if number in done else _RUNNING


def _posture(given: Any) -> CommandStatus:
    if given.HasField("sit_feedback"):
        return _judged(_Sit.Status, given.sit_feedback.status, _Sit.STATUS_IS_SITTING)
    return _judged(_Stand.Status, given.stand_feedback.status, _Stand.STATUS_IS_STANDING)


def _arm(given: Any) -> CommandStatus:
    if given.HasField("arm_stop_feedback"):
        return _DONE
    moved = given.arm_joint_move_feedback
    planned = _judged(_Move.PlannerStatus, moved.planner_status)
    return planned if planned is not _RUNNING else _judged(_Move.Status, moved.status, _Move.STATUS_COMPLETE)


def _gripper(given: Any) -> CommandStatus:
    status = given.claw_gripper_feedback.status
    if status == _Claw.STATUS_APPLYING_FORCE:
        return CommandStatus(CommandState.DONE, "stopped by an object in the gripper")
    return _judged(_Claw.Status, status, _Claw.STATUS_AT_GOAL)
