"""Loose objects rest still and have their masses."""

import numpy as np
import pytest
from pydrake.geometry import Box, Role
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from plant.diagram import add_model
from plant.models.catalogue import load_catalogue

LOOSE = [(name, form) for name, entry in load_catalogue().items() if name != "person" for form in entry.forms]
MASSES_KG = {("coke", "can"): 0.35, ("beer", "brown_bottle"): 0.55, ("hammer", "claw"): 0.55, ("cube", "blue"): 0.12}


def of(loose):
    return load_catalogue()[loose[0]].forms[loose[1]]


@pytest.fixture(scope="module")
def poses():
    """Each form's pose on a table after 0.5 s and after 3.5 s, dropped from one millimetre."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=0.0125, discrete_contact_approximation="sap")
    plant, _ = AddMultibodyPlant(config, builder)
    X_WT, friction = RigidTransform([0.0, 0.0, 0.70]), CoulombFriction(0.8, 0.8)
    plant.RegisterCollisionGeometry(plant.world_body(), X_WT, Box(40, 4, 0.1), "table", friction)
    parser, bodies = Parser(plant), {}
    parser.SetAutoRenaming(True)
    for index, loose in enumerate(LOOSE):
        bodies[loose] = plant.GetBodyByName(loose[0], add_model(parser, of(loose).path()))
        z = 0.75 + of(loose).rest_height_m + 0.001
        X_WO = RigidTransform(RollPitchYaw(0.0, 0.0, 0.4 + index), np.array([0.5 * index, 0.3, z]))
        plant.SetDefaultFloatingBaseBodyPose(bodies[loose], X_WO)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyContextFromRoot(simulator.get_context())
    seen = {loose: [] for loose in LOOSE}
    for time_s in (0.5, 3.5):
        simulator.AdvanceTo(time_s)
        for loose, body in bodies.items():
            seen[loose].append(plant.EvalBodyPoseInWorld(context, body))
    return seen


@pytest.mark.parametrize("loose", LOOSE)
def test_rests_still_on_a_table(loose, poses):
    early, late = poses[loose]
    assert np.linalg.norm(late.translation() - early.translation()) < 1e-3
    assert np.degrees(early.InvertAndCompose(late).rotation().ToAngleAxis().angle()) < 0.2


@pytest.mark.parametrize("loose", LOOSE)
def test_rests_at_the_height_that_the_catalogue_says(loose, poses):
    height = poses[loose][1].translation()[2] - 0.75
    assert height == pytest.approx(of(loose).rest_height_m, abs=12e-4)
    assert np.degrees(np.arccos(min(1.0, poses[loose][1].rotation().matrix()[2, 2]))) < 2.0


@pytest.mark.parametrize("loose", LOOSE)
def test_has_its_mass_and_friction(loose):
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(time_step=0.005), builder)
    add_model(Parser(plant), of(loose).path())
    plant.Finalize()
    body = plant.GetBodyByName(loose[0])
    assert body.default_mass() == pytest.approx(MASSES_KG.get(loose, body.default_mass()))
    assert 0.02 < body.default_mass() < 3.0  # the arm lifts 5 kg, reaching far 3 kg
    inspector = scene_graph.model_inspector()
    for geometry in plant.GetCollisionGeometriesForBody(body):
        friction = inspector.GetProximityProperties(geometry).GetProperty("material", "coulomb_friction")
        assert friction.dynamic_friction() == pytest.approx(0.8)
    assert inspector.NumGeometriesWithRole(Role.kPerception) == 1


@pytest.mark.parametrize("loose", [loose for loose in LOOSE if loose[0] in ("hammer", "screwdriver", "wrench")])
def test_a_tool_has_no_cylinders_because_drake_mistakes_how_deep_a_box_swallows_a_disc(loose):
    assert "<cylinder>" not in of(loose).path().read_text()


def test_every_class_that_is_handled_has_several_forms():
    handled = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "cylinder", "cube")
    forms = {name: len(entry.forms) for name, entry in load_catalogue().items() if name != "person"}
    assert forms == dict.fromkeys(handled, 3)


def test_class_ids_are_distinct_and_leave_zero_to_nothing():
    ids = [entry.id for entry in load_catalogue().values()]
    assert len(set(ids)) == len(ids)
    assert min(ids) > 0
