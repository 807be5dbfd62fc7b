"""Inverse kinematics against forward kinematics: Fetch's seven joints, and an arm of no family."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from plant.robots.fetch.kind import FETCH
from skills.manipulation.arm.kinematics import ArmModel, ChainJoint, arm_model

MODEL = arm_model(FETCH.capabilities())
LOWER, UPPER = (np.clip(limits, -np.pi, np.pi) for limits in (MODEL.lower_rad, MODEL.upper_rad))
_ROWS = (
    ((0.2, 0.0, 0.4), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.13, 0.0), (0.0, math.pi / 2, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, -0.12, 0.42), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.39), (0.0, math.pi / 2, 0.0), (0.0, -1.0, 0.0)),
    ((0.0, 0.09, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.0, 0.09), (0.0, 0.0, 0.0), (0.0, 0.6, 0.8)),
)


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


@pytest.fixture(scope="module")
def model():
    joints = tuple(
        ChainJoint(f"j{k}", f"l{k}", RigidTransform(RollPitchYaw(rpy), list(xyz)), axis, -3.1, 3.1)
        for k, (xyz, rpy, axis) in enumerate(_ROWS)
    )
    return ArmModel(joints, np.zeros(6), closed_form=False)


def poses(model, count):
    rng = np.random.default_rng(3)
    return [(q, model.X_BH(q)) for q in rng.uniform(-2.9, 2.9, (count, 6))]


def test_solutions_put_the_hand_at_the_pose_and_differ(model):
    for _, X_BH in poses(model, 6):
        found = model.inverse(X_BH)
        assert found
        assert all(model.X_BH(q).IsNearlyEqualTo(X_BH, 1e-4) for q in found)
        assert all(np.max(np.abs(a - b)) > 0.02 for n, a in enumerate(found) for b in found[:n])


def test_solutions_keep_a_margin_from_the_limits(model):
    for _, X_BH in poses(model, 10):
        assert all(model.within_limits(q, 0.1) for q in model.inverse(X_BH, 0.1))


def test_a_solution_near_a_posture_is_found(model):
    for q_rad, X_BH in poses(model, 20):
        found = model.nearest_inverse(X_BH, q_rad + 0.03)
        assert found is not None and np.max(np.abs(found - q_rad)) < 0.2


def test_a_pose_out_of_reach_has_none(model):
    far = RigidTransform([3.0, 0.0, 0.5])
    assert model.inverse(far) == () and not model.reaches(far)
    assert model.nearest_inverse(far, np.zeros(6)) is None
