"""The connection to a robot: login, clock, E-stop, lease, power; every call has a time limit."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Protocol

import bosdyn.client
import grpc
from bosdyn.api import estop_pb2, lease_pb2, power_pb2, robot_command_pb2, robot_state_pb2, time_sync_pb2
from bosdyn.api.docking import docking_pb2
from bosdyn.api.spot import door_pb2

from errand_spot.adapter.statuses import call_trouble, response_trouble, trouble
from errand_spot.messages import seconds
from skills.inputs.errors import InputError
from skills.robot import CommandCause

CLIENT: Final = "errand"
CALL_S: Final = 0.5
SLOW_S: Final = 5.0
"""Timeouts of a call, and of the first calls, before the robot moves."""
_ROUND_TRIPS: Final = 5
_FILES: Final[Mapping[str, str]] = {
    **{name: name.replace("-", "_") for name in ("estop", "image", "lease", "power", "robot-command")},
    **{name: name.replace("-", "_") for name in ("robot-state", "time-sync", "gripper-camera-param")},
    **{"docking": "docking.docking", "door": "spot.door", "keepalive": "keepalive.keepalive"},
    **{"velodyne-point-cloud": "point_cloud", "graph-nav-service": "graph_nav.graph_nav"},
    "manipulation": "manipulation_api",
}
"""Files of the SDK that describe the called services, by the names of the services."""


class LostError(RuntimeError):
    """Error of a call that the robot refused or did not answer, with the cause and the present lease holder."""

    def __init__(self, message: str, cause: CommandCause = CommandCause.NO_ANSWER, holder: str = "") -> None:
        super().__init__(message)
        self.cause, self.holder = cause, holder


@dataclass(frozen=True)
class Address:
    """Address of a robot: host, port, and its expected certificate (None: the SDK's own)."""

    host: str
    port: int = 443
    certificate: Path | None = None


class Connection:
    """Connection to one robot."""

    def __init__(self, address: Address, user: str, password: str) -> None:
        """Logs in. Raises InputError when the robot cannot be reached, or refuses user and password."""
        self._epoch_s = time.time() - time.monotonic()
        glob = None if address.certificate is None else str(address.certificate)
        sdk = bosdyn.client.create_standard_sdk(CLIENT, cert_resource_glob=glob)
        self._robot = sdk.create_robot(address.host)
        self._robot.update_secure_channel_port(address.port)
        where = f"spot://{address.host}:{address.port}"
        try:
            self._robot.authenticate(user, password, timeout=SLOW_S)
            services = {entry.name: entry.type for entry in self._robot.list_services()}
            self.identity = self._robot.ensure_client("robot-id").get_id(timeout=SLOW_S)
        except bosdyn.client.auth.InvalidLoginError as error:
            hint = "check --user, and the password that was typed or stands in BOSDYN_CLIENT_PASSWORD"
            raise InputError(f"{where}: the robot refuses user '{user}' with this password", hint=hint) from error
        except bosdyn.client.auth.TemporarilyLockedOutError as error:
            hint = "wait a minute before the next try"
            raise InputError(f"{where}: too many wrong passwords for user '{user}'", hint=hint) from error
        except bosdyn.client.Error as error:
            hint = "check address and network; is the robot on?"
            raise InputError(f"{where}: the robot does not answer ({_first_line(error)})", hint=hint) from error
        self._stubs = {name: self._stub(name, services[name]) for name in _FILES if name in services}
        self.clock_identifier, self._ahead_s = "", 0.0
        self.lease: Any = None

    def _stub(self, service: str, type_name: str) -> Any:
        """Returns the SDK's stub of a service."""
        module = import_module(f"bosdyn.api.{_FILES[service]}_service_pb2_grpc")
        return getattr(module, f"{type_name.rpartition('.')[2]}Stub")(self._robot.ensure_channel(service))

    def has(self, service: str) -> bool:
        """Returns whether the robot has a service."""
        return service in self._stubs

    def call(self, service: str, name: str, request: Any, timeout_s: float = CALL_S, *, checked: bool = True) -> Any:
        """Calls a service. Raises LostError after a timeout, or (if `checked`) for an answer without success."""
        request.header.client_name = CLIENT
        request.header.request_timestamp.FromNanoseconds(round(self._now_s() * 1e9))
        try:
            answer = getattr(self._stubs[service], name)(request, timeout=timeout_s)
        except (grpc.RpcError, KeyError) as error:
            found = call_trouble(error)
            raise LostError(f"{found.text} [{service}/{name}]", found.cause) from error
        wrong = response_trouble(answer) if checked else None
        if wrong is not None:
            raise LostError(f"{wrong.text} [{service}/{name}]", wrong.cause, wrong.holder)
        return answer

    def software_version(self) -> tuple[int, int, int]:
        """Returns the version of the robot's software."""
        version = self.identity.software_release.version
        return version.major_version, version.minor_version, version.patch_level

    # -- clock -------------------------------------------------------------------------------------------------------

    def synchronise(self, *, jumped: bool = False, timeout_s: float = CALL_S) -> None:
        """Measures how far the robot's clock is ahead of ours; forgets trips if it has `jumped`. Raises LostError."""
        trips, request = list[tuple[float, float]](), time_sync_pb2.TimeSyncUpdateRequest()
        request.clock_identifier = "" if jumped else self.clock_identifier
        for _ in range(_ROUND_TRIPS):
            sent_s = self._now_s()
            answer = self.call("time-sync", "TimeSyncUpdate", request, timeout_s)
            back_s = self._now_s()
            received, answered = answer.header.request_received_timestamp, answer.header.response_timestamp
            skew_s = 0.5 * (seconds(received) - sent_s + seconds(answered) - back_s)
            trips.append((back_s - sent_s - (seconds(answered) - seconds(received)), skew_s))
            request = time_sync_pb2.TimeSyncUpdateRequest(clock_identifier=answer.clock_identifier)
            trip = request.previous_round_trip
            trip.client_tx.FromNanoseconds(round(sent_s * 1e9))
            trip.server_rx.CopyFrom(received)
            trip.server_tx.CopyFrom(answered)
            trip.client_rx.FromNanoseconds(round(back_s * 1e9))
        if (wrong := response_trouble(answer.state)) is not None:
            raise LostError(wrong.text, wrong.cause)
        self.clock_identifier, (_, self._ahead_s) = answer.clock_identifier, min(trips)

    def robot_time_s(self) -> float:
        """The robot's time now (s since 1970), by the last synchronisation."""
        return self._now_s() + self._ahead_s

    def _now_s(self) -> float:
        """This machine's time (s since 1970); it does not jump when somebody sets the clock."""
        return self._epoch_s + time.monotonic()

    # -- lease, E-stop and power -------------------------------------------------------------------------------------

    def acquire(self, *, take: bool = False) -> None:
        """Acquires the body's lease, or takes it. Raises LostError that names its owner."""
        verb, Request = ("Take", lease_pb2.TakeLeaseRequest) if take else ("Acquire", lease_pb2.AcquireLeaseRequest)
        self.lease = self.call("lease", f"{verb}Lease", Request(resource="body")).lease

    def retain(self) -> None:
        """Retains the lease. Raises LostError."""
        self.call("lease", "RetainLease", lease_pb2.RetainLeaseRequest(lease=self.lease))

    def holder(self) -> str:
        """Name of the body's lease holder; empty when it is free. Raises LostError."""
        resources = self.call("lease", "ListLeases", lease_pb2.ListLeasesRequest()).resources
        return next((each.lease_owner.client_name for each in resources if each.resource == "body"), "")

    def give_back(self) -> None:
        """Returns the lease. Raises LostError."""
        lease, self.lease = self.lease, None
        if lease is not None:
            self.call("lease", "ReturnLease", lease_pb2.ReturnLeaseRequest(lease=lease))

    def estop_trouble(self) -> str | None:
        """Returns why the E-stop allows no motion, None when it does. Raises LostError."""
        answer = self.call("estop", "GetEstopSystemStatus", estop_pb2.GetEstopSystemStatusRequest())
        wrong = trouble(estop_pb2.EstopStopLevel.DESCRIPTOR, answer.status.stop_level)
        return None if wrong is None else wrong.text

    def power(self, on: bool) -> int:
        """Asks for the motors to be switched on or off; returns the command's number. Raises LostError."""
        Request = power_pb2.PowerCommandRequest
        wanted = Request.REQUEST_ON_MOTORS if on else Request.REQUEST_OFF_MOTORS
        return int(self.call("power", "PowerCommand", Request(lease=self.lease, request=wanted)).power_command_id)

    def power_is_done(self, number: int) -> bool:
        """Returns whether the motors have been switched as a command said. Raises LostError."""
        request = power_pb2.PowerCommandFeedbackRequest(power_command_id=number)
        return bool(self.call("power", "PowerCommandFeedback", request).status == power_pb2.STATUS_SUCCESS)

    def stop(self, *, power_off: bool = False) -> None:
        """Stops base and arm, or lets the robot sit down and switch its motors off. Raises LostError."""
        command = robot_command_pb2.RobotCommand()
        whole = command.full_body_command
        (whole.safe_power_off_request if power_off else whole.stop_request).SetInParent()
        self.command(command)

    def command(self, command: Any) -> Any:
        """Sends a command with the lease; returns the answer. Raises LostError."""
        request = robot_command_pb2.RobotCommandRequest(lease=self.lease, command=command)
        request.clock_identifier = self.clock_identifier
        return self.call("robot-command", "RobotCommand", request)

    def feedback(self, number: int) -> Any:
        """Returns how far a command has come. Raises LostError."""
        request = robot_command_pb2.RobotCommandFeedbackRequest(robot_command_id=number)
        return self.call("robot-command", "RobotCommandFeedback", request).feedback

    def dock(self, station: int | None, end_s: float) -> int:
        """Asks to dock at a station, or (None) to undock, until a robot time; returns the number. Raises LostError."""
        how = docking_pb2.PREP_POSE_UNDOCK if station is None else docking_pb2.PREP_POSE_USE_POSE
        request = docking_pb2.DockingCommandRequest(lease=self.lease, clock_identifier=self.clock_identifier)
        request.docking_station_id, request.prep_pose_behavior = station or 0, how
        request.end_time.FromNanoseconds(round(end_s * 1e9))
        return int(self.call("docking", "DockingCommand", request).docking_command_id)

    def docking(self, number: int) -> int:
        """Returns the status of a command to dock or undock. Raises LostError."""
        request = docking_pb2.DockingCommandFeedbackRequest(docking_command_id=number)
        return int(self.call("docking", "DockingCommandFeedback", request, checked=False).status)

    def open_door(self, command: Any) -> int:
        """Sends a door command; returns the command's number. Raises LostError."""
        request = door_pb2.OpenDoorCommandRequest(lease=self.lease, door_command=command)
        return int(self.call("door", "OpenDoor", request).door_command_id)

    def opening(self, number: int) -> int:
        """Returns the status of a door command. Raises LostError."""
        answer = self.call("door", "OpenDoorFeedback", door_pb2.OpenDoorFeedbackRequest(door_command_id=number))
        return int(answer.feedback.status)

    def docked(self) -> bool:
        """Returns whether the robot stands on a docking station. Raises LostError."""
        if not self.has("docking"):
            return False
        answer = self.call("docking", "GetDockingState", docking_pb2.GetDockingStateRequest())
        return bool(answer.dock_state.status == docking_pb2.DockState.DOCK_STATUS_DOCKED)

    def state(self) -> Any:
        """Returns the response with the robot's state. Raises LostError."""
        return self.call("robot-state", "GetRobotState", robot_state_pb2.RobotStateRequest())


class RobotClock(Protocol):
    """Clock of the robot for an adapter: the protocol's clock, and the robot's time."""

    def now(self) -> float:
        """Seconds since the connection was made."""

    def robot_time_s(self) -> float:
        """The robot's time (s since 1970)."""


class WallClock:
    """Clock of a real robot: wall time; `advance` waits, and `after` is called after each wait."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._began_s, self._due_s = connection, time.monotonic(), 0.0
        self.after: list[Callable[[], None]] = []

    def now(self) -> float:
        """Seconds since the connection was made."""
        return time.monotonic() - self._began_s

    def robot_time_s(self) -> float:
        """The robot's time (s since 1970)."""
        return self._connection.robot_time_s()

    def advance(self, dt_s: float) -> None:
        """Waits until dt_s have passed since the last advance; a late program goes on at once."""
        self._due_s = max(self._due_s + dt_s, self.now() - dt_s)
        time.sleep(max(0.0, self._due_s - self.now()))
        for each in self.after:
            each()


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
