"""Tests of weighing a held object by the arm's efforts."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from plant.robots.spot.kind import spot_capabilities
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.forces import HeldLoad, held_load, mean_load
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.poses import hand_rotation

CAPABILITIES = spot_capabilities()
MODEL = arm_model(CAPABILITIES)
AHEAD = np.array([0.0, -1.6, 1.6, 0.0, 0.4, 0.0])
ASIDE = np.array([0.9, -2.2, 1.9, 0.4, 0.3, 0.2])
GRIP = np.array([0.19, 0.0, 0.0])


def _efforts_of(mass_kg, q, p_HO=GRIP):
    """By virtual work, from another difference than the code's."""
    up = [(MODEL.X_BH(q + 2e-6 * e) @ p_HO - MODEL.X_BH(q) @ p_HO)[2] / 2e-6 for e in np.eye(len(q))]
    return mass_kg * 9.81 * np.array(up)


@pytest.mark.parametrize("q", [AHEAD, ASIDE])
@pytest.mark.parametrize("mass_kg", [0.0, 0.4, 2.4, 7.0])
def test_the_mass_follows_from_the_extra_efforts(mass_kg, q):
    assert held_load(MODEL, q, GRIP, _efforts_of(mass_kg, q)).mass_kg == pytest.approx(mass_kg, abs=1e-3)


@pytest.mark.parametrize("beside_m", [-0.1, 0.0, 0.12])
def test_the_centre_of_mass_beside_the_grip_follows_from_the_efforts(beside_m):
    # the fingers point down and the object lies across the arm
    q = MODEL.inverse(RigidTransform(hand_rotation(np.pi / 2, 0.5, 1.0), [0.85, 0.0, -0.1]))[0]
    load = held_load(MODEL, q, GRIP, _efforts_of(0.8, q, GRIP + [0.0, beside_m, 0.0]))
    assert load.mass_kg == pytest.approx(0.8, abs=0.03)
    assert load.beside_m == pytest.approx(beside_m, abs=0.02)


def test_efforts_that_tell_no_moment_give_none():
    # the hand's y axis is upright: a weight beside the grip has no lever
    q = MODEL.inverse(RigidTransform(hand_rotation(0.0, 0.0, 1.0), [0.8, 0.0, 0.1]))[0]
    assert held_load(MODEL, q, GRIP, _efforts_of(0.8, q)).moment_nm == pytest.approx(0.0, abs=0.05)


def test_readings_count_by_their_median_mass_and_mean_moment():
    mean = mean_load([HeldLoad(1.0, 0.2), HeldLoad(1.1, 0.4), HeldLoad(9.0, 0.6)])
    assert (mean.mass_kg, mean.moment_nm) == (1.1, pytest.approx(0.4))


def test_a_moment_about_the_vertical_gives_no_mass():
    assert held_load(MODEL, AHEAD, GRIP, np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])).mass_kg == pytest.approx(
        0.0, abs=1e-6
    )


def test_an_arm_held_out_ahead_needs_efforts_against_its_own_weight():
    # the shoulder carries the whole arm: about 8 kg whose middle is a few decimetres ahead, up being negative pitch
    efforts = ArmScene(CAPABILITIES, MODEL, {}).gravity_efforts(AHEAD)
    assert efforts[0] == pytest.approx(0.0, abs=1e-6)
    assert -20.0 < efforts[1] < -5.0
    assert -20.0 < efforts[2] < -5.0
