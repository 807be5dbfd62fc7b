"""Tests of a can that moves between the close view and the grasp."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from executive.testing.bench import SkillBench
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, ObjectKind, ObjectObservation
from skills.manipulation.grasp.skill import Grasp
from skills.manipulation.grasp.skill import GraspInputs as Inputs
from skills.robot import Pose2D
from skills.testing.blocks import ROOM, TABLE_CAN
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot, Start

NO_DEPTH = "no depth"
HERE = Pose2D(0.45, 0.0, 0.0)
AT = (0.5 * (TABLE_CAN.x0 + TABLE_CAN.x1), 0.5 * (TABLE_CAN.y0 + TABLE_CAN.y1), TABLE_CAN.z0)
SEEN = Inputs(
    ObjectObservation(0.0, ObjectKind("coke"), (AT[0], AT[1], 0.807), (0.066, 0.066, 0.115), 0.0, 1.0, "table")
)


class Disturbed(Grasp):
    """Something happens each time that the hand is at its pre-grasp."""

    happens = ()

    def _aimed(self, view, plan, thing):
        *self.happens, next_one = self.happens or (lambda: None,)
        next_one()
        return (yield from super()._aimed(view, plan, thing))


def _without_depth(robot):
    """The next picture has no depth, as that of a camera just above a table."""
    image_of = robot.image

    def image(source):
        robot.image = image_of
        seen = image_of(source)
        return replace(seen, depth_m=np.zeros_like(seen.depth_m))

    robot.image = image


def ran(*moves):
    """The skill's run when the can is moved by (x, y) m at the first, second, ... pre-grasp; None takes it away."""
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=spot_capabilities(), blocks=(*ROOM, TABLE_CAN), start=Start(HERE))

    def move(by):
        if by == NO_DEPTH:
            return _without_depth(robot)
        (can,) = (block for block in robot.blocks if block.loose)
        robot.blocks.remove(can)
        if by is not None:
            robot.blocks.append(
                replace(can, x0=can.x0 + by[0], x1=can.x1 + by[0], y0=can.y0 + by[1], y1=can.y1 + by[1])
            )

    skill = type("Disturbed", (Disturbed,), {"happens": [partial(move, by) for by in reversed(moves)]})
    bench = SkillBench(robot, clock, localiser=KnownPlace(HERE), costmap=BlockCostmap(robot.blocks))
    return bench.run(skill, SEEN), robot


# how far the can is pushed across the fingers before the hand closes -> how often it is looked at until it is taken
@pytest.mark.parametrize(("by", "views"), [((0.0, 0.0), 1), ((0.0, 0.025), 1), ((0.0, -0.03), 1), ((0.0, 0.1), 2)])
def test_a_can_that_is_pushed_is_taken_after_another_look_if_it_is_far(by, views):
    run, robot = ran(by)
    assert (run.outcome, run.message) == ("success", "holding the coke")
    assert robot.held is not None
    assert sum("looking closely" in message for _, message in run.messages) == views


def test_a_can_that_was_removed_is_gone_and_the_hand_does_not_close():
    run, _ = ran(None)
    assert (run.outcome, run.cause) == ("failure", Cause.PRECONDITION)
    assert "no longer where it was seen" in run.message
    assert not any("closing on" in message for _, message in run.messages)


def test_a_can_that_moves_at_every_attempt_is_a_failed_precondition():
    run, _ = ran((0.0, 0.1), (0.0, -0.1))
    assert (run.outcome, run.cause) == ("failure", Cause.PRECONDITION)
    assert "moves while the hand reaches for it" in run.message


def test_the_hand_does_not_wait_for_depth_that_its_camera_is_too_near_to_see():
    run, robot = ran(NO_DEPTH)
    assert (run.outcome, robot.held is not None) == ("success", True)
    assert not any("shows nothing" in message for _, message in run.messages)
