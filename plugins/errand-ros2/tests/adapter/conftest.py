"""A scripted Spot before a wall, served in ROS 2, and an adapter's robot in lock-step with it."""

from contextlib import closing

import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port
from ros_lock_step import LockStep, scripted

from errand_ros2.wire.node import Place


@pytest.fixture
def step():
    """The robot with its `lease`, and `until` for the ends of commands."""
    with closing(LockStep(scripted, Place(port=free_port()))) as made:
        made.lease = made.robot.acquire_lease("test")
        yield made
