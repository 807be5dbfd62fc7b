"""The guide_person skill: at the person's pace, waiting, going back, and what is claimed when they are lost."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_people import person_at
from planar_robot import Bench, ExactPlace

from errand_people.followed_person import Target, TargetOptions
from errand_people.guide_person import GuidePerson, GuidePersonInputs, GuidePersonOptions, places_of
from executive.run.control import Control
from skills.api import Cause, Failed, Running, Succeeded, nobody_to_ask
from skills.perception.people import SeenPerson
from skills.robot import Pose2D

START, GOAL = Pose2D(3.5, 5.4, math.pi), Pose2D(3.2, 2.0, -1.5)
ROOM = ((0.0, 0.0), (4.95, 0.0), (4.95, 4.0), (0.0, 4.0))
ROBIN = (2.0, 5.4)
INPUTS = GuidePersonInputs("Robin", GOAL, "the kitchen", ROBIN, ROOM)
END_OF_CORRIDOR = ((3.8, 4.1), (9.9, 4.1), (9.9, 7.0), (3.8, 7.0))
NEAR = GuidePersonInputs("Robin", Pose2D(5.5, 5.4, 0.0), "the window", ROBIN, END_OF_CORRIDOR)
"""A place 2 m behind the robot, without a door before it."""
STEP_M, APART_M = 0.05, 1.4


class Guided:
    """A bench with a person who walks along the robot's path, and what the robot says."""

    def __init__(self, at=ROBIN, unmapped=(), answer="yes", **options):
        self.bench = Bench(START, unmapped=unmapped, cameras=False, component=ExactPlace(), azimuths=360)
        self.at, self.trail, self.body = at, [], None
        self.stays = lambda now_s: False
        self.control = Control(pace=None)
        self.stand(at)
        self.bench.tick(10)
        self.questions = []
        ask = lambda question: self.questions.append(question.text) or nobody_to_ask(replace(question, default=answer))  # noqa: E731
        context = replace(self.bench.context(), listen=self.control.listen, ask=ask)
        self.skill = GuidePerson(context, GuidePersonOptions(**options))

    def stand(self, at):
        """Puts the person somewhere; None: nowhere."""
        boxes = self.bench.robot.blocks
        if self.body is not None:
            boxes.remove(self.body)
        self.at, self.body = at, None if at is None else person_at(*at)
        if self.body is not None:
            boxes.append(self.body)

    def walk(self):
        """Lets the person go on along the robot's path, behind the robot."""
        pose = self.bench.robot.pose
        here = (pose.x_m, pose.y_m)
        if not self.trail or math.dist(here, self.trail[-1]) > 0.1:
            self.trail.append(here)
        while self.trail and math.dist(self.at, self.trail[0]) < 0.15:
            self.trail.pop(0)
        if self.trail and math.dist(self.at, here) > APART_M:
            off = math.dist(self.at, self.trail[0])
            share = min(1.0, STEP_M / max(off, 1e-6))
            self.stand(tuple(a + share * (b - a) for a, b in zip(self.at, self.trail[0], strict=True)))

    def tick(self):
        self.bench.tick()
        if self.at is not None and not self.stays(self.bench.clock.now()):
            self.walk()

    def go(self, inputs=NEAR, at_s=(), limit_s=150.0):
        """Runs the skill; `at_s` maps times to changes."""
        changes = sorted(dict(at_s).items())
        self.skill.begin(inputs)
        while isinstance(step := self.skill.step(), Running) and self.bench.clock.now() < limit_s:
            while changes and changes[0][0] <= self.bench.clock.now():
                changes.pop(0)[1]()
            self.tick()
        self.skill.end()
        return step

    @property
    def said(self):
        return [message["text"] for topic, message in self.bench.published if topic == "speech"]

    def apart_m(self):
        return math.dist(self.at, (self.bench.robot.pose.x_m, self.bench.robot.pose.y_m))


@pytest.fixture(scope="module")
def in_kitchen():
    """A guide and a person who came along through the door, and the last step."""
    guided = Guided()
    return guided, guided.go(INPUTS)


def test_robot_and_person_arrive_together(in_kitchen):
    guided, step = in_kitchen
    assert isinstance(step, Succeeded), step
    assert guided.apart_m() < 3.0
    assert guided.at[1] < 4.0
    assert guided.said == ["Please follow me to the kitchen.", "Here we are: the kitchen."]
    assert guided.questions == []


def test_robot_waits_and_goes_back_for_a_person_who_stops():
    guided = Guided()
    guided.stays = lambda now_s: 3.5 < now_s < 20.0
    step = guided.go()
    assert isinstance(step, Succeeded), step
    assert guided.said.count("Please follow me to the window.") >= 2
    assert "I wait for you." in guided.said


@pytest.mark.parametrize(
    ("answer", "ends", "asked"),
    [("yes", Succeeded, 1), ("no", Failed, 1), ("", Failed, 2)],
    ids=["yes", "no", "silence"],
)
def test_somebody_who_was_out_of_sight_is_guided_only_if_they_say_that_they_are_the_person(answer, ends, asked):
    guided = Guided(answer=answer)
    step = guided.go(at_s={2.0: lambda: guided.skill._target.doubt()})
    assert isinstance(step, ends), step
    assert guided.questions == ["Are you Robin?"] * asked


