import math

import numpy as np
import pytest
from planar_robot import OUTLINE, TWO_ROOMS, Box, grid_of

from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint
from skills.navigate.follower import FollowerOptions, PathFollower, speed_limits
from skills.path import Path
from skills.robot import Pose2D

FOOTPRINT = Footprint.rectangle(OUTLINE)


def straight(length_m=4.0, yaw_rad=0.0, clearance_m=1.0):
    x = np.arange(2.0, 2.0 + length_m, 0.05)
    return Path(np.column_stack([x, np.full_like(x, 5.5), np.full_like(x, yaw_rad)]), np.full_like(x, clearance_m))


def test_speed_falls_towards_the_goal_and_near_obstacles():
    path, options = straight(), FollowerOptions()
    limits = speed_limits(path, path.progress_m(), options)
    assert limits[0] == pytest.approx(options.max_speed_m_s)
    assert limits[-1] < 0.05
    assert (np.diff(limits[-12:]) < 0.0).all()
    near = straight(clearance_m=0.08)
    assert speed_limits(near, near.progress_m(), options)[0] == pytest.approx(options.near_speed_m_s)


def test_going_sideways_or_backwards_is_slower():
    options = FollowerOptions()
    for yaw_rad, most in ((math.pi / 2, options.lateral_m_s), (math.pi, options.backward_m_s)):
        path = straight(yaw_rad=yaw_rad)
        assert speed_limits(path, path.progress_m(), options).max() == pytest.approx(most)


def test_robot_left_of_its_path_steers_to_the_right():
    costmap = LayeredCostmap(grid_of(TWO_ROOMS, (0.05, 1.0)))
    follower = PathFollower(straight(), FOOTPRINT)
    answer = follower.command(Pose2D(2.5, 5.6, 0.0), (0.5, 0.0, 0.0), np.array([0.5, 0.0, 0.0]), costmap)
    assert answer.velocity[1] < 0.0
    assert answer.off_path_m == pytest.approx(0.1, abs=0.01)
    assert answer.remaining_m == pytest.approx(3.45, abs=0.1)


def test_velocity_changes_no_faster_than_the_accelerations():
    costmap = LayeredCostmap(grid_of(TWO_ROOMS, (0.05, 1.0)))
    options = FollowerOptions()
    answer = PathFollower(straight(), FOOTPRINT).command(Pose2D(2.0, 5.5, 0.0), (0.0, 0.0, 0.0), np.zeros(3), costmap)
    assert answer.velocity[0] == pytest.approx(options.acceleration_m_s2 * options.period_s)


def test_robot_brakes_for_an_obstacle_ahead_and_reports_its_position():
    costmap = LayeredCostmap(grid_of([*TWO_ROOMS, Box(3.6, 5.4, 3.8, 5.6)], (0.05, 1.0)))
    last = np.array([0.8, 0.0, 0.0])
    far = PathFollower(straight(), FOOTPRINT).command(Pose2D(2.2, 5.5, 0.0), (0.8, 0.0, 0.0), last, costmap)
    assert far.blocked_at is not None and far.blocked_at[0] == pytest.approx(3.6, abs=0.3)
    assert far.velocity[0] < 0.8
    follower, velocity = PathFollower(straight(), FOOTPRINT), (0.24, 0.0, 0.0)
    for _ in range(4):
        velocity = follower.command(Pose2D(2.98, 5.5, 0.0), velocity, np.array(velocity), costmap).velocity
    assert velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.01)


def test_a_path_needs_rows_of_three():
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        Path(np.zeros((0, 3)), np.zeros(0))
