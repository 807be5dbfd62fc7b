"""A Spot behind the Robot protocol, driven through its API.

Readings are those of the last `poll`; commands are sent at once and followed by `poll`. The protocol's robot clock
begins with the connection.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import numpy as np
from bosdyn.api import manipulation_api_pb2, robot_state_pb2
from bosdyn.client.robot_command import RobotCommandBuilder

from errand_spot.adapter import commands
from errand_spot.adapter.commands import Sent, SentCommands, docking_status, door_status, status_of
from errand_spot.adapter.connection import Connection, LostError, RobotClock
from errand_spot.adapter.heartbeat import Heartbeat
from errand_spot.adapter.readings import off_path_rad
from errand_spot.adapter.sensors import OLD_STATE_S, Sensors
from skills.command_table import refusal_of
from skills.robot import (
    ArmTrajectory,
    Battery,
    Capabilities,
    CommandCause,
    CommandId,
    CommandState,
    CommandStatus,
    DoorHandle,
    Gripper,
    Image,
    Imu,
    Joints,
    Lease,
    LeaseError,
    Odometry,
    OwnLocalisation,
    Scan,
)

_LOG: Final = logging.getLogger(__name__)
DRIVE_EXPIRY_S: Final = 0.6
SILENT_S, GONE_S = 3.0, 15.0
OLD_CLOCK_S: Final = 30.0
PRESSED: Final = "the E-stop is pressed"
OFF_PATH_RAD: Final = 0.15
_SYNCHRONISED_EVERY_S: Final = 10.0
_LATE_S: Final = 0.3
_LOOK_S: Final = 1.0


class ApiRobot:
    """Spot, through a connection. Implements `skills.robot.Robot`."""

    def __init__(
        self,
        name: str,
        connection: Connection,
        clock: RobotClock,
        capabilities: Capabilities,
        *,
        padding_m: float | None = None,
    ) -> None:
        """Reads the robot's first state. The robot keeps `padding_m` from obstacles by itself. Raises LostError."""
        self._name, self._connection, self._clock = name, connection, clock
        docks, doors = connection.has("docking"), connection.has("door") and capabilities.arm is not None
        self._padding_m = padding_m
        self._capabilities = replace(
            capabilities, drive_expiry_s=DRIVE_EXPIRY_S, docks=docks, opens_doors=doors, localises=True
        )
        self.sensors, self.heartbeat = Sensors(connection, clock, capabilities), Heartbeat(connection)
        self._sent = SentCommands()
        self._unsure: set[str | None] = set()
        self._ended, self._taken_by, self._looked_s = "", "", -math.inf
        self._lease_number, self._synchronised_s = 0, clock.now()
        self._current: Lease | None = None
        self._carries: bool | None = None  # what the robot has yet to hear
        self._posture = (capabilities.standing_height_m, 0.0)

    # -- know and sense ----------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self._name

    def capabilities(self) -> Capabilities:
        """Capabilities of Spot."""
        return self._capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""
        return self.sensors.readings.odometry

    def imu(self) -> Imu | None:
        """Returns None: the API gives no inertial readings."""
        return None

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution, None before the first."""
        return self.sensors.scan

    def own_localisation(self) -> OwnLocalisation | None:
        """Latest pose by GraphNav, None before it has one; polled only after the first use."""
        self.sensors.localises = True
        return self.sensors.place

    def joints(self) -> Joints:
        """Latest joint state."""
        return self.sensors.readings.joints

    def gripper(self) -> Gripper:
        """Latest gripper state."""
        return self.sensors.readings.gripper

    def battery(self) -> Battery:
        """Latest battery state."""
        return self.sensors.readings.battery

    @property
    def powered(self) -> bool:
        """Returns whether the motors have power."""
        return self.sensors.readings.powered

    def faults(self) -> tuple[str, ...]:
        """Present faults, with a pressed E-stop, unknown feet, and a silent robot."""
        now, silent_s = self.sensors.readings, self.sensors.silent_s()
        own = {
            PRESSED: not now.released,
            "no foot is on the floor, so the height is unknown": now.powered and not now.feet_known,
            f"the robot has not answered for {silent_s:.0f} s": silent_s > SILENT_S,
        }
        return (*now.faults, *(fault for fault, present in own.items() if present))

    def stopped_because(self) -> str:
        """Reason why the robot has stopped for good; empty while it goes on."""
        present = {
            self._ended: bool(self._ended),
            PRESSED: not self.sensors.readings.released,
            "the motors have lost their power": not self.sensors.readings.powered,
            f"the robot has not answered for {GONE_S:.0f} s": self.sensors.silent_s() > GONE_S,
        }
        return next((why for why, holds in present.items() if holds), "")

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with depth, or only one of the two. Raises ValueError and NoImageError."""
        return self.sensors.image(source, visual=visual, depth=depth)

    # -- act ---------------------------------------------------------------------------------------------------------

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Drives at a body-frame velocity; the robot stops by itself at `until_s`, or 0.6 s from now."""
        if (refused := self._objection("base", lease, until_s, (vx, vy, wz))) is not None:
            return refused
        end_s = min(until_s, self._clock.now() + DRIVE_EXPIRY_S)
        robot_end_s = self._clock.robot_time_s() + end_s - self._clock.now()
        command = commands.drive((vx, vy, wz), robot_end_s, self._params())
        return self._send(command, Sent(0, "base", until_s=end_s + _LATE_S))

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch."""
        if (refused := self._objection("posture", lease, until_s, (height_m, pitch_rad))) is not None:
            return refused
        before, self._posture = self._posture, (height_m, pitch_rad)
        sent = self._send(
            RobotCommandBuilder.synchro_stand_command(params=self._params()), Sent(0, "posture", until_s=until_s)
        )
        if self.command_status(sent).state is CommandState.REFUSED:
            self._posture = before
        return sent

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""
        refused = self._objection("posture", lease, until_s)
        return refused or self._send(RobotCommandBuilder.synchro_sit_command(), Sent(0, "posture", until_s=until_s))

    def dock(self, station: int, *, until_s: float, lease: Lease) -> CommandId:
        """Docks at the docking station of a number, nearby."""
        return self._dock(station, until_s, lease)

    def undock(self, *, until_s: float, lease: Lease) -> CommandId:
        """Stands up and leaves the docking station."""
        return self._dock(None, until_s, lease)

    def _dock(self, station: int | None, until_s: float, lease: Lease) -> CommandId:
        end_s = self._clock.robot_time_s() + until_s - self._clock.now()
        return self._ask("dock", lambda: self._connection.dock(station, end_s), until_s, lease)

    def open_door(self, handle: DoorHandle, *, until_s: float, lease: Lease) -> CommandId:
        """Opens a door with the arm and walks through."""
        command = commands.door_command(handle)
        return self._ask("door", lambda: self._connection.open_door(command), until_s, lease)

    def _ask(self, part: str, call: Callable[[], int], until_s: float, lease: Lease) -> CommandId:
        """Asks a service of its own for a command; `call` returns the number of the command there."""
        if (refused := self._objection(part, lease, until_s)) is not None:
            return refused
        try:
            number = call()
        except LostError as error:
            return self._lost(error, part, part)
        return self._sent.add(Sent(number, part, until_s=until_s + _LATE_S))

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory and holds at its end; done by the robot's report, stopped off the path."""
        if (refused := self._objection("arm", lease, until_s, trajectory.times_s)) is not None:
            return refused
        path_rad = np.vstack([self.sensors.arm_rad, trajectory.positions_rad])
        command = commands.arm_move(trajectory, self._clock.robot_time_s())
        return self._send(command, Sent(0, "arm", until_s=until_s, path_rad=path_rad))

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Refuses: Spot has no head."""
        return self._refused("point_head: the robot has no head", CommandCause.UNSUPPORTED)

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper to an opening with at most force_n at its tip."""
        if (gripper := self._capabilities.gripper) is None:
            return self._refused("set_gripper: the robot has no gripper", CommandCause.UNSUPPORTED)
        if (out := gripper.refusal(opening, force_n)) is not None:
            return self._refused(out, CommandCause.INVALID)
        refused = self._objection("gripper", lease, until_s, (opening, force_n))
        return refused or self._send(commands.claw(opening, force_n), Sent(0, "gripper", until_s=until_s))

    def carry(self, holding: bool, *, lease: Lease) -> None:
        """Sets whether the robot keeps the held object after a loss of communication; repeats until it answers."""
        if lease == self._current:
            self._carries = holding
            with suppress(LostError):
                self._say_carry()

    def _say_carry(self) -> None:
        if self._carries is None:
            return
        State, request = robot_state_pb2.ManipulatorState, manipulation_api_pb2.ApiGraspOverrideRequest()
        carried, free = State.CARRY_STATE_CARRIABLE, State.CARRY_STATE_NOT_CARRIABLE
        request.carry_state_override.override_request = carried if self._carries else free
        try:
            self._connection.call("manipulation", "OverrideGrasp", request)
        except LostError as error:
            if error.cause is CommandCause.NO_ANSWER:
                raise
        self._carries = None

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops base and arm, or only the part of a command; the gripper keeps its clamp force."""
        sent = None if only is None else self._sent.get(only)
        if sent is not None and (sent.status.state is not CommandState.RUNNING or sent.part == "gripper"):
            return self._sent.note(CommandState.DONE)
        if (gone := self._without(lease)) is not None:
            return self._refused(f"stop: {gone}", CommandCause.NO_LEASE)
        part = None if sent is None else sent.part
        try:
            self._connection.command(commands.halt(part))
        except LostError as error:
            return self._lost(error, "stop", part)
        self._unsure -= {part, None} if part else {None, "base", "posture", "arm"}
        self._sent.stopped(part)
        return self._sent.note(CommandState.DONE)

    def command_status(self, command: CommandId) -> CommandStatus:
        """Returns the last known status of a command. Raises KeyError for an unknown id."""
        return self._sent.get(command).status

    # -- own ---------------------------------------------------------------------------------------------------------

    def lease_holder(self) -> Lease | None:
        """Valid lease by the robot's last answer; another client's lease has the client's name."""
        return Lease(self._name, self._taken_by, self._lease_number + 1) if self._taken_by else self._current

    def acquire_lease(self, holder: str) -> Lease:
        """Takes the lease within this program, and acquires the robot's. Raises LeaseError when another has it."""
        if (held := self.lease_holder()) is not None:
            raise LeaseError(f"{self._name}: the lease is held by {held.holder!r}")
        return self._own(holder, take=False)

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from its holder, another client included. Raises LeaseError when the robot refuses."""
        return self._own(holder, take=True)

    def _own(self, holder: str, *, take: bool) -> Lease:
        try:
            if self._connection.lease is None:
                self._connection.acquire(take=take)
        except LostError as error:
            raise LeaseError(f"{self._name}: {error}") from error
        self._taken_by = ""
        self._lease_number += 1
        self._current = Lease(self._name, holder, self._lease_number, self._connection.lease.epoch)
        return self._current

    def return_lease(self, lease: Lease) -> None:
        """Returns the lease; the robot stops. The robot's own lease is kept until the connection is closed."""
        if lease == self._current:
            self.stop(lease=lease)
            self._current = None

    # -- upkeep ------------------------------------------------------------------------------------------------------

    def poll(self) -> None:
        """Reads state and scan, follows the running commands, and sends the heartbeat.

        Unanswered readings keep their last value: old readings stop the drive, and are a fault later. A silent robot
        gets no other calls, so it falls back on E-stop, policy and stale lease.
        """
        read_state, read_scan = self.sensors.read_state, self.sensors.read_scan
        acting = (self._follow, self._halt_unsure, self._say_carry)
        for step in (read_state, *acting, self._synchronise, self._keep, read_scan, self.sensors.read_place):
            try:
                step()
            except LostError as error:
                if error.cause is CommandCause.NO_LEASE:
                    self._lose(error.holder)
                elif error.cause is CommandCause.ESTOPPED:
                    self._ended = str(error)
                elif error.cause is CommandCause.NO_ANSWER:
                    if self.sensors.silent_s() > OLD_STATE_S:
                        self._end_running(error)
                    return

    def _follow(self) -> None:
        """Reads the progress of the commands; ends late ones, and arm motions off their path."""
        for sent in self._sent.running():
            try:
                if sent.part == "dock":
                    status = docking_status(self._connection.docking(sent.number))
                elif sent.part == "door":
                    status = door_status(self._connection.opening(sent.number))
                else:
                    status = status_of(self._connection.feedback(sent.number).synchronized_feedback, sent.part)
            except LostError as error:
                status = CommandStatus(CommandState.STOPPED, str(error), error.cause)
            if status.state is CommandState.RUNNING:
                status = self._watched(sent)
            self._sent.update(sent, status)
            if status.state is CommandState.STOPPED:
                self._unsure.add(sent.part)
            if status.cause is CommandCause.NO_ANSWER:
                raise LostError(status.reason)

    def _watched(self, sent: Sent) -> CommandStatus:
        """Status of a running command: stopped after its time, or when the arm has left its path."""
        if self._clock.now() >= sent.until_s:
            return CommandStatus(CommandState.STOPPED, "expired before it was done", CommandCause.LATE)
        off_rad = off_path_rad(sent.path_rad, self.sensors.arm_rad) if sent.part == "arm" else 0.0
        if off_rad > OFF_PATH_RAD:
            reason = f"the arm is {off_rad:.2f} rad off its path; look what is in its way"
            return CommandStatus(CommandState.STOPPED, reason, CommandCause.BLOCKED)
        return sent.status

    def _end_running(self, error: LostError) -> None:
        """Ends the running commands of a silent robot; their parts stop when it answers again."""
        for sent in self._sent.running():
            self._unsure.add(sent.part)
            self._sent.update(sent, CommandStatus(CommandState.STOPPED, str(error), error.cause))

    def _halt_unsure(self) -> None:
        """Stops the parts that may be moving; the gripper keeps its clamp."""
        for part in list(self._unsure):
            if part != "gripper" and self._connection.lease is not None:
                try:
                    self._connection.command(commands.halt(part))
                except LostError as error:
                    if error.cause is CommandCause.NO_ANSWER:
                        raise
            self._unsure.discard(part)

    def _synchronise(self) -> None:
        """Measures the robot's clock again, at once after it has jumped; nothing moves before."""
        jumped = self.sensors.clock_jumped
        self._synchronised_s = -math.inf if jumped else self._synchronised_s
        if self._clock.now() - self._synchronised_s > _SYNCHRONISED_EVERY_S:
            self._connection.synchronise(jumped=jumped)
            self._synchronised_s, self.sensors.clock_jumped = self._clock.now(), False

    def _keep(self) -> None:
        """Sends the heartbeat; checks whether a lost lease is free again."""
        self.heartbeat.beat()
        if self._taken_by and self._clock.now() - self._looked_s > _LOOK_S:
            self._looked_s = self._clock.now()
            self._taken_by = self._connection.holder()

    # -- inside ------------------------------------------------------------------------------------------------------

    def _params(self) -> Any:
        """Mobility parameters with the posture last asked for."""
        height_m, pitch_rad = self._posture
        return commands.mobility_params(height_m - self._capabilities.standing_height_m, pitch_rad, self._padding_m)

    def _without(self, lease: Lease) -> str | None:
        """Returns why a lease does not count; None when it does."""
        if lease == self._current:
            return None
        by = f"; it is held by {self._taken_by}" if self._taken_by else ""
        return f"lease {lease.number} of {lease.holder!r} no longer counts{by}"

    def _objection(self, part: str, lease: Lease, until_s: float, values: Iterable[float] = ()) -> CommandId | None:
        """Refuses a forbidden command; returns None for an allowed one."""
        now_s = self._clock.now()
        clock_s, state_s = now_s - self._synchronised_s, self.sensors.silent_s()
        if refused := refusal_of(part, self._without(lease), values, until_s=until_s, now_s=now_s):
            return self._refused(*refused)
        if clock_s > OLD_CLOCK_S:
            old = f"{part}: the clocks were last synchronised {clock_s:.0f} s ago; check the network"
            return self._refused(old, CommandCause.NO_ANSWER)
        if part == "base" and state_s > OLD_STATE_S:
            return self._refused(f"drive: the last state is {state_s:.1f} s old", CommandCause.NO_ANSWER)
        if part == "base" and not self.sensors.readings.feet_known:
            return self._refused("drive: no foot is on the floor, so the height is unknown", CommandCause.FAULT)
        return None

    def _send(self, command: Any, sent: Sent) -> CommandId:
        try:
            sent.number = self._connection.command(command).robot_command_id
        except LostError as error:
            return self._lost(error, sent.part, sent.part)
        return self._sent.add(sent)

    def _lost(self, error: LostError, what: str, part: str | None) -> CommandId:
        """Notes a command that was lost on its way, and stops its part, because the robot may have begun it."""
        if error.cause is CommandCause.NO_LEASE:
            self._lose(error.holder)
        else:
            self._unsure.add(part)
        return self._refused(f"{what}: {error}", error.cause)

    def _lose(self, holder: str) -> None:
        """Notes that another client has the lease, and warns at once; does not take it back."""
        if self._connection.lease is not None:
            _LOG.warning("%s: %s has taken the lease; the mission waits", self._name, holder or "another client")
        self._current, self._connection.lease, self._taken_by = None, None, holder
        self._looked_s = self._clock.now()

    def _refused(self, reason: str, cause: CommandCause) -> CommandId:
        return self._sent.note(CommandState.REFUSED, reason, cause)
