"""Power and motion commands of clients: permission, timing and progress."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from itertools import count
from threading import Lock
from typing import Any, Final

from bosdyn.api import basic_command_pb2, estop_pb2, full_body_command_pb2, lease_pb2, power_pb2, robot_command_pb2

from errand_spot.messages import InvalidRequestError, seconds, timestamp
from errand_spot.server import arm, gripper, hand, joint_control, mobility
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer, Motion, Motors, Snapshot
from errand_spot.server.identity import DOMAIN, TimeSyncService
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY, LeaseService
from errand_spot.server.posture import Posture
from errand_spot.server.refusals import LONGEST_S, RefusedError, check_values, end_of, unsupported

Status = robot_command_pb2.RobotCommandResponse
Progress = basic_command_pb2.RobotCommandFeedbackStatus
_LOG: Final = logging.getLogger(__name__)
_FIELDS: Final = {MOBILITY: "mobility_command", ARM: "arm_command", GRIPPER: "gripper_command"}
_ALL: Final = tuple(_FIELDS)
_REMEMBERED: Final = 1000


class PowerService(Service):
    """Switches the motors on and off."""

    name, type, authority = "power", "bosdyn.api.PowerService", f"power.{DOMAIN}"

    def __init__(self, computer: Computer, leases: LeaseService) -> None:
        self._computer, self._leases, self._ids = computer, leases, count(1)
        self._wanted, self._fan_ends_s = dict[int, Motors](), dict[int, float]()

    def PowerCommand(self, request: Any, _call: Call) -> Any:
        """Takes a command for the motors; the power of the computer, ports and radio cannot be switched."""
        Response, Request = power_pb2.PowerCommandResponse, power_pb2.PowerCommandRequest
        used = self._leases.use(request.lease, _ALL)
        if used.status != lease_pb2.LeaseUseResult.STATUS_OK:
            return Response(lease_use_result=used, status=power_pb2.STATUS_UNKNOWN)
        if request.request == Request.REQUEST_ON_MOTORS:
            if self._computer.estop.level() != estop_pb2.ESTOP_LEVEL_NONE:
                return Response(lease_use_result=used, status=power_pb2.STATUS_ESTOPPED)
            if self._computer.snapshot.faults:
                return Response(lease_use_result=used, status=power_pb2.STATUS_FAULTED)
            wanted, work = Motors.ON, self._computer.switch_on
        elif request.request == Request.REQUEST_OFF_MOTORS:
            wanted, work = Motors.OFF, self._computer.switch_off
        else:
            raise InvalidRequestError("request: only the motors can be switched on and off")
        number = next(self._ids)
        self._wanted[number] = wanted
        self._computer.do(work)
        return Response(lease_use_result=used, status=power_pb2.STATUS_IN_PROGRESS, power_command_id=number)

    def PowerCommandFeedback(self, request: Any, _call: Call) -> Any:
        """Tells whether a command is done."""
        Response = power_pb2.PowerCommandFeedbackResponse
        wanted = self._wanted.get(request.power_command_id)
        if wanted is None:
            raise InvalidRequestError(f"power_command_id: there is no command {request.power_command_id}")
        if self._computer.snapshot.motors is wanted:
            return Response(status=power_pb2.STATUS_SUCCESS)
        if wanted is Motors.ON and self._computer.estop.level() != estop_pb2.ESTOP_LEVEL_NONE:
            return Response(status=power_pb2.STATUS_ESTOPPED)
        return Response(status=power_pb2.STATUS_IN_PROGRESS)

    def FanPowerCommand(self, request: Any, _call: Call) -> Any:
        """Accepts a command for the fans, which do not turn in simulation."""
        Response = power_pb2.FanPowerCommandResponse
        used = self._leases.use(request.lease, _ALL)
        if used.status != lease_pb2.LeaseUseResult.STATUS_OK:
            return Response(lease_use_result=used, status=Response.STATUS_UNKNOWN)
        lasts_s = seconds(request.duration)
        if not 0.0 < lasts_s <= LONGEST_S:
            raise InvalidRequestError(f"duration must be above 0, and at most {LONGEST_S:.0f} s")
        number, end_s = next(self._ids), self._computer.now_s() + lasts_s
        self._fan_ends_s[number] = end_s
        made = Response(lease_use_result=used, status=Response.STATUS_OK, command_id=number)
        made.desired_end_time.CopyFrom(timestamp(end_s))
        return made

    def FanPowerCommandFeedback(self, request: Any, _call: Call) -> Any:
        """Returns whether a command's time is over, or a later command has replaced it."""
        Response, end_s = power_pb2.FanPowerCommandFeedbackResponse, self._fan_ends_s.get(request.command_id)
        if end_s is None:
            raise InvalidRequestError(f"command_id: there is no command {request.command_id}")
        status = Response.STATUS_COMPLETE if self._computer.now_s() >= end_s else Response.STATUS_RUNNING
        if status == Response.STATUS_RUNNING and request.command_id != max(self._fan_ends_s):
            status = Response.STATUS_OVERRIDDEN_BY_COMMAND
        return Response(status=status, desired_end_time=timestamp(end_s))


