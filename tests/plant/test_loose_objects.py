"""Loose objects sleep at rest and wake before a contact; carried objects follow the hand."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import Simulator

from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.loose_objects import FASTEST_M_S, FASTEST_SPIN_RAD_S, CarriedObjects, Sleepers, arc_m
from plant.models.catalogue import load_catalogue
from plant.robots.robot_kind import PlacedRobot
from skills.robot import Pose2D
from tests.plant.boxes import box_world, fixed_box

CORNERS = "".join(
    f'<collision name="corner{i}"><pose>{x} {y} {z} 0 0 0</pose>'
    "<geometry><sphere><radius>0.01</radius></sphere></geometry></collision>"
    for i, (x, y, z) in enumerate(itertools.product((-0.04, 0.04), repeat=3))
)
BLOCK = f"""<sdf version="1.9"><model name="block"><link name="block">
<inertial><mass>0.5</mass><inertia><ixx>0.001</ixx><iyy>0.001</iyy><izz>0.001</izz></inertia></inertial>
<collision name="box"><geometry><box><size>0.09 0.09 0.09</size></box></geometry></collision>{CORNERS}
</link></model></sdf>"""
ALICE = {"Alice": Pose2D(0.0, 0.0, 0.0)}


@pytest.fixture
def stage(tmp_path):
    """A function from blocks' places to an engine in which they have come to rest on the floor."""
    (tmp_path / "block.sdf").write_text(BLOCK)
    floor = box_world(tmp_path, floor=("8 8 1", "0 0 -0.5"))

    def make(seconds=1.5, robots=None, **places_W):
        models = [LooseModel(name, tmp_path / "block.sdf", RigidTransform(p_W)) for name, p_W in places_W.items()]
        placed = [PlacedRobot(name, "spot", start) for name, start in (robots or {}).items()]
        config = DiagramConfig(directives=floor, models=models, robots=placed, visuals=False, render=False)
        engine = Engine(build_diagram(config))
        engine.advance(seconds)
        return engine

    return make


def body(engine, name):
    plant = engine.world.plant
    return plant.get_body(plant.GetBodyIndices(engine.world.models[name])[0])


def place(engine, name):
    return engine.world.plant.EvalBodyPoseInWorld(engine.context, body(engine, name)).translation()


def put(engine, name, p_W, v_W=(0.0, 0.0, 0.0)):
    plant, moved = engine.world.plant, body(engine, name)
    plant.SetFloatingBaseBodyPoseInWorldFrame(engine.context, moved, RigidTransform(p_W))
    velocity = SpatialVelocity([0, 0, 0], v_W)
    plant.SetFreeBodySpatialVelocity(context=engine.context, body=moved, V_JpJc=velocity)


def test_objects_at_rest_sleep_and_stay_where_they_are(stage):
    engine = stage(one=(0, 0, 0.051), two=(1, 0, 0.051))
    assert engine.asleep == {"one", "two"}
    before = place(engine, "one").copy()
    engine.advance(1.0)
    np.testing.assert_allclose(place(engine, "one"), before, rtol=0, atol=1e-9)
    assert before[2] == pytest.approx(0.05, abs=1e-3)


def test_a_falling_object_is_awake_until_it_rests(stage):
    engine = stage(0.3, one=(0, 0, 1.0))
    assert engine.asleep == frozenset()
    engine.advance(2.0)
    assert (engine.asleep, place(engine, "one")[2]) == ({"one"}, pytest.approx(0.05, abs=2e-3))


def test_an_object_falls_when_its_support_is_taken_away(stage):
    engine = stage(under=(0, 0, 0.051), top=(0, 0, 0.152))
    assert engine.asleep == {"under", "top"}
    put(engine, "under", (3.0, 0.0, 0.05))
    engine.advance(0.1)
    assert "top" not in engine.asleep
    engine.advance(1.5)
    assert (engine.asleep, place(engine, "top")[2]) == ({"under", "top"}, pytest.approx(0.05, abs=2e-3))


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
    assert max(moved_m) > 1e-3 and engine.asleep == frozenset()


