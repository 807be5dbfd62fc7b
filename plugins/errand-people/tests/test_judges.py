"""The pages of tasks judge whom the robot followed, guided and greeted by the recorded paths."""

from dataclasses import replace

import numpy as np
import pytest

from executive.words.goal import GoalCondition, GoalKind, Region
from tests.plant.referee.paths import finding, path, walked

OFFICE = Region("office", ((8.0, -2.0), (12.0, -2.0), (12.0, 2.0), (8.0, 2.0)))
HALL = Region("hall", ((-2.0, -2.0), (4.0, -2.0), (4.0, 2.0), (-2.0, 2.0)))


STEP = {"began_s": 0.0, "ended_s": 30.0}
FOLLOWED = GoalCondition(GoalKind.OWN, task="follow", goal=(OFFICE,), person="Robin", robot="alice", **STEP)


ANYONE = replace(FOLLOWED, person=None, robot=None)
AWAY = {"Robin": walked(0.0, 10.0, y=50.0), "Kim": walked(0.0, 10.0)}


@pytest.mark.parametrize(
    ("condition", "robot", "people", "success", "why"),
    [
        (FOLLOWED, walked(-1.5, 8.5), {"Robin": walked(0.0, 10.0)}, True, "in the office"),
        (FOLLOWED, walked(2.0, 6.5), {"Robin": walked(2.0, 10.0)}, False, ""),
        (FOLLOWED, walked(-1.5, 3.0), {"Robin": walked(0.0, 4.5)}, False, "not in the office"),
        (FOLLOWED, walked(-1.5, 8.5), AWAY, False, ""),
        (ANYONE, walked(-1.5, 8.5), {"Robin": walked(0.0, 10.0), "Kim": path((50.0, 0.0, 0.0))}, True, ""),
        (ANYONE, walked(-1.5, 8.5), {"Robin": walked(2.0, 10.0), "Kim": path((-2.0, 0.0, 0.0))}, False, "from Kim"),
    ],
    ids=["behind", "far away", "outside the room", "behind somebody else", "anyone", "not the one before the robot"],
)
def test_a_robot_behind_the_person_who_stands_in_the_room_has_followed(condition, robot, people, success, why):
    found = finding(condition, robot, **people)
    assert (found.success, why in found.why) == (success, True), found.why


@pytest.mark.parametrize(("late_s", "kept"), [(8.0, True), (18.0, False)])
def test_a_person_who_was_away_for_long_was_lost(late_s, kept):
    robot = path(*((x, 0.0, x + (late_s if x > 2.0 else 0.0)) for x in np.arange(0.0, 9.5, 0.1)))
    found = finding(FOLLOWED, robot, Robin=walked(0.0, 10.0))
    assert found.success is kept and "over 5 m away" in found.why


GUIDED = GoalCondition(GoalKind.OWN, task="guide", goal=(OFFICE,), person="Robin", **STEP)


@pytest.mark.parametrize(("robot_m", "person_m", "success"), [(10.5, 9.0, True), (10.5, 3.0, False), (4.0, 9.0, False)])
def test_a_person_who_stands_in_the_goal_beside_the_robot_was_guided(robot_m, person_m, success):
    from_m = -1.5 if success else 0.0
    assert finding(GUIDED, walked(0.0, robot_m), Robin=walked(from_m, person_m)).success is success


def greeted(*spoken_s):
    return GoalCondition(GoalKind.OWN, task="greet", goal=(HALL,), **STEP, spoken_s=spoken_s)


ROUND = path((0.0, 0.0, 0.0), (3.0, 0.0, 10.0))
KIM, ROBIN = path((0.0, 1.5, 0.0)), path((3.0, 1.5, 0.0))


@pytest.mark.parametrize(
    ("spoken_s", "right", "why"),
    [
        ((5.0, 12.0), True, "Kim and Robin stood in the hall and were greeted."),
        ((5.0,), False, "Kim and Robin stood in the hall and 1 of 2 were greeted."),
        ((5.0, 6.0), False, "Kim and Robin stood in the hall and 1 of 2 were greeted; the robot spoke 2 times."),
        ((5.0, 12.0, 13.0), False, "Kim and Robin stood in the hall and were greeted; the robot spoke 3 times."),
        ((), False, "Kim and Robin stood in the hall and were not greeted."),
    ],
)
def test_each_person_in_the_room_is_greeted_once(spoken_s, right, why):
    found = finding(greeted(*spoken_s), ROUND, Kim=KIM, Robin=ROBIN)
    assert (found.success, found.why) == (right, why)


def test_one_person_is_greeted_in_the_singular():
    assert (
        finding(greeted(5.0), ROUND, Robin=path((3.0, 1.5, 0.0))).why
        == "Robin stood in the hall and was not greeted; the robot spoke 1 time."
    )


def test_a_person_who_left_the_room_need_not_be_greeted():
    leaves = path((0.0, 1.5, 0.0), (0.0, 5.0, 4.0))
    assert finding(greeted(12.0), ROUND, Kim=leaves, Robin=ROBIN).success
    assert finding(greeted(3.0, 12.0), ROUND, Kim=leaves, Robin=ROBIN).success


def test_people_who_walk_in_and_are_greeted_stood_there():
    comes, late = path((0.0, 5.0, 0.0), (0.0, 1.5, 4.0)), path((3.0, 5.0, 5.0), (3.0, 1.5, 11.0))
    found = finding(greeted(5.0, 12.0), ROUND, Kim=comes, Robin=late)
    assert (found.success, found.why) == (True, "Kim and Robin stood in the hall and were greeted.")


def test_a_person_who_stayed_is_to_be_greeted_rather_than_one_who_walked_past():
    past = path((0.0, 5.0, 0.0), (0.5, 1.5, 5.0), (0.5, 5.0, 10.0))
    assert finding(greeted(5.0), ROUND, Past=past, Kim=KIM).why == "Kim stood in the hall and was greeted."
    assert finding(greeted(), ROUND, Past=past).why == "Nobody stayed in the hall."
    outside = finding(greeted(5.0), ROUND, Past=past, Kim=path((-1.9, -1.9, 0.0)))
    assert not outside.success


def test_an_empty_room_holds_nobody_to_greet():
    found = finding(greeted(), ROUND, Kim=path((30.0, 0.0, 0.0)))
    assert found.success and "Nobody stood" in found.why
