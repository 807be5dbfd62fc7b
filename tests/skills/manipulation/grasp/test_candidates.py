"""Grasp candidates from shapes, and which of them the arm reaches."""

import numpy as np
import pytest

from plant.robots.fetch.kind import FETCH
from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.grasp.candidates import grasp_candidates
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.planning import within_reach

MODEL, GRIPPER = arm_model(spot_capabilities()), spot_capabilities().gripper
TWO_FINGERS = FETCH.capabilities().gripper
UP = np.array([0.0, 0.0, 1.0])


def _target(length, width, height, *, is_round=False, yaw=0.0, points=None, base=0.2, x=0.85):
    if points is None:
        s, t = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.5, 0.5, 20))
        points = np.column_stack([s.ravel() * length, t.ravel() * width])
    xy = points @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + [x, 0.0]
    cloud = np.column_stack([xy, np.full(len(xy), base + height)])
    return Target(cloud, (x, 0.0), yaw, length, width, height, base, is_round)


def _hammer(yaw, head_m=0.12):
    """Seen from above: a handle of 30 mm along x with a head across at its end."""
    handle = np.stack(np.meshgrid(np.linspace(-0.165, 0.13, 150), np.linspace(-0.015, 0.015, 15)), -1).reshape(-1, 2)
    head = np.stack(
        np.meshgrid(np.linspace(0.13, 0.165, 18), np.linspace(-0.5 * head_m, 0.5 * head_m, 60)), -1
    ).reshape(-1, 2)
    return _target(0.33, head_m, 0.03, yaw=yaw, points=np.concatenate([handle, head]))


def _wrench(yaw):
    """Seen from above: a flat handle of 14 mm."""
    return _target(0.27, 0.014, 0.0096, yaw=yaw)


def _found(target):
    return grasp_candidates(target, MODEL.p_BS, GRIPPER)


def _can(height_m=0.115, **how):
    return _target(0.066, 0.066, height_m, is_round=True, **how)


def test_a_can_is_taken_from_the_side_with_the_wrist_rolled():
    best = _found(_can())[0]
    R = best.X_BH.rotation().matrix()
    assert abs(R[2, 2]) < 1e-9  # the gripper closes level
    assert R[0, 0] > 0.9  # the fingers point ahead
    assert best.width_m == pytest.approx(0.066)


def test_the_can_lies_between_palm_and_fingertips_and_clear_of_the_fixed_gripper():
    best = _found(_can())[0]
    p_HT = best.X_BH.inverse() @ np.array([0.85, 0.0, 0.2 + 0.06])
    assert GRIPPER.palm_x_m + 0.033 < p_HT[0] < GRIPPER.tip_x_m - 0.033
    assert p_HT[2] - 0.033 > GRIPPER.fixed_z_m + 0.005


# width of an upright peg -> the rubber of both tips closes on its middle, or it is loose in the hollow behind them
@pytest.mark.parametrize("width_m", [0.02, 0.03, 0.045])
def test_a_slim_upright_object_is_held_between_the_tips(width_m):
    for candidate in [each for each in _found(_target(width_m, width_m, 0.15, is_round=True)) if each.tilt_rad == 0.0]:
        middle_m = float((candidate.X_BH.inverse() @ np.array([0.85, 0.0, 0.2]))[0])
        assert GRIPPER.fixed_tip_x_m - 0.012 < middle_m < GRIPPER.fixed_tip_x_m


# height -> the fingers can take it from above, too, with the palm over its top and the tips clear of the surface
@pytest.mark.parametrize("height_m", [0.08, 0.115, 0.24])
def test_an_upright_object_can_be_taken_from_above(height_m):
    found = _found(_can(height_m))
    above = [each for each in found if each.X_BH.rotation().matrix()[2, 0] < -0.999]
    assert above
    assert above[0].cost > found[0].cost
    for each in above:
        palm, tip = ((each.X_BH @ np.array([x, 0.0, 0.0]))[2] - 0.2 for x in (GRIPPER.palm_x_m, GRIPPER.tip_x_m))
        assert palm > height_m
        assert 0.01 < tip < height_m - 0.014


