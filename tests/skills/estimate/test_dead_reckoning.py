import numpy as np
import pytest
from planar_robot import Bench

from skills.estimate.dead_reckoning import DeadReckoning
from skills.robot import Pose2D

START = Pose2D(1.5, 5.4, 0.3)


def test_the_start_is_where_it_was_told_and_the_rest_is_odometry():
    bench = Bench(START, component=DeadReckoning(), cameras=False)
    bench.tick()
    assert bench.localiser.estimate().localised
    assert bench.pose_error() == pytest.approx((0.0, 0.0), abs=1e-3)
    bench.robot.push(3.0, 0.5, 0.4)
    bench.tick()
    assert bench.pose_error() == pytest.approx((0.0, 0.0), abs=1e-3)


def test_it_is_less_sure_the_farther_it_has_gone():
    bench = Bench(START, component=DeadReckoning(), cameras=False)
    bench.tick()
    before = bench.localiser.estimate().covariance
    bench.robot.push(5.0, 0.0, 0.0)
    bench.tick()
    assert np.all(np.diag(bench.localiser.estimate().covariance) > np.diag(before))


def test_a_start_that_is_not_known_is_the_origin():
    bench = Bench(START, component=DeadReckoning(), told=False, cameras=False)
    bench.tick()
    pose = bench.context().pose()
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_it_is_not_localised_before_it_has_seen_odometry():
    assert not DeadReckoning().build(Bench(START).costmap.keepout, None, surely=False).estimate().localised
