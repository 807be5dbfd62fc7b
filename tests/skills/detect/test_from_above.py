"""A robot with its camera on its head looks once more from as high as its body goes."""

import pytest
from head_robot import HEAD_CAPABILITIES, HeadRobot
from scripted_robot import context_of, failed, outcome
from table_scene import COKE, TABLE

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs

USUAL_M, TOP_M = HEAD_CAPABILITIES.standing_height_m, HEAD_CAPABILITIES.height_range_m[1]
INPUTS = DetectInputs(("coke",), (TABLE,))


def test_what_is_not_found_is_looked_for_from_as_high_as_the_body_goes_which_stands_as_usual_afterwards():
    robot = HeadRobot(things=())
    failed(Detect(context_of(robot)), INPUTS, Cause.POSTCONDITION, "no coke seen on the table")
    assert max(robot.stood_m) == pytest.approx(TOP_M, abs=0.02)
    assert robot.stood_m[-1] == USUAL_M


def test_what_is_found_at_once_is_not_looked_for_from_above():
    robot = HeadRobot(things=(COKE,))
    assert isinstance(outcome(Detect(context_of(robot)), INPUTS), Succeeded)
    assert max(robot.stood_m, default=0.0) < TOP_M - 0.05


def test_what_only_shows_from_above_is_found():
    robot = HeadRobot(things=())
    stand = robot.stand

    def stand_up(height_m, pitch_rad, **how):
        """Things come into view from a body that stands high."""
        robot.things = (COKE,) if height_m > USUAL_M + 0.16 else ()
        return stand(height_m, pitch_rad, **how)

    robot.stand = stand_up
    assert isinstance(outcome(Detect(context_of(robot)), INPUTS), Succeeded)
    assert robot.height_m > USUAL_M + 0.16
