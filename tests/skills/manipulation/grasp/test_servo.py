"""Tests of the measured shift of an object just before the grasp, and of shifted trajectories."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_robot import MODEL
from table_scene import GREEN, TABLE, Can, scene

from skills.manipulation.arm.poses import camera_pose
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.servo import measure_shift, shift_trajectory
from skills.robot import ArmTrajectory

CAN = Can(1.0, 0.0, 0.033, 0.115, GREEN)
MIDDLE = np.array([CAN.x, CAN.y, TABLE.height_m + 0.06])
AHEAD = camera_pose(MIDDLE + [-0.26, 0.0, 0.03], MIDDLE)
ABOVE = camera_pose(MIDDLE + [-0.1, 0.0, 0.3], MIDDLE)


def target_of(can):
    """A can as its side and lid are known."""
    turn, up = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 60), np.linspace(0.0, can.height, 12))
    side = np.column_stack([np.cos(turn.ravel()) * can.radius, np.sin(turn.ravel()) * can.radius, up.ravel()])
    points = side + [can.x, can.y, can.base]
    width = 2.0 * can.radius
    return Target(points, (can.x, can.y), 0.0, width, width, can.height, can.base, True)


# camera, shift of the can (x, y) in m -> what is seen of the shift: level, across where the camera looks ahead
@pytest.mark.parametrize(
    ("X_BC", "moved_m", "seen_m"),
    [
        (AHEAD, (0.0, 0.0), (0.0, 0.0)),
        (AHEAD, (0.0, 0.02), (0.0, 0.02)),
        (AHEAD, (0.0, -0.035), (0.0, -0.035)),
        (ABOVE, (0.0, 0.0), (0.0, 0.0)),
        (ABOVE, (0.02, 0.01), (0.02, 0.01)),
        (ABOVE, (-0.02, 0.03), (-0.02, 0.03)),
    ],
)
def test_a_can_that_was_pushed_is_seen_where_it_is(X_BC, moved_m, seen_m):
    now = replace(CAN, x=CAN.x + moved_m[0], y=CAN.y + moved_m[1])
    found = measure_shift(target_of(CAN), scene([now], X_WC=X_BC), X_BC)
    assert found.offset_B == pytest.approx([*seen_m, 0.0], abs=0.006)
    assert found.overlap > 0.7


def test_an_object_too_near_for_depth_is_seen_by_its_outline():
    image = scene([replace(CAN, y=0.02)], X_WC=AHEAD)
    image = replace(image, depth_m=np.where(image.depth_m < 0.3, 0.0, image.depth_m).astype(np.float32))
    assert measure_shift(target_of(CAN), image, AHEAD).offset_B == pytest.approx([0.0, 0.02, 0.0], abs=0.006)


@pytest.mark.parametrize("X_BC", [AHEAD, ABOVE])
def test_the_outline_of_a_missing_can_hardly_overlaps(X_BC):
    assert measure_shift(target_of(CAN), scene([], X_WC=X_BC), X_BC).overlap < 0.2


def test_an_empty_picture_gives_no_shift():
    image = scene([CAN], X_WC=ABOVE)
    blind = replace(image, depth_m=np.zeros_like(image.depth_m))
    assert measure_shift(target_of(CAN), blind, camera_pose(MIDDLE + [0.0, 0.01, 0.12], MIDDLE)) is None


def test_a_neighbour_is_not_taken_for_the_object():
    found = measure_shift(target_of(CAN), scene([CAN, Can(1.0, 0.12, 0.033, 0.115, GREEN)], X_WC=AHEAD), AHEAD)
    assert found.offset_B == pytest.approx(np.zeros(3), abs=0.006)


def test_a_shifted_trajectory_keeps_its_times_and_leads_the_hand_beside_where_it_was():
    q = MODEL.inverse(RigidTransform([0.75, 0.0, 0.2]))[0]
    trajectory = ArmTrajectory(np.array([0.0, 0.5, 1.0]), np.stack([q, q, q]))
    beside = shift_trajectory(MODEL, trajectory, np.array([0.0, 0.02, 0.0]))
    assert np.array_equal(beside.times_s, trajectory.times_s)
    for q_rad in beside.positions_rad:
        assert MODEL.X_BH(q_rad).translation() == pytest.approx([0.75, 0.02, 0.2], abs=1e-6)


def test_beyond_the_arms_reach_there_is_no_shifted_trajectory():
    q = MODEL.inverse(RigidTransform([0.75, 0.0, 0.2]))[0]
    assert shift_trajectory(MODEL, ArmTrajectory(np.array([0.0]), q[None, :]), np.array([2.0, 0.0, 0.0])) is None
