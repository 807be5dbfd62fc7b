"""Tests of body heights and of grasps within reach."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_robot import CAPABILITIES, GRIPPER, MODEL

from skills.api import ObjectKind, ObjectObservation, Surface
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.held_object import square_hand_pose
from skills.manipulation.arm.poses import hand_rotation
from skills.manipulation.grasp.candidates import GraspCandidate
from skills.manipulation.grasp.close_view import space_about
from skills.manipulation.grasp.planning import GeometricGraspPlanner
from skills.manipulation.grasp.reach import (
    ReachCheck,
    body_heights_m,
    openings,
    passing,
    raise_onto_surface,
)
from skills.robot import Pose2D

CANDIDATES = partial(GeometricGraspPlanner().candidates, p_BS=MODEL.p_BS, gripper=GRIPPER)
CAN = ObjectObservation(0.0, ObjectKind("coke"), (0.9, 0.0, 0.76), (0.066, 0.066, 0.115), 0.0, 1.0, "table")
HERE = Pose2D(0.0, 0.0, 0.0)
LOW_M, USUAL_M, HIGH_M = 0.425, 0.52, 0.575


# height of the surface (m) -> the body height that is tried first
@pytest.mark.parametrize(("base_m", "first_m"), [(0.0, LOW_M), (0.45, USUAL_M), (0.9, HIGH_M)])
def test_the_body_crouches_for_the_floor_and_stands_up_for_high_objects(base_m, first_m):
    heights_m = body_heights_m(base_m, CAPABILITIES)
    low, high = CAPABILITIES.height_range_m
    assert heights_m[0] == pytest.approx(first_m, abs=0.006)
    assert len(heights_m) == 3
    assert all(low <= height_m <= high for height_m in heights_m)


def test_a_body_of_one_height_has_one():
    fixed = replace(CAPABILITIES, height_range_m=(0.52, 0.52), standing_height_m=0.52)
    assert body_heights_m(0.0, fixed) == (0.52,)


def test_a_can_that_stands_free_is_reached_from_the_usual_height_and_no_other_is_looked_at():
    found = _check(()).all(HERE.transform, (USUAL_M, LOW_M, HIGH_M))
    assert [reached.height_m for reached in found] == [USUAL_M]


def test_boxes_stay_where_they_are_in_the_world_when_the_body_stands_elsewhere():
    wall = Box(RigidTransform([0.7, 0.0, 0.2]), (0.04, 2.0, 2.0))
    assert _check([wall]).best(Pose2D(1.75, 0.0, np.pi).transform, (USUAL_M,)) is not None


def test_a_can_behind_a_wall_is_not_reached():
    wall = Box(RigidTransform([0.7, 0.0, 0.2]), (0.04, 2.0, 2.0))
    assert _check([wall]).best(HERE.transform, (USUAL_M, LOW_M, HIGH_M)) is None


def _check(boxes):
    return ReachCheck(
        ArmScene(CAPABILITIES, MODEL, {}), boxes, HERE.transform(USUAL_M), CAN, CANDIDATES, GRIPPER.widest
    )


def test_the_space_about_an_object_holds_it_and_a_band_of_its_surface():
    seen = ObjectObservation(0.0, ObjectKind("coke"), (1.0, 2.0, 0.76), (0.066, 0.066, 0.12), 0.0, 1.0)
    low, high = space_about(seen)[0]
    assert np.all(low < [1.0, 2.0, 0.69])
    assert np.all(high > [1.0, 2.0, 0.82])


def test_a_tall_object_has_its_own_space_up_to_its_top_and_not_beside_it():
    seen = ObjectObservation(0.0, ObjectKind("extinguisher"), (1.0, 2.0, 0.9), (0.09, 0.09, 0.4), 0.0, 1.0)
    about, own = space_about(seen)
    assert about[1][2] < 1.1 < own[1][2] < 1.16
    assert own[1][0] < 1.1 < about[1][0]


# tilt of the hand (degrees), which way it is turned over -> whether what stands turns square to the fingers
@pytest.mark.parametrize(("tilt_deg", "side", "turns"), [(10, 1.0, True), (10, -1.0, True), (45, 1.0, False)])
def test_an_upright_object_counts_as_square_to_the_fingers_of_a_slightly_tilted_hand(tilt_deg, side, turns):
    X_BH, p_HT = RigidTransform(hand_rotation(np.radians(tilt_deg), 0.7, side), [0.7, 0.1, 0.2]), np.array([0.18, 0, 0])
    now = square_hand_pose(X_BH, p_HT)
    assert bool(abs(now.rotation().matrix()[2, 0]) < 1e-9) is turns
    assert np.allclose(now @ p_HT, X_BH @ p_HT)


def test_a_grasp_beside_a_neighbour_is_a_last_choice_but_a_choice():
    wall = Box(RigidTransform([0.7, 0.0, 0.2]), (0.04, 2.0, 2.0))
    free = _check(()).best(HERE.transform, (USUAL_M,))
    assert replace(_check(()), beside=[wall]).best(HERE.transform, (USUAL_M,)).cost > free.cost + 0.5


def test_the_arm_at_the_best_grasp_goes_from_the_shoulder_to_the_object():
    arm_W = _check(()).arm_W(HERE.transform, (USUAL_M,))
    assert np.min(np.linalg.norm(arm_W - HERE.transform(USUAL_M) @ MODEL.p_BS, axis=1)) < 0.01
    assert np.min(np.linalg.norm(arm_W - CAN.position_W, axis=1)) < 0.3


def test_without_a_grasp_the_arm_goes_nowhere():
    wall = Box(RigidTransform([0.7, 0.0, 0.2]), (0.04, 2.0, 2.0))
    assert len(_check([wall]).arm_W(HERE.transform, (USUAL_M,))) == 0


# where a can of 0.115 m on a table of 0.70 m seems to stand -> where it does
@pytest.mark.parametrize(("seen_m", "stands_m"), [(0.745, 0.7575), (0.7575, 0.7575), (0.78, 0.78)])
def test_an_object_that_seems_sunk_into_its_surface_is_raised_onto_it(seen_m, stands_m):
    table = Surface("table", ((0.7, -0.5), (1.3, -0.5), (1.3, 0.5), (0.7, 0.5)), 0.70)
    shelf = replace(table, name="shelf", height_m=1.5)
    assert raise_onto_surface(replace(CAN, position_W=(0.9, 0.1, seen_m)), [table, shelf]).position_W == (
        0.9,
        0.1,
        stands_m,
    )


def test_an_object_on_no_known_surface_stays_where_it_was_seen():
    assert raise_onto_surface(CAN, ()) == CAN


def test_a_gripper_that_opens_for_a_neck_is_not_led_about_the_body_of_the_bottle():
    neck, body = (GraspCandidate(RigidTransform(), width_m, 0.0, 0.0) for width_m in (0.028, 0.062))
    wide, for_neck, for_body = openings([neck, body], GRIPPER)
    assert wide > for_body > for_neck
    assert passing([neck, body], for_neck, GRIPPER) == [neck]
    assert passing([neck, body], for_body, GRIPPER) == passing([neck, body], wide, GRIPPER) == [neck, body]
