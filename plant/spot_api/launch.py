"""Runs a program of the SDK unchanged against a server on this machine.

    python -m plant.spot_api.launch CERTIFICATE PORT SCRIPT [ARGUMENT ...]

A program that names no certificate of its own trusts the server's, and its robots are reached at the server's port.
"""

from __future__ import annotations

import runpy
import sys
from functools import partialmethod
from pathlib import Path
from typing import Any

from bosdyn.client.sdk import Sdk


def use_server(certificate: Path, port: int) -> None:
    """Makes the SDK of this process trust a certificate and use a port, unless a program says otherwise."""
    load, create = Sdk.load_robot_cert, Sdk.create_robot

    def load_robot_cert(self: Sdk, resource_path_glob: str | None = None) -> None:
        load(self, resource_path_glob or str(certificate))

    def create_robot(self: Sdk, *arguments: Any, server_port: int, **named: Any) -> Any:
        robot = create(self, *arguments, **named)
        robot.update_secure_channel_port(server_port)
        return robot

    Sdk.load_robot_cert = load_robot_cert
    Sdk.create_robot = partialmethod(create_robot, server_port=port)


def main() -> None:
    """Runs the script of the command line as `python SCRIPT` does."""
    certificate, port, script, *arguments = sys.argv[1:]
    use_server(Path(certificate), int(port))
    sys.argv = [script, *arguments]
    sys.path[0] = str(Path(script).resolve().parent)
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main()
