"""Closed-form inverse kinematics against forward kinematics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.kinematics import arm_model

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
SHARE = st.floats(0.03, 0.97)


def _configuration(shares):
    return MODEL.lower_rad + np.array(shares) * (MODEL.upper_rad - MODEL.lower_rad)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[SHARE] * 6))
def test_every_inverse_solution_puts_the_hand_where_it_was(shares):
    X_BH = MODEL.X_BH(_configuration(shares))
    for q in MODEL.inverse(X_BH, margin_rad=0.0):
        assert MODEL.X_BH(q).IsNearlyEqualTo(X_BH, 1e-6)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[SHARE] * 6))
def test_a_reachable_pose_has_its_own_configuration_among_the_solutions(shares):
    q = _configuration(shares)
    if abs(q[4]) < 0.02:
        return  # at the wrist's singularity the two rolls may be shared out otherwise
    solutions = MODEL.inverse(MODEL.X_BH(q), margin_rad=0.0)
    assert min(np.max(np.abs(other - q)) for other in solutions) < 1e-5


def test_forward_kinematics_agrees_with_the_urdf_read_by_drake():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(CAPABILITIES.description, "urdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q = _configuration((0.4, 0.6, 0.3, 0.7, 0.2, 0.55))
    for name, angle in zip(MODEL.names, q, strict=True):
        plant.GetJointByName(name).set_angle(context, angle)
    X_BH = plant.GetFrameByName("arm_wr1").CalcPose(context, plant.GetFrameByName("body"))
    assert MODEL.X_BH(q).IsNearlyEqualTo(X_BH, 1e-9)


def test_a_point_out_of_reach_has_no_solution():
    assert MODEL.inverse(RigidTransform([2.0, 0.0, 0.3])) == ()


def test_the_margin_keeps_solutions_away_from_the_limits():
    X_BH = MODEL.X_BH(MODEL.upper_rad - 0.01)
    assert all(MODEL.within_limits(other, 0.1) for other in MODEL.inverse(X_BH, margin_rad=0.1))


def test_an_arm_of_another_structure_is_solved_by_iteration():
    description = CAPABILITIES.description.replace('<axis xyz="1 0 0"', '<axis xyz="0 0 1"')
    other = arm_model(type(CAPABILITIES)(**{**CAPABILITIES.__dict__, "description": description}))
    X_BH = other.X_BH(np.clip(np.full(6, 0.3), other.lower_rad + 0.1, other.upper_rad - 0.1))
    assert not other.closed_form and MODEL.closed_form
    assert any(other.X_BH(q).IsNearlyEqualTo(X_BH, 1e-4) for q in other.inverse(X_BH))


def test_a_missing_joint_is_named():
    description = CAPABILITIES.description.replace('"arm_el1"', '"elbow"')
    with pytest.raises(ValueError, match="no joint arm_el1"):
        arm_model(type(CAPABILITIES)(**{**CAPABILITIES.__dict__, "description": description}))
