"""A server with a scripted robot, and the SDK's robot logged in to it.

In a test module with `PACE = Pace.CLIENT` the sleep of the test and of the SDK steps the robot, else a thread does.
"""

import os
import sys
import time
from dataclasses import dataclass

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

import bosdyn.client
from bosdyn.client.lease import LeaseKeepAlive
from bosdyn.client.robot_command import RobotCommandClient, blocking_stand
from bosdyn.client.robot_state import RobotStateClient
from bosdyn.client.time_sync import TimeSyncEndpoint
from google.protobuf.duration_pb2 import Duration
from lock_step import PASSWORD, USER, robot_time, scripted_spot

from errand_spot.server.computer import Pace
from errand_spot.server.server import SpotServer
from skills.testing.blocks import Block
from skills.testing.robot import ScriptedRobot


@dataclass
class Served:
    """A running server, its scripted robot, and a way to log in."""

    server: SpotServer
    scripted: ScriptedRobot

    def login(self, password=PASSWORD):
        sdk = bosdyn.client.create_standard_sdk("test", cert_resource_glob=str(self.server.certificate))
        robot = sdk.create_robot("127.0.0.1")
        robot.update_secure_channel_port(self.server.port)
        robot.authenticate(USER, password)
        return robot


@pytest.fixture
def served(credentials, request, monkeypatch):
    pace = getattr(request.module, "PACE", Pace.REAL)
    with scripted_spot(credentials, pace=pace, blocks=[Block(1.7, -1.5, 1.9, 1.5)]) as (server, scripted):
        if pace is Pace.CLIENT:
            monkeypatch.setattr(TimeSyncEndpoint, "clock_skew", Duration())
            monkeypatch.setattr("bosdyn.util._clock_source_fn", server.computer.now_s)
            sdk = [module for name, module in sys.modules.items() if name.startswith("bosdyn.")]
            for module in (request.module, *sdk):
                if vars(module).get("time") is time:
                    monkeypatch.setattr(module, "time", robot_time(server.computer))
        yield Served(server, scripted)


@dataclass
class Spot:
    """The SDK's robot with its clients, standing with motors on."""

    robot: bosdyn.client.Robot
    commands: RobotCommandClient
    states: RobotStateClient
    served: Served

    @property
    def tree(self):
        return self.states.get_robot_state().kinematic_state.transforms_snapshot


@pytest.fixture
def spot(served, monkeypatch):
    monkeypatch.setattr("errand_spot.server.computer.POWER_ON_S", 0.0)
    robot = served.login()
    while not robot.time_sync.has_established_time_sync:
        time.sleep(0.002)  # of the wall: the robot has not begun to sit down
    with LeaseKeepAlive(robot.ensure_client("lease"), must_acquire=True, return_at_exit=True):
        robot.power_on(timeout_sec=10, update_frequency=20.0)
        commands = robot.ensure_client("robot-command")
        blocking_stand(commands, timeout_sec=5.0, update_frequency=5.0)
        yield Spot(robot, commands, robot.ensure_client("robot-state"), served)
    robot.time_sync.stop()


os.environ.setdefault("GRPC_VERBOSITY", "NONE")
