"""The guide_person skill: leads a person at their pace, waits for them, and goes back for them."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from errand_people.followed_person import Target, TargetOptions, people_about
from errand_people.listening import ListeningSkill
from errand_people.meet_person import MeetPerson, MeetPersonInputs, MeetPersonOptions, person_text
from skills.api import Cause, Part, Running, Step, Succeeded, say
from skills.footprint import SAFE_MARGIN_M, footprint_clearance_m, pose_array
from skills.geometry import grid_inside, inside_polygon, wrap
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.skill import Navigate
from skills.navigate.surroundings import Company, NavigateInputs
from skills.perception.people_tracking import PeopleOptions, PeopleWatch
from skills.quantities import Coordinate, Delay, Length, Speed, Tries, Turn
from skills.robot import Pose2D
from skills.routine import ENDED_EARLY, Patience, Routine, SkillFailure
from skills.world_model import PERSON

_TRACKING: Final = PeopleOptions(period_s=1.0, track_m=6.0, hidden_s=8.0)
_NEAR: Final = MeetPersonOptions(apart_m=(1.3, 1.6, 2.2, 2.7))
"""Distances from a person who fell behind at which the robot stands, larger ones for a person in a doorway."""
_SLOWEST_M_S = 0.25
_CLEAR_M = SAFE_MARGIN_M + 0.05
"""Clearance of a pose in a room, where the robot stands for longer."""
_SURELY_M = 0.25
"""Distance of a person from the edge of a room at which they are certainly in it, and not in its door."""
_COMES_M = 2.7
"""Distance from which on a person comes after the robot."""
_STEP_IN_M = 0.3
"""Least distance by which the robot goes further into a room."""
_YAWS_RAD = (0.0, 0.8, -0.8, 1.6, -1.6, 2.4, -2.4, math.pi)
"""Turns of the robot there from the direction away from the person, the best first."""
_WALKS_M_S = 0.3
"""Speed from which on a person who is out of sight has walked on."""
_ON_M = 2.0
"""Steps in which the robot looks for that person, ahead and back along the trail."""


@dataclass(frozen=True)
class GuidePersonInputs:
    """Name of a person for messages, the robot's pose at the goal, and the name of the goal.

    `place_W` (x, y) is where the person was last seen (None: the nearest one ahead). At the end the person must stand
    in the outline `area_W`; without an outline, near the robot.
    """

    person: str
    goal: Pose2D
    place: str
    place_W: tuple[Coordinate, Coordinate] | None = None
    area_W: tuple[tuple[Coordinate, Coordinate], ...] = ()


@dataclass(frozen=True)
class GuidePersonOptions:
    """Distances between robot and person, and times.

    `most_m_s` and `close_m`: the robot's full speed, and up to which distance of the person it applies. `wait_m` and
    `hidden_s`: it stands beyond this distance, or when it has not seen them for this time. `behind_s` and `returns`:
    after standing so long it goes back for them, at most so often. `arrive_s`: it waits for them at the goal.
    `outside_s` and `drives`: for a person who has stood so long at the room's door, it goes further in, at most so
    often. `same_m`: a person this near to the expected position counts as the one; without a position, the nearest
    within `ahead_m` and `ahead_rad` ahead. `call_s`: a robot that waits says so after this time. `questions` and
    `answer_s`: how often a doubtful person is asked for the name, and the time for each answer.
    """

    most_m_s: Speed = 0.7
    close_m: Length = 2.2
    wait_m: Length = 2.8
    hidden_s: Delay = 1.5
    behind_s: Delay = 5.0
    returns: Tries = 6
    arrive_s: Delay = 8.0
    same_m: Length = 1.2
    ahead_m: Length = 3.0
    ahead_rad: Turn = 1.2
    drives: Tries = 3
    outside_s: Delay = 2.0
    call_s: Delay = 2.0
    questions: Tries = 2
    answer_s: Delay = 5.0


class Leading(Navigate):
    """Drive of a robot that leads; a stop to wait for the person does not count as blocked."""

    def _give_way(self) -> tuple[float, str | None]:
        most_m_s, waits = super()._give_way()
        if waits is None and self._company is not None and self._company.most_m_s <= 0.0:
            waits = self._waits("waiting for the person")
        return most_m_s, waits


class GuidePerson(ListeningSkill[GuidePersonInputs]):
    """Leads a person to a place: drives at their pace, waits for them, and goes back for them."""

    name = "guide_person"
    Inputs = GuidePersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE, Part.VOICE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan, or localisation is lost",
        Cause.PLANNING: "there is no path to the place, or back to the person",
        Cause.EXECUTION: "the robot makes no progress, refuses to drive or cannot see the person",
        Cause.POSTCONDITION: "the person is lost, does not come along, or ends it on the way",
    }
    default_timeout_s = 600.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}
    Options: ClassVar[type] = GuidePersonOptions
    options: GuidePersonOptions

    def begin(self, inputs: GuidePersonInputs) -> None:
        """Starts with the person at the inputs' position."""
        super().begin(inputs)
        self._inputs, self._place_W, self._who = inputs, inputs.place_W, person_text(inputs.person)
        self._company = Company(PeopleWatch(self.context, _TRACKING))
        self._target: Target | None = None
        self._doubted = False
        self._behind = Patience(self.context.clock, self.options.behind_s)
        self._waiting, self._asked = Patience(self.context.clock, self.options.call_s), False

    def step(self) -> Step:
        """Looks for the person, then steps the routine (see `RoutineSkill.step`)."""
        watch, now_s = self._company.watch, self.context.clock.now()
        watch.step(np.zeros(3))
        if self._target is None:
            here = self.context.pose()
            reach_m = self.options.ahead_m if self._place_W is None else self.options.same_m
            if near := people_about(watch.tracks(), here, self._place_W, reach_m, self.options.ahead_rad):
                self._target = Target(near[0], here, TargetOptions())
        else:
            self._target.update(watch.tracks(), (), now_s)
        self._company.track = 0 if self._target is None else self._target.seen.track
        return super().step()

    def _gap_m(self) -> float:
        """Distance between the robot and the person, in metres; infinite while the person is hidden."""
        if self._target is None or self._target.hidden_s(self.context.clock.now()) > self.options.hidden_s:
            return math.inf
        here = self.context.pose()
        return math.dist(self._target.seen.place_W, (here.x_m, here.y_m))

    def trouble(self) -> SkillFailure | None:
        """Returns a failure when somebody ends the skill before both are at the goal."""
        if (said := self.remark) is None or self._are_there():
            return None
        return SkillFailure(Cause.POSTCONDITION, f"'{said}' was said before {self._who} was at {self._inputs.place}")

    def run(self, inputs: GuidePersonInputs) -> Routine[Succeeded]:
        """Leads the person, and goes back for them when they fall behind."""
        yield from self._fetch()
        for _ in range(self.options.returns + 1):
            say(self.context, f"Please follow me to {inputs.place}.")
            if (yield from self._lead()):
                yield from self._make_sure()
                say(self.context, f"Here we are: {inputs.place}.")
                apart_m = self._gap_m()
                return Succeeded(f"{self._who} came along to {inputs.place}, {apart_m:.1f} m from the robot")
            yield from self._fetch()
        raise SkillFailure(Cause.POSTCONDITION, f"{self._who} does not come along to {inputs.place}")

    def _lead(self) -> Routine[bool]:
        """Drives to the goal; returns True when both are there, and False once the person is too far behind."""
        inputs, goal, now_s = self._inputs, self._inputs.goal, self.context.clock.now
        for _ in range(self.options.drives):
            drive = NavigateInputs(goal, 0.25, 0.4, self.options.most_m_s)
            leading = Leading(self.context, None, self._company)
            try:
                if (yield from self.perform(leading, drive, self._must_stop)) is ENDED_EARLY:
                    break
            except SkillFailure as failure:
                if failure.cause is not Cause.PLANNING or not self._is_in():
                    raise
                if goal is not inputs.goal:
                    break
            end_s = now_s() + self.options.arrive_s
            outside_s = end_s - self.options.arrive_s + self.options.outside_s
            while not (self._are_there() or (self._is_close() and now_s() > outside_s)) and now_s() < end_s:
                yield Running(f"waiting for {self._who} at {inputs.place}")
            further = None if self._are_there() else self._pose_further_in()
            if further is None:
                break
            say(self.context, "Please come in.")
            goal = further
        return self._are_there()

    def _make_sure(self) -> Routine[None]:
        """Asks a doubtful person for their name. Raises SkillFailure unless they say yes."""
        doubted = self._doubted or (self._target is not None and self._target.doubted is not None)
        if self._inputs.place_W is None or self._inputs.person == PERSON or not doubted:
            return  # nobody without a name can say that it is them
        answer: str | None = None
        answer_s, asking = self.options.answer_s, Running(f"asking whether it is {self._who}")
        for _ in range(self.options.questions):
            if answer := (yield from self.ask_for_name(self._inputs.person, answer_s, lambda: [asking], lambda: False)):
                break
        if answer != "yes":
            why = f"is not {self._who}" if answer else f"did not say whether they are {self._who}"
            raise SkillFailure(Cause.POSTCONDITION, f"the person who came along to {self._inputs.place} {why}")

    def _must_stop(self) -> bool:
        """Sets the pace; returns whether the drive must end because the person fell behind or ended it."""
        self._company.most_m_s = self._pace_m_s()
        return self._is_behind() or self.remark is not None

    def _pose_further_in(self) -> Pose2D | None:
        """Free pose in the room, far enough from the person that they come in; None when there is none."""
        area, here = self._inputs.area_W, self.context.pose()
        if self._target is None or not area:
            return None
        person_W, footprint = np.array(self._target.seen.place_W), ArmFootprint(self.context).now()
        apart_m = math.dist(person_W, (here.x_m, here.y_m))
        if apart_m > self.options.wait_m:
            return None
        points = grid_inside(area, 0.25, first_m=0.3, margin_m=-0.4)
        away_m = np.linalg.norm(points - person_W, axis=1)
        drive_m = np.linalg.norm(points - (here.x_m, here.y_m), axis=1)
        for n in np.lexsort((drive_m, np.maximum(0.0, _COMES_M - away_m).round(1))):
            if away_m[n] > apart_m + _STEP_IN_M:
                (x, y), ahead_rad = points[n], math.atan2(*(points[n] - person_W)[::-1])
                poses = [Pose2D(float(x), float(y), wrap(ahead_rad + turn)) for turn in _YAWS_RAD]
                clear_m = footprint_clearance_m(self.context.free_space(), footprint, pose_array(poses))
                if clear_m.max() > _CLEAR_M:
                    return poses[int(np.argmax(clear_m > _CLEAR_M))]
        return None

    def _fetch(self) -> Routine[None]:
        """Goes back to where the person was last seen, or was heading. Raises SkillFailure when nobody is there."""
        if self._is_close():
            return
        inputs, failures = self._inputs, list[SkillFailure]()
        last = None if self._target is None else self._target.seen
        if last is not None:
            say(self.context, "I come back for you.")
        for place_W in (self._place_W,) if self._target is None else places_of(self._target):
            try:
                goal = MeetPersonInputs(inputs.person, place_W)
                met = yield from self.perform(MeetPerson(self.context, _NEAR), goal, self._is_close)
            except SkillFailure as failure:
                if failure.cause not in (Cause.POSTCONDITION, Cause.PLANNING):
                    raise
                failures.append(failure)
                continue
            if met is not ENDED_EARLY and not self._is_close():
                self._place_W, self._target = met.outputs["person"].position_W[:2], None
                self._doubted = True
            return
        why = f"lost {self._who} on the way to {inputs.place}: {failures[0].message}"
        raise SkillFailure(failures[0].cause, why)

    def _pace_m_s(self) -> float:
        """Speed limit at the present distance to the person; 0 to wait."""
        options, gap_m = self.options, self._gap_m()
        if gap_m > options.wait_m:
            return 0.0
        share = min(1.0, (options.wait_m - gap_m) / (options.wait_m - options.close_m))
        return _SLOWEST_M_S + share * (options.most_m_s - _SLOWEST_M_S)

    def _is_behind(self) -> bool:
        """Returns whether the person has been too far behind for too long; asks them once to come."""
        if self._gap_m() <= self.options.wait_m:
            self._behind.reset()
            self._waiting.reset()
            self._asked = False
            return False
        if not self._waiting.is_left() and not self._asked:
            say(self.context, "I wait for you.")
            self._asked = True
        return not self._behind.is_left()

    def _is_close(self) -> bool:
        return self._gap_m() <= self.options.close_m

    def _are_there(self) -> bool:
        """Returns whether the person is seen near the robot, and both are at the goal."""
        area = self._inputs.area_W
        if self._target is None or self._gap_m() > self.options.wait_m:
            return False
        if not area:
            return True
        return self._is_in() and bool(inside_polygon(np.array([self._target.seen.place_W]), area, -_SURELY_M).all())

    def _is_in(self) -> bool:
        """Returns whether the robot is in the area at the goal."""
        area, here = self._inputs.area_W, self.context.pose()
        return bool(area) and bool(inside_polygon(np.array([(here.x_m, here.y_m)]), area).all())


def places_of(target: Target) -> Iterator[tuple[float, float]]:
    """Yields possible positions of a hidden person: the last one, farther in the same direction, and back on the trail.

    When the robot sees the person from one of them, the person's position comes next.
    """
    last, trail = target.seen, target.trail[::-1]
    guesses, back_m = [last.place_W], _ON_M
    if target.speed_m_s >= _WALKS_M_S:
        x, y = (at + _ON_M * v / target.speed_m_s for at, v in zip(last.place_W, last.velocity_W, strict=True))
        guesses.append((x, y))
    for (x, y), length_m in zip(trail[1:], np.cumsum(np.linalg.norm(np.diff(trail, axis=0), axis=1)), strict=True):
        if length_m >= back_m:
            back_m += _ON_M
            guesses.append((float(x), float(y)))
    for place_W in guesses:
        yield place_W
        if target.seen.stamp_s > last.stamp_s:
            last = target.seen
            yield last.place_W