def test_a_robot_that_walks_into_a_sleeping_object_pushes_it(stage):
    engine = stage(robots=ALICE, box=(1.6, 0.17, 0.051))
    assert engine.asleep == {"box"}
    robot = engine.robots["Alice"]
    robot.drive(0.5, 0.0, 0.0, until_s=engine.now() + 4.0, lease=robot.acquire_lease("test"))
    engine.advance(4.0)
    assert place(engine, "box")[0] > 1.7 and "box" not in engine.asleep


def test_the_same_run_twice_sleeps_and_moves_alike(stage):
    ends = []
    for _ in range(2):
        engine = stage(one=(0, 0, 0.4), two=(0.05, 0.02, 0.9), three=(1, 0, 0.051))
        ends.append((engine.asleep, place(engine, "one"), place(engine, "two")))
    assert ends[0][0] == ends[1][0] == {"one", "three"}
    np.testing.assert_array_equal(ends[0][1:], ends[1][1:])


def query(engine):
    return engine.world.plant.get_geometry_query_input_port().Eval(engine.context)


def hand_shapes(engine):
    """Collision shapes of Alice's hand, all of them, and those that the search for contacts knows now."""
    plant, robot = engine.world.plant, engine.world.robots["Alice"]
    links = [plant.GetBodyByName(link, robot.instance) for link in robot.kind.gripper_links]
    shapes = [each for link in links for each in plant.GetCollisionGeometriesForBody(link)]
    inspector = query(engine).inspector()
    return shapes, [each for each in shapes if inspector.GetProperties(each, Role.kProximity) is not None]


def test_a_hand_far_from_everything_costs_no_search_for_contacts(stage):
    shapes, searched = hand_shapes(stage(0.1, robots=ALICE))
    assert (len(shapes) > 50, searched) == (True, [])


def test_a_hand_may_have_links_without_collision_shapes(stage, monkeypatch):
    engine = stage(0.1, robots=ALICE)
    world = engine.world
    robot = world.robots["Alice"]
    bare = next(
        body.name()
        for body in map(world.plant.get_body, world.plant.GetBodyIndices(robot.instance))
        if not world.plant.GetCollisionGeometriesForBody(body)
    )
    links = (*robot.kind.gripper_links, bare)
    monkeypatch.setattr(robot, "kind", replace(robot.kind, gripper_links=links))
    Sleepers(world, engine.root_context).update(0.0)
    assert hand_shapes(engine)[1] == []


def test_a_sleeping_hand_touches_an_object_that_comes_and_never_its_own_arm(stage):
    engine = stage(0.1, robots=ALICE, box=(3.0, 0.0, 0.051))
    hand = engine.world.robots["Alice"].hand
    put(engine, "box", engine.world.plant.EvalBodyPoseInWorld(engine.context, hand).translation() + [0.1, 0.0, 0.3])
    engine.advance(0.3)
    shapes, searched = hand_shapes(engine)
    box = engine.world.plant.GetCollisionGeometriesForBody(body(engine, "box"))
    touching = [{each.id_A, each.id_B} for each in query(engine).ComputePointPairPenetration()]
    assert searched == shapes and any(pair & set(box) and pair & set(shapes) for pair in touching)
    assert all(pair & set(box) for pair in touching)


DT_S, TURN_RAD_S, REACH_M = 0.0125, 0.75, 0.9


