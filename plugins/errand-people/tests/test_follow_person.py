"""Drives behind a person who walks along a corridor, seen by the LiDAR alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_people import LateAnswer, PeopleDetector, blind, person_at
from planar_robot import Bench, Box, ExactPlace

from errand_people.follow_person import FollowPerson, FollowPersonInputs
from errand_people.followed_person import FollowPersonOptions, Target, TargetOptions, poses_to_search
from skills.api import Cause, Failed, Running, Succeeded, Zone, ZoneKind, nobody_to_ask
from skills.doorway import Doorway
from skills.perception.people import SeenPerson
from skills.robot import Pose2D

START, LANE_M = Pose2D(1.5, 5.4, 0.0), 5.4
END = ((5.0, 4.5), (8.0, 4.5), (8.0, 6.5), (5.0, 6.5))
EXACT = {"component": ExactPlace(), "azimuths": 360}
QUICK = FollowPersonOptions(lost_s=2.0, finding_s=2.0, asking_s=2.0, search_s=4.0)


class Walk:
    """One run behind a person who walks from x = 3.2 m to `to_m` at a speed, and is gone from `gone_s` to `back_s`.

    Who comes back answers "Are you Robin?" with `answer`.
    """

    def __init__(
        self,
        to_m=6.5,
        *,
        speed_m_s=0.6,
        gone_s=math.inf,
        back_s=math.inf,
        answer="yes",
        told_s=math.inf,
        others=(),
        cameras=False,
        zones=(),
        **inputs,
    ):
        self.bench = Bench(START, unmapped=[person_at(3.2, LANE_M), *others], cameras=cameras, **EXACT)
        self.to_m, self.speed_m_s, self.gone_s, self.back_s, self.x_m = to_m, speed_m_s, gone_s, back_s, 3.2
        self.questions = []
        self.bench.tick(10)
        self.remark = LateAnswer(self.bench.clock, "thank you", told_s)
        self.detector = PeopleDetector(self.bench, [])
        ask = lambda question: self.questions.append(question.text) or nobody_to_ask(replace(question, default=answer))  # noqa: E731
        context = replace(
            self.bench.context(), listen=lambda: self.remark, detector=self.detector, ask=ask, zones=zones
        )
        self.skill, self.distances_m, self.messages = FollowPerson(context, QUICK), [], []
        self.inputs = FollowPersonInputs("Robin", **inputs)
        self.skill.begin(self.inputs)

    def tick(self):
        """One tick of everybody; returns the skill's step."""
        now_s, boxes = self.bench.clock.now(), self.bench.robot.blocks
        boxes[:] = [box for box in boxes if box != person_at(self.x_m, LANE_M)]
        step_m = 0.05 * self.speed_m_s if now_s > 3.0 else 0.0
        self.x_m += math.copysign(min(abs(step_m), abs(self.to_m - self.x_m)), step_m)
        if not self.gone_s <= now_s < self.back_s:
            boxes.append(person_at(self.x_m, LANE_M))
        self.bench.tick()
        here = self.bench.robot.pose
        self.distances_m.append(math.dist((here.x_m, here.y_m), (self.x_m, LANE_M)))
        step = self.skill.step()
        self.messages.append(step.message)
        return step

    def run(self, most_s=40.0):
        """Runs to the end; returns the last step."""
        step = self.tick()
        while isinstance(step, Running) and self.bench.clock.now() < most_s:
            step = self.tick()
        self.skill.end()
        return step

    def said(self):
        return [message["text"] for topic, message in self.bench.published if topic == "speech"]


class Started(Walk):
    """A walk that has gone on for some seconds."""

    def __init__(self, *args, seconds, **how):
        super().__init__(*args, **how)
        while self.bench.clock.now() < seconds:
            self.tick()


def test_robot_keeps_behind_a_person_until_they_stand_in_the_place():
    walk = Walk(until_W=END, until="kitchen")
    assert walk.run() == Succeeded("followed Robin to the kitchen")
    assert 1.2 <= walk.distances_m[-1] <= 2.1
    assert min(walk.distances_m) > 1.1 and max(walk.distances_m) < 2.9
    assert not walk.bench.robot.driving


def test_robot_stays_out_of_a_keep_out_zone_through_which_the_person_goes():
    zone = Zone("lab", ZoneKind.KEEP_OUT, ((4.4, 4.0), (5.6, 4.0), (5.6, 7.0), (4.4, 7.0)))
    walk = Walk(zones=(zone,), time_limit_s=12.0)
    assert walk.run().cause is Cause.TIMEOUT
    assert 2.5 < walk.bench.robot.pose.x_m < 4.4  # as near as the zone allows


def test_without_anybody_ahead_the_skill_fails():
    step = Walk(gone_s=0.0).run()
    assert isinstance(step, Failed) and step.cause is Cause.PRECONDITION
    assert "nobody is seen ahead" in step.message


def test_the_robot_does_not_say_that_nobody_is_ahead_without_depth(monkeypatch):
    # something low stands ahead, where a camera looks for people
    bench = Bench(START, unmapped=(Box(2.7, 5.2, 3.0, 5.5, 0.0, 0.8),), **EXACT)
    blind(bench, monkeypatch)
    bench.tick(10)
    skill = FollowPerson(replace(bench.context(), detector=PeopleDetector(bench, [])), QUICK)
    step = bench.run(skill, FollowPersonInputs("Robin"))
    assert step == Failed(Cause.EXECUTION, "cannot see Robin: the frontleft camera gives pictures without depth")


