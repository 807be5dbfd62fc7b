"""The find_people skill: turns and observations."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_people import PeopleDetector, person_at
from planar_robot import LENS, TWO_ROOMS, Bench, Box

from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Running, Succeeded
from skills.find_people.skill import FindPeople, FindPeopleInputs
from skills.robot import Pose2D

ROOM = tuple((x, y) for x, y in ((0.2, 0.2), (4.8, 0.2), (4.8, 3.8), (0.2, 3.8)))


CORRIDOR = (Box(-4.0, -0.1, 4.0, 0.0), Box(-4.0, 1.2, 4.0, 1.3), Box(-4.1, -0.1, -4.0, 1.3), Box(4.0, -0.1, 4.1, 1.3))


def test_in_a_narrow_corridor_the_robot_turns_no_further_than_is_clear():
    bench = Bench(Pose2D(0.0, 0.6, 0.0), surveyed=CORRIDOR, cameras=False)
    for _ in range(10):
        bench.tick()
    skill = FindPeople(bench.context())
    skill.begin(FindPeopleInputs(((-3.9, 0.1), (3.9, 0.1), (3.9, 1.1), (-3.9, 1.1)), "corridor"))
    while isinstance(step := skill.step(), Running):
        bench.tick()
    skill.end()
    assert "nobody is seen in the corridor from here" in step.message
    assert abs(bench.robot.pose.yaw_rad) < 0.9  # 1.1 m long and 0.5 m wide, it would touch the walls at about 1.2


def test_the_observation_is_at_the_persons_position():
    # a body 0.4 m wide at (3.0, 2.0), seen by the LiDAR from (1.5, 2.0)
    bench = Bench(Pose2D(1.5, 2.0, 0.0), unmapped=(Box(2.8, 1.8, 3.2, 2.2),), surveyed=TWO_ROOMS, cameras=False)
    for _ in range(10):
        bench.tick()
    skill = FindPeople(bench.context())
    skill.begin(FindPeopleInputs(ROOM, "room"))
    while isinstance(step := skill.step(), Running):
        bench.tick()
    skill.end()
    assert isinstance(step, Succeeded)
    assert math.dist(step.outputs["observation"].position_W[:2], (3.0, 2.0)) < 0.3


def test_the_pictures_with_a_person_are_published_with_their_boxes(monkeypatch):
    # a person 2 m ahead in the room; the first look has both cameras' pictures
    person = person_at(3.5, 2.0)
    bench = Bench(Pose2D(1.5, 2.0, 0.0), unmapped=(person,), surveyed=TWO_ROOMS)
    take = bench.robot.image
    lit = lambda source: replace(take(source), grey=np.full((LENS.height, LENS.width), 120, np.uint8))  # noqa: E731
    monkeypatch.setattr(bench.robot, "image", lit)
    for _ in range(10):
        bench.tick()
    skill = FindPeople(replace(bench.context(), detector=PeopleDetector(bench, [person])))
    skill.begin(FindPeopleInputs(ROOM, "room"))
    while isinstance(skill.step(), Running):
        bench.tick()
    skill.end()
    shown = [message for topic, message in bench.published if topic == "detections"]
    assert all(message["detections"][0]["class_name"] == "person" for message in shown)
    assert shown


def test_people_near_avoided_positions_do_not_count():
    bench = Bench(Pose2D(1.5, 2.0, 0.0), unmapped=(Box(2.8, 1.8, 3.2, 2.2),), surveyed=TWO_ROOMS, cameras=False)
    for _ in range(10):
        bench.tick()
    known = ObjectObservation(0.0, ObjectKind("person"), (3.3, 2.2, 0.8), (0.5, 0.5, 1.7), 0.0, 1.0, "room")
    skill = FindPeople(bench.context())
    skill.begin(FindPeopleInputs(ROOM, "room", avoid=(known,)))
    while isinstance(step := skill.step(), Running):
        bench.tick()
    skill.end()
    assert step.message == "nobody else is seen in the room from here"


@pytest.mark.parametrize(("unpictured", "kind"), [(False, Failed), (True, Succeeded)])
def test_a_body_that_no_picture_shows_counts_only_where_that_is_asked_for(unpictured, kind, monkeypatch):
    # a body 1.5 m ahead, as wide as a person, for whom the detector sees nobody
    bench = Bench(Pose2D(1.5, 2.0, 0.0), unmapped=(person_at(3.0, 2.0),), surveyed=TWO_ROOMS)
    take = bench.robot.image
    lit = lambda source: replace(take(source), grey=np.full((LENS.height, LENS.width), 120, np.uint8))  # noqa: E731
    monkeypatch.setattr(bench.robot, "image", lit)
    for _ in range(10):
        bench.tick()
    skill = FindPeople(replace(bench.context(), detector=PeopleDetector(bench, [])))
    skill.begin(FindPeopleInputs(ROOM, "room", unpictured=unpictured))
    while isinstance(step := skill.step(), Running):
        bench.tick()
    skill.end()
    assert isinstance(step, kind), step


# the room on the left, in which a screen hides the right half of it
SCREEN = (*TWO_ROOMS, Box(2.6, 0.1, 2.7, 2.2))


def _ended(bench, inputs):
    for _ in range(10):
        bench.tick()
    skill = FindPeople(bench.context())
    skill.begin(inputs)
    while isinstance(step := skill.step(), Running):
        bench.tick()
    skill.end()
    return step


def test_a_robot_that_may_move_finds_a_person_behind_a_screen():
    hidden = Box(3.9, 0.9, 4.3, 1.3)
    bench = Bench(Pose2D(1.8, 1.6, 0.0), unmapped=(hidden,), surveyed=SCREEN, cameras=False)
    step = _ended(bench, FindPeopleInputs(ROOM, "room", moves=True))
    assert isinstance(step, Succeeded), step.message
    assert math.dist(step.outputs["observation"].position_W[:2], (4.1, 1.1)) < 0.3


def test_a_robot_that_sees_the_whole_empty_room_stays_where_it_is():
    bench = Bench(Pose2D(1.5, 2.0, 0.0), surveyed=TWO_ROOMS, cameras=False)
    step = _ended(bench, FindPeopleInputs(ROOM, "room", moves=True))
    assert (step.cause, step.message) == (Cause.POSTCONDITION, "nobody is seen in the room from here")
    assert math.dist((bench.robot.pose.x_m, bench.robot.pose.y_m), (1.5, 2.0)) < 0.1


def test_a_hidden_part_is_the_cause_where_no_pose_shows_it():
    closed = (*TWO_ROOMS, Box(2.4, 0.1, 2.5, 3.9))
    bench = Bench(Pose2D(1.5, 2.0, 0.0), surveyed=closed, cameras=False)
    step = _ended(bench, FindPeopleInputs(ROOM, "room", moves=True))
    assert (step.cause, step.message[-23:]) == (Cause.EXECUTION, "of it was never in view")
