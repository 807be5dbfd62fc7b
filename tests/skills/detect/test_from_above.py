"""A robot with a head camera searches once more with its body raised."""

import pytest
from table_robot import HEAD_CAPABILITIES, TableRobot, context_of, failed, outcome
from table_scene import COKE, TABLE

from skills.api import Cause, Succeeded
from skills.detect.skill import Detect, DetectInputs

USUAL_M, TOP_M = HEAD_CAPABILITIES.standing_height_m, HEAD_CAPABILITIES.height_range_m[1]
INPUTS = DetectInputs(("coke",), (TABLE,))


def test_robot_raises_its_body_to_search_and_lowers_it_afterwards():
    robot = TableRobot(capabilities=HEAD_CAPABILITIES, things=())
    failed(Detect(context_of(robot)), INPUTS, Cause.POSTCONDITION, "no coke seen on the table")
    heights_m = [height_m for height_m, _ in robot.commanded("stand")]
    assert max(heights_m) == pytest.approx(TOP_M, abs=0.02)
    assert heights_m[-1] == USUAL_M


def test_robot_does_not_raise_its_body_when_it_finds_the_object_at_once():
    robot = TableRobot(capabilities=HEAD_CAPABILITIES, things=(COKE,))
    assert isinstance(outcome(Detect(context_of(robot)), INPUTS), Succeeded)
    assert max((height_m for height_m, _ in robot.commanded("stand")), default=0.0) < TOP_M - 0.05


class OnlyFromAbove(TableRobot):
    """Robot whose objects are visible only from a raised body."""

    def image(self, source, **how):
        self.things = (COKE,) if self.height_m > USUAL_M + 0.16 else ()
        return super().image(source, **how)


def test_object_visible_only_from_above_is_found():
    robot = OnlyFromAbove(capabilities=HEAD_CAPABILITIES)
    assert isinstance(outcome(Detect(context_of(robot)), INPUTS), Succeeded)
    assert robot.height_m > USUAL_M + 0.16