@pytest.fixture
def scene():
    """A hand that slides along y and turns about z, and a free object."""
    plant, inertia = MultibodyPlant(DT_S), SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    slide, hand, thing = (plant.AddRigidBody(name, inertia) for name in ("slide", "hand", "thing"))
    plant.AddJoint(PrismaticJoint("along", plant.world_frame(), slide.body_frame(), [0.0, 1.0, 0.0]))
    plant.AddJoint(RevoluteJoint("turn", slide.body_frame(), hand.body_frame(), [0.0, 0.0, 1.0]))
    plant.Finalize()
    return plant, plant.CreateDefaultContext(), hand, thing


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
def test_a_carried_object_is_moved_towards_the_axis_of_the_turn(scene, p_W, v_W, along_m_s, moved_mm):
    plant, context, hand, thing = scene
    plant.GetJointByName("along").set_translation_rate(context, along_m_s)
    plant.GetJointByName("turn").set_angular_rate(context, TURN_RAD_S)
    _set(plant, context, thing, p_W, [0.0, 0.0, TURN_RAD_S], v_W)
    CarriedObjects(plant, context, [thing]).after_steps(hand, DT_S)
    moved = plant.EvalBodyPoseInWorld(context, thing).translation() - p_W
    assert np.allclose(1e3 * moved, [-moved_mm, 0.0, 0.0], atol=1e-9)


def test_a_fast_turn_leaves_no_carried_object_behind(scene):
    """Contact made its velocity equal to the hand's before the hand turned on, by 0.08 m/s of direction here."""
    plant, context, hand, thing = scene
    plant.GetJointByName("turn").set_angular_rate(context, 4.0)
    _set(plant, context, thing, [0.4, 0.0, 0.2], [0.0, 0.0, 4.0], 1.6 * np.array([np.sin(4.0 * DT_S), 1.0, 0.0]))
    CarriedObjects(plant, context, [thing]).after_steps(hand, DT_S)
    moved = plant.EvalBodyPoseInWorld(context, thing).translation() - [0.4, 0.0, 0.2]
    assert np.allclose(moved, [-0.5 * DT_S**2 * 16.0 * 0.4, 0.0, 0.0], atol=1e-9)


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
    carried = CarriedObjects(plant, context, [bar])
    for step in range(160):
        simulator.AdvanceTo((step + 1) * DT_S)
        if limited:
            carried.limit_motion()
    return float(np.linalg.norm(plant.EvalBodySpatialVelocityInWorld(context, bar).rotational()))


def test_a_bar_that_spins_as_it_flies_spins_no_faster_with_time():
    assert _spinning_bar(limited=True) < 2.0 * FASTEST_SPIN_RAD_S
    assert not _spinning_bar(limited=False) < 1000.0


def test_a_bar_that_a_wrong_contact_throws_is_slowed_down():
    plant = MultibodyPlant(DT_S)
    bar = plant.AddRigidBody("bar", SpatialInertia.SolidBoxWithMass(0.15, 0.26, 0.03, 0.01))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    _set(plant, context, bar, np.zeros(3), np.zeros(3), [30.0, 0.0, 40.0])
    CarriedObjects(plant, context, [bar]).limit_motion()
    v_W = plant.EvalBodySpatialVelocityInWorld(context, bar).translational()
    assert v_W == pytest.approx([0.6 * FASTEST_M_S, 0.0, 0.8 * FASTEST_M_S])


@pytest.mark.parametrize("steps_before", [1, 2, 3, 4])
def test_a_can_that_spins_out_of_the_fingers_stays_near_the_table(tmp_path, steps_before):
    """It spins at 600 rad/s, 1 mm over a table: it falls over there, wherever in the engine's periods that happens."""
    can = next(iter(load_catalogue()["coke"].forms.values()))
    models = [fixed_box(tmp_path, "table", "4 4 0.2", "0 0 -0.1")]
    models.append(LooseModel("can", can.path(), RigidTransform([0.0, 0.0, 0.5])))
    engine = Engine(build_diagram(DiagramConfig(models=models, render=False)))
    plant, context = engine.world.plant, engine.context
    body = plant.GetBodyByName("coke", engine.world.models["can"])
    engine.advance(steps_before * DT_S)
    _set(plant, context, body, [0.0, 0.0, can.rest_height_m + 0.001], [600.0, 0.0, 0.0], np.zeros(3))
    speeds_m_s = []
    for _ in range(40):
        engine.advance(DT_S)
        speeds_m_s.append(np.linalg.norm(plant.EvalBodySpatialVelocityInWorld(context, body).translational()))
    assert max(speeds_m_s) < 2.0
