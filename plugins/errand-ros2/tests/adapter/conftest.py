"""A scripted Spot before a wall, served in ROS 2, and an adapter's robot in lock-step with it."""

from contextlib import closing

import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port
from ros_lock_step import LockStep

from errand_ros2.wire.node import Place
from plant.robots.spot.kind import spot_capabilities
from skills.testing.blocks import Block
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


def scripted(**options):
    """Builds a scripted Spot two metres before a wall."""
    clock = VirtualClock()
    given = {"capabilities": spot_capabilities(), "blocks": [Block(3.0, -1.5, 3.2, 1.5)], **options}
    return ScriptedRobot(clock, **given), clock


@pytest.fixture
def step():
    """The robot with its `lease`, and `until` for the ends of commands."""
    with closing(LockStep(scripted, Place(port=free_port()))) as made:
        made.lease = made.robot.acquire_lease("test")
        yield made
