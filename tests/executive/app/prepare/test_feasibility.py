"""What the kinds of robots are able to, as far as is known before a mission."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from executive.app.prepare import feasibility
from executive.app.prepare.feasibility import (
    RouteCache,
    abilities_in,
    abilities_of,
    check_prepared,
    reached_heights_m,
)
from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.mission.request import Request
from executive.tree.estimate import Route
from plant.robots.robot_kind import robot_kind
from plant.worlds.world import load_world
from skills.manipulation.place.skill import Place
from skills.robot import Pose2D
from skills.testing.robot import BASE_ONLY
from tests.skills.exported_networks import export


@pytest.mark.parametrize("kind", ["spot", "fetch"])
def test_the_payload_and_the_gripper_are_those_of_the_kind(kind):
    capabilities, able = robot_kind(kind).capabilities(), abilities_of(kind)
    assert (able.lift_kg, able.opens_m) == (capabilities.arm.max_payload_kg, capabilities.gripper.max_grasp_m)


class Reaches(Place):
    """A skill with limits of its own."""

    @classmethod
    def reached_heights_m(cls, capabilities):
        return (0.1, 0.9)


def tree_of(*skills):
    """A tree with these skills."""
    nodes = [SimpleNamespace(skill=each) for each in (*skills, None)]
    return SimpleNamespace(root=SimpleNamespace(walk=lambda: nodes))


def test_a_mission_reaches_what_all_of_its_skills_reach():
    assert reached_heights_m(tree_of(Place, Reaches), BASE_ONLY) == (0.1, 0.9)
    assert reached_heights_m(tree_of(), BASE_ONLY) == (-math.inf, math.inf)


# how far (m) the start lies aside: the planner's grid begins there
@pytest.mark.parametrize("aside_m", [0.0, 0.02, 0.04, 0.06, 0.08])
def test_a_fetch_gets_through_the_narrowest_door_of_a_world_wherever_it_begins(aside_m):
    world = load_world("lab")
    planner = feasibility.route_planner_of(world, only_robot("Alice", world, kind="fetch"), cached=False)
    route = planner.route(Pose2D(14.38 + aside_m, 10.52, -2.671), Pose2D(15.0, 9.1, 0.0))
    assert 3.0 < route.length_m < 5.0


def test_people_who_take_objects_and_full_surfaces_are_those_of_the_world():
    world = load_world("flat")
    able = abilities_in(world)
    assert able.takers == {person.name for person in world.seed_rules.people}
    assert able.apart_m == world.seed_rules.rules.clear_m
    assert all(name in world.surfaces and taken_m2 > 0.0 for name, taken_m2 in able.taken_m2.items())
    nobody = replace(world, seed_rules=world.seed_rules.model_copy(update={"people": ()}))
    assert abilities_in(nobody).takers == frozenset()


TWO = {"names": "{0: 'bottle', 1: 'can'}"}


# the classes of the network, the sentence, and what the robot looks for or why it cannot
@pytest.mark.parametrize(
    ("classes", "said", "expected"),
    [
        ("{bottle: drink}", "fetch me a drink", {("drink",)}),
        ("{bottle: drink, can: coke}", "fetch me a drink", {("coke", "drink")}),
        ("{bottle: drink}", "fetch me a coke", "the robot does not know what coke looks like"),
        ("{can: coke}", "fetch me a drink", "the robot does not know what beer looks like"),
    ],
)
def test_a_category_that_an_own_detector_reports_stands_for_its_classes(tmp_path, classes, said, expected):
    export(tmp_path / "own.onnx", {"output0": np.zeros((1, 6, 84), np.float32)}, metadata=TWO)
    stack = tmp_path / "stack.yaml"
    stack.write_text(f"detector: {{use: onnx, file: own.onnx, classes: {classes}}}\n")
    prepared = prepare(Request(sentence=said, world="flat", stack=stack))
    errors = check_prepared(prepared).errors
    detects = [node for node in prepared.tree.root.walk() if node.skill is not None and node.skill.name == "detect"]
    looks = {node.options["inputs"]["classes"].value for node in detects}
    assert expected in str(errors[0]) if errors else looks == expected


HERE, THERE, NOWHERE = Pose2D(0.0, 0.0, 0.0), Pose2D(3.0, 4.0, 0.5), Pose2D(99.0, 0.0, 0.0)


class Planner:
    """Counts how often it is asked."""

    def __init__(self):
        self.asked = 0

    def route(self, start, goal, zones=()):
        self.asked += 1
        if goal == NOWHERE:
            raise ValueError("There is no way.")
        return Route(5.0, 5.25)


@pytest.mark.parametrize("broken", ["", "[", '{"a": 1'])
def test_each_route_is_planned_once_in_all_processes(tmp_path, broken):
    file, planner = tmp_path / "routes" / "a.json", Planner()
    file.parent.mkdir()
    file.write_text(broken)
    for process in range(2):
        routes = RouteCache(file, planner)
        assert routes.route(HERE, THERE) == Route(5.0, 5.25)
        with pytest.raises(ValueError, match=r"There is no way\."):
            routes.route(HERE, NOWHERE)
        assert planner.asked == 2, process
    RouteCache(file, planner).route(THERE, HERE)
    assert planner.asked == 3


def test_routes_are_planned_without_a_writable_cache(tmp_path):
    (tmp_path / "routes").write_text("a file where the folder would be")
    assert RouteCache(tmp_path / "routes" / "a.json", Planner()).route(HERE, THERE) == Route(5.0, 5.25)


def test_routes_are_planned_again_when_a_file_that_they_depend_on_has_changed(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot, planner = tmp_path / "robot.yaml", Planner()
    for text, asked in (("a", 1), ("a", 1), ("b", 2)):
        robot.write_text(text)
        feasibility.route_cache_of(open_world("flat"), planner, robot).route(HERE, THERE)
        assert planner.asked == asked
