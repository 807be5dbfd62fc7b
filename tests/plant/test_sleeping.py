"""Objects at rest sleep, and wake for whatever may move them."""

import itertools

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity

from plant.diagram import LooseModel, build_diagram
from plant.engine import Engine
from skills.robot import Pose2D

SHELF = """<sdf version="1.9"><model name="shelf"><static>false</static><link name="shelf">
<collision name="top"><pose>0 0 -0.5 0 0 0</pose><geometry><box><size>8 8 1</size></box></geometry></collision>
</link></model></sdf>"""
CORNERS = "".join(
    f'<collision name="corner{i}"><pose>{x} {y} {z} 0 0 0</pose>'
    "<geometry><sphere><radius>0.01</radius></sphere></geometry></collision>"
    for i, (x, y, z) in enumerate(itertools.product((-0.04, 0.04), repeat=3))
)
BLOCK = f"""<sdf version="1.9"><model name="block"><link name="block">
<inertial><mass>0.5</mass><inertia><ixx>0.001</ixx><iyy>0.001</iyy><izz>0.001</izz></inertia></inertial>
<collision name="box"><geometry><box><size>0.09 0.09 0.09</size></box></geometry></collision>{CORNERS}
</link></model></sdf>"""
FLOOR = """directives:
- add_model: {name: floor, file: "%s"}
- add_weld: {parent: world, child: "floor::shelf"}
"""


@pytest.fixture
def stage(tmp_path):
    """A function from blocks' places to an engine in which they have come to rest on the floor."""
    (tmp_path / "floor.sdf").write_text(SHELF)
    (tmp_path / "block.sdf").write_text(BLOCK)
    (tmp_path / "world.dmd.yaml").write_text(FLOOR % (tmp_path / "floor.sdf").as_uri())

    def make(seconds=1.5, robots=None, **places_W):
        models = [LooseModel(name, tmp_path / "block.sdf", RigidTransform(p_W)) for name, p_W in places_W.items()]
        built = build_diagram(
            directives=tmp_path / "world.dmd.yaml",
            models=models,
            robots=dict.fromkeys(robots or {}, "spot"),
            visuals=False,
            render=False,
        )
        engine = Engine(built, robots or {})
        engine.advance(seconds)
        return engine

    return make


def body(engine, name):
    plant = engine.world.plant
    return plant.get_body(plant.GetBodyIndices(engine.world.models[name])[0])


def place(engine, name):
    return engine.world.plant.EvalBodyPoseInWorld(engine.context, body(engine, name)).translation()


def put(engine, name, p_W, v_W=(0.0, 0.0, 0.0)):
    plant = engine.world.plant
    plant.SetFloatingBaseBodyPoseInWorldFrame(engine.context, body(engine, name), RigidTransform(p_W))
    plant.SetFreeBodySpatialVelocity(
        context=engine.context, body=body(engine, name), V_JpJc=SpatialVelocity([0, 0, 0], v_W)
    )


def test_objects_at_rest_sleep_and_stay_where_they_are(stage):
    engine = stage(one=(0, 0, 0.051), two=(1, 0, 0.051))
    assert engine.asleep == {"one", "two"}
    before = place(engine, "one").copy()
    engine.advance(1.0)
    np.testing.assert_allclose(place(engine, "one"), before, rtol=0, atol=1e-9)
    assert before[2] == pytest.approx(0.05, abs=1e-3)


def test_what_falls_is_awake_until_it_lies(stage):
    engine = stage(0.3, one=(0, 0, 1.0))
    assert engine.asleep == frozenset()
    engine.advance(2.0)
    assert engine.asleep == {"one"}
    assert place(engine, "one")[2] == pytest.approx(0.05, abs=2e-3)


def test_what_lies_on_an_object_that_is_taken_away_falls(stage):
    engine = stage(under=(0, 0, 0.051), top=(0, 0, 0.152))
    assert engine.asleep == {"under", "top"}
    put(engine, "under", (3.0, 0.0, 0.05))
    engine.advance(0.1)
    assert "top" not in engine.asleep
    engine.advance(1.5)
    assert place(engine, "top")[2] == pytest.approx(0.05, abs=2e-3)
    assert engine.asleep == {"under", "top"}


def test_a_sleeping_object_that_is_hit_by_another_wakes_and_moves(stage):
    engine = stage(one=(0, 0, 0.051), two=(1, 0, 0.051))
    put(engine, "one", (0.01, 0.0, 0.05))
    engine.advance(0.05)
    assert engine.asleep == {"two"}
    put(engine, "one", (0.6, 0.0, 0.05), v_W=(3.0, 0.0, 0.0))
    rest, moved_m = place(engine, "two"), []
    for _ in range(40):
        engine.advance(0.01)
        moved_m.append(np.linalg.norm(place(engine, "two") - rest))
    assert max(moved_m) > 1e-3
    assert engine.asleep == frozenset()


def test_a_robot_that_walks_into_a_sleeping_object_pushes_it(stage):
    engine = stage(robots={"Alice": Pose2D(0.0, 0.0, 0.0)}, box=(1.6, 0.17, 0.051))
    assert engine.asleep == {"box"}
    robot = engine.robots["Alice"]
    robot.drive(0.5, 0.0, 0.0, until_s=engine.now() + 4.0, lease=robot.acquire_lease("test"))
    engine.advance(4.0)
    assert place(engine, "box")[0] > 1.7
    assert "box" not in engine.asleep


def test_the_same_run_twice_sleeps_and_moves_alike(stage):
    ends = []
    for _ in range(2):
        engine = stage(one=(0, 0, 0.4), two=(0.05, 0.02, 0.9), three=(1, 0, 0.051))
        ends.append((engine.asleep, place(engine, "one"), place(engine, "two")))
    assert ends[0][0] == ends[1][0] == {"one", "three"}
    np.testing.assert_array_equal(ends[0][1:], ends[1][1:])
