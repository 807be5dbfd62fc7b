"""A robot with a head camera searches once more with its body raised."""

import pytest
from head_robot import HEAD_CAPABILITIES, HeadRobot
from scripted_robot import context_of, failed, outcome
from table_scene import COKE, TABLE

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs

USUAL_M, TOP_M = HEAD_CAPABILITIES.standing_height_m, HEAD_CAPABILITIES.height_range_m[1]
INPUTS = DetectInputs(("coke",), (TABLE,))


def test_robot_raises_its_body_to_search_and_lowers_it_afterwards():
    robot = HeadRobot(things=())
    failed(Detect(context_of(robot)), INPUTS, Cause.POSTCONDITION, "no coke seen on the table")
    assert max(robot.stood_m) == pytest.approx(TOP_M, abs=0.02)
    assert robot.stood_m[-1] == USUAL_M


def test_robot_does_not_raise_its_body_when_it_finds_the_object_at_once():
    robot = HeadRobot(things=(COKE,))
    assert isinstance(outcome(Detect(context_of(robot)), INPUTS), Succeeded)
    assert max(robot.stood_m, default=0.0) < TOP_M - 0.05


def test_object_visible_only_from_above_is_found():
    robot = HeadRobot(things=())
    stand = robot.stand

    def stand_up(height_m, pitch_rad, **how):
        """Robot whose objects are visible only from a raised body."""
        robot.things = (COKE,) if height_m > USUAL_M + 0.16 else ()
        return stand(height_m, pitch_rad, **how)

    robot.stand = stand_up
    assert isinstance(outcome(Detect(context_of(robot)), INPUTS), Succeeded)
    assert robot.height_m > USUAL_M + 0.16
