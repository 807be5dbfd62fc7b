"""Tests of viewpoints and carrying poses."""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from plant.robots.fetch.kind import FETCH
from plant.robots.spot.kind import spot_capabilities
from skills.api import PlanningError
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.poses import (
    carry_configuration,
    finger_sweep_m,
    hand_rotation,
    overview_viewpoints,
    tucked_configuration,
    viewpoints_beside,
)

SHOULDER, TARGET = np.array([0.0, 0.0, 0.5]), np.array([1.0, 0.0, 0.3])
CAPABILITIES = FETCH.capabilities()
FETCH_MODEL, LIFT = (
    arm_model(CAPABILITIES),
    {CAPABILITIES.lift_joint: CAPABILITIES.standing_height_m - CAPABILITIES.height_range_m[0]},
)


# tilt of the fingers, lean towards the fixed finger (degrees) -> depth of the moving finger's sweep (mm)
@pytest.mark.parametrize(("tilt_deg", "lean_deg", "sweep_mm"), [(90, 0, 9.0), (90, 6, 3.7), (90, 14, 0.0), (0, 0, 0.0)])
def test_finger_sweeps_below_the_fixed_one_unless_the_hand_leans(tilt_deg, lean_deg, sweep_mm):
    R_BH = hand_rotation(np.radians(tilt_deg), 0.0, 1.0)
    leaning = R_BH @ RotationMatrix(AngleAxis(-np.radians(lean_deg), np.array([0.0, 1.0, 0.0])))
    spot = spot_capabilities().gripper
    swept_m = finger_sweep_m(RigidTransform(leaning, np.zeros(3)), RigidTransform(), spot)
    assert 1e3 * swept_m == pytest.approx(sweep_mm, abs=0.2)


def test_two_moving_fingers_sweep_over_no_surface():
    down = RigidTransform(hand_rotation(0.5 * np.pi, 0.0, 1.0), np.zeros(3))
    assert finger_sweep_m(down, RigidTransform(), CAPABILITIES.gripper) == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
def test_places_beside_another_are_first_those_farther_out_on_its_side(side):
    eye = np.array([0.2, 0.3 * side, 0.9])
    farther_out = side * (np.array(viewpoints_beside(SHOULDER, eye, TARGET))[:, 1] - eye[1]) > 0.03
    assert farther_out.tolist() == [True, True, False, False, False]


def test_places_beside_another_are_six_centimetres_from_it_across_the_view():
    eye = np.array([0.2, 0.3, 0.9])
    for place in viewpoints_beside(SHOULDER, eye, TARGET)[:2]:
        step = (place - eye)[:2]
        assert np.linalg.norm(step) == pytest.approx(0.06)
        assert step @ (TARGET - eye)[:2] == pytest.approx(0.0, abs=1e-9)


# how the hand was tilted as it took what it carries (rad below level)
@pytest.mark.parametrize("tilt_rad", [0.0, 0.35])
def test_an_object_that_sticks_out_is_drawn_in_beside_the_body_as_upright_as_before(tilt_rad):
    scene = ArmScene(CAPABILITIES, FETCH_MODEL, LIFT)
    ahead = carry_configuration(scene, CAPABILITIES.arm, hand_rotation(tilt_rad, 0.0, 1.0), FETCH_MODEL.stowed_rad)
    drawn_in = tucked_configuration(scene, CAPABILITIES.arm, FETCH_MODEL.X_BH(ahead).rotation(), ahead)
    tips_m = [FETCH_MODEL.X_BH(q) @ np.array([CAPABILITIES.gripper.tip_x_m, 0.0, 0.0]) for q in (ahead, drawn_in)]
    assert tips_m[0][0] > 0.65
    assert np.hypot(*tips_m[1][:2]) < 0.42
    assert scene.beyond_body_m(drawn_in)[0] < 0.1
    tilts = [FETCH_MODEL.X_BH(q).rotation().matrix()[2] for q in (ahead, drawn_in)]
    assert tilts[0] == pytest.approx(tilts[1], abs=1e-6)
    assert scene.free(drawn_in)


# how the hand was tilted as it took what it carries (rad below level)
@pytest.mark.parametrize("tilt_rad", [0.0, 0.35, 0.7])
def test_an_arm_that_carries_keeps_its_elbow_near_the_body(tilt_rad):
    scene = ArmScene(CAPABILITIES, FETCH_MODEL, LIFT)
    q = carry_configuration(scene, CAPABILITIES.arm, hand_rotation(tilt_rad, 0.0, 1.0), FETCH_MODEL.stowed_rad)
    assert scene.beyond_body_m(q)[1] < 0.04  # 0.14 where nothing is said about it


@pytest.mark.parametrize("tilt_rad", [1.1, 1.57])
def test_an_object_that_hangs_below_the_fingers_is_carried_hanging(tilt_rad):
    spot, model = spot_capabilities(), arm_model(spot_capabilities())
    scene = ArmScene(spot, model, {})
    scene.hold([Box(RigidTransform([0.36, 0.0, 0.0]), (0.32, 0.09, 0.09))])
    R_BH = hand_rotation(tilt_rad, 0.3, 1.0)
    hanging = carry_configuration(scene, spot.arm, R_BH, model.stowed_rad, hangs=True)
    assert model.X_BH(hanging).rotation().matrix()[2, 0] == pytest.approx(R_BH.matrix()[2, 0], abs=1e-6)
    level = carry_configuration(scene, spot.arm, R_BH, model.stowed_rad)
    assert model.X_BH(level).rotation().matrix()[2, 0] > 0.0


def test_an_object_that_cannot_be_drawn_in_is_refused():
    scene = ArmScene(CAPABILITIES, FETCH_MODEL, {})
    scene.set_boxes([Box(RigidTransform([0.4, 0.0, 0.6]), (0.3, 1.5, 0.8))])
    with pytest.raises(PlanningError, match="cannot be drawn in"):
        tucked_configuration(scene, CAPABILITIES.arm, hand_rotation(0.0, 0.0, 1.0), FETCH_MODEL.stowed_rad)


def test_a_tall_object_is_seen_from_further_back_first():
    model = arm_model(spot_capabilities())
    p_BT = model.p_BS + np.array([0.7, 0.0, 0.0])
    low, tall = (overview_viewpoints(model.p_BS, p_BT, height_m=height_m) for height_m in (0.3, 0.6))
    assert tall[0][0] < min(p_BC[0] for p_BC in low)
    assert np.allclose(tall[len(low) :], low)
