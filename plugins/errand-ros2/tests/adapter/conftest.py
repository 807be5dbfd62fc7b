"""A scripted Spot before a wall, served in ROS 2, and an adapter's robot in lock-step with it."""

from contextlib import closing

import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port
from ros_lock_step import LockStep, scripted

from errand_ros2.wire.node import Place


@pytest.fixture(scope="module")
def step_of_module():
    with closing(LockStep(scripted, Place(port=free_port()))) as made:
        yield made


@pytest.fixture
def step(step_of_module):
    """The robot with its `lease`, where it began, and `until` for the ends of commands."""
    step_of_module.begin_anew()
    return step_of_module
