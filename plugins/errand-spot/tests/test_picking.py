"""What stands at a point is picked up, where a grasp is allowed."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from errand_spot.picking import PointPicker, observe
from plant.robots.spot.kind import spot_capabilities
from skills.api import PlanningError
from skills.robot import Pose2D
from skills.stack import default_stack
from skills.testing.blocks import Block
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot, Start

TOP_M = 0.75
"""Height of the table."""
LEGS = [Block(x, y, x + 0.05, y + 0.05, 0.0, 0.70, (90, 60, 40)) for x in (1.2, 1.75) for y in (-0.6, 0.55)]
TABLE = [Block(1.2, -0.6, 1.8, 0.6, 0.70, TOP_M, (130, 90, 60)), *LEGS]
CAN = Block(1.347, -0.033, 1.413, 0.033, TOP_M, TOP_M + 0.115, (200, 20, 25), loose=True)


def table_points(x0=1.2, y0=-0.6, x1=1.8, y1=0.6, z=TOP_M, apart=0.02):
    x, y = np.meshgrid(np.arange(x0, x1, apart), np.arange(y0, y1, apart))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])


def can_points(x=1.38, y=0.0, base=TOP_M, height=0.115):
    across, up = np.meshgrid(np.linspace(-0.033, 0.033, 7), np.linspace(0.0, height, 12))
    return np.column_stack([np.full(up.size, x - 0.033), y + across.ravel(), base + up.ravel()])


def test_an_object_stands_on_the_surface_below_the_point():
    floor = table_points(0.6, -0.6, 1.2, 0.6, 0.0)
    points = np.concatenate([floor, table_points(), can_points()])
    seen = observe(np.array([1.347, 0.0, 0.80]), points, 3.0)
    assert seen.position_W[2] - 0.5 * seen.size_m[2] == pytest.approx(TOP_M, abs=0.01)
    assert seen.size_m[2] == pytest.approx(0.115, abs=0.02)
    assert seen.position_W[:2] == pytest.approx((1.36, 0.0), abs=0.03)
    assert seen.surface is None


def test_an_object_below_a_cabinet_ends_at_its_own_top():
    cabinet = table_points(1.2, -0.3, 1.6, 0.3, 1.4)
    seen = observe(np.array([1.347, 0.0, 0.80]), np.concatenate([table_points(), can_points(), cabinet]), 3.0)
    assert seen.position_W[2] + 0.5 * seen.size_m[2] == pytest.approx(TOP_M + 0.115, abs=0.01)


def test_an_object_without_a_surface_stands_on_the_floor():
    seen = observe(np.array([1.0, 0.0, 0.05]), can_points(1.033, 0.0, 0.0), 0.0)
    assert seen.surface == "floor"


@pytest.fixture
def before_the_table():
    """A robot before a table with a can, and how to pick up what stands at a point; returns the picker and the end."""
    clock = VirtualClock()
    start = Start(Pose2D(0.45, 0.0, 0.0))
    robot = ScriptedRobot(clock, capabilities=spot_capabilities(), blocks=[*TABLE, CAN], start=start)
    lease = robot.take_lease("test")

    def pick(point_O, allows=lambda R_OH: True, most_s=90.0):
        picker = PointPicker(robot, clock)
        cloud_O = np.concatenate([table_points(), can_points()]) - [0.45, 0.0, 0.0]
        picker.begin(lease, np.array(point_O), cloud_O, allows)
        while (held := picker.step()) is None and clock.now() < most_s:
            clock.advance(0.05)
        picker.end()
        return picker, held

    return robot, pick


@dataclass
class Stuck:
    """The usual planner of the arm, which finds no path while the robot holds something."""

    robot: ScriptedRobot
    planner: Any
    was_asked: bool = False

    def path(self, *ends):
        if self.robot.held is None:
            return self.planner.path(*ends)
        self.was_asked = True
        raise PlanningError("no free path was found for the arm")

    def __getattr__(self, name):
        return getattr(self.planner, name)


ANY, NONE = (lambda R_OH: True), (lambda R_OH: False)
# Whether the can is there and can be carried; the point, and how the hand may turn -> is it held, had it a plan?
PICKS = [
    (True, True, (0.90, 0.0, 0.80), ANY, True, True),
    (True, True, (0.90, 0.0, 0.80), NONE, False, False),
    (False, True, (0.90, 0.3, 0.76), ANY, False, True),
    (True, False, (0.90, 0.0, 0.80), ANY, True, True),
]


@pytest.mark.parametrize(("there", "carried", "point_O", "allows", "holds", "planned"), PICKS)
def test_an_object_at_a_point_is_picked_up_where_that_is_allowed(
    before_the_table, monkeypatch, there, carried, point_O, allows, holds, planned
):
    robot, pick = before_the_table
    if not there:
        robot.blocks.remove(CAN)
    stuck = Stuck(robot, default_stack().arm_planner)
    if not carried:
        monkeypatch.setattr("errand_spot.picking.default_stack", lambda: replace(default_stack(), arm_planner=stuck))
    picker, held = pick(point_O, allows)
    assert stuck.was_asked == (not carried)
    in_hand = None if robot.held is None else robot.held.colour
    assert (held, not picker.no_plan, in_hand) == (holds, planned, CAN.colour if holds else None)
