"""Drives near people: slower, waiting, around them, and on once they have left."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_people import PeopleDetector, person_at
from planar_robot import OUTLINE, TWO_ROOMS, Bench, ExactPlace

from skills.api import Cause, Failed, Running, Succeeded
from skills.footprint import Footprint, disc_centres, pose_array
from skills.navigate.skill import Navigate, NavigateInputs
from skills.navigate.surroundings import NavigateOptions
from skills.robot import Pose2D

BEFORE_DOOR, BEHIND, FAR = (Pose2D(x_m, 5.4, 0.0) for x_m in (4.0, 6.8, 8.5))
FOOTPRINT = Footprint.rectangle(OUTLINE)
START, GOAL = Pose2D(2.8, 5.4, 0.0), Pose2D(8.0, 5.4, 0.0)


class Drive:
    """One run along the corridor, with speeds, distances to people, and messages."""

    def __init__(
        self,
        people=(),
        *,
        start=START,
        goal=GOAL,
        unmapped=(),
        surveyed=(),
        until=None,
        detector=True,
        there_at_first=True,
        options=None,
    ):
        first = people if there_at_first else ()
        self.bench = Bench(
            start, surveyed=[*TWO_ROOMS, *surveyed], unmapped=[*first, *unmapped], component=ExactPlace(), azimuths=360
        )
        self.people = list(people)
        found = PeopleDetector(self.bench, self.people)
        context = replace(self.bench.context(), detector=found) if detector else self.bench.context()
        skill = Navigate(context, options)
        skill.begin(NavigateInputs(goal))
        self.speeds, self.messages, self.nearest_m = [], [], math.inf
        step = skill.step()
        while isinstance(step, Running) and self.bench.clock.now() < 90.0:
            self.messages.append(step.message)
            self.bench.tick()
            if until is not None:
                until(self)
            self.speeds.append((self.bench.robot.pose.x_m, float(np.hypot(*self.bench.robot.velocity[:2]))))
            self.nearest_m = min(self.nearest_m, self.from_people_m())
            step = skill.step()
        skill.end()
        self.step = step

    def from_people_m(self):
        """Distance (m) from the outline to the axis of the nearest person or unmapped object."""
        there = [box for box in self.bench.robot.blocks if box.z1 == person_at(0.0, 0.0).z1]
        centres = np.array([(0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)) for box in there]).reshape(-1, 2)
        discs = disc_centres(FOOTPRINT.discs, pose_array([self.bench.robot.pose]))[0]
        offsets = np.linalg.norm(discs[:, None] - centres[None], axis=2) - FOOTPRINT.discs[:, 2:3]
        return float(np.min(offsets, initial=math.inf))

    @property
    def seconds(self):
        return self.bench.clock.now()

    def fastest(self, low_m, high_m):
        return max(speed for x_m, speed in self.speeds if low_m <= x_m <= high_m)

    def waited(self):
        return sum("waiting for a person" in one for one in self.messages) * 0.05


@pytest.fixture(scope="module")
def alone():
    return Drive()


def test_without_people_it_drives_as_without_a_detector(alone):
    blind = Drive(detector=False)
    assert isinstance(alone.step, Succeeded)
    assert alone.seconds == pytest.approx(blind.seconds, abs=0.1)
    assert alone.fastest(4.0, 5.0) == pytest.approx(0.8, abs=0.05)


def test_robot_slows_down_beside_a_person_and_speeds_up_again(alone):
    drive = Drive([person_at(4.5, 6.5)])
    assert isinstance(drive.step, Succeeded), drive.step.message
    assert drive.fastest(3.5, 4.3) < 0.5
    assert drive.fastest(6.2, 7.4) > 0.7
    assert drive.nearest_m > 0.7
    assert drive.seconds > alone.seconds + 2.0


def test_robot_keeps_more_clearance_to_a_person_than_to_an_object():
    person = person_at(6.4, 5.2)
    around_a_thing = Drive(unmapped=[person], start=BEFORE_DOOR)
    around_a_person = Drive([person], start=BEFORE_DOOR)
    assert isinstance(around_a_person.step, Succeeded), around_a_person.step.message
    assert isinstance(around_a_thing.step, Succeeded)
    assert around_a_person.nearest_m > max(0.6, around_a_thing.nearest_m + 0.05)


def test_robot_waits_for_a_person_in_a_door_and_drives_on_afterwards():
    def leaves(drive):
        if drive.bench.clock.now() > 7.0 and drive.people[0] in drive.bench.robot.blocks:
            drive.bench.robot.blocks.remove(drive.people[0])

    drive = Drive([person_at(7.45, 4.0)], start=BEFORE_DOOR, goal=Pose2D(7.5, 2.0, -math.pi / 2), until=leaves)
    assert isinstance(drive.step, Succeeded), drive.step.message
    assert drive.seconds > 7.0
    assert drive.bench.robot.least_clearance_m > 0.1


def test_a_door_blocked_by_a_person_is_a_planning_failure_after_long_patience():
    room, patience = Pose2D(7.5, 2.0, -math.pi / 2), NavigateOptions(person_patience_s=2.0)
    drive = Drive([person_at(7.45, 4.0)], start=BEFORE_DOOR, goal=room, options=patience)
    assert isinstance(drive.step, Failed)
    assert drive.step.cause is Cause.PLANNING
    assert "blocks the path, and does not let the robot pass" in drive.step.message
    assert 6.0 < drive.seconds < 31.0
    assert drive.bench.robot.least_clearance_m > 0.1


# the robot with its back to the person in the door, and with its goal just behind the person
@pytest.mark.parametrize(
    ("start", "goal"),
    [
        (Pose2D(7.45, 5.5, math.pi / 2), Pose2D(7.5, 2.0, -math.pi / 2)),
        (Pose2D(7.45, 5.5, -math.pi / 2), Pose2D(7.5, 3.45, -math.pi / 2)),
    ],
)
def test_robot_asks_the_person_without_whom_there_is_a_path(start, goal):
    drive = Drive([person_at(7.45, 4.0)], start=start, goal=goal, options=NavigateOptions(person_patience_s=2.0))
    said = [message["text"] for topic, message in drive.bench.published if topic == "speech"]
    assert said == ["May I pass, please?"] * 2
    assert drive.step.cause is Cause.PLANNING


def test_robot_does_not_ask_a_person_who_blocks_no_path():
    drive = Drive([person_at(3.0, 5.4)], start=BEFORE_DOOR, goal=GOAL)
    assert isinstance(drive.step, Succeeded)
    assert not [topic for topic, _ in drive.bench.published if topic == "speech"]


def test_robot_stops_for_a_person_who_steps_into_its_path():
    person = person_at(6.9, 5.4)

    def steps_in(drive):
        if drive.bench.robot.pose.x_m > 4.6 and person not in drive.bench.robot.blocks:
            drive.bench.robot.blocks.append(person)

    drive = Drive([person], start=Pose2D(3.2, 5.4, 0.0), goal=FAR, until=steps_in, there_at_first=False)
    assert isinstance(drive.step, Succeeded), drive.step.message
    assert drive.waited() > 1.0
    assert drive.nearest_m > 0.55


def test_robot_approaches_a_person_who_is_the_goal():
    """A hand-over pose 1.5 m before a person is reached slowly, not refused."""
    goal = Pose2D(7.9, GOAL.y_m, 0.0)
    drive = Drive([person_at(goal.x_m + 1.5, GOAL.y_m)], start=BEFORE_DOOR, goal=goal)
    assert isinstance(drive.step, Succeeded), drive.step.message
    assert drive.waited() == 0.0
    assert drive.fastest(7.3, 7.9) < 0.5


def test_robot_passes_a_person_slowly_in_a_narrow_passage():
    """In a corridor of 1.1 m beside the person a disc of full size would block the path."""
    drive = Drive(
        [person_at(5.0, 4.4)], goal=BEHIND, surveyed=[replace(TWO_ROOMS[-1], x0=4.0, x1=6.0, y0=6.05, y1=7.0)]
    )
    assert isinstance(drive.step, Succeeded), drive.step.message
    assert drive.bench.robot.least_clearance_m > 0.03
    assert drive.fastest(4.3, 5.2) < 0.35
