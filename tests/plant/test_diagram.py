"""Scenery belongs to the world body, shape for shape, and keeps its names."""

import gc
import shutil
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import LoadModelDirectives, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder

from plant.diagram import DiagramConfig, build_diagram, parser_of
from plant.engine import Engine
from plant.referee import Referee
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import SPOT
from plant.worlds.world import load_world
from skills.robot import Pose2D


@pytest.fixture
def directives(tmp_path):
    directives = shutil.copytree(Path(__file__).with_name("diagram_files"), tmp_path / "home") / "world.dmd.yaml"
    directives.write_text(directives.read_text().replace("FOLDER", directives.parent.as_uri()))
    return directives


def shapes(plant, scene_graph):
    """Name, kind, roles and place in the world of every shape, sorted."""
    context, inspector = plant.CreateDefaultContext(), scene_graph.model_inspector()
    found = []
    for each in inspector.GetAllGeometryIds():
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(each))
        X_WG = plant.EvalBodyPoseInWorld(context, body) @ inspector.GetPoseInFrame(each)
        roles = [inspector.GetProperties(each, role) is not None for role in (Role.kProximity, Role.kPerception)]
        kind, place = type(inspector.GetShape(each)).__name__, X_WG.GetAsMatrix34().round(9).ravel().tolist()
        found.append((inspector.GetName(each).rpartition("::")[2], kind, roles, np.add(place, 0.0).tolist()))
    return sorted(found)


def test_every_shape_of_the_flat_stands_where_the_directives_put_it():
    world = load_world("flat")
    built = build_diagram(DiagramConfig(directives=world.directives_path, render=False))
    plant, scene_graph = AddMultibodyPlant(MultibodyPlantConfig(), DiagramBuilder())
    ProcessModelDirectives(LoadModelDirectives(world.directives_path), parser_of(plant))
    plant.Finalize()
    assert (shapes(built.plant, built.scene_graph), built.plant.num_bodies()) == (shapes(plant, scene_graph), 1)
    assert {"fridge", "kitchen_table", "sofa"} <= set(built.scenery.values())


def test_a_model_with_a_part_that_moves_stays_a_model(directives):
    built = build_diagram(DiagramConfig(directives=directives, render=False))
    assert {*built.scenery.values()} == {"north_wall"}
    hinge = built.plant.GetJointByName("hinge", built.plant.GetModelInstanceByName("cupboard"))
    assert built.plant.num_positions() == hinge.num_positions() == 1
    frame = built.plant.GetBodyByName("frame")
    X_WF = built.plant.EvalBodyPoseInWorld(built.plant.CreateDefaultContext(), frame)
    assert X_WF.IsNearlyEqualTo(RigidTransform([-3, 0, 0.5]), 1e-9)


def test_a_world_that_is_no_longer_used_leaves_no_plant_behind(directives):
    def plants():
        gc.collect()
        return sum(isinstance(each, MultibodyPlant) for each in gc.get_objects())

    before = plants()
    build_diagram(DiagramConfig(directives=directives, render=False))
    assert plants() <= before  # those of earlier tests may go meanwhile


def test_a_bump_into_scenery_names_the_piece(directives):
    alice = PlacedRobot("Alice", "spot", Pose2D(0.0, 0.0, 0.0))
    built = build_diagram(DiagramConfig(directives=directives, robots=[alice], visuals=False, render=False))
    engine = Engine(built)
    referee = Referee(built.plant, [], robots={"Alice": SPOT}, scenery=built.scenery)
    engine.observe(lambda now_s: referee.observe(engine.context, now_s), every=5)
    robot = engine.robots["Alice"]
    robot.drive(0.8, 0.0, 0.0, until_s=3.0, lease=robot.acquire_lease("test"))
    engine.advance(2.0)
    hit = {bump.sentence.partition(" hit ")[2].partition(" at ")[0] for bump in referee.collisions}
    assert hit == {"the north_wall"}
