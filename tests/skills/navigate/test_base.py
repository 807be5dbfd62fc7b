"""Drives of the base, which a scripted robot obeys."""

import numpy as np
import pytest
from table_robot import TableRobot, context_of

from skills.navigate.base import Base
from skills.testing.blocks import Block
from skills.testing.estimators import BlockCostmap

TICK_S = 0.1
CHANGE = TICK_S * np.array([1.0, 1.0, 2.0])


def driven(wanted, costmap, seconds=3.0):
    """Drives towards a velocity for a while; the last answer and the robot's pose."""
    robot = TableRobot()
    base, drives = Base(context_of(robot, costmap=costmap)), False
    for _ in range(round(seconds / TICK_S)):
        drives = base.drive_clear(np.array(wanted), CHANGE)
        robot.advance(TICK_S)
    return drives, robot.odometry().pose, base.last_velocity


def wall_at(x_m):
    return BlockCostmap([Block(x_m, -9.0, x_m + 9.0, 9.0)])


def test_the_base_gains_speed_by_the_change_that_is_allowed():
    assert driven((0.8, 0.0, 0.0), BlockCostmap(), 0.3)[2] == pytest.approx([0.3, 0.0, 0.0])
    assert driven((0.8, 0.0, 0.0), BlockCostmap(), 2.0)[2] == pytest.approx([0.8, 0.0, 0.0])


# wall at x (m), half a body's length and more ahead -> how far the base comes
@pytest.mark.parametrize("x_m", [1.2, 1.8])
def test_the_base_stops_before_a_wall(x_m):
    drives, pose, _ = driven((0.8, 0.0, 0.0), wall_at(x_m), 6.0)
    assert not drives
    assert x_m - 0.9 < pose.x_m < x_m - 0.45


def test_the_base_may_leave_an_obstacle_that_it_is_close_to():
    drives, pose, _ = driven((-0.4, 0.0, 0.0), wall_at(0.5), 1.0)
    assert drives
    assert pose.x_m < -0.2


def test_the_base_halts_another_driver_before_it_drives_or_stops():
    robot, halted = TableRobot(), []
    base = Base(context_of(robot, costmap=BlockCostmap()))
    halt = halted.append
    for take_back in (lambda: base.drive((0.1, 0.0, 0.0)), base.stop, base.stop):
        base.leave_to(lambda: halt("halted"))
        take_back()
    base.stop()
    assert halted == ["halted"] * 3


def test_the_base_stands_still_after_it_has_stopped_another_driver():
    robot, halted = TableRobot(), []
    base = Base(context_of(robot, costmap=BlockCostmap()))
    base.drive((0.5, 0.0, 0.0))
    robot.advance(TICK_S)
    base.leave_to(halted.clear)
    base.leave_to(halted.clear)  # nothing new
    base.stop()
    robot.advance(TICK_S)
    assert robot.odometry().velocity == pytest.approx((0.0, 0.0, 0.0))
