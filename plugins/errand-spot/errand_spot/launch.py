"""Runs a program of the SDK unchanged against a server on this machine.

    python launch.py CERTIFICATE PORT real|client SCRIPT [ARGUMENT ...]

The interpreter needs the SDK, and nothing of Errand. Whatever address, certificate and login the program names, it
reaches the server, trusts its certificate and logs in by the variables of the environment. With `client` the program
steps the robot whenever its main thread sleeps.
"""

from __future__ import annotations

import logging
import os
import queue  # noqa: F401  it keeps the true time, as `grpc` does
import re
import runpy
import sys
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from threading import current_thread, main_thread
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

import grpc
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp

if TYPE_CHECKING:
    from bosdyn.client.sdk import Sdk

ADVANCE: Final = "/errand.Clock/Advance"
"""Call by which a client steps the robot: google.protobuf.Duration -> google.protobuf.Timestamp."""
_NAME: Final = "clock.spot.robot"
_ADDRESS: Final = "127.0.0.1"
_LOGIN: Final = ("BOSDYN_CLIENT_USERNAME", "BOSDYN_CLIENT_PASSWORD")
_LEAST_SDK: Final = (3, 2, 0)


def refuse_old_sdk() -> None:
    """Ends the program with a line when its interpreter has no SDK, or one that is too old."""
    try:
        found = version("bosdyn-client")
    except PackageNotFoundError:
        found = ""
    if tuple(int(part) for part in re.findall(r"\d+", found)[:2]) < _LEAST_SDK[:2]:
        least = ".".join(map(str, _LEAST_SDK))
        said = f"{found} is too old" if found else "is missing"
        hint = f"{sys.executable} -m pip install 'bosdyn-client>={least}'"
        sys.exit(f"Error: the SDK (bosdyn-client) {said}; at least {least} is needed.\nHint: {hint}")


def use_server(certificate: Path, port: int) -> None:
    """Makes the SDK of this process reach and trust the server whatever address, certificate or login it names."""
    from bosdyn.client import channel, robot_command
    from bosdyn.client.auth import AuthClient
    from bosdyn.client.exceptions import ResponseError
    from bosdyn.client.sdk import Sdk

    load, connect = Sdk.load_robot_cert, channel.create_secure_channel
    user, secret = (os.environ.get(name, "") for name in _LOGIN)

    def load_robot_cert(self: Sdk, resource_path_glob: str | None = None) -> None:
        load(self, str(certificate))

    def create_secure_channel(_address: str, _port: int, *arguments: Any, **named: Any) -> Any:
        return connect(_ADDRESS, port, *arguments, **named)

    def logged_in(call: Callable[..., Any]) -> Callable[..., Any]:
        return lambda self, own, password, *more, **named: call(self, user or own, secret or password, *more, **named)

    def reason(self: ResponseError) -> str:
        return f"{told(self)} {getattr(self.response, 'message', '')}".rstrip()

    if downloads := os.environ.get("SPOT_HTTPS_PORT"):
        from bosdyn.client import data_acquisition_helpers

        def open_url(request: Any, *arguments: Any, **named: Any) -> Any:
            request.full_url = f"https://{_ADDRESS}:{downloads}/{request.full_url.split('/', 3)[-1]}"
            return opened(request, *arguments, **named)

        opened, data_acquisition_helpers.urlopen = data_acquisition_helpers.urlopen, open_url
    if streaming := getattr(robot_command, "RobotCommandStreamingClient", None):

        def stream(self: Any, commands: Any) -> Any:
            answer = sent(self, commands)
            if answer.message:  # programs do not look at it
                logging.warning("JointControlStream: %s", answer.message)
            return answer

        sent, streaming.send_joint_control_commands = streaming.send_joint_control_commands, stream
    told, ResponseError.__str__ = ResponseError.__str__, reason  # it names what was refused
    ResponseError.__repr__ = lambda self: f"{type(self).__name__}({str(self)!r})"
    Sdk.load_robot_cert, channel.create_secure_channel = load_robot_cert, create_secure_channel
    AuthClient.auth, AuthClient.auth_async = logged_in(AuthClient.auth), logged_in(AuthClient.auth_async)


def step_in_sleep(certificate: Path, port: int) -> None:
    """Replaces the module `time` of the SDK and the program: it has the robot's time, and `sleep` steps the robot.

    Call it before the import of the SDK. Other threads sleep in true time.
    """
    trusted = grpc.ssl_channel_credentials(certificate.read_bytes())
    channel = grpc.secure_channel(f"{_ADDRESS}:{port}", trusted, [("grpc.ssl_target_name_override", _NAME)])
    advance = channel.unary_unary(ADVANCE, Duration.SerializeToString, Timestamp.FromString)
    robot_ns = [advance(Duration()).ToNanoseconds()]

    def sleep(seconds: Any) -> None:
        if current_thread() is main_thread():
            asked = Duration()
            asked.FromNanoseconds(round(seconds * 1e9))
            robot_ns[:] = [advance(asked).ToNanoseconds()]
        else:
            time.sleep(seconds)

    robots = ModuleType("time")
    vars(robots).update(vars(time), sleep=sleep)
    for name in ("time", "monotonic", "perf_counter"):
        vars(robots).update({name: lambda: robot_ns[0] * 1e-9, f"{name}_ns": lambda: robot_ns[0]})
    sys.modules["time"] = robots
    from bosdyn.client.time_sync import TimeSyncEndpoint, TimeSyncThread

    def wait_for_sync(self: Any, timeout_sec: float = 3.0) -> None:
        self.endpoint.establish_timesync(break_on_success=True)

    TimeSyncEndpoint.clock_skew = property(lambda self: Duration())
    TimeSyncThread.wait_for_sync = wait_for_sync


def main() -> None:
    """Runs the script of the command line as `python SCRIPT` does."""
    certificate, port, pace, script, *arguments = sys.argv[1:]
    refuse_old_sdk()
    if pace == "client":
        step_in_sleep(Path(certificate), int(port))
    use_server(Path(certificate), int(port))
    sys.argv = [script, *arguments]
    sys.path[0] = str(Path(script).resolve().parent)
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main()
