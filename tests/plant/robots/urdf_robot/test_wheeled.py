"""Odometry of two wheels."""

import numpy as np
import pytest

from plant.robots.urdf_robot.wheeled import Axle, WheelOdometer


def test_equal_wheel_turns_count_as_straight_and_opposite_ones_as_a_turn():
    """Radius 0.05 m, half track 0.2 m: 10 rad each are 0.5 m; -4 and 4 rad are 1 rad."""
    odometer = WheelOdometer(Axle(0.05, 0.2), np.zeros(2))
    odometer.count(np.array([10.0, 10.0]))
    odometer.count(np.array([6.0, 14.0]))
    assert (odometer.pose.x_m, odometer.pose.y_m, odometer.pose.yaw_rad) == pytest.approx((0.5, 0.0, 1.0))
