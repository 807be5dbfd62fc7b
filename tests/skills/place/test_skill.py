"""What the place skill does when it cannot put the thing down."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from scripted_robot import ScriptedRobot, context_of, failed
from table_scene import RED, Can
from table_scene import TABLE as TOP

from plant.spot.capabilities import spot_capabilities
from skills.api import Cause, Failed, Running, Succeeded, Surface
from skills.arm.collision import ArmScene, Box
from skills.arm.kinematics import arm_model
from skills.arm.motion import RrtConnect
from skills.place.skill import HeldObject, Place, PlaceInputs, Release, above_goal, clear_heights, with_held
from skills.robot import Pose2D

MODEL = arm_model(spot_capabilities())
LEVEL_FORWARD = RotationMatrix.MakeXRotation(np.pi / 2)
"""A hand that points ahead and closes level, as after a grasp from the side."""
TABLE = Surface("kitchen table", ((0.75, -0.5), (1.3, -0.5), (1.3, 0.5), (0.75, 0.5)), 0.7)
CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])


def test_an_empty_gripper_is_a_failed_precondition():
    failed(Place(context_of(ScriptedRobot())), PlaceInputs(TABLE), Cause.PRECONDITION, "nothing in the gripper")


def test_a_surface_that_is_not_seen_is_a_failed_planning_and_the_thing_is_kept():
    robot = ScriptedRobot(q=CARRYING.copy(), holding=True, opening=0.3)
    failed(Place(context_of(robot)), PlaceInputs(TABLE), Cause.PLANNING, "the kitchen table is not seen from here")
    assert robot.holding
    assert robot.opening == 0.3


def test_a_surface_without_a_spot_out_of_the_way_is_a_failed_planning_before_anything_moves():
    robot = ScriptedRobot(q=CARRYING.copy(), holding=True, opening=0.3)
    inputs = PlaceInputs(TABLE, clear_of=((1.0, 0.0, 2.0),))
    failed(Place(context_of(robot)), inputs, Cause.PLANNING, "the kitchen table has no room out of the way")
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
    step = resumed(ScriptedRobot(), {})
    assert isinstance(step, Failed)
    assert (step.cause, "not yet over its place" in step.message) == (Cause.PRECONDITION, True)


def test_after_a_restart_an_empty_gripper_makes_the_robot_look_whether_the_thing_stands_there():
    robot = ScriptedRobot()
    step = resumed(robot, {"spot_W": [0.9, 0.0]})
    assert isinstance(step, Failed)  # the scripted camera is dark
    assert "not seen" in step.message
    assert robot.arm_commands


class _Rolling(ScriptedRobot):
    """A can stands on the table, and rolls to and fro until a time."""

    rests_s = 0.0

    def image(self, source, *, visual=True, depth=True):
        off_m = 0.02 * math.sin(7.0 * min(self.now_s, self.rests_s))
        self.things = (Can(0.95, off_m, 0.033, 0.115, RED),)
        return super().image(source, visual=visual, depth=depth)


@pytest.mark.parametrize(("rests_s", "why"), [(0.0, None), (3.0, None), (math.inf, "the object still moves on the")])
def test_what_was_put_down_is_to_be_at_rest(rests_s, why):
    robot = _Rolling()
    robot.rests_s = rests_s
    step = resumed(robot, {"spot_W": [0.95, 0.0]}, TOP)
    assert isinstance(step, Succeeded) is (why is None), step
    assert robot.now_s > rests_s or why is not None
    assert why is None or (step.cause is Cause.POSTCONDITION and why in step.message)


def test_a_thing_still_held_after_a_restart_is_put_down_as_it_was_brought():
    robot = ScriptedRobot(q=CARRYING.copy(), holding=True, opening=0.3)
    skill = Place(context_of(robot))
    skill.checkpoint = {"carried": np.eye(3).tolist()}
    assert np.array_equal(skill._carried().matrix(), np.eye(3))


def test_what_is_still_in_the_gripper_is_not_put_down():
    robot = ScriptedRobot(holding=True)
    assert Place(context_of(robot)).undone(PlaceInputs(TABLE)) is not None


def test_a_held_object_reaches_below_the_hand_as_far_as_its_lowest_corner():
    bottle_H = np.array([[0.15, -0.14, -0.03], [0.22, 0.08, 0.03]])
    held = HeldObject(LEVEL_FORWARD, bottle_H)  # the hand's y axis points up
    assert held.drop_m(LEVEL_FORWARD) == pytest.approx(0.14)
    assert [held.drop_m(each) for each in held.rotations(0.7)] == pytest.approx([0.14] * 3)
    assert held.p_HO == pytest.approx([0.185, -0.03, 0.0])


def test_what_was_taken_from_above_is_put_down_with_the_fingers_down_whatever_way_they_are_turned():
    down = RotationMatrix.MakeYRotation(np.pi / 2)
    turned = HeldObject(down, np.zeros((2, 3))).rotations(0.3)
    assert len(turned) == 8
    assert [each.matrix()[2, 0] for each in turned] == pytest.approx([-1.0] * 8)


# What stands beside the first of two spots (m to its side) -> the spot that is taken
@pytest.mark.parametrize(("beside_m", "taken"), [(None, 0), (0.35, 0), (0.12, 1), (-0.12, 1)])
def test_a_spot_is_left_out_where_the_open_hand_would_touch_a_tall_thing_beside_it(beside_m, taken):
    spots_B = [np.array([0.85, y, 0.02]) for y in (0.0, -0.5)]
    beside = [] if beside_m is None else [Box(RigidTransform([0.8, beside_m, 0.2]), (0.1, 0.1, 0.3))]
    scene = ArmScene(spot_capabilities(), MODEL, {})
    can_H = np.array([[0.15, -0.05, -0.03], [0.22, 0.06, 0.03]])
    goal = above_goal(spots_B, HeldObject(LEVEL_FORWARD, can_H), RrtConnect(), Release(beside, 0.7))
    above = MODEL.X_BH(goal(scene, CARRYING)).translation()
    assert int(np.argmin([abs(above[1] - spot[1]) for spot in spots_B])) == taken


# How high (m) a surface below the hand at its goal is -> whether the path is planned with the object in the hand
@pytest.mark.parametrize(("top_m", "held"), [(-0.3, True), (0.1, False)])
def test_what_is_held_keeps_clear_on_the_way_unless_it_touches_something_at_an_end(top_m, held):
    scene, can = ArmScene(spot_capabilities(), MODEL, {}), Box(RigidTransform([0.2, -0.08, 0.0]), (0.06, 0.16, 0.06))
    above_B = RigidTransform(LEVEL_FORWARD, [0.8, 0.0, 0.25])
    (q_goal, *_) = MODEL.inverse(above_B)
    scene.set_boxes([Box(RigidTransform([1.0, 0.0, top_m - 0.05]), (0.3, 0.6, 0.1))])
    with_held(lambda scene, q: q_goal, can)(scene, CARRYING)
    lower = MODEL.inverse(RigidTransform(LEVEL_FORWARD, [0.8, 0.0, top_m + 0.1]))[0]
    assert scene.free(q_goal)
    assert scene.free(lower) is not held


BENCH = Surface("bench", ((0.0, -0.5), (0.6, -0.5), (0.6, 0.5), (0.0, 0.5)), 0.82)
FROM_ABOVE = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.array([[0.19, -0.02, -0.02], [0.24, 0.02, 0.02]]))
FROM_THE_SIDE = HeldObject(LEVEL_FORWARD, np.array([[0.15, -0.05, -0.03], [0.22, 0.06, 0.03]]))


# Held, and how far the body is from the spot (m) -> whether the arm can put it down there
@pytest.mark.parametrize(
    ("held", "off_m", "reached"),
    [(FROM_ABOVE, 0.85, True), (FROM_ABOVE, 1.0, False), (FROM_THE_SIDE, 1.0, True), (FROM_THE_SIDE, 1.4, False)],
)
def test_what_is_held_from_above_is_put_down_nearer(held, off_m, reached):
    skill = Place(context_of(ScriptedRobot(holding=True)))
    cost = skill._reach_cost(np.array([0.1, 0.0]), BENCH, held)
    assert (cost(Pose2D(0.1 - off_m, 0.0, 0.0)) is not None) is reached


def test_before_a_high_surface_the_body_stands_up():
    skill = Place(context_of(ScriptedRobot(holding=True)))
    assert skill._heights_m(BENCH)[0] > spot_capabilities().standing_height_m == skill._heights_m(TABLE)[0]


# Where the held object is (x, and its lowest z, with the body 0.76 m high) -> the heights that are tried.
@pytest.mark.parametrize(
    ("x_m", "low_m", "tried_m"),
    [
        (0.9, 0.9, (0.76, 0.6)),  # over the table of 0.7 m: 0.2 m of room, 1 cm of it is kept
        (0.7, 0.9, (0.76, 0.6)),  # its edge
        (0.4, 0.9, (0.76, 0.6, 0.5, 0.4)),  # before it
        (0.9, 0.5, (0.76, 0.6, 0.5, 0.4)),  # under it
    ],
)
def test_a_body_is_not_lowered_so_far_that_what_it_holds_is_pressed_on_the_surface(x_m, low_m, tried_m):
    corners_W = np.array([[x_m, y, z] for y in (-0.03, 0.03) for z in (low_m, low_m + 0.1)])
    assert tuple(clear_heights((0.76, 0.6, 0.5, 0.4), 0.76, corners_W, TABLE)) == tried_m