def test_the_time_limit_ends_the_skill():
    step = Walk(time_limit_s=5.0, until_W=END, until="kitchen").run()
    assert isinstance(step, Failed) and step.cause is Cause.TIMEOUT


def test_a_blind_lidar_ends_the_skill_with_its_sentence():
    walk = Started(seconds=5.0)
    walk.bench.robot.scan = lambda: None
    step = walk.run()
    assert isinstance(step, Failed) and step.cause is Cause.EXECUTION


def test_a_person_is_found_at_the_place_where_they_were_seen():
    walk = Walk(others=[person_at(3.0, 4.6)], place_W=(3.2, LANE_M), until_W=END)
    assert isinstance(walk.run(), Succeeded)
    assert walk.distances_m[-1] < 2.2


def test_a_remark_ends_the_skill_with_success():
    walk = Walk(told_s=6.0)
    assert walk.run() == Succeeded('stopped following Robin when told "thank you"')
    assert walk.remark.withdrawn and not walk.bench.robot.driving


def test_a_lost_person_is_searched_and_asked_for_before_the_skill_fails():
    walk = Walk(gone_s=6.0)
    step = walk.run()
    assert isinstance(step, Failed) and step.cause is Cause.EXECUTION
    assert "Robin is lost, seen last at" in step.message
    assert walk.said() == ["I follow you.", "I have lost sight of you.", "I lost you. Where are you?"]
    assert any("going to where Robin went" in message for message in walk.messages)


def test_robot_goes_aside_for_a_person_who_comes_back():
    walk = Started(to_m=5.5, seconds=8.0)
    walk.to_m, walk.speed_m_s = 0.6, -0.6
    while walk.x_m > 2.0 and walk.bench.clock.now() < 25.0:
        here = walk.bench.robot.pose
        blocked = 0.0 < walk.x_m - here.x_m < 1.3 and abs(here.y_m - LANE_M) < 0.6
        walk.speed_m_s = 0.0 if blocked else -0.6
        walk.tick()
    assert walk.x_m <= 2.0
    assert min(walk.distances_m) > 0.6


@pytest.mark.parametrize(("answer", "outcome"), [("yes", Succeeded), ("no", Failed)])
def test_somebody_found_after_a_search_is_followed_only_if_they_are_the_person(answer, outcome):
    walk = Walk(to_m=5.5, gone_s=6.0, back_s=9.5, answer=answer, place_W=(3.2, LANE_M), until_W=END)
    assert isinstance(walk.run(), outcome)
    assert walk.questions == ["Are you Robin?"]


def test_a_person_who_is_not_told_apart_from_others_nearby_is_a_failure_that_says_so():
    walk = Started(to_m=5.5, others=[person_at(3.6, LANE_M + 1.0)], place_W=(3.2, LANE_M), until_W=END, seconds=5.0)
    walk.skill.options = replace(QUICK, doubtful_s=1.0, answer_s=30.0)
    walk.skill._target.doubt()
    step = walk.run()
    assert step.cause is Cause.EXECUTION
    assert step.message == "Robin could not be told apart from others for 1 s"


def test_after_drives_that_failed_the_robot_makes_way_for_the_person_next_to_it(monkeypatch):
    walk = Started(to_m=5.5, seconds=6.0)
    here = walk.bench.robot.pose
    other = SeenPerson((here.x_m + 1.2, here.y_m), np.eye(2), 1.0, 6.0, here, track=9)
    monkeypatch.setattr(walk.skill._company, "others", lambda: (other,))
    walk.skill._tries = 3
    assert abs(walk.skill._next_pose(walk.skill._target, 0.0).y_m - here.y_m) > 0.5


def test_the_search_goes_from_room_to_room_through_the_nearest_doors():
    walk = Walk()
    doors = (Doorway((6.0, 5.4), 1.0, 0.0), Doorway((7.5, 5.4), 1.0, 0.0), Doorway((1.0, 5.4), 1.0, 0.0))
    seen = SeenPerson((4.0, LANE_M), 0.01 * np.eye(2), 1.0, 0.0, START, velocity_W=(0.6, 0.0))
    target, here = Target(seen, START, TargetOptions()), walk.skill.context.pose
    poses = list(poses_to_search(target, doors, None, len(doors), here, walk.skill._free))
    assert [round(pose.x_m, 1) for pose in poses[:2]] == [7.0, 8.5]


@pytest.mark.parametrize("at_s", [0.6, 4.0, 9.5])
def test_a_cancel_in_any_phase_stops_the_base_and_the_listening(at_s):
    walk = Started(gone_s=6.5, seconds=at_s)
    walk.skill.end()
    assert not walk.bench.robot.driving and walk.remark.withdrawn


def test_after_a_pause_the_robot_looks_for_the_person_again_and_follows():
    walk = Started(until_W=END, seconds=5.0)
    walk.skill.suspend()
    assert not walk.bench.robot.driving
    walk.bench.tick(20)
    walk.skill.resume(walk.inputs)
    assert isinstance(walk.run(), Succeeded)


def test_pictures_are_bounded():
    assert 4 <= len(Started(cameras=True, seconds=6.0).detector.pictures) <= 8
