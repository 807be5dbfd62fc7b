"""What the detect skill does when it cannot look or sees nothing."""

import numpy as np
from scripted_robot import MODEL, ScriptedRobot, context_of, failed

from skills.api import Cause, Surface
from skills.detect.skill import Detect, DetectInputs

TABLE = Surface("kitchen table", ((0.8, -0.6), (1.4, -0.6), (1.4, 0.6), (0.8, 0.6)), 0.75)
FAR = Surface("shelf", ((8.0, -0.6), (8.4, -0.6), (8.4, 0.6), (8.0, 0.6)), 0.75)


def test_an_unknown_class_is_named():
    skill = Detect(context_of(ScriptedRobot()))
    failed(skill, DetectInputs(("coke", "unicorn"), (TABLE,)), Cause.PRECONDITION, "what unicorn looks like")


def test_an_unknown_attribute_is_named():
    skill = Detect(context_of(ScriptedRobot()))
    failed(skill, DetectInputs(("coke",), (TABLE,), ("shiny",)), Cause.PRECONDITION, "what shiny looks like")


def test_no_surface_is_a_failed_precondition():
    failed(Detect(context_of(ScriptedRobot())), DetectInputs(("coke",), ()), Cause.PRECONDITION, "no surface")


def test_a_surface_out_of_sight_is_a_failed_precondition():
    skill = Detect(context_of(ScriptedRobot()))
    failed(skill, DetectInputs(("coke",), (FAR,)), Cause.PRECONDITION, "the shelf is out of sight")


def test_nothing_seen_is_a_failed_postcondition_and_the_arm_is_stowed():
    robot, log = ScriptedRobot(), []
    skill = Detect(context_of(robot, log))
    failed(
        skill,
        DetectInputs(("coke", "beer"), (TABLE,)),
        Cause.POSTCONDITION,
        "no coke or beer seen on the kitchen table",
    )
    assert np.allclose(robot.q, MODEL.stowed_rad, atol=1e-6)
    assert next(topic for topic, _ in log) == "object_to_detect"
    assert {topic for topic, _ in log} == {"object_to_detect", "detections"}


def test_the_jaw_is_opened_to_look_and_closed_again():
    robot = ScriptedRobot()
    skill = Detect(context_of(robot))
    failed(skill, DetectInputs(("coke",), (TABLE,)), Cause.POSTCONDITION, "no coke")
    assert robot.opening_rad == 0.0
