"""A camera that is fixed to the body looks for objects: at what is in its view, from the only height."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from executive.testing.bench import SkillBench
from skills.detect.skill import Detect
from skills.routine import SkillFailure
from skills.testing.blocks import ROOM
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


@pytest.fixture
def look(rover_kind):
    """Looks at a point of the body frame with the body raised; returns the robot's calls."""
    clock = VirtualClock()
    robot = ScriptedRobot(clock, capabilities=rover_kind.capabilities(), blocks=ROOM)
    skill = Detect(SkillBench(robot, clock).context())

    def looked(*p_BT):
        for _ in islice(skill.look_at(np.array(p_BT), [], "looking", raised_m=0.15), 200):
            clock.advance(0.05)
        return robot.calls

    return looked


def test_a_robot_without_an_arm_looks_with_the_camera_of_its_body(rover_kind):
    clock, armless = VirtualClock(), replace(rover_kind.capabilities(), arm=None, gripper=None)
    robot = ScriptedRobot(clock, capabilities=armless, blocks=ROOM)
    skill = Detect(SkillBench(robot, clock).context())
    for _ in islice(skill.look_at(np.array([1.2, 0.0, 0.5]), [], "looking"), 200):
        clock.advance(0.05)
    assert "move_arm" not in robot.calls
    assert np.allclose(skill.p_BS, armless.object_camera.X_FC.translation())


def test_a_body_that_cannot_rise_stays_at_its_height(look):
    assert "stand" not in look(1.2, 0.0, 0.5)


def test_a_point_out_of_view_is_refused(look):
    with pytest.raises(SkillFailure, match="outside of the view of the"):
        look(0.5, 2.0, 0.5)
