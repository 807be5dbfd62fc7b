"""The stow skill: stowed when empty, near the body when holding."""

import numpy as np
from scripted_robot import MODEL, ScriptedRobot, context_of, failed, outcome

from skills.api import Cause, Succeeded
from skills.robot import CommandState, CommandStatus
from skills.stow.skill import Stow, StowInputs

OUT = np.array([0.4, -1.6, 1.6, 0.0, 0.4, 0.0])


def test_a_stowed_arm_is_left_alone():
    robot = ScriptedRobot()
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert robot.arm_commands == []


def test_an_arm_that_is_out_is_stowed():
    robot = ScriptedRobot(q=OUT.copy())
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert np.allclose(robot.q, MODEL.stowed_rad, atol=1e-6)


def test_an_open_empty_gripper_is_closed_first():
    robot = ScriptedRobot(q=OUT.copy(), opening=1.4)
    outcome(Stow(context_of(robot)), StowInputs())
    assert robot.opening == 0.0


def test_a_held_thing_is_drawn_in_and_kept():
    robot = ScriptedRobot(q=OUT.copy(), holding=True, opening=0.3)
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    hand = MODEL.X_BH(robot.q).translation()
    assert hand[0] < 0.52
    assert abs(hand[1]) < 0.2
    assert robot.opening == 0.3


def test_an_arm_that_is_stopped_is_a_failed_execution():
    robot = ScriptedRobot(q=OUT.copy(), arm_answers={1: CommandStatus(CommandState.STOPPED, "expired")})
    failed(Stow(context_of(robot)), StowInputs(), Cause.EXECUTION, "expired")
