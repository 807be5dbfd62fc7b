"""Scenery belongs to the world body, shape for shape, and keeps its names."""

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import LoadModelDirectives, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.framework import DiagramBuilder

from plant.diagram import DiagramConfig, build_diagram, parser_of
from plant.engine import Engine
from plant.referee import Referee
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import SPOT
from plant.worlds.world import load_world
from skills.robot import Pose2D

DOOR = """<sdf version="1.9"><model name="cupboard"><link name="frame"><collision name="frame"><geometry><box>
<size>0.5 0.5 1</size></box></geometry></collision></link><link name="door"><pose>0.3 0 0 0 0 0</pose>
<collision name="door"><geometry><box><size>0.02 0.5 1</size></box></geometry></collision></link>
<joint name="hinge" type="revolute"><parent>frame</parent><child>door</child><axis><xyz>0 0 1</xyz></axis></joint>
</model></sdf>"""
WALL = """<sdf version="1.9"><model name="wall"><link name="wall"><collision name="wall"><geometry><box>
<size>0.2 4 2</size></box></geometry></collision></link></model></sdf>"""
DIRECTIVES = """directives:
- add_model: {name: north_wall, file: "FOLDER/wall.sdf"}
- add_weld: {parent: world, child: "north_wall::wall", X_PC: {translation: [1.5, 0, 1.2]}}
- add_model: {name: cupboard, file: "FOLDER/cupboard.sdf"}
- add_weld: {parent: world, child: "cupboard::frame", X_PC: {translation: [-3, 0, 0.5]}}
"""


@pytest.fixture
def directives(tmp_path):
    (tmp_path / "wall.sdf").write_text(WALL)
    (tmp_path / "cupboard.sdf").write_text(DOOR)
    (tmp_path / "world.dmd.yaml").write_text(DIRECTIVES.replace("FOLDER", tmp_path.as_uri()))
    return tmp_path / "world.dmd.yaml"


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
    assert shapes(built.plant, built.scene_graph) == shapes(plant, scene_graph)
    assert built.plant.num_bodies() == 1
    assert {"fridge", "kitchen_table", "sofa"} <= set(built.scenery.values())


def test_a_model_with_a_part_that_moves_stays_a_model(directives):
    built = build_diagram(DiagramConfig(directives=directives, render=False))
    assert {*built.scenery.values()} == {"north_wall"}
    hinge = built.plant.GetJointByName("hinge", built.plant.GetModelInstanceByName("cupboard"))
    assert built.plant.num_positions() == hinge.num_positions() == 1
    frame = built.plant.GetBodyByName("frame")
    X_WF = built.plant.EvalBodyPoseInWorld(built.plant.CreateDefaultContext(), frame)
    assert X_WF.IsNearlyEqualTo(RigidTransform([-3, 0, 0.5]), 1e-9)


def test_a_bump_into_scenery_names_the_piece(directives):
    built = build_diagram(
        DiagramConfig(
            directives=directives,
            robots=[PlacedRobot("Alice", "spot", Pose2D(0.0, 0.0, 0.0))],
            visuals=False,
            render=False,
        )
    )
    engine = Engine(built)
    referee = Referee(built.plant, [], robots={"Alice": SPOT}, scenery=built.scenery)
    engine.observe(lambda now_s: referee.observe(engine.context, now_s), every=5)
    robot = engine.robots["Alice"]
    robot.drive(0.8, 0.0, 0.0, until_s=3.0, lease=robot.acquire_lease("test"))
    engine.advance(2.0)
    assert referee.collisions
    assert {"the north_wall"} == {
        bump.sentence.partition(" hit ")[2].partition(" at ")[0] for bump in referee.collisions
    }
