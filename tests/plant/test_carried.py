"""What moves with a hand is moved along its arc after each step; what does not is left alone."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia

from plant.carried import Carried, arc_m

DT_S, TURN_RAD_S, REACH_M = 0.0125, 0.75, 0.9


@pytest.fixture
def scene():
    """A free hand and a free object, both 0.9 m from an axis about which the hand turns."""
    plant = MultibodyPlant(DT_S)
    hand, thing = (plant.AddRigidBody(name, SpatialInertia.SolidSphereWithMass(1.0, 0.1)) for name in ("hand", "thing"))
    plant.Finalize()
    return plant, plant.CreateDefaultContext(), hand, thing


def _set(plant, context, body, p_W, w_W, v_W):
    plant.SetFreeBodyPose(context, body, RigidTransform(p_W))
    plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity(w=w_W, v=v_W))


# where the object is, and how fast it moves -> how far it is moved (mm)
@pytest.mark.parametrize(
    ("p_W", "v_W", "moved_mm"),
    [
        ([REACH_M, 0.0, 0.5], [0.0, TURN_RAD_S * REACH_M, 0.0], 1e3 * 0.5 * DT_S**2 * TURN_RAD_S**2 * REACH_M),
        ([REACH_M, 0.0, 0.5], [0.0, 0.0, -1.0], 0.0),  # falls past the hand
        ([REACH_M + 2.0, 0.0, 0.5], [0.0, TURN_RAD_S * (REACH_M + 2.0), 0.0], 0.0),  # far from the hand
    ],
)
def test_only_what_moves_with_the_hand_is_moved_inwards(scene, p_W, v_W, moved_mm):
    plant, context, hand, thing = scene
    turn = [0.0, 0.0, TURN_RAD_S]
    _set(plant, context, hand, [REACH_M, 0.0, 0.5], turn, [0.0, TURN_RAD_S * REACH_M, 0.0])
    _set(plant, context, thing, p_W, turn, v_W)
    Carried(plant, context, [thing]).after_step(hand, DT_S)
    moved = plant.EvalBodyPoseInWorld(context, thing).translation() - p_W
    assert np.allclose(1e3 * moved, [-moved_mm, 0.0, 0.0], atol=1e-9)


def test_steps_along_tangents_with_the_arc_stay_on_the_circle():
    p_m, turn = np.array([REACH_M, 0.0, 0.0]), np.array([0.0, 0.0, TURN_RAD_S])
    tangents_m = p_m.copy()
    for _ in range(round(8.0 / DT_S)):
        v, along = np.cross(turn, p_m), np.cross(turn, tangents_m)
        p_m, tangents_m = p_m + DT_S * v + arc_m(turn, v, DT_S), tangents_m + DT_S * along
    assert np.linalg.norm(p_m) == pytest.approx(REACH_M, abs=1e-4)
    assert np.linalg.norm(tangents_m) > REACH_M + 0.015
