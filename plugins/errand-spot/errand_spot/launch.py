"""Runs a program of the SDK unchanged against a server on this machine.

    python launch.py CERTIFICATE PORT real|client SCRIPT [ARGUMENT ...]

The interpreter needs the SDK, and nothing of Errand. A program that names no certificate trusts the server's, and its
robots are reached at the server's port. With `client` the program steps the robot whenever its main thread sleeps.
"""

from __future__ import annotations

import queue  # noqa: F401  it keeps the true time, as `grpc` does
import runpy
import sys
import time
from functools import partialmethod
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


def use_server(certificate: Path, port: int) -> None:
    """Makes the SDK of this process trust a certificate and use a port, unless a program says otherwise."""
    from bosdyn.client.sdk import Sdk

    load, create = Sdk.load_robot_cert, Sdk.create_robot

    def load_robot_cert(self: Sdk, resource_path_glob: str | None = None) -> None:
        load(self, resource_path_glob or str(certificate))

    def create_robot(self: Sdk, *arguments: Any, server_port: int, **named: Any) -> Any:
        robot = create(self, *arguments, **named)
        robot.update_secure_channel_port(server_port)
        return robot

    Sdk.load_robot_cert = load_robot_cert
    Sdk.create_robot = partialmethod(create_robot, server_port=port)


def step_in_sleep(certificate: Path, port: int) -> None:
    """Replaces the module `time` of the SDK and the program: it has the robot's time, and `sleep` steps the robot.

    Call it before the import of the SDK. Other threads sleep in true time.
    """
    trusted = grpc.ssl_channel_credentials(certificate.read_bytes())
    channel = grpc.secure_channel(f"127.0.0.1:{port}", trusted, [("grpc.ssl_target_name_override", _NAME)])
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
    if pace == "client":
        step_in_sleep(Path(certificate), int(port))
    use_server(Path(certificate), int(port))
    sys.argv = [script, *arguments]
    sys.path[0] = str(Path(script).resolve().parent)
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main()