# Who is lost, stays behind, is far from the place, or never gets into the area at the goal has not been guided.
@pytest.mark.parametrize(
    ("guided", "inputs", "gone_s", "stays", "message"),
    [
        ({}, INPUTS, 3.0, False, "lost Robin on the way to the kitchen"),
        ({"returns": 0}, NEAR, 999.0, True, "does not come along"),
        ({"at": (8.5, 5.4)}, NEAR, 999.0, True, ""),
        ({"returns": 0, "arrive_s": 1.0}, replace(NEAR, area_W=((9.3, 4.2), (9.9, 4.2), (9.9, 4.8))), 999.0, False, ""),
    ],
    ids=["lost", "stays behind", "far from the place", "not in the area"],
)
def test_robot_does_not_claim_to_have_guided_a_person_who_is_not_there(guided, inputs, gone_s, stays, message):
    guided = Guided(**guided)
    guided.stays = lambda now_s: stays
    step = guided.go(inputs, at_s={gone_s: lambda: guided.stand(None)})
    assert (type(step), step.cause) == (Failed, Cause.POSTCONDITION)
    assert message in step.message


def test_robot_makes_room_for_a_person_who_waits_before_the_door():
    guided = Guided()
    step = guided.go(replace(INPUTS, goal=Pose2D(2.45, 3.2, -1.57)))
    assert isinstance(step, Succeeded), step
    assert "Please come in." in guided.said
    assert guided.at[1] < 4.0


def test_a_person_who_stands_on_the_edge_of_the_place_is_asked_in(in_kitchen):
    edge_m = in_kitchen[0].at[1] + 0.1
    guided = Guided()
    guided.go(replace(INPUTS, area_W=((0.1, 0.1), (9.9, 0.1), (9.9, edge_m), (0.1, edge_m))))
    assert "Please come in." in guided.said


def test_a_remark_before_both_are_there_ends_it_and_is_no_success():
    guided = Guided()
    step = guided.go(at_s={3.0: lambda: guided.control.tell("stop")})
    assert (type(step), step.cause) == (Failed, Cause.POSTCONDITION)
    assert "'stop' was said before Robin was at the window" in step.message
    assert not guided.bench.robot.driving


def test_without_a_path_to_the_goal_the_planner_gives_the_cause():
    step = Guided(unmapped=tuple(person_at(x, 4.05) for x in (2.1, 2.45, 2.8, 7.1, 7.45, 7.8))).go(INPUTS)
    assert (type(step), step.cause) == (Failed, Cause.PLANNING)


def test_somebody_on_the_goal_is_no_failure_once_the_robot_is_in_the_room():
    guided, taken = Guided(), person_at(GOAL.x_m, GOAL.y_m)
    step = guided.go(INPUTS, at_s={9.0: lambda: guided.bench.robot.blocks.append(taken)})
    assert isinstance(step, Succeeded), step
    assert guided.at[1] < 4.0


def test_a_suspended_robot_stands_and_goes_on_afterwards():
    guided = Guided()
    guided.skill.begin(NEAR)
    while not (guided.bench.robot.driving and guided.bench.robot.pose.x_m > 4.0):
        assert isinstance(guided.skill.step(), Running)
        guided.tick()
    guided.skill.suspend()
    assert not guided.bench.robot.driving
    assert not guided.control.tell("stop")
    for _ in range(40):
        guided.tick()
    guided.skill.resume(NEAR)
    while isinstance(step := guided.skill.step(), Running) and guided.bench.clock.now() < 150.0:
        guided.tick()
    guided.skill.end()
    assert isinstance(step, Succeeded), step


def test_a_cancel_stops_the_robot_and_hears_no_remark():
    guided = Guided()
    guided.skill.begin(NEAR)
    while not guided.bench.robot.driving:
        assert isinstance(guided.skill.step(), Running)
        guided.tick()
    guided.skill.end()
    assert not guided.bench.robot.driving
    assert not guided.control.tell("stop")


@pytest.mark.parametrize(("at", "ends"), [(ROBIN, Succeeded), ((8.5, 5.4), Failed)])
def test_without_a_place_the_person_ahead_is_guided(at, ends):
    assert isinstance(Guided(at=at).go(replace(NEAR, place_W=None)), ends)


def test_a_person_out_of_sight_is_looked_for_ahead_behind_and_where_they_are_seen():
    def seen(x_m, stamp_s, number=1):
        place_W, here = (x_m, 0.0), Pose2D(0.0, 0.0, 0.0)
        return SeenPerson(place_W, 0.01 * np.eye(2), 1.0, stamp_s, here, track=number, velocity_W=(1.0, 0.0), scans=9)

    target = Target(seen(1.0, 0.0), Pose2D(0.0, 0.0, 0.0), TargetOptions())
    for n in range(1, 31):
        target.update([seen(1.0 + 0.1 * n, 0.1 * n)], (), 0.1 * n)
    places = places_of(target)
    assert [next(places)[0] for _ in range(3)] == pytest.approx([4.0, 6.0, 2.0], abs=0.11)
    target.update([seen(4.5, 5.0, 2)], (), 5.0)
    assert next(places) == (4.5, 0.0)
