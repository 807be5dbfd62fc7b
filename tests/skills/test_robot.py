"""Readings of the robot protocol."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from skills.robot import Scan

HERE = RigidTransform()


def test_points_become_a_revolution_with_the_nearest_of_each_ray():
    points_L = np.array([[2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 5.0]])
    scan = Scan.of_points(points_L, np.radians(np.linspace(-15.0, 15.0, 31)), 900, 1.0, HERE, HERE)
    assert scan.ranges_m.shape == (31, 900)
    # ahead, left; what lies within 0.3 m or above the rings is left out
    assert (scan.ranges_m[15, 450], scan.ranges_m[15, 675]) == (pytest.approx(2.0), pytest.approx(2.5))
    assert np.isfinite(scan.ranges_m).sum() == 2
    assert np.sort(scan.points_B(), axis=0) == pytest.approx(
        np.sort([[2.0, 0.0, 0.0], [0.0, 2.5, 0.0]], axis=0), abs=1e-6
    )
