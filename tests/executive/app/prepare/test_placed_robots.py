"""Where the robots of a run stand and charge."""

import math

import pytest

from executive.app.prepare.placed_robots import knowledge_for, placed_robots
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.robot_config import RobotConfig
from plant.robots.robot_kind import PlacedRobot
from plant.worlds.seeding import place_people
from skills.inputs.errors import InputError
from skills.robot import Pose2D

WORLD = open_world("flat")
KNOWN = knowledge_of(WORLD)
TWO = (RobotConfig("Alice", "spot"), RobotConfig("Bob", "fetch"))


def test_the_first_robot_stands_at_the_worlds_start_and_charges_at_its_dock():
    alice = placed_robots(WORLD, KNOWN, TWO)["Alice"]
    assert (alice.start, alice.dock) == (WORLD.start, WORLD.dock)


def test_another_robot_stands_free_and_near_and_charges_where_it_stands():
    robots = placed_robots(WORLD, KNOWN, TWO)
    alice, bob = robots["Alice"].start, robots["Bob"].start
    apart_m = math.dist((alice.x_m, alice.y_m), (bob.x_m, bob.y_m))
    assert 0.9 < apart_m < 3.0
    assert robots["Bob"].dock == bob


def test_robots_keep_the_order_in_which_they_are_named():
    assert list(placed_robots(WORLD, KNOWN, (RobotConfig("Bob", "spot"), TWO[0]))) == ["Bob", "Alice"]


def test_a_robot_with_no_start_makes_room_for_one_with_a_start():
    here = Pose2D(WORLD.start.x_m, WORLD.start.y_m, 0.0)
    robots = placed_robots(
        WORLD, KNOWN, (RobotConfig("Bob", "spot"), RobotConfig("Carl", "spot", start=Pose2D(4.0, 4.5, 0.0)))
    )
    assert (robots["Bob"].start, robots["Carl"].start.x_m) == (here, 4.0)


# What is said of the starts and docks; the words of the refusal.
REFUSED = [
    ((RobotConfig("Alice", "spot"), RobotConfig("Bob", "spot", start=Pose2D(9.5, 4.05, 0.0))), "overlap"),
    ((RobotConfig("Alice", "spot", start=Pose2D(50.0, 50.0, 0.0)),), "stands in an obstacle"),
    ((RobotConfig("Alice", "spot", dock="moon"),), "is no place"),
    ([RobotConfig(f"Robot {number}", "spot") for number in range(60)], "no free place"),
]


@pytest.mark.parametrize(("setups", "words"), REFUSED)
def test_a_start_or_dock_that_cannot_be_is_refused(setups, words):
    with pytest.raises(InputError, match=words):
        placed_robots(WORLD, KNOWN, setups)


def test_a_robot_knows_its_own_name_start_and_dock_and_the_names_of_the_others():
    known = knowledge_for(PlacedRobot("Bob", "spot", Pose2D(1.0, 2.0, 0.5)), ("Alice", "Bob"), KNOWN)
    assert (known.robot.name, known.robot.others) == ("Bob", ("Alice",))
    assert (known.start.x, known.start.y, known.start.yaw, known.dock) == (1.0, 2.0, 0.5, None)


def test_no_robot_without_a_start_stands_where_a_person_may_stand():
    """Four robots about the world's start, before which a person stands at all seeds."""
    kinds = {"Alice": "spot", "Bob": "spot", "Carol": "fetch", "Dave": "fetch"}
    robots = placed_robots(WORLD, KNOWN, [RobotConfig(name, kind) for name, kind in kinds.items()])
    people = [one.X_WO.translation()[:2] for seed in range(20) for one in place_people(WORLD, seed)]
    for name in ("Bob", "Carol", "Dave"):
        start = robots[name].start
        assert min(math.dist((start.x_m, start.y_m), person) for person in people) > 1.0
