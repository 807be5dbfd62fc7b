"""What moves with a hand is moved along its arc after each step; what does not is left alone."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import Simulator

from plant.carried import FASTEST_SPIN_RAD_S, Carried, arc_m
from plant.diagram import LooseModel, build_diagram
from plant.engine import Engine
from plant.models.catalogue import load_catalogue

DT_S, TURN_RAD_S, REACH_M = 0.0125, 0.75, 0.9


@pytest.fixture
def scene():
    """A hand that slides along y and turns about z, and a free object."""
    plant = MultibodyPlant(DT_S)
    slide, hand, thing = (
        plant.AddRigidBody(name, SpatialInertia.SolidSphereWithMass(1.0, 0.1)) for name in ("slide", "hand", "thing")
    )
    plant.AddJoint(PrismaticJoint("along", plant.world_frame(), slide.body_frame(), [0.0, 1.0, 0.0]))
    plant.AddJoint(RevoluteJoint("turn", slide.body_frame(), hand.body_frame(), [0.0, 0.0, 1.0]))
    plant.Finalize()
    return plant, plant.CreateDefaultContext(), hand, thing


def _move(plant, context, along_m_s, turn_rad_s):
    plant.GetJointByName("along").set_translation_rate(context, along_m_s)
    plant.GetJointByName("turn").set_angular_rate(context, turn_rad_s)


def _set(plant, context, body, p_W, w_W, v_W):
    plant.SetFreeBodyPose(context, body, RigidTransform(p_W))
    plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity(w=w_W, v=v_W))


BENT_MM = 1e3 * 0.5 * DT_S**2 * TURN_RAD_S**2 * REACH_M


# where the object is, how fast it moves, how fast the hand slides -> how far it is moved (mm)
@pytest.mark.parametrize(
    ("p_W", "v_W", "along_m_s", "moved_mm"),
    [
        ([0.4, 0.0, 0.2], [0.0, TURN_RAD_S * 0.4, 0.0], 0.0, BENT_MM * 0.4 / REACH_M),
        ([0.4, 0.0, 0.2], [0.0, TURN_RAD_S * 0.4 + 1.0, 0.0], 1.0, BENT_MM * 0.4 / REACH_M),  # sliding bends nothing
        ([0.0, 0.0, 0.2], [0.0, 1.0, 0.0], 1.0, 0.0),  # on the axis of a wrist that turns
        ([0.4, 0.0, 0.2], [0.0, 0.0, -1.0], 0.0, 0.0),  # falls past the hand
        ([2.0, 0.0, 0.2], [0.0, TURN_RAD_S * 2.0, 0.0], 0.0, 0.0),  # far from the hand
    ],
)
def test_what_moves_with_the_hand_is_moved_towards_the_axis_about_which_it_turns(scene, p_W, v_W, along_m_s, moved_mm):
    plant, context, hand, thing = scene
    _move(plant, context, along_m_s, TURN_RAD_S)
    _set(plant, context, thing, p_W, [0.0, 0.0, TURN_RAD_S], v_W)
    Carried(plant, context, [thing]).after_step(hand, DT_S)
    moved = plant.EvalBodyPoseInWorld(context, thing).translation() - p_W
    assert np.allclose(1e3 * moved, [-moved_mm, 0.0, 0.0], atol=1e-9)


def test_steps_along_tangents_with_the_arc_stay_on_the_circle():
    p_m, turn = np.array([REACH_M, 0.0, 0.0]), np.array([0.0, 0.0, TURN_RAD_S])
    tangents_m = p_m.copy()
    for _ in range(round(8.0 / DT_S)):
        v, along = np.cross(turn, p_m), np.cross(turn, tangents_m)
        p_m, tangents_m = p_m + DT_S * v + arc_m(np.cross(turn, v), DT_S), tangents_m + DT_S * along
    assert np.linalg.norm(p_m) == pytest.approx(REACH_M, abs=1e-4)
    assert np.linalg.norm(tangents_m) > REACH_M + 0.015


def _spinning_bar(limited):
    """The spin (rad/s) of a flat bar of 150 g, thrown into the air with a spin, after two seconds."""
    plant = MultibodyPlant(DT_S)
    bar = plant.AddRigidBody("bar", SpatialInertia.SolidBoxWithMass(0.15, 0.26, 0.03, 0.01))
    plant.Finalize()
    simulator = Simulator(plant)
    context = simulator.get_mutable_context()
    _set(plant, context, bar, np.zeros(3), [30.0, 3.0, 35.0], np.zeros(3))
    carried = Carried(plant, context, [bar])
    for step in range(160):
        simulator.AdvanceTo((step + 1) * DT_S)
        if limited:
            carried.limit_spin()
    return float(np.linalg.norm(plant.EvalBodySpatialVelocityInWorld(context, bar).rotational()))


def test_a_bar_that_spins_as_it_flies_spins_no_faster_with_time():
    assert _spinning_bar(limited=True) < 2.0 * FASTEST_SPIN_RAD_S
    assert not _spinning_bar(limited=False) < 1000.0


TABLE = """<sdf version="1.7"><model name="table"><link name="table"><collision name="table"><pose>0 0 -0.1 0 0 0</pose>
<geometry><box><size>4 4 0.2</size></box></geometry></collision></link></model></sdf>"""


@pytest.mark.parametrize("steps_before", [1, 2, 3, 4])
def test_a_can_that_is_wrung_out_of_the_fingers_over_a_table_is_not_hurled_away(tmp_path, steps_before):
    """It spins at 600 rad/s, 1 mm over a table: it falls over there, wherever in the engine's periods that happens."""
    path = tmp_path / "table.sdf"
    path.write_text(TABLE)
    (can,) = list(load_catalogue()["coke"].forms.values())[:1]
    models = [
        LooseModel("table", path, RigidTransform(), fixed=True),
        LooseModel("can", can.path(), RigidTransform([0.0, 0.0, 0.5])),
    ]
    engine = Engine(build_diagram(directives=None, models=models, robots={}, render=False), {})
    plant, context = engine.world.plant, engine.context
    body = plant.GetBodyByName("coke", engine.world.models["can"])
    engine.advance(steps_before * DT_S)
    _set(plant, context, body, [0.0, 0.0, can.rest_height_m + 0.001], [600.0, 0.0, 0.0], np.zeros(3))
    fastest_m_s = 0.0
    for _ in range(40):
        engine.advance(DT_S)
        velocity = plant.EvalBodySpatialVelocityInWorld(context, body).translational()
        fastest_m_s = max(fastest_m_s, float(np.linalg.norm(velocity)))
    assert fastest_m_s < 2.0
