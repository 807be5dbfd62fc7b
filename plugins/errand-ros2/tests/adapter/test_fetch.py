"""A scripted Fetch in lock-step: its head, its sliding fingers, its wheels and the one ring of its LiDAR."""

from contextlib import closing
from functools import partial

import pytest
from ros_client import free_port
from ros_lock_step import LockStep

from errand_ros2.wire.node import Place
from plant.robots.robot_kind import robot_kind
from skills.robot import CommandCause, CommandState
from skills.testing.blocks import ROOM
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


def scripted(can):
    clock = VirtualClock()
    return ScriptedRobot(clock, capabilities=can, blocks=ROOM), clock


@pytest.fixture
def step():
    can = robot_kind("fetch").capabilities()
    with closing(LockStep(partial(scripted, can), Place(port=free_port()), kind="fetch")) as made:
        made.lease = made.robot.acquire_lease("test")
        yield made


def test_head_gripper_and_scan_of_a_fetch(step):
    robot = step.robot
    until = {"until_s": step.now() + 10.0, "lease": step.lease}
    assert step.ends(robot.point_head(0.3, 0.2, **until)).state is CommandState.DONE
    assert step.served.head_rad == pytest.approx((0.3, 0.2))
    far = robot.command_status(robot.point_head(9.0, 0.0, **until))
    assert (far.state, far.cause) == (CommandState.REFUSED, CommandCause.INVALID)
    assert step.ends(robot.set_gripper(0.08, 20.0, **until)).state is CommandState.DONE
    assert robot.gripper().opening == pytest.approx(0.08, abs=0.003)
    assert robot.scan().ranges_m.shape[0] == 1
    sideways = robot.command_status(robot.drive(0.0, 0.3, 0.0, **until))
    assert (sideways.state, sideways.cause) == (CommandState.REFUSED, CommandCause.INVALID)
    head = robot.image("head").frames.pose("head_camera")
    assert head.translation() == pytest.approx(
        step.served.image("head").frames.pose("head_camera").translation(), abs=1e-6
    )
