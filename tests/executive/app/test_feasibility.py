"""What the kinds of robots are able to, as far as is known before a mission."""

from dataclasses import replace

import pytest

from executive.app.feasibility import abilities_in, abilities_of, reached_heights_m, route_planner_of
from executive.app.robots import only_robot
from plant.kinds import robot_kind
from plant.worlds.world import load_world
from skills.robot import Pose2D
from skills.testing.robot import BASE_ONLY


@pytest.mark.parametrize("kind", ["spot", "fetch"])
def test_both_kinds_reach_the_floor_and_a_counter_but_not_the_ceiling(kind):
    low_m, high_m = reached_heights_m(robot_kind(kind).capabilities())
    assert low_m < 0.02
    assert 0.9 < high_m < 2.2


def test_a_torso_on_a_lift_reaches_higher_than_legs():
    assert abilities_of("fetch").reaches_m[1] > abilities_of("spot").reaches_m[1] + 0.2


def test_without_an_arm_no_height_is_said():
    assert reached_heights_m(BASE_ONLY) == (float("-inf"), float("inf"))


def test_the_payload_and_the_gripper_are_those_of_the_kind():
    for kind in ("spot", "fetch"):
        capabilities = robot_kind(kind).capabilities()
        able = abilities_of(kind)
        assert (able.lift_kg, able.opens_m) == (capabilities.arm.max_payload_kg, capabilities.gripper.max_grasp_m)


# how far (m) the start lies aside: the planner's grid begins there
@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.04, 0.06, 0.08])
def test_a_fetch_gets_through_the_narrowest_door_of_a_world_wherever_it_begins(aside_m):
    world = load_world("lab")
    planner = route_planner_of(world, only_robot("Alice", world, kind="fetch"), kept=False)
    route = planner.route(Pose2D(14.38 + aside_m, 10.52, -2.671), Pose2D(15.0, 9.1, 0.0))
    assert 3.0 < route.length_m < 5.0


def test_who_takes_things_and_what_covers_the_surfaces_are_those_of_the_world():
    world = load_world("flat")
    able = abilities_in(world)
    assert able.takers == {person.name for person in world.seed_rules.people}
    assert able.apart_m == world.seed_rules.rules.clear_m
    assert all(name in world.surfaces and taken_m2 > 0.0 for name, taken_m2 in able.taken_m2.items())
    nobody = replace(world, seed_rules=world.seed_rules.model_copy(update={"people": ()}))
    assert abilities_in(nobody).takers == frozenset()
