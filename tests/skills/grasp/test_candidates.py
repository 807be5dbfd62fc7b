"""Grasp candidates from shapes, and which of them the arm reaches."""

import numpy as np
import pytest

from plant.spot.capabilities import spot_capabilities
from skills.arm.kinematics import arm_model
from skills.grasp.candidates import Target, grasp_candidates
from skills.grasp.planning import within_reach

MODEL, GRIPPER = arm_model(spot_capabilities()), spot_capabilities().gripper
UP = np.array([0.0, 0.0, 1.0])


def _target(length, width, height, *, is_round=False, yaw=0.0, points=None, base=0.2, x=0.85):
    if points is None:
        s, t = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.5, 0.5, 20))
        points = np.column_stack([s.ravel() * length, t.ravel() * width])
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    xy = points @ turn + [x, 0.0]
    cloud = np.column_stack([xy, np.full(len(xy), base + height)])
    return Target(cloud, (x, 0.0), yaw, length, width, height, base, is_round)


def _hammer(yaw):
    """Seen from above: a handle of 30 mm along x with a head of 120 mm across at its end."""
    handle = np.stack(np.meshgrid(np.linspace(-0.165, 0.13, 150), np.linspace(-0.015, 0.015, 15)), -1).reshape(-1, 2)
    head = np.stack(np.meshgrid(np.linspace(0.13, 0.165, 18), np.linspace(-0.06, 0.06, 60)), -1).reshape(-1, 2)
    return _target(0.33, 0.12, 0.03, yaw=yaw, points=np.concatenate([handle, head]))


def test_a_can_is_taken_from_the_side_with_the_wrist_rolled():
    best = grasp_candidates(_target(0.066, 0.066, 0.115, is_round=True), MODEL.p_BS, GRIPPER)[0]
    R = best.X_BH.rotation().matrix()
    assert abs(R[2, 2]) < 1e-9  # the gripper closes level
    assert R[0, 0] > 0.9  # the fingers point ahead
    assert best.width_m == pytest.approx(0.066)


def test_the_can_lies_between_palm_and_fingertips_and_clear_of_the_fixed_gripper():
    gripper = GRIPPER
    best = grasp_candidates(_target(0.066, 0.066, 0.115, is_round=True), MODEL.p_BS, GRIPPER)[0]
    p_HT = best.X_BH.inverse() @ np.array([0.85, 0.0, 0.2 + 0.06])
    assert gripper.palm_x_m + 0.033 < p_HT[0] < gripper.tip_x_m - 0.033
    assert p_HT[2] - 0.033 > gripper.fixed_z_m + 0.005


# height -> the fingers can take it from above, too, with the palm over its top and the tips clear of the surface
@pytest.mark.parametrize("height_m", [0.08, 0.115, 0.24])
def test_what_stands_can_be_taken_from_above(height_m):
    found = grasp_candidates(_target(0.066, 0.066, height_m, is_round=True), MODEL.p_BS, GRIPPER)
    above = [each for each in found if each.X_BH.rotation().matrix()[2, 0] < -0.999]
    assert above
    assert above[0].cost > found[0].cost
    for each in above:
        palm, tip = ((each.X_BH @ np.array([x, 0.0, 0.0]))[2] - 0.2 for x in (GRIPPER.palm_x_m, GRIPPER.tip_x_m))
        assert palm > height_m
        assert 0.01 < tip < height_m - 0.014


@pytest.mark.parametrize("yaw", [0.0, 0.8, 1.57, 2.5])
def test_a_hammer_is_taken_across_its_handle(yaw):
    candidates = grasp_candidates(_hammer(yaw), MODEL.p_BS, GRIPPER)
    best = candidates[0]
    closing = best.X_BH.rotation().matrix()[:, 2]
    assert best.width_m < 0.04
    assert abs(closing @ [np.cos(yaw), np.sin(yaw), 0.0]) < 0.1
    assert best.X_BH.rotation().matrix()[2, 0] < -0.9


def test_fingertips_keep_off_the_surface():
    gripper = GRIPPER
    for target in (_hammer(0.6), _target(0.05, 0.05, 0.05)):
        for candidate in grasp_candidates(target, MODEL.p_BS, GRIPPER):
            for y in (-0.03, 0.03):
                assert (candidate.X_BH @ np.array([gripper.tip_x_m, y, gripper.fixed_z_m]))[2] > target.base_m + 0.002


@pytest.mark.parametrize(("height_m", "room_m"), [(0.030, 0.004), (0.022, 0.003)])
def test_fingertips_stay_further_off_the_surface_where_a_thing_is_high_enough(height_m, room_m):
    # a plain rod, straight from above: half of 30 mm leaves 4 mm and a grip, half of 22 mm less, but 3 mm at least
    gripper, base = GRIPPER, 0.2
    straight = [
        candidate
        for candidate in grasp_candidates(_target(0.25, 0.02, height_m, base=base), MODEL.p_BS, GRIPPER)
        if candidate.X_BH.rotation().matrix()[2, 0] < -0.999
    ]
    assert straight
    for candidate in straight:
        tip = (candidate.X_BH @ np.array([gripper.tip_x_m, 0.0, gripper.fixed_z_m]))[2] - base
        assert room_m - 1e-6 <= tip < room_m + 0.002


def test_a_thing_wider_than_the_gripper_has_no_candidates():
    assert grasp_candidates(_target(0.25, 0.2, 0.05), MODEL.p_BS, GRIPPER) == []


def test_candidates_come_best_first():
    costs = [candidate.cost for candidate in grasp_candidates(_hammer(0.3), MODEL.p_BS, GRIPPER)]
    assert costs == sorted(costs)


def test_a_can_ahead_is_within_reach_and_one_across_the_room_is_not():
    near, far = (_target(0.066, 0.066, 0.115, is_round=True, x=x) for x in (0.9, 2.0))
    assert any(within_reach(MODEL, candidate, UP) for candidate in grasp_candidates(near, MODEL.p_BS, GRIPPER))
    assert not any(within_reach(MODEL, candidate, UP) for candidate in grasp_candidates(far, MODEL.p_BS, GRIPPER))
