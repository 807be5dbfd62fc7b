"""The meet_person skill: where it stands, people who walk on, and people who are gone."""

import itertools
import math
from dataclasses import replace

import pytest
from planar_people import PeopleDetector, blind, person_at
from planar_robot import TWO_ROOMS, Bench, Box

from errand_people.meet_person import MeetPerson, MeetPersonInputs
from skills.api import Cause, Failed, Running, Succeeded
from skills.robot import Pose2D

START = Pose2D(1.2, 5.4, 0.0)


def bench_with(*people, start=START, surveyed=TWO_ROOMS):
    return Bench(start, unmapped=people, surveyed=surveyed, cameras=False)


def met(bench, inputs, at_tick=()):
    """Runs the skill; `at_tick` maps ticks to changes of the bench."""
    bench.tick(10)
    changes, ticks = dict(at_tick), itertools.count(1)
    return bench.run(MeetPerson(bench.context()), inputs, each=lambda: changes.pop(next(ticks), lambda: None)())


def apart_m(bench, x, y):
    return math.dist((bench.robot.pose.x_m, bench.robot.pose.y_m), (x, y))


def test_robot_goes_beside_a_person_and_faces_them():
    bench = Bench(START, unmapped=(person_at(6.0, 5.2),), surveyed=TWO_ROOMS, cameras=False)
    step = met(bench, MeetPersonInputs("Robin", (6.0, 5.2), "corridor"))
    assert isinstance(step, Succeeded), step
    assert 0.9 < apart_m(bench, 6.0, 5.2) < 1.9
    assert math.dist(step.outputs["person"].position_W[:2], (6.0, 5.2)) < 0.3
    assert step.outputs["person"].surface == "corridor"


def test_without_a_place_the_robot_stays_before_the_person_ahead():
    bench = bench_with(person_at(2.6, 5.4))
    assert isinstance(met(bench, MeetPersonInputs("somebody")), Succeeded)
    assert apart_m(bench, START.x_m, START.y_m) < 0.1


def test_robot_goes_after_a_person_who_walks_on():
    bench = bench_with(person_at(5.0, 5.4))

    def walk_on():
        bench.robot.blocks[bench.robot.blocks.index(person_at(5.0, 5.4))] = person_at(5.8, 5.0)

    step = met(bench, MeetPersonInputs("Robin", (5.0, 5.4)), {60: walk_on})
    assert isinstance(step, Succeeded), step
    assert apart_m(bench, 5.8, 5.0) < 1.9


def test_robot_does_not_claim_to_have_met_a_person_who_is_gone():
    first = person_at(5.0, 5.4)
    bench = bench_with(first)
    step = met(bench, MeetPersonInputs("Robin", (5.0, 5.4)), {40: lambda: bench.robot.blocks.remove(first)})
    assert step == Failed(Cause.POSTCONDITION, "Robin is not seen at (5.00, 5.40)")


def test_the_robot_does_not_say_that_the_person_is_gone_without_depth(monkeypatch):
    # something low stands where a camera looks for the person
    bench = Bench(START, unmapped=(Box(2.4, 5.2, 2.7, 5.5, 0.0, 0.8),), surveyed=TWO_ROOMS)
    blind(bench, monkeypatch)
    bench.tick(10)
    skill = MeetPerson(replace(bench.context(), detector=PeopleDetector(bench, [])))
    step = bench.run(skill, MeetPersonInputs("Robin", (2.6, 5.4)))
    assert step == Failed(Cause.EXECUTION, "cannot see Robin: the frontleft camera gives pictures without depth")


@pytest.mark.parametrize("people", [(), (person_at(8.0, 5.4),)])
def test_without_anybody_near_there_is_nobody_to_meet(people):
    step = met(bench_with(*people), MeetPersonInputs("somebody"))
    assert (type(step), step.cause) == (Failed, Cause.POSTCONDITION)


@pytest.mark.parametrize(("within_m", "ends"), [(None, Failed), (2.35, Succeeded)])
def test_robot_stops_further_away_only_where_that_is_near_enough_and_nothing_nearer_is_free(within_m, ends):
    # the person stands in a niche 0.5 m wide, into which the robot does not fit
    niche = (Box(7.6, 5.05, 10.0, 5.15), Box(7.6, 5.65, 10.0, 5.75))
    bench = Bench(START, unmapped=(person_at(9.0, 5.4),), surveyed=(*TWO_ROOMS, *niche), cameras=False)
    step = met(bench, MeetPersonInputs("somebody", (9.0, 5.4), within_m=within_m))
    assert isinstance(step, ends), step
    assert within_m is None or 1.9 < apart_m(bench, 9.0, 5.4) < 2.35


def test_robot_does_not_stand_on_the_other_side_of_a_wall():
    # a person 0.6 m above the wall between room and corridor; the robot is in the room below
    bench = Bench(Pose2D(6.0, 2.5, 1.57), unmapped=(person_at(5.5, 4.9),), surveyed=TWO_ROOMS, cameras=False)
    step = met(bench, MeetPersonInputs("Robin", (5.5, 4.9)))
    assert isinstance(step, Succeeded), step
    assert bench.robot.pose.y_m > 4.1


def test_a_cancel_stops_the_robot():
    bench = Bench(START, unmapped=(person_at(6.0, 5.2),), surveyed=TWO_ROOMS, cameras=False)
    bench.tick(10)
    skill = MeetPerson(bench.context())
    skill.begin(MeetPersonInputs("Robin", (6.0, 5.2)))
    while not bench.robot.driving:
        assert isinstance(skill.step(), Running)
        bench.tick()
    skill.end()
    assert not bench.robot.driving
