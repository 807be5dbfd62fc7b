"""The meet_person skill: drives to a known person, and checks that they are still there."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar

import numpy as np

from skills.api import Cause, ObjectObservation, Part, Running, Succeeded
from skills.footprint import footprint_clear
from skills.geometry import bearing_rad, facing_poses, line_of_sight
from skills.manipulation.approach.base_placement import go_to_one
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.surroundings import NavigateInputs
from skills.navigate.trip_planning import place_text
from skills.perception.people import SeenPerson, person_observation
from skills.perception.people_tracking import PeopleOptions, PeopleWatch
from skills.quantities import Coordinate, Delay, Length, Tries, Turn
from skills.robot import Pose2D
from skills.routine import Patience, Routine, RoutineSkill, SkillFailure
from skills.world_model import PERSON

_SCAN_AGE_S = 1.0
_ARM_M = 0.5
"""Distance from a person's axis up to which their own body is in the costmap."""
_SHORT_M = 0.25
"""Difference between the largest distance of the inputs and the distance of the goal pose."""
_POSES_EACH = 2
"""Free poses at each distance from the person to which the robot tries to drive."""


def person_text(name: str) -> str:
    """Name of a person in a sentence."""
    return "the person" if name == PERSON else name


@dataclass(frozen=True)
class MeetPersonInputs:
    """Names of a person and their room, and the point (x, y) where they were last seen (None: the nearest one ahead).

    With `within_m`, the robot may stop at this distance (m) when nothing nearer is free.
    """

    person: str
    place_W: tuple[Coordinate, Coordinate] | None = None
    place: str = ""
    within_m: Length | None = None


@dataclass(frozen=True)
class MeetPersonOptions:
    """Positions of the robot near a person: at the first free one of the distances `apart_m`, turned to the person.

    `near_m` and `facing_rad`: a robot that is nearer and faces the person within this angle stays. `same_m`: a person
    this near to the expected position is the one. `reach_m` and `look_s`: radius and time of the search. `tries`: when
    the person has walked on, how many drives the robot makes after them.
    """

    apart_m: tuple[Length, ...] = (1.3, 1.6)
    near_m: Length = 1.85
    facing_rad: Turn = 0.6
    same_m: Length = 1.2
    ahead_m: Length = 3.0
    reach_m: Length = 5.0
    look_s: Delay = 1.5
    tries: Tries = 4


class MeetPerson(RoutineSkill[MeetPersonInputs]):
    """Goes beside a person, also if they move on, and faces them. The output `person` is their observation."""

    name = "meet_person"
    Inputs = MeetPersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    outputs: ClassVar[Mapping[str, type]] = {"person": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan",
        Cause.PLANNING: "there is no free place to stand beside the person, or no path",
        Cause.EXECUTION: "the robot did not reach the place to stand, or a camera gives old pictures or no depth",
        Cause.POSTCONDITION: "nobody is seen there, or the person walks on",
    }
    default_timeout_s = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "person": 2.0}
    Options: ClassVar[type] = MeetPersonOptions
    options: MeetPersonOptions

    def run(self, inputs: MeetPersonInputs) -> Routine[Succeeded]:
        """Drives beside the person; again if they have moved meanwhile."""
        place_W, who, near_m = inputs.place_W, person_text(inputs.person), self.options.near_m
        for drives in range(self.options.tries + 1):
            if drives or place_W is None or self._is_in_view(place_W):
                person = yield from self._look(who, place_W)
                if person is None:
                    nobody = f"nobody is seen within {self.options.ahead_m:g} m"
                    why = nobody if place_W is None else f"{who} is not seen at {place_text(place_W)}"
                    raise SkillFailure(Cause.POSTCONDITION, why)
                place_W = person.place_W
                off_rad = abs(bearing_rad(self.context.pose(), place_W))
                if person.distance_m <= near_m and off_rad <= self.options.facing_rad:
                    seen = person_observation(person, inputs.person, inputs.place or None)
                    return Succeeded(f"beside {who} at {place_text(place_W)}", {"person": seen})
            near_m = max(near_m, inputs.within_m or 0.0)
            yield from self._go_beside(place_W, who, inputs.within_m)
        raise SkillFailure(Cause.POSTCONDITION, f"{who} does not stay where the robot goes")

    def _look(self, name: str, place_W: tuple[float, float] | None) -> Routine[SeenPerson | None]:
        """Looks for the person nearest to a place (None: nearest ahead); returns None when nobody is there."""
        clock, patience, sight = self.context.clock, Patience(self.context.clock), Patience(self.context.clock)
        watch, end_s = PeopleWatch(self.context, PeopleOptions(track_m=self.options.reach_m)), -math.inf
        while True:
            scan = self.context.robot.scan()
            if scan is None or scan.stamp_s < clock.now() - _SCAN_AGE_S:
                if not patience.is_left():
                    raise SkillFailure(Cause.PRECONDITION, f"there is no new scan to see {name} in")
                end_s = -math.inf
            else:
                end_s = clock.now() + self.options.look_s if end_s < 0.0 else end_s
                watch.step(np.zeros(3))
                if found := self._candidates(watch.tracks(), place_W):
                    return found[0]
                if clock.now() >= end_s and not watch.faults:
                    return None
                if watch.faults and not sight.is_left():
                    raise SkillFailure(Cause.EXECUTION, f"cannot see {name}: {watch.faults[0]}")
            yield Running(f"looking for {name}")

    def _candidates(self, people: Sequence[SeenPerson], place_W: tuple[float, float] | None) -> list[SeenPerson]:
        """People who may be the person to meet, likeliest first."""
        here = self.context.pose()
        if place_W is None:
            near = [one for one in people if one.distance_m <= self.options.ahead_m]
            return sorted(near, key=lambda one: (abs(bearing_rad(here, one.place_W)) > math.pi / 3, one.distance_m))
        near = [one for one in people if math.dist(one.place_W, place_W) <= self.options.same_m]
        return sorted(near, key=lambda one: math.dist(one.place_W, place_W))

    def _is_in_view(self, place_W: tuple[float, float]) -> bool:
        """Returns whether the robot stands near a place, with no wall in between."""
        here = self.context.pose()
        towards = Pose2D(here.x_m, here.y_m, here.yaw_rad + bearing_rad(here, place_W))
        return math.dist(place_W, (here.x_m, here.y_m)) <= self.options.near_m and self._sees(towards, place_W)

    def _go_beside(self, place_W: tuple[float, float], name: str, within_m: float | None) -> Routine[None]:
        """Drives to the nearest free pose that faces a place. Raises SkillFailure when there is none."""
        footprint, costmap, here = ArmFootprint(self.context).now(), self.context.free_space(), self.context.pose()
        free = []
        for apart_m in (*self.options.apart_m, *(() if within_m is None else (within_m - _SHORT_M,))):
            poses = (pose for pose in facing_poses(place_W, here, apart_m) if footprint_clear(costmap, footprint, pose))
            free += [*islice((pose for pose in poses if self._sees(pose, place_W)), _POSES_EACH)]
        if not free:
            raise SkillFailure(Cause.PLANNING, f"there is no free place to stand beside {name}")
        yield from go_to_one(self, [NavigateInputs(pose, 0.15, 0.2) for pose in free])

    def _sees(self, pose: Pose2D, place_W: tuple[float, float]) -> bool:
        """Returns whether no wall or table is between a pose and a person."""
        at_W = np.array([(pose.x_m, pose.y_m)])
        return bool(line_of_sight(self.context.costmap, np.array(place_W), at_W, beyond_m=_ARM_M)[0])
