"""Tests of the grip after an object was felt at its lift."""

import pytest
from pydrake.math import RigidTransform

from plant.robots.fetch.kind import fetch_capabilities
from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.forces import HeldLoad
from skills.manipulation.grasp.candidates import GraspCandidate
from skills.manipulation.grasp.felt_load import centre_of_mass, grip_n, hangs_out, nearest_first, twist_grip_n

GRIPPER = spot_capabilities().gripper


def test_grip_is_firmer_for_a_larger_moment_on_either_side():
    weak, firm = (twist_grip_n(HeldLoad(0.6, moment_nm), GRIPPER) for moment_nm in (0.2, -0.4))
    assert firm == pytest.approx(2.0 * weak)
    assert twist_grip_n(HeldLoad(2.0, 0.0), GRIPPER) == 0.0


@pytest.mark.parametrize(("moment_nm", "hangs"), [(0.1, False), (0.9, False), (2.0, True), (-2.0, True)])
def test_object_hangs_out_when_the_largest_force_cannot_hold_its_moment(moment_nm, hangs):
    assert hangs_out(HeldLoad(1.0, moment_nm), GRIPPER) is hangs


def test_noise_never_feigns_a_moment_for_a_weak_gripper():
    assert not hangs_out(HeldLoad(0.3, 0.5), fetch_capabilities().gripper)


def test_grip_is_as_firm_as_load_and_gripper_allow():
    assert grip_n(80.0, HeldLoad(0.5), GRIPPER) == pytest.approx(86.0)
    assert grip_n(80.0, HeldLoad(0.5, 1.2), GRIPPER) > 100.0
    assert grip_n(80.0, HeldLoad(5.0, 3.0), GRIPPER) < GRIPPER.max_force_n


def test_grasps_near_the_felt_centre_of_mass_come_first():
    near, far = (GraspCandidate(RigidTransform([x, 0.0, 0.0]), 0.03, cost, 0.0) for x, cost in ((0.2, 0.5), (0.0, 0.1)))
    felt_B = centre_of_mass(HeldLoad(1.0), near.X_BH, GRIPPER)
    assert nearest_first([far, near], [felt_B], GRIPPER) == [near, far]
    assert nearest_first([far, near], [], GRIPPER) == [far, near]
