"""`ros2://NAMESPACE`: a scripted robot served in real time, connected, silent, and what is refused."""

import threading
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port

from errand_ros2 import backend
from errand_ros2.backend import Ros2
from errand_ros2.server import RobotServer
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from plant.robots.spot.kind import spot_capabilities
from skills.inputs.errors import InputError
from skills.robot import CommandState, RobotStoppedError
from skills.testing.blocks import ROOM
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


@contextmanager
def served(place):
    """A scripted Spot in a server of real time; the function `end` ends it."""
    clock, ended = VirtualClock(), threading.Event()
    robot = ScriptedRobot(clock, capabilities=spot_capabilities(), blocks=ROOM)
    with open_session(place) as session:
        server = RobotServer(session, robot, clock)
        thread = threading.Thread(target=server.run, args=(ended,))
        thread.start()

        def end():
            ended.set()
            thread.join()

        try:
            yield SimpleNamespace(robot=robot, end=end)
        finally:
            end()


@pytest.fixture
def place():
    return Place(port=free_port())


def driver(place, **options):
    return Ros2(network=f"@{place.host}:{place.port}", **options)


def test_a_connected_robot_drives_and_is_still_at_the_end(place):
    with served(place) as it:
        with driver(place).connect("alice", "Alice") as made:
            made.make_ready()
            robot, clock = made.robot, made.clock
            lease = robot.acquire_lease("test")
            assert (
                made.notes[0]
                == f"Robot of ROS 2 at ros2://alice, by domain 0, Zenoh at tcp/127.0.0.1:{place.port} (by its router)."
            )
            for _ in range(10):
                drive = robot.drive(0.4, 0.0, 0.0, until_s=clock.now() + 0.4, lease=lease)
                clock.advance(0.05)
            assert robot.command_status(drive).state is CommandState.RUNNING
            assert robot.odometry().velocity[0] > 0.2
        until = it.robot.odometry().stamp_s + 0.6
        while it.robot.odometry().stamp_s < until:
            threading.Event().wait(0.05)
        assert not it.robot.velocity.any()


def test_a_robot_that_falls_silent_ends_the_run_after_15_s(place, monkeypatch):
    monkeypatch.setattr("errand_ros2.adapter.robot.GONE_S", 0.3)
    monkeypatch.setattr("errand_ros2.adapter.clocks._GRACE_S", 0.1)
    with served(place) as it, driver(place).connect("alice", "Alice") as made:
        made.make_ready()
        made.clock.advance(0.05)
        it.end()
        with pytest.raises(RobotStoppedError, match="has not answered"):
            for _ in range(200):
                made.clock.advance(0.05)


@pytest.mark.parametrize("address", ["", "a b", "1a", "a//b", "ä"])
def test_an_address_that_is_no_namespace_is_refused(place, address):
    with pytest.raises(InputError, match="is no name of ROS 2"), driver(place).connect(address, "Alice"):
        pass


def test_a_robot_that_is_not_there_is_refused_with_the_topic_that_is_missing(place, monkeypatch):
    monkeypatch.setattr(backend, "_PATIENCE_S", 0.2)
    with pytest.raises(InputError, match="nothing is heard on /clock"), driver(place).connect("alice", "Alice"):
        pass
    with (
        served(place),
        pytest.raises(InputError, match="nothing is heard on odom"),
        driver(place).connect("bob", "Bob"),
    ):
        pass
