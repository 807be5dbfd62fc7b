"""The world home: its people and objects are drawn by the seed, and the robot's hand can hold most objects."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from executive.app.prepare.worlds import knowledge_of, open_world, refuse_unusable
from plant.diagram import DiagramConfig, build_diagram
from plant.models.person_figure import Figure
from plant.worlds.seeding import place_objects, place_people

WIDEST_M = 0.115
"""Width of an object that the gripper takes."""
CLEAR_M = 0.03
SHOULDER = (0.0, 0.2, 1.42)
FINGERS = 1.1
"""Length of an arm with its fingers, as a multiple of the length to the hand."""


@pytest.fixture(scope="module")
def home():
    return open_world("home")


def test_the_world_is_found_by_its_name_and_can_be_used(home):
    refuse_unusable(home)
    knowledge = knowledge_of(home)
    assert (len(knowledge.rooms), len(knowledge.tops), len(knowledge.people)) == (5, 12, 6)


def test_most_objects_fit_into_the_gripper(home):
    sides = {name: each.object.size_m for name, each in home.imports.items()}
    assert len(sides) == 24
    assert sum(min(size_m[:2]) < WIDEST_M for size_m in sides.values()) >= 18


@pytest.mark.parametrize("seed", range(40, 60))
def test_all_objects_find_a_place_at_each_seed(home, seed):
    assert {each.class_name for each in place_objects(home, seed)} == {*home.imports}


def test_people_stand_at_places_that_the_seed_chooses(home):
    spots = [
        {each.name: tuple(np.round(each.X_WO.translation()[:2], 2)) for each in place_people(home, seed)}
        for seed in range(12)
    ]
    assert {name: len({each[name] for each in spots}) > 1 for name in spots[0]} == dict.fromkeys(spots[0], True)


def arms_of(spot, gesture):
    """Points (N, 3) of both arms and hands of a person, in the world frame."""
    figure = Figure(spot.posture, gesture)
    X_WP = RigidTransform(RotationMatrix.MakeZRotation(spot.yaw), [spot.x, spot.y, spot.z_m])
    for side in (1, -1):
        shoulder = np.array(SHOULDER) * [1, side, 1]
        for time_s in np.arange(0.0, 1.25, 0.25):
            arm = figure.hand(side, time_s) - shoulder
            yield from (X_WP @ figure.X_PT @ (shoulder + share * arm) for share in np.linspace(0.0, FINGERS, 12))


def test_no_arm_of_a_person_reaches_into_walls_or_furniture(home):
    built = build_diagram(DiagramConfig(home.directives_path, render=False))
    context = built.scene_graph.GetMyContextFromRoot(built.diagram.CreateDefaultContext())
    query = built.scene_graph.get_query_output_port().Eval(context)
    reached = [
        (rule.name, spot.x, spot.y, gesture, query.inspector().GetName(near.id_G))
        for rule in home.seed_rules.people
        for spot in rule.poses
        for gesture in (rule.gestures if spot.posture != "lying" else ())
        for p_W in arms_of(spot, gesture)
        for near in query.ComputeSignedDistanceToPoint(p_W, CLEAR_M)
    ]
    assert sorted(set(reached)) == []
