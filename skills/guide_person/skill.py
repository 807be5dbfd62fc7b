"""The guide_person skill: goes ahead of a person at their pace, waits for them, and goes back for them."""

import math
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
import shapely

from skills.api import Cause, Job, Running, SkillContext, Step, Succeeded
from skills.meet_person.skill import MeetPerson
from skills.navigate.skill import Navigate
from skills.perception.people import SeenPerson
from skills.perception.people_tracking import PeopleOptions, PeopleWatch, predicted_place_W
from skills.ports import GuidePersonInputs, GuidePersonPorts, MeetPersonInputs, NavigateInputs
from skills.quantities import Delay, Length, Speed, Tries
from skills.routine import ENDED_EARLY, Patience, Routine, RoutineSkill, SkillFailure
from skills.speak.skill import say

_TRACKING: Final = PeopleOptions(track_m=6.0, hidden_s=8.0)
_SLOWEST_M_S = 0.25
_GROWTH_M_S, _GROWTH_M = 0.4, 1.5
"""Growth of the distance within which a hidden person is found again, and its most."""
_LOOK_S = 1.0
_ASK_AFTER_S = 2.0
_WALKS_M_S = 0.3
_ON_M = 2.0
"""Distance along their last direction at which a person is looked for who is not where they were seen last."""


@dataclass(frozen=True)
class GuidePersonOptions:
    """Distances between robot and person, and times.

    The robot drives at up to most_m_s while the person is within `close_m`, slower beyond, and stands beyond `wait_m`
    or when it has not seen them for `hidden_s`. After `behind_s` of standing it goes back for them, at most `returns`
    times. At the goal it waits `arrive_s` for them. Somebody within `same_m` of where they should be is taken for them.
    """

    most_m_s: Speed = 0.7
    close_m: Length = 2.2
    wait_m: Length = 2.8
    hidden_s: Delay = 1.5
    behind_s: Delay = 5.0
    returns: Tries = 6
    arrive_s: Delay = 8.0
    same_m: Length = 1.2


class Companion:
    """The person whom the robot guides: their track, or else somebody who is where they should be."""

    def __init__(self, context: SkillContext, options: GuidePersonOptions, place_W: tuple[float, float] | None) -> None:
        self._context, self._options = context, options
        self._watch = PeopleWatch(context, _TRACKING)
        self._expected_W = place_W
        self.seen: SeenPerson | None = None

    def expect_at(self, place_W: tuple[float, float]) -> None:
        """Takes the person nearest to a place for them from now on."""
        self._expected_W, self.seen = place_W, None

    def look(self) -> None:
        """Takes in new scans and pictures."""
        self._watch.step(np.zeros(3))
        tracks, now_s = self._watch.tracks(), self._context.clock.now()
        same = next((one for one in tracks if self.seen is not None and one.track == self.seen.track), None)
        expected_W = self._expected_W if self.seen is None else predicted_place_W(self.seen, now_s)
        if same is None and expected_W is not None:
            hidden_s = 0.0 if self.seen is None else now_s - self.seen.stamp_s
            same_m = self._options.same_m + min(_GROWTH_M, _GROWTH_M_S * hidden_s)
            away = {math.dist(one.place_W, expected_W): one for one in tracks if now_s - one.stamp_s < _LOOK_S}
            same = next((one for distance_m, one in sorted(away.items()) if distance_m <= same_m), None)
        self.seen = same or self.seen

    @property
    def place_W(self) -> tuple[float, float] | None:
        """Place (x, y) at which the person was seen last, or is expected."""
        return self._expected_W if self.seen is None else self.seen.place_W

    def gap_m(self) -> float:
        """Distance from the robot to the person, in metres; infinite while they are hidden."""
        if self.seen is None or self._context.clock.now() - self.seen.stamp_s > self._options.hidden_s:
            return math.inf
        here = self._context.pose()
        return math.dist(self.seen.place_W, (here.x_m, here.y_m))


class Leading(Navigate):
    """Drive of a robot that leads: at most at `most_m_s`, and standing for the person at 0, which is no trouble."""

    most_m_s = math.inf
    message = ""

    def _give_way(self) -> tuple[float, str | None]:
        most_m_s, waits = super()._give_way()
        if waits is None and self.most_m_s <= 0.0:
            waits = self._waits(self.message)
        return min(most_m_s, self.most_m_s), waits


