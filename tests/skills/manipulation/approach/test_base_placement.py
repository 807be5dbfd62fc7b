"""Tests of base placements before an object on a surface."""

import math
from functools import partial

import numpy as np
import pytest
from table_robot import CAPABILITIES, GRIPPER, MODEL

from skills.api import ObjectKind, ObjectObservation
from skills.footprint import Footprint
from skills.manipulation.approach.base_placement import (
    BasePlacement,
    first_reachable_spot,
    free_placements,
    is_comfortable,
    reachable_placements,
)
from skills.manipulation.grasp.planning import GeometricGraspPlanner
from skills.manipulation.grasp.reach import observed_target, reached_grasps
from skills.robot import Pose2D
from skills.testing.blocks import Block
from skills.testing.estimators import BlockCostmap

CAN = ObjectObservation(0.0, ObjectKind("coke"), (2.15, 0.0, 0.807), (0.066, 0.066, 0.115), 0.0, 1.0, "table")
CANDIDATES = partial(GeometricGraspPlanner().candidates, p_BS=MODEL.p_BS, gripper=GRIPPER)


TABLE = BlockCostmap([Block(2.0, -9.0, 9.0, 9.0)])
"""A table top from x = 2 on; the floor before it is free."""


def _grasp_cost(X_WB, seen):
    reached, least = reached_grasps(MODEL, CANDIDATES, X_WB, seen)
    return reached[0].cost - least if reached else None


def _poses(reach_cost=lambda pose: 0.0):
    distances_m, here = CAPABILITIES.arm.standing_m, Pose2D(0.5, 0.3, 0.0)
    free = free_placements((2.15, 0.0), here, TABLE, Footprint.of(CAPABILITIES), distances_m, distances_m[0])
    return reachable_placements(free, reach_cost)


def test_the_body_keeps_off_the_table_and_faces_the_object():
    found = _poses()
    assert found
    for placement in found:
        pose = placement.pose
        front = pose.x_m + 0.52 * math.cos(pose.yaw_rad)
        bearing = math.atan2(-pose.y_m, 2.15 - pose.x_m) - pose.yaw_rad
        assert front < 2.0
        assert abs(math.remainder(bearing, 2 * math.pi)) < 1e-6


def test_the_best_comes_first():
    costs = [placement.cost for placement in _poses()]
    assert costs == sorted(costs)


def test_places_out_of_reach_are_left_out():
    assert _poses(lambda pose: None) == []


def test_a_can_is_within_reach_from_the_best_place_but_not_from_afar():
    assert _grasp_cost(_poses()[0].pose.transform(0.52), CAN) == 0.0
    assert _grasp_cost(Pose2D(0.0, 0.0, 0.0).transform(0.52), CAN) is None


@pytest.mark.parametrize(
    ("pose", "comfortable"),
    [
        (Pose2D(1.25, 0.0, 0.0), True),
        (Pose2D(0.5, 0.0, 0.0), False),
        (Pose2D(1.25, 0.0, 1.0), False),
        (Pose2D(1.25, 0.0, 2 * math.pi), True),
    ],
)
def test_standing_well_already(pose, comfortable):
    assert is_comfortable(pose, (2.15, 0.0), CAPABILITIES.arm) is comfortable


def test_an_observation_keeps_its_axes_when_the_body_is_turned():
    hammer = ObjectObservation(0.0, ObjectKind("hammer"), (1.0, 0.0, 0.765), (0.33, 0.12, 0.03), 0.5, 1.0, "bench")
    target = observed_target(hammer, Pose2D(0.0, 0.0, 0.3).transform(0.52))
    assert target.yaw_rad == pytest.approx(0.2)
    assert target.base_m == pytest.approx(0.75 - 0.52)
    assert not target.round


@pytest.mark.parametrize("yaw", [0.0, 0.7, 1.57, 2.4])
def test_a_hammer_at_any_angle_is_within_reach_from_some_pose(yaw):
    hammer = ObjectObservation(0.0, ObjectKind("hammer"), (2.15, 0.0, 0.765), (0.33, 0.12, 0.03), yaw, 1.0, "bench")
    assert _poses(lambda pose: _grasp_cost(pose.transform(0.52), hammer))


def test_a_place_with_a_better_grasp_is_preferred():
    nearest = _poses()[0].pose
    best = _poses(lambda pose: 1.0 if pose == nearest else 0.0)[0].pose
    assert best != nearest


def test_a_place_is_left_for_a_nearer_one_where_stopping_short_of_it_is_out_of_reach():
    best = _poses(lambda pose: 0.0 if math.hypot(pose.x_m - 2.15, pose.y_m) < 0.91 else None)[0].pose
    assert math.hypot(best.x_m - 2.15, best.y_m) < 0.88


# The distances (m) of the free places before spots 0, 1, 2 of which 1 m is within reach -> the spot, how many places
@pytest.mark.parametrize(
    ("free_m", "chosen"),
    [(((1.0,), (1.0,), ()), (0, 1)), (((), (2.0,), (1.0, 2.0)), (2, 1)), (((), (2.0, 3.0), ()), (1, 2))],
)
def test_the_robot_goes_before_the_first_spot_that_it_can_reach_from_a_free_place(free_m, chosen):
    before = [
        (np.array([spot, 0.0]), [BasePlacement(Pose2D(spot - off_m, 0.0, 0.0), off_m) for off_m in each])
        for spot, each in enumerate(free_m)
    ]
    spot, places = first_reachable_spot(before, lambda spot: lambda pose: 0.0 if spot[0] - pose.x_m < 1.2 else None)
    assert (spot[0], len(places)) == chosen


def test_without_a_free_pose_before_any_spot_there_is_no_placement():
    assert first_reachable_spot([(np.zeros(2), [])], lambda spot: lambda pose: 0.0) is None