@dataclass(frozen=True)
class _Commanded:
    """Motions of a command by part, or the whole-body motion."""

    parts: Mapping[str, Any]
    whole: Any = None

    def feedback(self) -> Any:
        """The message of how far the command has come."""
        made = robot_command_pb2.RobotCommandFeedback()
        if self.whole is not None:
            made.full_body_feedback.CopyFrom(self.whole.feedback)
            return made
        made.synchronized_feedback.SetInParent()
        for part, motion in self.parts.items():
            getattr(made.synchronized_feedback, f"{_FIELDS[part]}_feedback").CopyFrom(motion.feedback)
        return made


class RobotCommandService(Service):
    """Takes commands for the whole robot or its parts, and tells how far they have come."""

    name, type, authority = "robot-command", "bosdyn.api.RobotCommandService", f"command.{DOMAIN}"
    checks_values = True

    def __init__(
        self, computer: Computer, leases: LeaseService, clocks: TimeSyncService, updates: joint_control.Updates
    ) -> None:
        self._computer, self._leases, self._clocks, self._updates = computer, leases, clocks, updates
        self._ids, self._lock = count(1), Lock()
        self._commands: dict[int, _Commanded] = {}

    def RobotCommand(self, request: Any, _call: Call) -> Any:
        """Starts a command; commands for other parts go on."""
        parts = _parts_of(request.command)
        used = self._leases.use(request.lease, parts)
        if used.status != lease_pb2.LeaseUseResult.STATUS_OK:
            return Status(lease_use_result=used, status=Status.STATUS_UNKNOWN)
        status, message, number = Status.STATUS_OK, "", 0
        try:
            number = self._start(request)
        except RefusedError as refused:
            status, message = refused.status, str(refused)
        except InvalidRequestError as invalid:
            status, message = Status.STATUS_INVALID_REQUEST, str(invalid)
        return Status(lease_use_result=used, status=status, message=message, robot_command_id=number)

    def RobotCommandFeedback(self, request: Any, _call: Call) -> Any:
        """Tells how far a command has come."""
        with self._lock:
            commanded = self._commands.get(request.robot_command_id)
        if commanded is None:
            raise InvalidRequestError(f"robot_command_id: there is no command {request.robot_command_id}")
        return robot_command_pb2.RobotCommandFeedbackResponse(feedback=commanded.feedback())

    def ClearBehaviorFault(self, request: Any, _call: Call) -> Any:
        """Clears the fault of a fall, when the robot lies still."""
        Response, computer = robot_command_pb2.ClearBehaviorFaultResponse, self._computer
        used, fault = self._leases.use(request.lease, _ALL), computer.fault
        made = Response(lease_use_result=used, behavior_fault=fault, status=Response.STATUS_NOT_CLEARED)
        known = fault is not None and fault.behavior_fault_id == request.behavior_fault_id
        if used.status == lease_pb2.LeaseUseResult.STATUS_OK and known and computer.snapshot.sitting:
            computer.fault, made.status = None, Response.STATUS_CLEARED
        return made

    def _start(self, request: Any) -> int:
        """Starts a command and returns its number. Raises RefusedError or InvalidRequestError."""
        command, computer, snapshot = request.command, self._computer, self._computer.snapshot
        check_values(command, "command")
        moves = command.full_body_command.WhichOneof("command") in (None, "selfright_request", "joint_request")
        if not computer.able and moves:
            if snapshot.motors is not Motors.ON or computer.fault is None:
                raise RefusedError(Status.STATUS_NOT_POWERED_ON, "the motors are off, or an E-stop is pressed")
            raise RefusedError(Status.STATUS_BEHAVIOR_FAULT, "the robot has fallen: clear its behaviour fault")
        whole: Any = None
        if command.HasField("full_body_command"):
            joints = command.full_body_command.HasField("joint_request")
            whole = joint_control.activation(computer, self._updates) if joints else _whole_motion(command)
        elif computer.docked() and _leaves_dock(command.synchronized_command):
            raise RefusedError(Status.STATUS_DOCKED, "the robot is docked: undock it first")
        parts: Mapping[str, Any] = {}
        if whole is None:
            if _has_end_time(command) and not self._clocks.knows(request.clock_identifier):
                raise RefusedError(Status.STATUS_NO_TIMESYNC, "the client has not synchronised its clock")
            parts = self._motions(command.synchronized_command, snapshot)
        commanded = _Commanded(parts, whole)
        with self._lock:
            number = next(self._ids)
            self._commands[number] = commanded
            self._commands.pop(number - _REMEMBERED, None)
        begun = computer.do(lambda: computer.move(parts) if whole is None else whole.begin_alone(computer))
        begun.add_done_callback(_log_failure)
        return number

    def _motions(self, command: Any, snapshot: Snapshot) -> Mapping[str, Motion]:
        """Motions of a synchronised command by part."""
        made, now_s = dict[str, Motion](), self._computer.now_s()
        if command.HasField("mobility_command"):
            made[MOBILITY] = _base_motion(command.mobility_command, self._computer, snapshot, now_s)
        if command.HasField("arm_command"):
            if self._computer.solver is None:
                raise unsupported("arm_command of a robot without an arm")
            made[ARM] = _arm_motion(command.arm_command, self._computer, snapshot, now_s)
        if command.HasField("gripper_command"):
            can = self._computer.capabilities.gripper
            if can is None:
                raise unsupported("gripper_command of a robot without a gripper")
            request = command.gripper_command.claw_gripper_command
            made[GRIPPER] = gripper.Claw(request, can.widest, can.max_force_n, now_s)
        if not made:
            raise InvalidRequestError("command: it names no part of the robot")
        return made


