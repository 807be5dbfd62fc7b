"""Where on an object the fingers may close: along it, and over its height."""

import numpy as np
import pytest

from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.grasp.candidates import grasp_candidates
from skills.manipulation.grasp.placements import Target, placements

P_BS, GRIPPER = arm_model(spot_capabilities()).p_BS, spot_capabilities().gripper
BASE_M, X_M = 0.2, 0.85


def _drum(radius_m, low_m, high_m, x=X_M):
    """The front of an upright cylinder, as the shoulder sees it, and its rim."""
    angle, z = np.meshgrid(np.linspace(0.5 * np.pi, 1.5 * np.pi, 40), np.arange(low_m, high_m, 0.004))
    front = np.column_stack([np.cos(angle.ravel()), np.sin(angle.ravel()), z.ravel()])
    turn = np.linspace(0.0, 2.0 * np.pi, 120)
    top = np.column_stack([np.cos(turn), np.sin(turn), np.full(120, high_m)])
    return np.concatenate([front, top]) * [radius_m, radius_m, 1.0] + [x, 0.0, BASE_M]


def _bar(length_m, width_m, low_m, high_m, yaw=0.0):
    """A bar over the middle of an object."""
    s, t, z = np.meshgrid(
        np.linspace(-0.5, 0.5, 30) * length_m, np.linspace(-0.5, 0.5, 8) * width_m, np.arange(low_m, high_m, 0.004)
    )
    c, sn = np.cos(yaw), np.sin(yaw)
    return np.column_stack([X_M + c * s.ravel() - sn * t.ravel(), sn * s.ravel() + c * t.ravel(), z.ravel() + BASE_M])


def _target(*parts, width_m, height_m, is_round=True):
    return Target(np.concatenate(parts), (X_M, 0.0), 0.0, width_m, width_m, height_m, BASE_M, is_round)


def _big_bottle():
    return _target(_drum(0.07, 0.0, 0.18), _drum(0.015, 0.18, 0.27), width_m=0.14, height_m=0.27)


def _best(target):
    return grasp_candidates(target, P_BS, GRIPPER)[0]


def _height_m(candidate):
    return float((candidate.X_BH @ np.array([GRIPPER.grip_x_m, 0.0, 0.0]))[2]) - BASE_M


def test_the_palm_stays_before_the_body_when_the_fingers_take_the_neck():
    found = [each for each in grasp_candidates(_big_bottle(), P_BS, GRIPPER) if each.tilt_rad == 0.0]
    beside_body = [each for each in found if _height_m(each) < 0.23]
    assert beside_body
    for candidate in beside_body:
        ahead = candidate.X_BH.rotation().matrix()[:, 0]
        palm_m = (candidate.X_BH @ np.array([GRIPPER.palm_x_m, 0.0, 0.0]) - [X_M, 0.0, 0.0]) @ ahead
        assert palm_m < -0.07


def test_the_round_top_of_a_bottle_alone_costs_more_than_a_grasp_that_reaches_its_shoulder():
    bottle = _target(_drum(0.033, 0.0, 0.14), _drum(0.014, 0.14, 0.22), width_m=0.066, height_m=0.22)
    above = [each for each in placements(bottle, P_BS, 0.0) if each.below_top_m]
    top, deeper = ([each.cost for each in above if (each.below_top_m < 0.06) == shallow] for shallow in (True, False))
    assert min(top) > max(deeper)


def test_a_handle_beside_the_middle_costs_more_the_farther_it_is():
    tank, handle = _drum(0.08, 0.0, 0.25), _bar(0.16, 0.02, 0.27, 0.30)
    found = placements(_target(tank, handle, width_m=0.16, height_m=0.30), P_BS, 0.0)
    above = sorted((each for each in found if each.below_top_m), key=lambda each: each.cost)
    assert above[0].lever_m < above[-1].lever_m


def test_a_tank_with_a_hose_beside_it_is_taken_below_the_hose():
    tank, hose = _drum(0.045, 0.0, 0.30), _drum(0.012, 0.1, 0.30) + [0.0, 0.06, 0.0]
    best = _best(_target(tank, hose, width_m=0.12, height_m=0.30))
    assert best.width_m == pytest.approx(0.09, abs=0.006)
    assert _height_m(best) < 0.1


def test_a_bottle_that_is_too_wide_for_the_gripper_is_taken_by_its_neck():
    best = _best(_big_bottle())
    assert best.width_m == pytest.approx(0.03, abs=0.004)
    assert _height_m(best) > 0.19


def test_a_slim_bottle_is_still_taken_by_its_body():
    slim = _target(_drum(0.03, 0.0, 0.15), _drum(0.012, 0.15, 0.23), width_m=0.06, height_m=0.23)
    assert _best(slim).width_m == pytest.approx(0.06, abs=0.004)


@pytest.mark.parametrize("yaw", [0.0, 0.7, 1.5])
def test_a_wide_tank_is_taken_from_above_by_its_handle(yaw):
    tank, handle = _drum(0.08, 0.0, 0.25), _bar(0.12, 0.02, 0.27, 0.30, yaw)
    best = _best(_target(tank, handle, width_m=0.16, height_m=0.30))
    closing = best.X_BH.rotation().matrix()[:, 2]
    assert best.width_m == pytest.approx(0.02, abs=0.006)
    assert abs(closing @ [np.cos(yaw), np.sin(yaw), 0.0]) < 0.15
    assert best.lever_m < 0.05


def test_a_wide_flat_object_in_the_shape_of_an_l_is_taken_by_its_narrow_part_near_the_middle():
    barrel, handle = _bar(0.18, 0.05, 0.0, 0.055), _bar(0.05, 0.14, 0.0, 0.055) + [0.06, -0.09, 0.0]
    corner = Target(np.concatenate([barrel, handle]), (X_M, -0.07), 0.0, 0.185, 0.18, 0.055, BASE_M, False)
    best = _best(corner)
    assert best.width_m == pytest.approx(0.05, abs=0.006)
    assert best.lever_m < 0.08


def test_an_object_that_is_wide_over_all_its_height_has_no_placement_for_the_gripper():
    assert grasp_candidates(_target(_drum(0.08, 0.0, 0.3), width_m=0.16, height_m=0.3), P_BS, GRIPPER) == []


def test_a_plate_has_no_rim_that_a_finger_enters():
    assert grasp_candidates(_bowl(0.02), P_BS, GRIPPER) == []


def _bowl(depth_m, *, radius_m=0.08, height_m=0.055):
    """A bowl seen from above: the rim, and its inside as deep as depth_m."""
    angle, r = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 180), np.linspace(0.0, radius_m, 40))
    z = np.where(r.ravel() > radius_m - 0.008, height_m, height_m - depth_m) + BASE_M
    points = np.column_stack([X_M + (r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel(), z])
    return Target(points, (X_M, 0.0), 0.0, 2.0 * radius_m, 2.0 * radius_m, height_m, BASE_M, False)


def test_a_bowl_is_taken_by_its_rim_with_one_finger_inside():
    best = _best(_bowl(0.045))
    R, rim_m = best.X_BH.rotation().matrix(), GRIPPER.fixed_z_m + 0.017 + 0.5 * best.width_m
    rim = (best.X_BH @ np.array([GRIPPER.tip_x_m, 0.0, rim_m]))[:2] - [X_M, 0.0]
    assert best.width_m < 0.03
    assert np.linalg.norm(rim) == pytest.approx(0.072, abs=0.01)
    assert abs(R[:2, 2] @ rim) > 0.95 * np.linalg.norm(rim)  # the gripper closes along the radius