@pytest.mark.parametrize("yaw", [0.0, 0.8, 1.57, 2.5])
def test_a_hammer_is_taken_across_its_handle(yaw):
    best = _found(_hammer(yaw))[0]
    closing = best.X_BH.rotation().matrix()[:, 2]
    assert best.width_m < 0.04
    assert abs(closing @ [np.cos(yaw), np.sin(yaw), 0.0]) < 0.1
    assert best.X_BH.rotation().matrix()[2, 0] < -0.9


@pytest.mark.parametrize("oblique_rad", [0.1, -0.17])
def test_fingers_close_square_to_a_handle_that_lies_oblique_to_the_box_about_the_object(oblique_rad):
    turn = np.array([[np.cos(oblique_rad), np.sin(oblique_rad)], [-np.sin(oblique_rad), np.cos(oblique_rad)]])
    s, t = np.meshgrid(np.linspace(-0.15, 0.1, 150), np.linspace(-0.015, 0.015, 15))
    best = _found(_target(0.3, 0.07, 0.03, points=np.column_stack([s.ravel(), t.ravel()]) @ turn))[0]
    assert best.width_m < 0.033
    assert abs(best.X_BH.rotation().matrix()[:, 2] @ [np.cos(oblique_rad), np.sin(oblique_rad), 0.0]) < 0.05


def test_fingers_do_not_close_on_the_round_jaws_of_a_wrench():
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    jaws = np.concatenate([r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (0.028, 0.02, 0.01)])
    handle = np.stack(np.meshgrid(np.linspace(0.02, 0.15, 90), np.linspace(-0.01, 0.01, 12)), -1).reshape(-1, 2)
    best = _found(_target(0.18, 0.056, 0.013, points=np.concatenate([jaws, handle]) - [0.06, 0.0]))[0]
    assert best.width_m < 0.03


def _tips_m(candidate, base_m, beside_m):
    """How high over the surface the ends of the fixed finger and of the moving one at the object are."""
    fixed = (GRIPPER.fixed_tip_x_m, GRIPPER.fixed_z_m)
    moving = (GRIPPER.tip_x_m - 0.004, GRIPPER.fixed_z_m + candidate.width_m + beside_m)
    ends = [np.array([x, y, z]) for x, z in (fixed, moving) for y in (-GRIPPER.half_breadth_m, GRIPPER.half_breadth_m)]
    return [float((candidate.X_BH @ end)[2]) - base_m for end in ends]


# target, what is left beside the fixed finger (m) -> the least room under the fingers, m
@pytest.mark.parametrize(
    ("target", "beside_m", "least_m"),
    [(_hammer(0.6), 0.017, 0.003), (_target(0.05, 0.05, 0.05), 0.017, 0.003), (_wrench(0.3), 0.012, 0.001)],
)
def test_fingertips_keep_off_the_surface(target, beside_m, least_m):
    for candidate in _found(target):
        assert min(_tips_m(candidate, target.base_m, beside_m)) > least_m - 1e-6


def test_a_thin_object_is_held_by_fingers_that_end_level():
    # 9.6 mm: straight from above the fixed finger, 11 mm shorter than the other can be, would pass over it
    found = _found(_wrench(0.3))
    assert found
    for candidate in found:
        assert max(_tips_m(candidate, _wrench(0.3).base_m, 0.012)) < 0.0096 - 0.003


@pytest.mark.parametrize("height_m", [0.018, 0.024, 0.032])
def test_both_fingers_end_well_below_the_middle_of_a_round_handle(height_m):
    handle = _target(0.25, height_m, height_m, yaw=0.3)
    beside_m = 0.012 if height_m < 0.02 else 0.017
    assert max(_tips_m(_found(handle)[0], handle.base_m, beside_m)) < 0.5 * height_m - 0.0035


