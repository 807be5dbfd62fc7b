"""Things that lie still far from every robot are held; nothing else is.

| the thing | a robot | held |
|---|---|---|
| lies still | far | yes |
| lies still | near | no |
| falls | far | no |
| was held | comes near | no more |
"""

from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity

import plant
from plant.diagram import LooseModel, build_diagram
from plant.resting import NEAR_M
from plant.simulation import Engine
from skills.robot import Pose2D

FLOOR = """<sdf version="1.9"><model name="ground"><link name="ground"><collision name="ground">
<geometry><box><size>20 20 0.2</size></box></geometry></collision></link></model></sdf>"""
CUBE = Path(plant.__file__).parent / "models/cube/cube.sdf"
LYING_M = 0.025
FAR_M, CLOSE_M = NEAR_M + 1.0, NEAR_M - 0.5


@pytest.fixture
def cube_at(tmp_path):
    """An engine with Alice at the origin and a cube at (x, height)."""

    def make(x_m, height_m=LYING_M):
        ground = tmp_path / "ground.sdf"
        ground.write_text(FLOOR)
        models = [
            LooseModel("ground", ground, RigidTransform([0, 0, -0.1]), fixed=True),
            LooseModel("cube", CUBE, RigidTransform([x_m, 0, height_m])),
        ]
        world = build_diagram(directives=None, models=models, robot_names=["Alice"], looks=False, render=False)
        return Engine(world, {"Alice": Pose2D(0, 0, 0)})

    return make


def cube_of(engine):
    return engine.world.plant.GetBodyByName("cube", engine.world.models["cube"])


def held(engine):
    tree = engine.world.plant
    joints = map(tree.get_joint, tree.GetJointIndices())
    (joint,) = (each for each in joints if each.child_body().index() == cube_of(engine).index())
    return joint.is_locked(engine.context)


def put_robot(engine, x_m):
    engine.world.robots["Alice"].place(engine.context, Pose2D(x_m, 0.0, 0.0))


def test_a_thing_that_lies_still_far_away_is_held(cube_at):
    engine = cube_at(FAR_M)
    engine.advance(1.0)
    assert held(engine)


def test_a_thing_near_a_robot_is_free(cube_at):
    engine = cube_at(CLOSE_M)
    engine.advance(1.0)
    assert not held(engine)


def test_a_falling_thing_is_free_until_it_lies(cube_at):
    engine = cube_at(FAR_M, height_m=2.0)
    engine.advance(0.5)
    assert not held(engine)
    engine.advance(3.0)
    assert held(engine)
    p_WO = engine.world.plant.EvalBodyPoseInWorld(engine.context, cube_of(engine)).translation()
    assert p_WO[2] == pytest.approx(LYING_M, abs=0.01)


def test_a_thing_is_freed_when_a_robot_comes_near(cube_at):
    engine = cube_at(FAR_M)
    engine.advance(1.0)
    put_robot(engine, FAR_M - CLOSE_M)
    engine.advance(0.2)
    assert not held(engine)


def test_what_is_freed_moves_when_it_is_pushed(cube_at):
    engine = cube_at(FAR_M)
    engine.advance(1.0)
    put_robot(engine, FAR_M - CLOSE_M)
    engine.advance(0.2)
    tree, body = engine.world.plant, cube_of(engine)
    tree.SetFreeBodySpatialVelocity(engine.context, body, SpatialVelocity(np.zeros(3), np.array([0.5, 0.0, 0.0])))
    before = tree.EvalBodyPoseInWorld(engine.context, body).translation()
    engine.advance(0.2)
    assert np.linalg.norm(tree.EvalBodyPoseInWorld(engine.context, body).translation() - before) > 0.01


def test_what_was_held_is_held_again_after_a_restart(cube_at):
    engine, again = cube_at(FAR_M), cube_at(FAR_M)
    engine.advance(1.0)
    again.restore(engine.state(), engine.world_state())
    assert held(again)
