"""What is remembered of a slab, 2 m ahead and 0.42 to 0.46 m high, that beams of 2 degrees' spacing hit or miss."""

import numpy as np
from pydrake.math import RigidTransform

from errand_spot.server.scan_points import ScanPoints
from skills.robot import Scan

ELEVATIONS_RAD = np.radians([-14.0, -12.0, -10.0, -8.0, -6.0, -4.0])
SLAB_M, HEIGHTS_M, LIDAR_M = 2.0, (0.42, 0.46), 0.75


def scan(x_m, stamp_s, *, there=True):
    """Scan straight ahead by a robot at a position along x; beams that miss the slab have no return."""
    away_m = SLAB_M - x_m
    heights_m = LIDAR_M + away_m * np.tan(ELEVATIONS_RAD)
    hits = there & (heights_m > HEIGHTS_M[0]) & (heights_m < HEIGHTS_M[1])
    ranges_m = np.where(hits, away_m / np.cos(ELEVATIONS_RAD), np.nan)[:, None].astype(np.float32)
    X_BL, X_OB = RigidTransform([0.0, 0.0, LIDAR_M]), RigidTransform([x_m, 0.0, 0.0])
    return Scan(stamp_s, ranges_m, ELEVATIONS_RAD, np.zeros(1), X_BL, X_OB)


def approached(to_m):
    """Points that are known after a walk from the origin at 0.5 m/s and 10 Hz, and the last scan."""
    points = ScanPoints()
    for x_m in np.arange(0.0, to_m + 1e-6, 0.05):
        last = scan(x_m, x_m / 0.5)
        points.take(last)
    return points, last


def test_a_slab_between_two_beams_is_remembered():
    points, last = approached(0.65)
    assert np.isnan(last.ranges_m).all()
    assert np.allclose(points.points_O[:, 0], SLAB_M, atol=0.01) and len(points.points_O)


def test_a_slab_below_the_lowest_beam_is_remembered_for_15_s():
    points, last = approached(1.3)
    assert len(points.points_O) and np.isnan(last.ranges_m).all()
    points.take(scan(1.3, last.stamp_s + 16.0))
    assert not len(points.points_O)


def test_a_slab_that_is_gone_is_forgotten_where_a_beam_passes():
    points = ScanPoints()
    points.take(scan(0.35, 0.0))
    assert len(points.points_O)
    points.take(scan(0.35, 0.1, there=False))
    assert not len(points.points_O)
