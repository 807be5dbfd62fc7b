"""Tests of hand poses that put an object down on a surface."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from plant.robots.spot.kind import spot_capabilities
from skills.api import Surface
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.motion import RrtConnect
from skills.manipulation.place.placement import HeldObject, above_goal, clear_heights, hold_on_path

MODEL = arm_model(spot_capabilities())
LEVEL_FORWARD = RotationMatrix.MakeXRotation(np.pi / 2)
"""A hand that points ahead and closes level, as after a grasp from the side."""
TABLE = Surface("kitchen table", ((0.75, -0.5), (1.3, -0.5), (1.3, 0.5), (0.75, 0.5)), 0.7)
CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])


def test_a_held_object_reaches_below_the_hand_as_far_as_its_lowest_corner():
    bottle_H = np.array([[0.15, -0.14, -0.03], [0.22, 0.08, 0.03]])
    held = HeldObject(LEVEL_FORWARD, bottle_H)  # the hand's y axis points up
    assert held.drop_m(LEVEL_FORWARD) == pytest.approx(0.14)
    assert [held.drop_m(each) for each in held.rotations(0.7)] == pytest.approx([0.14] * 3)
    assert held.p_HO == pytest.approx([0.185, -0.03, 0.0])


def test_an_object_taken_from_above_is_placed_with_the_fingers_down_at_any_turn():
    turned = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.zeros((2, 3))).rotations(0.3)
    assert len(turned) == 8
    assert [each.matrix()[2, 0] for each in turned] == pytest.approx([-1.0] * 8)


# What stands beside the first of two spots (m to its side) -> the spot that is taken
@pytest.mark.parametrize(("beside_m", "taken"), [(None, 0), (0.35, 0), (0.12, 1), (-0.12, 1)])
def test_a_spot_is_left_out_where_the_open_hand_would_touch_a_tall_neighbour(beside_m, taken):
    spots_B = [np.array([0.85, y, 0.02]) for y in (0.0, -0.5)]
    beside = [] if beside_m is None else [Box(RigidTransform([0.8, beside_m, 0.2]), (0.1, 0.1, 0.3))]
    scene = ArmScene(spot_capabilities(), MODEL, {})
    can_H = np.array([[0.15, -0.05, -0.03], [0.22, 0.06, 0.03]])
    goal = above_goal(spots_B, HeldObject(LEVEL_FORWARD, can_H), RrtConnect(), beside, 0.7)
    above = MODEL.X_BH(goal(scene, CARRYING)).translation()
    assert int(np.argmin([abs(above[1] - spot[1]) for spot in spots_B])) == taken


# How high (m) a surface below the hand at its goal is -> whether the path is planned with the object in the hand
@pytest.mark.parametrize(("top_m", "held"), [(-0.3, True), (0.1, False)])
def test_the_held_object_is_checked_on_the_path_unless_it_touches_at_an_end(top_m, held):
    scene, can = ArmScene(spot_capabilities(), MODEL, {}), Box(RigidTransform([0.2, -0.08, 0.0]), (0.06, 0.16, 0.06))
    (q_goal, *_) = MODEL.inverse(RigidTransform(LEVEL_FORWARD, [0.8, 0.0, 0.25]))
    scene.set_boxes([Box(RigidTransform([1.0, 0.0, top_m - 0.05]), (0.3, 0.6, 0.1))])
    hold_on_path(lambda scene, q: q_goal, can)(scene, CARRYING)
    lower = MODEL.inverse(RigidTransform(LEVEL_FORWARD, [0.8, 0.0, top_m + 0.1]))[0]
    assert scene.free(q_goal)
    assert scene.free(lower) is not held


HAMMER = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.array([[0.22, -0.15, -0.05], [0.26, 0.15, 0.05]]))
BOTTLE = HeldObject(RotationMatrix.MakeYRotation(np.pi / 2), np.array([[0.1, -0.04, -0.04], [0.3, 0.04, 0.04]]))


# Held by fingers that point down -> (how far over the surface in m, how tilted in rad) it is brought, the best first
@pytest.mark.parametrize(
    ("held", "ways"), [(HAMMER, [(0.10, 0.0), (0.05, 0.0), (0.05, 0.3)]), (BOTTLE, [(0.10, 0.0), (0.05, 0.0)])]
)
def test_only_flat_objects_are_put_down_tilted(held, ways):
    assert held.approaches() == ways


# A spot ahead (m), 0.1 m above the shoulder -> how far over it and how tilted a hammer is brought
@pytest.mark.parametrize(("ahead_m", "way"), [(0.75, (0.10, 0.0)), (0.82, (0.05, 0.0)), (0.95, (0.05, 0.3))])
def test_a_far_spot_is_reached_from_lower_and_then_tilted(ahead_m, way):
    scene, spot_B = ArmScene(spot_capabilities(), MODEL, {}), np.array([ahead_m, 0.0, 0.3])
    X_BH = MODEL.X_BH(above_goal([spot_B], HAMMER, RrtConnect(), [], 0.7)(scene, CARRYING))
    fingers = X_BH.rotation().matrix()[:, 0]
    lowest_m = X_BH.translation()[2] - HAMMER.drop_m(X_BH.rotation()) - spot_B[2]
    assert (lowest_m, math.asin(fingers[0])) == pytest.approx(way, abs=1e-6)


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
def test_the_body_is_not_lowered_until_the_held_object_presses_on_the_surface(x_m, low_m, tried_m):
    corners_W = np.array([[x_m, y, z] for y in (-0.03, 0.03) for z in (low_m, low_m + 0.1)])
    assert tuple(clear_heights((0.76, 0.6, 0.5, 0.4), 0.76, corners_W, TABLE)) == tried_m