class GuidePerson(GuidePersonPorts, RoutineSkill[GuidePersonInputs]):
    """Implementation of `GuidePersonPorts`."""

    Options: ClassVar[type] = GuidePersonOptions
    options: GuidePersonOptions
    _remark: Job[str] | None = None

    def begin(self, inputs: GuidePersonInputs) -> None:
        """Starts with the person at the place of the inputs."""
        super().begin(inputs)
        self._inputs, self._companion = inputs, Companion(self.context, self.options, inputs.place_W)
        self._behind = Patience(self.context.clock, self.options.behind_s)
        self._waiting, self._asked = Patience(self.context.clock, _ASK_AFTER_S), False
        self._remark = self.context.listen()

    def step(self) -> Step:
        """Looks for the person; then as `RoutineSkill.step`."""
        self._companion.look()
        return super().step()

    def suspend(self) -> None:
        """Stands, and hears no remark meanwhile."""
        self._withdraw()
        super().suspend()

    def resume(self, inputs: GuidePersonInputs) -> None:
        """Continues; after a long pause, from where the person was seen last."""
        if self._remark is None:
            self.begin(inputs)
            return
        self._remark = self.context.listen()
        super().resume(inputs)

    def end(self) -> None:
        """Ends the drive."""
        self._withdraw()
        super().end()

    def _withdraw(self) -> None:
        if self._remark is not None:
            self._remark.withdraw()

    def trouble(self) -> SkillFailure | None:
        """Returns a failure when a person ends it before both are there."""
        if self._remark is None or not self._is_told() or self._are_there():
            return None
        inputs, said = self._inputs, self._remark.result()
        return SkillFailure(Cause.POSTCONDITION, f"'{said}' was said before {inputs.person} was at {inputs.place}")

    def run(self, inputs: GuidePersonInputs) -> Routine[Succeeded]:
        """Leads the person, and goes back for them as often as needed."""
        yield from self._fetch()
        for _ in range(self.options.returns + 1):
            say(self.context, f"Please follow me to {inputs.place}.")
            if (yield from self._lead()):
                say(self.context, f"Here we are: {inputs.place}.")
                apart_m = self._companion.gap_m()
                return Succeeded(f"{inputs.person} came along to {inputs.place}, {apart_m:.1f} m from the robot")
            yield from self._fetch()
        raise SkillFailure(Cause.POSTCONDITION, f"{inputs.person} does not come along to {inputs.place}")

    def _lead(self) -> Routine[bool]:
        """Drives to the goal; returns whether both are there, or False once the person is too far behind."""
        inputs, leading = self._inputs, Leading(self.context)
        leading.message = f"waiting for {inputs.person}"
        self._behind.reset()

        def enough() -> bool:
            leading.most_m_s = self._pace_m_s()
            return self._is_behind() or self._is_told()

        goal = NavigateInputs(inputs.goal, 0.25, 0.4, self.options.most_m_s)
        if (yield from self.perform(leading, goal, enough)) is not ENDED_EARLY:
            end_s = self.context.clock.now() + self.options.arrive_s
            while not self._are_there() and self.context.clock.now() < end_s:
                yield Running(f"waiting for {inputs.person} at {inputs.place}")
        return self._are_there()

    def _fetch(self) -> Routine[None]:
        """Goes back to where the person was seen last, or was going. Raises SkillFailure when nobody is there."""
        if self._is_close():
            return
        last, inputs, failures = self._companion.seen, self._inputs, list[SkillFailure]()
        if last is not None:
            say(self.context, f"I come back for you, {inputs.person}.")
        for place_W in (self._companion.place_W, *(() if last is None else _further_on(last))):
            try:
                goal = MeetPersonInputs(inputs.person, place_W)
                met = yield from self.perform(MeetPerson(self.context), goal, self._is_close)
            except SkillFailure as failure:
                if failure.cause not in (Cause.POSTCONDITION, Cause.PLANNING):
                    raise
                failures.append(failure)
                continue
            if met is not ENDED_EARLY:
                x, y, _ = met.outputs["person"].position_W
                self._companion.expect_at((x, y))
            return
        raise SkillFailure(
            failures[0].cause, f"lost {inputs.person} on the way to {inputs.place}: {failures[0].message}"
        )

    def _pace_m_s(self) -> float:
        """Speed that the distance of the person allows; 0 to wait."""
        options, gap_m = self.options, self._companion.gap_m()
        if gap_m > options.wait_m:
            return 0.0
        share = min(1.0, (options.wait_m - gap_m) / (options.wait_m - options.close_m))
        return _SLOWEST_M_S + share * (options.most_m_s - _SLOWEST_M_S)

    def _is_behind(self) -> bool:
        """Returns whether the person has been too far away for too long; asks them once to come."""
        if self._companion.gap_m() <= self.options.wait_m:
            self._behind.reset()
            self._waiting.reset()
            self._asked = False
            return False
        if not self._waiting.is_left() and not self._asked:
            say(self.context, "I wait for you.")
            self._asked = True
        return not self._behind.is_left()

    def _is_close(self) -> bool:
        return self._companion.gap_m() <= self.options.close_m

    def _is_told(self) -> bool:
        return self._remark is not None and self._remark.done()

    def _are_there(self) -> bool:
        """Returns whether the person is seen near the robot, and both are at the goal."""
        area, here, seen = shapely.Polygon(self._inputs.area_W), self.context.pose(), self._companion.seen
        if seen is None or self._companion.gap_m() > self.options.wait_m:
            return False
        return area.is_empty or bool(
            np.all(shapely.contains_xy(area, *np.transpose([seen.place_W, (here.x_m, here.y_m)])))
        )


def _further_on(one: SeenPerson) -> list[tuple[float, float]]:
    """Place on which a person who walked is now, if they kept their direction."""
    speed_m_s = math.hypot(*one.velocity_W)
    if speed_m_s < _WALKS_M_S:
        return []
    x, y = (at + _ON_M * v / speed_m_s for at, v in zip(one.place_W, one.velocity_W, strict=True))
    return [(x, y)]
