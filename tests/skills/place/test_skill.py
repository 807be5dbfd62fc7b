"""What the place skill does when it cannot put the thing down."""

import numpy as np
from scripted_robot import ScriptedRobot, context_of, failed

from skills.api import Cause, Failed, Running, Surface
from skills.place.skill import Place, PlaceInputs

TABLE = Surface("kitchen table", ((0.75, -0.5), (1.3, -0.5), (1.3, 0.5), (0.75, 0.5)), 0.7)
CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])


def test_an_empty_gripper_is_a_failed_precondition():
    failed(Place(context_of(ScriptedRobot())), PlaceInputs(TABLE), Cause.PRECONDITION, "nothing in the gripper")


def test_a_surface_that_is_not_seen_is_a_failed_planning_and_the_thing_is_kept():
    robot = ScriptedRobot(q=CARRYING.copy(), holding=True, opening_rad=0.3)
    failed(Place(context_of(robot)), PlaceInputs(TABLE), Cause.PLANNING, "the kitchen table is not seen from here")
    assert robot.holding
    assert robot.opening_rad == 0.3


def resumed(robot, checkpoint):
    """Go on to the end of putting down, which a restart broke off."""
    skill = Place(context_of(robot))
    skill.checkpoint = checkpoint
    skill.resume(PlaceInputs(TABLE))
    while isinstance(step := skill.step(), Running):
        robot.advance(0.05)
    skill.end()
    return step


def test_after_a_restart_an_empty_gripper_that_was_not_yet_over_the_spot_is_a_failed_precondition():
    step = resumed(ScriptedRobot(), {})
    assert isinstance(step, Failed)
    assert (step.cause, "not yet over its place" in step.message) == (Cause.PRECONDITION, True)


def test_after_a_restart_an_empty_gripper_makes_the_robot_look_whether_the_thing_stands_there():
    robot = ScriptedRobot()
    step = resumed(robot, {"spot_W": [0.9, 0.0]})
    assert isinstance(step, Failed)  # the scripted camera is dark
    assert "not seen" in step.message
    assert robot.arm_commands


def test_a_thing_still_held_after_a_restart_is_put_down_as_it_was_brought():
    robot = ScriptedRobot(q=CARRYING.copy(), holding=True, opening_rad=0.3)
    skill = Place(context_of(robot))
    skill.checkpoint = {"carried": np.eye(3).tolist()}
    assert np.array_equal(skill._carried().matrix(), np.eye(3))


def test_what_is_still_in_the_gripper_is_not_put_down():
    robot = ScriptedRobot(holding=True)
    assert Place(context_of(robot)).undone(PlaceInputs(TABLE)) is not None
