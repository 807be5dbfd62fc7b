"""Measured width of a doorway in scans of blocks; it is 0.9 m wide in a wall at x = 2."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform

from skills.perception.doorway import Doorway, measure_opening
from skills.robot import Pose2D
from skills.testing.blocks import Block, take_scan

DOOR = Doorway((2.0, 0.0), 0.9, 0.0)
WALL = (Block(1.95, 0.45, 2.05, 3.0), Block(1.95, -3.0, 2.05, -0.45), Block(1.95, -0.45, 2.05, 0.45, 2.05, 2.5))
BEYOND = Block(5.0, -3.0, 5.1, 3.0)


def seen(*blocks, at=None, believed=None, door=DOOR, count=5):
    """Opening measured in scans from a pose, which the robot believes to be another one."""
    at, rng = at or Pose2D(0.5, 0.0, 0.0), np.random.default_rng(0)
    X_WB = at.transform(0.52)
    scans = [take_scan((*WALL, BEYOND, *blocks), X_WB, RigidTransform(), 0.0, rng, noise_m=0.03) for _ in range(count)]
    X_believed = (believed or at).transform(0.52)
    return measure_opening(door, [(scan, X_believed @ scan.X_BL) for scan in scans])


@pytest.mark.parametrize(
    "at",
    [
        Pose2D(0.5, 0.0, 0.0),
        Pose2D(0.5, 0.0, 1.5),
        Pose2D(0.8, 1.0, -0.7),
        Pose2D(3.5, 0.0, math.pi),
        Pose2D(-0.5, 0, 0),
    ],
)
def test_an_open_doorway_is_free_over_nearly_its_width(at):
    assert 0.75 <= seen(at=at).least_m <= 0.9


def test_a_closed_doorway_is_free_nowhere():
    told = seen(Block(1.98, -0.45, 2.02, 0.45))
    assert (told.least_m, told.most_m) == (0.0, 0.0)


@pytest.mark.parametrize("gap_m", [0.2, 0.4, 0.7])
def test_a_gap_is_measured(gap_m):
    told = seen(Block(1.98, -0.45, 2.02, 0.45 - gap_m))
    assert told.least_m - 0.06 <= gap_m <= told.most_m + 0.06


def test_an_object_free_in_the_doorway_counts_as_unseen():
    told = seen(Block(1.85, -0.2, 2.15, 0.2, 0.0, 1.7))
    assert told.least_m < 0.3
    assert told.most_m >= 0.8


def test_an_object_before_a_closed_door_hides_it():
    told = seen(Block(1.98, -0.45, 2.02, 0.45), Block(1.2, -0.25, 1.4, 0.25, 0.0, 1.8))
    assert told.least_m == 0.0
    assert told.most_m >= 0.5


def test_a_swing_door_that_is_ajar_is_not_open_wide():
    leaf = [Block(2.0 + 0.06 * k, -0.45 + 0.1 * k, 2.06 + 0.06 * k, -0.35 + 0.1 * k) for k in range(8)]  # 30 degrees
    assert seen(*leaf).most_m < 0.6


def test_an_open_door_is_recognised_despite_a_small_pose_error():
    assert seen(believed=Pose2D(0.45, 0.08, 0.03)).least_m >= 0.6


def test_a_closed_door_is_recognised_despite_a_small_pose_error():
    assert seen(Block(1.98, -0.45, 2.02, 0.45), believed=Pose2D(0.45, 0.08, 0.03)).most_m <= 0.1


def test_too_few_rays_show_nothing():
    told = seen(at=Pose2D(-20.0, 0.0, 0.0), count=1)
    assert (told.least_m, told.rays < 50) == (0.0, True)
    assert told.most_m == pytest.approx(0.9)


def test_doors_behind_the_robot_are_measured():
    assert seen(at=Pose2D(0.5, 0.0, math.pi)).least_m >= 0.75


def test_view_angle_of_a_doorway():
    assert DOOR.view_angle_rad((0.0, 0.0)) == pytest.approx(0.0)
    assert DOOR.view_angle_rad((4.0, 0.0)) == pytest.approx(0.0)
    assert DOOR.view_angle_rad((1.0, 1.0)) == pytest.approx(math.pi / 4)
    assert DOOR.view_angle_rad((2.0, 1.0)) == pytest.approx(math.pi / 2)