def _log_failure(begun: Future[None]) -> None:
    """Logs the error of a command that could not begin, because no client waits for it."""
    if (error := begun.exception()) is not None:
        _LOG.error("a command could not begin", exc_info=error)


def _parts_of(command: Any) -> tuple[str, ...]:
    """The smallest parts that a command moves."""
    if command.HasField("full_body_command"):
        return _ALL
    named = command.synchronized_command
    return tuple(part for part, field in _FIELDS.items() if named.HasField(field)) or _ALL


def _has_end_time(command: Any) -> bool:
    """Returns whether a command says a time on the robot's clock."""
    named = command.synchronized_command
    which = named.mobility_command.WhichOneof("command")
    ends = ("se2_velocity_request", "se2_trajectory_request", "stance_request")
    return which in ends or named.arm_command.HasField("arm_velocity_command")


def _leaves_dock(command: Any) -> bool:
    """Returns whether a command would move a robot that is docked."""
    stays = (None, "sit_request", "stop_request", "freeze_request")
    return command.HasField("arm_command") or command.mobility_command.WhichOneof("command") not in stays


def _base_motion(request: Any, computer: Computer, snapshot: Snapshot, now_s: float) -> mobility.BaseMotion:
    """Motion of the base."""
    params, which = mobility.mobility_params(request), request.WhichOneof("command") or "no command"
    posture, given = Posture(params, computer, snapshot), getattr(request, which, None)
    end = partial(end_of, given, now_s, which)
    made: dict[str, Callable[[], mobility.BaseMotion]] = {
        "stand_request": lambda: mobility.Stand(posture),
        "sit_request": mobility.Sit,
        "se2_velocity_request": lambda: mobility.Velocity(given, params, end(), posture.walking()),
        "se2_trajectory_request": lambda: mobility.Trajectory(given, params, end(), snapshot, posture.walking()),
        "stance_request": lambda: mobility.Stance(given, end(), snapshot),
        "follow_arm_request": lambda: hand.FollowArm(given),
        "stop_request": lambda: mobility.Halt("stop_feedback"),
        "freeze_request": lambda: mobility.Halt("freeze_feedback"),
    }
    if which not in made:
        raise unsupported(f"mobility_command: {which}")
    return made[which]()


