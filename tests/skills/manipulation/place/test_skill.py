"""Tests of failures of the place skill."""

import math

import numpy as np
import pytest
from pydrake.math import RotationMatrix
from table_robot import TableRobot, context_of, failed
from table_scene import RED, Can
from table_scene import TABLE as TOP

from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Failed, ObjectKind, Running, Succeeded, Surface
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.place.free_spots import HeldObject, SpotSearch
from skills.manipulation.place.skill import Place, PlaceInputs
from skills.robot import Pose2D

MODEL = arm_model(spot_capabilities())
LEVEL_FORWARD = RotationMatrix.MakeXRotation(np.pi / 2)
"""A hand that points ahead and closes level, as after a grasp from the side."""
TABLE = Surface("kitchen table", ((0.75, -0.5), (1.3, -0.5), (1.3, 0.5), (0.75, 0.5)), 0.7)


def carrying():
    return TableRobot(np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57]), holding=True, opening=0.3)


def test_an_empty_gripper_is_a_failed_precondition():
    failed(Place(context_of(TableRobot())), PlaceInputs(TABLE), Cause.PRECONDITION, "nothing in the gripper")


def test_an_unseen_surface_is_a_failed_planning_and_the_object_stays_in_the_hand():
    robot = carrying()
    failed(Place(context_of(robot)), PlaceInputs(TABLE), Cause.PLANNING, "the kitchen table is not seen from here")
    assert (robot.holding, robot.opening) == (True, 0.3)


def test_a_surface_without_an_allowed_spot_is_a_failed_planning_before_anything_moves():
    robot = carrying()
    inputs = PlaceInputs(TABLE, clear_of=((1.0, 0.0, 2.0),))
    failed(Place(context_of(robot)), inputs, Cause.PLANNING, "the kitchen table has no spot out of the way")
    assert (robot.arm_commands, robot.holding) == ([], True)


def resumed(robot, checkpoint, surface=TABLE):
    """Go on to the end of putting down, which a restart broke off."""
    skill = Place(context_of(robot))
    skill.checkpoint = checkpoint
    skill.resume(PlaceInputs(surface))
    while isinstance(step := skill.step(), Running):
        robot.advance(0.05)
    skill.end()
    return step


def test_after_a_restart_an_empty_gripper_that_was_not_yet_over_the_spot_is_a_failed_precondition():
    robot = TableRobot()
    step = resumed(robot, {})
    assert (type(step), step.cause) == (Failed, Cause.PRECONDITION)
    assert "before it was over its place" in step.message
    assert robot.arm_commands == []


def test_after_a_restart_a_robot_with_an_empty_gripper_looks_for_the_object_on_its_spot():
    robot = TableRobot()
    step = resumed(robot, {"spot_W": [0.9, 0.0]})
    assert isinstance(step, Failed)  # the scripted camera is dark
    assert "not seen" in step.message
    assert robot.arm_commands


class _Rolling(TableRobot):
    """A can stands on the table, and rolls to and fro until a time."""

    def image(self, source, *, visual=True, depth=True):
        self.things = (Can(0.95, 0.02 * math.sin(7.0 * min(self.now_s, self.rests_s)), 0.033, 0.115, RED),)
        return super().image(source, visual=visual, depth=depth)


@pytest.mark.parametrize(("rests_s", "why"), [(0.0, None), (3.0, None), (math.inf, "the object still moves on the")])
def test_a_placed_object_must_be_at_rest(rests_s, why):
    robot = _Rolling(rests_s=rests_s)
    step = resumed(robot, {"spot_W": [0.95, 0.0]}, TOP)
    assert isinstance(step, Succeeded) is (why is None), step
    assert robot.now_s > rests_s or why is not None
    assert why is None or (step.cause is Cause.POSTCONDITION and why in step.message)


def test_an_object_held_after_a_restart_is_put_down_as_it_was_brought():
    skill = Place(context_of(carrying()))
    skill.checkpoint = {"carried": np.eye(3).tolist()}
    assert np.array_equal(skill._carried().matrix(), np.eye(3))


def test_messages_name_the_object_that_was_grasped():
    robot = carrying()
    context = context_of(robot)
    context.payload.kind = ObjectKind("mug", ("red",))
    skill = Place(context)
    skill._carried()
    assert skill.undone(PlaceInputs(TABLE)) == "the red mug is still in the gripper"
    context.payload.kind = None
    assert skill.undone(PlaceInputs(TABLE)) == "the red mug is still in the gripper"


def test_an_object_still_in_the_gripper_is_a_failed_postcondition():
    assert Place(context_of(TableRobot(holding=True))).undone(PlaceInputs(TABLE)) is not None


BENCH = Surface("bench", ((0.0, -0.5), (0.6, -0.5), (0.6, 0.5), (0.0, 0.5)), 0.82)
FROM_ABOVE = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.array([[0.19, -0.02, -0.02], [0.24, 0.02, 0.02]]))
FROM_THE_SIDE = HeldObject(LEVEL_FORWARD, np.array([[0.15, -0.05, -0.03], [0.22, 0.06, 0.03]]))


# Held, and how far the body is from the spot (m) -> whether the arm can put it down there
@pytest.mark.parametrize(
    ("held", "off_m", "reached"),
    [(FROM_ABOVE, 0.85, True), (FROM_ABOVE, 1.0, False), (FROM_THE_SIDE, 1.0, True), (FROM_THE_SIDE, 1.4, False)],
)
def test_the_robot_stands_nearer_to_place_an_object_held_from_above(held, off_m, reached):
    cost = Place(context_of(TableRobot(holding=True)))._reach(SpotSearch(BENCH, held))(np.array([0.1, 0.0]))
    assert (cost(Pose2D(0.1 - off_m, 0.0, 0.0)) is not None) is reached


def test_before_a_high_surface_the_body_stands_up():
    skill = Place(context_of(TableRobot(holding=True)))
    assert skill._heights_m(BENCH)[0] > spot_capabilities().standing_height_m == skill._heights_m(TABLE)[0]
