"""Inverse kinematics of Fetch's seven joints against forward kinematics."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from plant.robots.fetch.kind import fetch_capabilities
from skills.manipulation.arm.kinematics import arm_model

MODEL = arm_model(fetch_capabilities())
LOWER, UPPER = (np.clip(limits, -np.pi, np.pi) for limits in (MODEL.lower_rad, MODEL.upper_rad))


def configurations(count, seed=1):
    rng = np.random.default_rng(seed)
    return [rng.uniform(LOWER, UPPER) for _ in range(count)]


def test_every_solution_puts_the_hand_where_it_was_within_the_limits():
    for q in configurations(100):
        X_BH = MODEL.X_BH(q)
        for found in MODEL.inverse(X_BH, margin_rad=0.0):
            assert MODEL.X_BH(found).IsNearlyEqualTo(X_BH, 1e-6)
            assert MODEL.within_limits(found)


def test_joints_that_turn_without_end_come_within_half_a_turn_of_where_they_are():
    q = configurations(1)[0]
    turned = q + 2.0 * np.pi * np.array([0, 0, 1, 0, -2, 0, 3])
    assert MODEL.turned_near(q, turned) == pytest.approx(turned)
    assert MODEL.off_rad(q, turned) == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(MODEL.nearest_inverse(MODEL.X_BH(q), turned, 0.0), turned, atol=1e-6)


def test_nine_of_ten_reachable_poses_have_a_solution_and_all_have_one_near_their_own():
    qs = configurations(200)
    found = [bool(MODEL.inverse(MODEL.X_BH(q), margin_rad=0.0)) for q in qs]
    assert np.mean(found) > 0.9
    assert all(np.allclose(MODEL.nearest_inverse(MODEL.X_BH(q), q, 0.0), q, atol=1e-6) for q in qs)


def test_a_pose_with_solutions_is_reached_and_a_far_one_is_not():
    X_BH = MODEL.X_BH(configurations(1)[0])
    assert MODEL.reaches(X_BH, 0.0) == bool(MODEL.inverse(X_BH, 0.0))
    assert not MODEL.reaches(RigidTransform([2.0, 0.0, 0.3]))
    assert MODEL.inverse(RigidTransform([2.0, 0.0, 0.3])) == ()
