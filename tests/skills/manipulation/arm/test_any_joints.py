"""Inverse kinematics of an arm of no family: parallel joints and a wrist whose axes do not meet."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from skills.manipulation.arm.kinematics import ArmModel, ChainJoint

_ROWS = (
    ((0.2, 0.0, 0.4), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.13, 0.0), (0.0, math.pi / 2, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, -0.12, 0.42), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, 0.39), (0.0, math.pi / 2, 0.0), (0.0, -1.0, 0.0)),
    ((0.0, 0.09, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.0, 0.09), (0.0, 0.0, 0.0), (0.0, 0.6, 0.8)),
)


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