def _screwdriver():
    """A shaft of 6 mm over 11 cm, and a handle of 11 cm that widens from 18 to 31 mm towards its end."""
    x, across = np.meshgrid(np.linspace(-0.11, 0.11, 221), np.linspace(-1.0, 1.0, 9))
    half_m = np.where(x < 0.0, 0.003, 0.009 + 0.06 * np.maximum(x, 0.0))
    return _target(0.22, 0.03, 0.036, points=np.column_stack([x.ravel(), (across * half_m).ravel()]))


def test_a_screwdriver_is_held_by_its_handle_with_no_finger_beyond_the_end():
    along_m = (_found(_screwdriver())[0].X_BH @ np.array([GRIPPER.tip_x_m, 0.0, 0.0]))[0] - 0.85
    assert 0.03 < along_m < 0.11 - 0.03 + 0.001


def test_nobody_takes_a_sheet_of_paper():
    assert _found(_target(0.25, 0.02, 0.002)) == []


def test_an_object_wider_than_the_gripper_has_no_candidates():
    assert _found(_target(0.25, 0.2, 0.05)) == []


def test_a_finger_that_would_touch_at_one_end_of_its_breadth_only_is_no_grasp():
    # a hammer's head, 35 mm along the handle, is wide over less than half of what a finger covers
    assert all(candidate.width_m < 0.05 for candidate in _found(_hammer(0.6)))


@pytest.mark.parametrize("head_m", [0.08, 0.1, 0.11])
def test_fingers_do_not_close_beyond_the_end_of_a_hammers_head(head_m):
    s_m = [(each.X_BH @ np.array([GRIPPER.tip_x_m, 0.0, 0.0]))[0] - 0.85 for each in _found(_hammer(0.0, head_m))]
    assert s_m
    assert max(s_m) < 0.168


# length of a cube, m -> it is taken although it is shorter than the fingers are broad
@pytest.mark.parametrize("length_m", [0.022, 0.03, 0.05])
def test_an_object_shorter_than_the_fingers_are_broad_is_taken(length_m):
    assert _found(_target(length_m, length_m, length_m))


def test_candidates_come_best_first():
    costs = [candidate.cost for candidate in _found(_hammer(0.3))]
    assert costs == sorted(costs)


def test_a_can_ahead_is_within_reach_and_one_across_the_room_is_not():
    near, far = (_can(x=x) for x in (0.9, 2.0))
    assert any(within_reach(MODEL, candidate, UP) for candidate in _found(near))
    assert not any(within_reach(MODEL, candidate, UP) for candidate in _found(far))


def _by_two_fingers(target):
    return grasp_candidates(target, arm_model(FETCH.capabilities()).p_BS, TWO_FINGERS)


def test_two_fingers_close_about_the_middle_of_a_can():
    best = _by_two_fingers(_can())[0]
    x, _, z = best.X_BH.inverse() @ np.array([0.85, 0.0, 0.2 + 0.06])
    assert abs(best.X_BH.rotation().matrix()[2, 2]) < 1e-9  # the gripper closes level
    assert z == pytest.approx(0.0, abs=1e-9)
    assert TWO_FINGERS.palm_x_m + 0.033 < x < TWO_FINGERS.tip_x_m + 0.01


def test_an_object_as_wide_as_the_open_fingers_is_not_taken():
    assert _by_two_fingers(_target(0.12, TWO_FINGERS.max_grasp_m + 0.01, 0.12)) == []


# object -> both fingertips end as high over the surface, under the object's top
@pytest.mark.parametrize("target", [_wrench(0.3), _hammer(0.6), _target(0.05, 0.05, 0.05)])
def test_two_fingers_straight_from_above_end_level_at_a_lying_object(target):
    straight = [each for each in _by_two_fingers(target) if each.X_BH.rotation().matrix()[2, 0] < -0.999]
    assert straight
    for each in straight:
        half_m = 0.5 * each.width_m
        one, other = ((each.X_BH @ [TWO_FINGERS.tip_x_m, 0.0, z])[2] - target.base_m for z in (half_m, -half_m))
        assert one == pytest.approx(other, abs=1e-6)
        assert 0.0 < one < target.height_m
