"""The connection to a robot: login, clock, E-stop, lease, power; every call has a time limit."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any, Final, Protocol

import bosdyn.client
import grpc
from bosdyn.api import (
    estop_pb2,
    estop_service_pb2_grpc,
    header_pb2,
    image_service_pb2_grpc,
    lease_pb2,
    lease_service_pb2_grpc,
    manipulation_api_service_pb2_grpc,
    point_cloud_service_pb2_grpc,
    power_pb2,
    power_service_pb2_grpc,
    robot_command_pb2,
    robot_command_service_pb2_grpc,
    robot_state_pb2,
    robot_state_service_pb2_grpc,
    time_sync_pb2,
    time_sync_service_pb2_grpc,
)

from skills.files.errors import InputError
from skills.robot import CommandCause

CLIENT: Final = "errand"
CALL_S: Final = 0.5
_SLOW_S: Final = 5.0
_OFF_S, _LOOK_S = 15.0, 0.1
_ROUND_TRIPS: Final = 5
_STUBS: Final[Mapping[str, Callable[[Any], Any]]] = {
    "estop": estop_service_pb2_grpc.EstopServiceStub,
    "image": image_service_pb2_grpc.ImageServiceStub,
    "lease": lease_service_pb2_grpc.LeaseServiceStub,
    "manipulation": manipulation_api_service_pb2_grpc.ManipulationApiServiceStub,
    "velodyne-point-cloud": point_cloud_service_pb2_grpc.PointCloudServiceStub,
    "power": power_service_pb2_grpc.PowerServiceStub,
    "robot-command": robot_command_service_pb2_grpc.RobotCommandServiceStub,
    "robot-state": robot_state_service_pb2_grpc.RobotStateServiceStub,
    "time-sync": time_sync_service_pb2_grpc.TimeSyncServiceStub,
}


class LostError(RuntimeError):
    """A call that the robot did not answer, or answered with an error; the message names call and cause."""

    def __init__(self, message: str, cause: CommandCause = CommandCause.NO_ANSWER) -> None:
        super().__init__(message)
        self.cause = cause


@dataclass(frozen=True)
class Address:
    """Address of a robot: host, port, and the certificate that it must show (None: the SDK's own)."""

    host: str
    port: int = 443
    certificate: Path | None = None


class Connection:
    """Connection to one robot."""

    def __init__(self, address: Address, user: str, password: str) -> None:
        """Logs in. Raises InputError when the robot cannot be reached, or refuses user and password."""
        glob = None if address.certificate is None else str(address.certificate)
        sdk = bosdyn.client.create_standard_sdk(CLIENT, cert_resource_glob=glob)
        self._robot = sdk.create_robot(address.host)
        self._robot.update_secure_channel_port(address.port)
        where = f"spot://{address.host}:{address.port}"
        try:
            self._robot.authenticate(user, password, timeout=_SLOW_S)
            services = {entry.name for entry in self._robot.list_services()}
        except bosdyn.client.auth.InvalidLoginError as error:
            hint = "check --user, and the password that was typed or stands in BOSDYN_CLIENT_PASSWORD"
            raise InputError(f"{where}: the robot refuses user '{user}' with this password", hint=hint) from error
        except bosdyn.client.Error as error:
            hint = "check address and network; is the robot on?"
            raise InputError(f"{where}: the robot does not answer ({_cause(error)})", hint=hint) from error
        self.has_lidar = "velodyne-point-cloud" in services
        wanted = [name for name in _STUBS if name in services]
        self._stubs = {name: _STUBS[name](self._robot.ensure_channel(name)) for name in wanted}
        self.clock_identifier, self._ahead_s = "", 0.0
        self.lease: Any = None

    def call(self, service: str, name: str, request: Any, timeout_s: float = CALL_S) -> Any:
        """Calls a service. Raises LostError when no good answer comes in time."""
        request.header.client_name = CLIENT
        request.header.request_timestamp.FromNanoseconds(time.time_ns())
        try:
            answer = getattr(self._stubs[service], name)(request, timeout=timeout_s)
        except (grpc.RpcError, KeyError) as error:
            lacks = isinstance(error, KeyError) or error.code() is grpc.StatusCode.UNIMPLEMENTED
            cause = CommandCause.UNSUPPORTED if lacks else CommandCause.NO_ANSWER
            raise LostError(f"{service}/{name}: {_cause(error)}", cause) from error
        if answer.header.error.code not in (0, 1):
            invalid = answer.header.error.code == header_pb2.CommonError.CODE_INVALID_REQUEST
            cause = CommandCause.INVALID if invalid else CommandCause.FAULT
            raise LostError(f"{service}/{name}: {answer.header.error.message or answer.header.error.code}", cause)
        return answer

    # -- clock -------------------------------------------------------------------------------------------------------

    def synchronise(self) -> None:
        """Estimates how far the robot's clock is ahead of this machine's, which never jumps. Raises LostError."""
        request = time_sync_pb2.TimeSyncUpdateRequest(clock_identifier=self.clock_identifier)
        for _ in range(_ROUND_TRIPS):
            sent_ns = time.monotonic_ns()
            answer = self.call("time-sync", "TimeSyncUpdate", request)
            back_ns = time.monotonic_ns()
            self.clock_identifier = answer.clock_identifier
            request = time_sync_pb2.TimeSyncUpdateRequest(clock_identifier=self.clock_identifier)
            trip = request.previous_round_trip
            trip.client_tx.FromNanoseconds(sent_ns)
            trip.server_rx.CopyFrom(answer.header.request_received_timestamp)
            trip.server_tx.CopyFrom(answer.header.response_timestamp)
            trip.client_rx.FromNanoseconds(back_ns)
        skew = answer.state.best_estimate.clock_skew
        self._ahead_s = skew.seconds + skew.nanos * 1e-9

    def robot_time_s(self) -> float:
        """The robot's time now (s since 1970), by the last synchronisation."""
        return time.monotonic() + self._ahead_s

    # -- lease, E-stop and power -------------------------------------------------------------------------------------

    def acquire(self, *, take: bool = False) -> None:
        """Acquires the body's lease, or takes it. Raises LostError that names its owner."""
        if take:
            answer = self.call("lease", "TakeLease", lease_pb2.TakeLeaseRequest(resource="body"))
        else:
            answer = self.call("lease", "AcquireLease", lease_pb2.AcquireLeaseRequest(resource="body"))
        if answer.status != 1:
            holder = answer.lease_owner.client_name or "another client"
            raise LostError(f"the lease is held by {holder}", CommandCause.NO_LEASE)
        self.lease = answer.lease

    def retain(self) -> bool:
        """Retains the lease; returns whether it still counts. Raises LostError."""
        answer = self.call("lease", "RetainLease", lease_pb2.RetainLeaseRequest(lease=self.lease))
        return bool(answer.lease_use_result.status == lease_pb2.LeaseUseResult.STATUS_OK)

    def give_back(self) -> None:
        """Returns the lease."""
        lease, self.lease = self.lease, None
        if lease is not None:
            self.call("lease", "ReturnLease", lease_pb2.ReturnLeaseRequest(lease=lease))

    def is_released(self) -> bool:
        """Returns whether the E-stop allows motion. Raises LostError."""
        answer = self.call("estop", "GetEstopSystemStatus", estop_pb2.GetEstopSystemStatusRequest())
        return bool(answer.status.stop_level == estop_pb2.ESTOP_LEVEL_NONE)

    def power(self, on: bool) -> int:
        """Asks for the motors to be switched on or off; returns the command's number. Raises LostError."""
        Request = power_pb2.PowerCommandRequest
        wanted = Request.REQUEST_ON_MOTORS if on else Request.REQUEST_OFF_MOTORS
        answer = self.call("power", "PowerCommand", Request(lease=self.lease, request=wanted))
        if answer.status not in (power_pb2.STATUS_IN_PROGRESS, power_pb2.STATUS_SUCCESS):
            name = power_pb2.PowerCommandStatus.Name(answer.status)
            raise LostError(f"the motors stay off: {name}", CommandCause.UNPOWERED)
        return int(answer.power_command_id)

    def stop(self) -> None:
        """Stops base and arm. Raises LostError."""
        command = robot_command_pb2.RobotCommand()
        command.full_body_command.stop_request.SetInParent()
        self.command(command)

    def power_off_safely(self) -> None:
        """Lets the robot sit down and switch its motors off. Raises LostError."""
        command = robot_command_pb2.RobotCommand()
        command.full_body_command.safe_power_off_request.SetInParent()
        self.command(command)
        until_s = time.monotonic() + _OFF_S
        while self.state().power_state.motor_power_state == robot_state_pb2.PowerState.MOTOR_POWER_STATE_ON:
            if time.monotonic() > until_s:
                raise LostError("the motors do not switch off")
            self.retain()
            Event().wait(_LOOK_S)

    def command(self, command: Any) -> Any:
        """Sends a command with the lease; returns the answer. Raises LostError."""
        request = robot_command_pb2.RobotCommandRequest(
            lease=self.lease, command=command, clock_identifier=self.clock_identifier
        )
        return self.call("robot-command", "RobotCommand", request)

    def state(self) -> Any:
        """Returns the robot's state. Raises LostError."""
        return self.call("robot-state", "GetRobotState", robot_state_pb2.RobotStateRequest()).robot_state


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
        Event().wait(max(0.0, self._due_s - self.now()))
        for each in self.after:
            each()


def _cause(error: Exception) -> str:
    """The cause of a failed call in a few words."""
    if isinstance(error, grpc.RpcError):
        return f"{error.code().name.lower()}: {error.details()}"
    return str(error).splitlines()[0] if str(error) else type(error).__name__
