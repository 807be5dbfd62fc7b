"""Loose objects rest still, have their masses, and their files equal the builder's output."""

import numpy as np
import pytest
from pydrake.geometry import Box, Role
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from errand_train.dataset.objects.forms import FORMS, write_forms
from errand_train.models import objects
from errand_train.models.__main__ import build
from errand_train.models.mass import join_masses, shape_mass
from plant.diagram import add_model
from plant.models.builder.shapes import Cylinder
from plant.models.catalogue import MODELS_FOLDER, load_catalogue

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


def test_every_class_that_is_handled_has_several_forms():
    handled = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "cylinder", "cube")
    forms = {name: len(entry.forms) for name, entry in load_catalogue().items() if name != "person"}
    assert forms == dict.fromkeys(handled, 3)


def test_class_ids_are_distinct_and_leave_zero_to_nothing():
    ids = [entry.id for entry in load_catalogue().values()]
    assert len(set(ids)) == len(ids)
    assert min(ids) > 0


def test_the_hammer_is_heavy_at_its_head():
    assert objects.hammer().mass.com[0] > 0.05


def test_mass_properties_follow_the_parallel_axis_theorem():
    halves = [Cylinder(radius=0.01, length=0.2, p=(0, 0, z)) for z in (0.1, -0.1)]
    both = shape_mass(Cylinder(radius=0.01, length=0.4), 2.0)
    whole = join_masses([shape_mass(half, 1.0) for half in halves])
    np.testing.assert_allclose(whole.com, 0.0, atol=1e-12)
    np.testing.assert_allclose(whole.inertia, both.inertia, rtol=1e-9, atol=1e-15)


def test_mass_properties_without_mass_are_refused():
    with pytest.raises(ValueError, match="no mass"):
        join_masses([shape_mass(Cylinder(radius=0.01, length=0.2), 0.0)])


@pytest.mark.parametrize(("write", "files"), [(build, 18), (write_forms, 3 * len(FORMS))])
def test_committed_files_equal_those_that_are_made(write, files, tmp_path, monkeypatch):
    monkeypatch.setattr("errand_train.models.__main__.save_png", lambda *_: None)  # its bytes are the library's
    write(tmp_path)
    written = [path for path in tmp_path.rglob("*") if path.suffix in (".sdf", ".obj", ".mtl")]
    assert len(written) == files
    for path in written:
        committed = MODELS_FOLDER / path.relative_to(tmp_path)
        assert committed.read_text(encoding="utf-8") == path.read_text(encoding="utf-8"), committed
