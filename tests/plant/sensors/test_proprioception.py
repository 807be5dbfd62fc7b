"""Odometry drifts with the travelled distance, and only then."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from plant.sensors.proprioception import OdometryModel, OdometryNoise

ZERO = np.zeros(3)
EXACT = OdometryNoise(*([0.0] * 5), 0.03, 0.03, *([0.0] * 4))


def drive(model, poses, dt=0.05):
    reading = None
    for i, (x, y, yaw) in enumerate(poses):
        reading = model.update(i * dt, RigidTransform(RollPitchYaw(0, 0, yaw), [x, y, 0.52]), ZERO, ZERO)
    return reading


def straight(length_m, start=(3.0, -2.0, 0.7), steps=400):
    x, y, yaw = start
    return [(x + np.cos(yaw) * s, y + np.sin(yaw) * s, yaw) for s in np.linspace(0, length_m, steps)]


def test_without_errors_it_is_the_motion_since_waking():
    reading = drive(OdometryModel(np.random.default_rng(0), EXACT), [*straight(2.0), *straight(2.0)[::-1]][:500])
    turn = [(0.0, 0.0, a) for a in np.linspace(0, 4.0, 300)]
    assert drive(OdometryModel(np.random.default_rng(0), EXACT), turn).pose.yaw_rad == pytest.approx(4.0 - 2 * np.pi)
    assert reading.pose.x_m == pytest.approx(2.0 * (1 - 99 / 399) - 2.0 * 1 / 399, abs=0.01)
    assert reading.pose.y_m == pytest.approx(0.0, abs=1e-9)


def test_readings_begin_at_the_origin_and_are_the_same_for_a_seed():
    reading = drive(OdometryModel(np.random.default_rng(0), EXACT), [(5, 5, 1)])
    np.testing.assert_allclose(reading.X_OB.translation(), [0, 0, 0.52])
    first, second = (drive(OdometryModel(np.random.default_rng(7)), straight(3.0)) for _ in range(2))
    np.testing.assert_array_equal(first.X_OB.GetAsMatrix34(), second.X_OB.GetAsMatrix34())


def test_drift_over_ten_metres_is_about_a_percent_and_three_degrees():
    ends = [drive(OdometryModel(np.random.default_rng(seed)), straight(10.0)).pose for seed in range(40)]
    along = np.array([np.hypot(end.x_m, end.y_m) - 10.0 for end in ends])
    turned = np.degrees([end.yaw_rad for end in ends])
    assert 0.04 < np.std(along) < 0.16 and 1.5 < np.std(turned) < 4.5 and np.max(np.abs(along)) < 0.4


def test_standing_and_swaying_adds_no_drift():
    rng = np.random.default_rng(3)
    poses = [(1.0 + 0.0005 * rng.standard_normal(), 2.0, 0.0005 * rng.standard_normal()) for _ in range(4000)]
    pose = drive(OdometryModel(np.random.default_rng(0)), poses).pose
    assert np.hypot(pose.x_m, pose.y_m) < 0.01 and abs(pose.yaw_rad) < 0.01


def test_height_roll_and_pitch_are_true_within_small_noise():
    model = OdometryModel(np.random.default_rng(0))
    X_WB = RigidTransform(RollPitchYaw(0.05, -0.2, 1.0), [1, 2, 0.46])
    read = [model.update(i * 0.1, X_WB, ZERO, ZERO).X_OB for i in range(200)]
    rpy = np.array([RollPitchYaw(X.rotation()).vector() for X in read])
    assert (np.mean(rpy[:, 0]), np.mean(rpy[:, 1])) == (pytest.approx(0.05, abs=1e-3), pytest.approx(-0.2, abs=1e-3))
    assert 0.0005 < np.std([X.translation()[2] for X in read]) < 0.005


def test_velocity_is_in_the_body_frame():
    model = OdometryModel(np.random.default_rng(0), EXACT)
    X_WB = RigidTransform(RollPitchYaw(0, 0, np.pi / 2), [0, 0, 0.5])
    velocity = model.update(0.0, X_WB, np.array([0, 0, 0.4]), np.array([0.0, 1.0, 0.0])).velocity
    np.testing.assert_allclose(velocity, [1.0, 0.0, 0.4], atol=1e-12)
