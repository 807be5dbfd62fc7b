"""A server with a scripted robot, and the SDK's robot logged in to it.

In a test module with `PACE = Pace.CLIENT` the sleep of the test and of the SDK steps the robot, else a thread does. The
tests of a module with `SHARED = True` share one standing robot.
"""

import os
import sys
import time
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from types import SimpleNamespace

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

import bosdyn.client
from bosdyn.client.lease import LeaseKeepAlive
from bosdyn.client.robot_command import RobotCommandClient, blocking_stand
from bosdyn.client.robot_state import RobotStateClient
from bosdyn.client.time_sync import TimeSyncEndpoint
from google.protobuf.duration_pb2 import Duration
from lock_step import PASSWORD, USER, robot_time, scripted, scripted_spot

from errand_spot.server.computer import Grip, Pace
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY
from errand_spot.server.scan_points import ScanPoints
from errand_spot.server.server import SpotServer
from skills.testing.blocks import Block
from skills.testing.robot import ScriptedRobot

WALL = Block(1.7, -1.5, 1.9, 1.5)


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


@contextmanager
def serving(credentials, module):
    """Serves a scripted robot at the pace of a test module."""
    pace = getattr(module, "PACE", Pace.REAL)
    with pytest.MonkeyPatch.context() as patch, scripted_spot(credentials, pace=pace, blocks=[WALL]) as (server, robot):
        if pace is Pace.CLIENT:
            patch.setattr(TimeSyncEndpoint, "clock_skew", Duration())
            patch.setattr("bosdyn.util._clock_source_fn", server.computer.now_s)
            sdk = [each for name, each in sys.modules.items() if name.startswith("bosdyn.")]
            for each in (module, *sdk):
                if vars(each).get("time") is time:
                    patch.setattr(each, "time", robot_time(server.computer))
        yield Served(server, robot)


@pytest.fixture
def served(credentials, request):
    with serving(credentials, request.module) as made:
        yield made


@dataclass
class Spot:
    """The SDK's robot with its clients, standing with motors on."""

    robot: bosdyn.client.Robot
    commands: RobotCommandClient
    states: RobotStateClient
    served: Served

    def __post_init__(self):
        self._claims = dict(self.served.server.computer.leases._claims)

    @property
    def tree(self):
        return self.states.get_robot_state().kinematic_state.transforms_snapshot

    def client(self, kind):
        """Client of a service that the SDK does not register by itself."""
        self.robot.service_client_factories_by_type[kind.service_type] = kind
        return self.robot.ensure_client(kind.default_service_name)

    def stands_again(self):
        """Puts the robot back to its start; returns whether that is possible: it may have lost power or lease."""
        computer = self.served.server.computer
        if not computer.able or computer.settling or computer.regions or computer.leases._claims != self._claims:
            return False
        computer.do(self._restart).result()
        blocking_stand(self.commands, timeout_sec=5.0, update_frequency=5.0)
        return True

    def _restart(self):
        computer, (fresh, _) = self.served.server.computer, scripted(blocks=[WALL])
        computer.stop_parts((MOBILITY, ARM, GRIPPER))
        vars(computer.robot).update({**vars(fresh), "_clock": computer.clock})
        computer.lease = computer.robot.take_lease("the server of Spot's API")
        computer.grip, computer.scan_points, computer.dock_O, computer.feet_O = Grip(), ScanPoints(), None, None
        computer.step()


@contextmanager
def standing(credentials, module):
    """Serves a robot that stands, and holds its lease."""
    with serving(credentials, module) as served, pytest.MonkeyPatch.context() as patch:
        patch.setattr("errand_spot.server.computer.POWER_ON_S", 0.0)
        robot = served.login()
        while not robot.time_sync.has_established_time_sync:
            time.sleep(0.002)  # of the wall: the robot has not begun to sit down
        with LeaseKeepAlive(robot.ensure_client("lease"), must_acquire=True, return_at_exit=True):
            robot.power_on(timeout_sec=10, update_frequency=20.0)
            commands = robot.ensure_client("robot-command")
            blocking_stand(commands, timeout_sec=5.0, update_frequency=5.0)
            yield Spot(robot, commands, robot.ensure_client("robot-state"), served)
        robot.time_sync.stop()


@pytest.fixture(scope="module")
def shared():
    """The standing robot of a module, if it has one, and its ending."""
    with ExitStack() as ending:
        yield SimpleNamespace(spot=None, ending=ending)


@pytest.fixture
def spot(credentials, shared, request):
    if shared.spot is None or not shared.spot.stands_again():
        shared.ending.close()
        shared.spot = None
        shared.spot = shared.ending.enter_context(standing(credentials, request.module))
    yield shared.spot
    if not getattr(request.module, "SHARED", False):
        shared.ending.close()
        shared.spot = None


os.environ.setdefault("GRPC_VERBOSITY", "NONE")