def _arm_motion(request: Any, computer: Computer, snapshot: Snapshot, now_s: float) -> arm.ArmMotion:
    """Motion of the arm."""
    which = request.WhichOneof("command") or "no command"
    given, now_rad, solver = getattr(request, which, None), computer.arm_rad(snapshot.joints), computer.solver
    assert solver is not None
    made: dict[str, Callable[[], arm.ArmMotion]] = {
        "arm_joint_move_command": lambda: arm.JointMove(given, now_rad, now_s, solver),
        "named_arm_position_command": lambda: arm.Named(given),
        "arm_cartesian_command": lambda: hand.Cartesian(given, snapshot, now_s),
        "arm_impedance_command": lambda: hand.Impedance(given, snapshot, now_s),
        "arm_gaze_command": lambda: hand.Gaze(given, snapshot),
        "arm_velocity_command": lambda: hand.Moving(given, snapshot, end_of(given, now_s, which)),
        "arm_stop_command": arm.ArmHalt,
    }
    if which not in made:
        raise unsupported(f"arm_command: {which}")
    return made[which]()


class _Whole:
    """Command of the whole body: stops it, freezes it, or rights it."""

    def __init__(self, feedback: Any) -> None:
        self.feedback = feedback
        feedback.status = Progress.STATUS_PROCESSING

    def begin_alone(self, computer: Computer) -> None:
        """Starts it in place of all motions."""
        computer.stop_parts(_ALL)


class _PowerOff(_Whole):
    """Sits down and switches the motors off."""

    _computer: Computer

    def begin_alone(self, computer: Computer) -> None:
        """Starts to settle."""
        self._computer = computer
        computer.stop_parts(_ALL)
        computer.settle()
        computer.move({MOBILITY: self})

    def begin(self, computer: Computer) -> None:
        """Does nothing more."""

    def tick(self, _computer: Computer) -> None:
        """Reports whether the motors are off."""
        self.end(Progress.STATUS_PROCESSING)

    def end(self, status: int) -> None:
        """Ends with the motors, or before for another command."""
        made, part = full_body_command_pb2.FullBodyCommand.Feedback(), basic_command_pb2.SafePowerOffCommand.Feedback
        off = self._computer.motors is Motors.OFF
        made.status = Progress.STATUS_PROCESSING if off else status
        made.safe_power_off_feedback.status = part.STATUS_POWERED_OFF if off else part.STATUS_IN_PROGRESS
        self.feedback = made


def _whole_motion(command: Any) -> _Whole:
    """Motion of the whole body. Raises RefusedError."""
    which = command.full_body_command.WhichOneof("command")
    made = full_body_command_pb2.FullBodyCommand.Feedback()
    if which in ("stop_request", "freeze_request", "selfright_request"):
        made.selfright_feedback.status = basic_command_pb2.SelfRightCommand.Feedback.STATUS_COMPLETED
        getattr(made, which.replace("request", "feedback")).SetInParent()
        return _Whole(made)
    if which == "safe_power_off_request":
        made.safe_power_off_feedback.status = basic_command_pb2.SafePowerOffCommand.Feedback.STATUS_IN_PROGRESS
        return _PowerOff(made)
    raise unsupported(f"full_body_command: {which or 'no command'}")
