"""The find_person skill: searches a room for people of an appearance: pose, gesture and colour of clothes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from errand_people.appearance import candidates
from errand_people.looking import PeopleLookingSkill
from errand_people.looks import KINDS_NOTE, Appearance, Colour, Gesture, Pose, Trait
from skills.api import Cause, ObjectObservation, Part, Succeeded
from skills.footprint import footprint_clear
from skills.geometry import grid_inside
from skills.manipulation.approach.base_placement import go_to_one
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.surroundings import NavigateInputs
from skills.perception.people_tracking import PeopleWatch
from skills.quantities import Angle, Coordinate, Length, Tries
from skills.robot import Pose2D
from skills.routine import Routine, SkillFailure
from skills.world_model import PERSON

_LATENCY_S = 0.2
_LOOKS_AT_M, _LOOKS_UP_M = 2.0, 0.85
"""Distance and height of the point at which the camera looks while it searches."""
_GRID_M = 0.4
_SAME_M = 0.8
"""Distance within which two candidates are one person."""
_AT_EDGE_M = 0.3
"""Distance outside of the area at which a person still counts as inside."""


@dataclass(frozen=True)
class FindPersonInputs:
    """Area to search: the corners (x, y) `area_W`, and its name `place`; and the appearance of the person.

    `person` is the name in messages. `count`: how many people are wanted; 0 looks at everybody. `avoid`: people near
    these positions do not count.
    """

    area_W: tuple[tuple[Coordinate, Coordinate], ...]
    place: str
    person: str = PERSON
    pose: Pose | None = None
    gesture: Gesture | None = None
    clothes_colour: Colour | None = None
    count: Tries = 1
    avoid: tuple[ObjectObservation, ...] = ()


@dataclass(frozen=True)
class FindPersonOptions:
    """Search from `viewpoints` positions, `apart_m` or more from each other, in the directions `turns_rad`."""

    viewpoints: Tries = 3
    apart_m: Length = 2.0
    turns_rad: tuple[Angle, ...] = (0.0, 0.95, -0.95, 1.9, -1.9)


class FindPerson(PeopleLookingSkill[FindPersonInputs]):
    """Searches a room for skin and upright bodies, and looks at each until it is sure who fits.

    The output `person` is the first who fits, `people` are all.
    """

    name = "find_person"
    Inputs = FindPersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE, Part.ARM})
    outputs: ClassVar[Mapping[str, type]] = {"person": ObjectObservation, "people": tuple[ObjectObservation, ...]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "no appearance is given, or there is no camera to look with",
        Cause.PLANNING: "there is no free place to look from, or the arm reaches no viewpoint",
        Cause.EXECUTION: "the arm did not get there, the camera shows nothing, or somebody is not seen well enough",
        Cause.POSTCONDITION: "nobody in the area has this appearance",
    }
    default_timeout_s = 280.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 1.0, "joints": 0.5, "localisation": 1.0}
    Options: ClassVar[type] = FindPersonOptions
    options: FindPersonOptions

    def run(self, inputs: FindPersonInputs) -> Routine[Succeeded]:
        """Looks round from one position after another, and at each person found."""
        wanted, self.room_W = Appearance(inputs.pose, inputs.gesture, inputs.clothes_colour), inputs.area_W
        asked: Sequence[Trait] = tuple(wanted.traits())
        known = [(one.position_W[0], one.position_W[1]) for one in inputs.avoid]
        found, others, unsure, stood = list[ObjectObservation](), list[str](), list[str](), list[Pose2D]()
        for number in range(self.options.viewpoints):
            if number and not (yield from self._go_on(inputs, stood)):
                break
            stood.append(self.context.pose())
            for place_W in (yield from self._look_round(inputs)):
                if any(math.dist(place_W, each) < _SAME_M for each in known):
                    continue
                known.append(place_W)
                try:
                    seen = yield from self.looked_at(place_W, "somebody", asked, wanted)
                except SkillFailure as failure:
                    if failure.cause is not Cause.PLANNING:
                        raise
                    unsure.append(failure.message)
                    continue
                if seen is not None and not _is_inside(inputs.area_W, seen.place_W):
                    known.append(seen.place_W)
                elif seen is not None:
                    known.append(seen.place_W)
                    if seen.appearance.contradicts(wanted):
                        others.append(seen.appearance.text())
                    elif missing := seen.appearance.unsure_of(wanted):
                        unsure.append(f"the {missing[0].replace('_', ' ')} of somebody is not sure")
                    else:
                        found.append(self.observation(seen, inputs.person, inputs.place))
                if 0 < inputs.count <= len(found):
                    break
            if 0 < inputs.count <= len(found):
                break
        yield from self.stow()
        return self._ended(inputs, wanted, found, others, unsure)

    def _ended(
        self,
        inputs: FindPersonInputs,
        wanted: Appearance,
        found: Sequence[ObjectObservation],
        others: Sequence[str],
        unsure: Sequence[str],
    ) -> Succeeded:
        """Returns the result. Raises SkillFailure when too few fit, or somebody was not seen well enough."""
        outputs = {"person": found[0], "people": tuple(found)} if found else {}
        note = f"; {KINDS_NOTE}" if wanted.clothes_colour is not None else ""
        said = f"{len(found) or 'nobody'} in the {inputs.place} is {wanted.text()}{note}"
        if len(found) < max(1, inputs.count) or not inputs.count:
            if unsure:
                raise SkillFailure(Cause.EXECUTION, f"{said}, but {unsure[0]}", outputs)
            if len(found) < max(1, inputs.count):
                seen = f"; others are {'; '.join(others)}" if others else ""
                raise SkillFailure(Cause.POSTCONDITION, said + seen, outputs)
        return Succeeded(said, outputs)

    def _look_round(self, inputs: FindPersonInputs) -> Routine[list[tuple[float, float]]]:
        """Points the camera to all sides; returns where somebody may be in the area, nearest first."""
        here, message = self.context.pose(), f"looking for people in the {inputs.place}"
        found = list[tuple[float, float]]()
        found += [one.place_W for one in PeopleWatch(self.context).scanned()]
        for turn_rad in self.options.turns_rad:
            yaw_rad = here.yaw_rad + turn_rad
            x, y = here.x_m + _LOOKS_AT_M * math.cos(yaw_rad), here.y_m + _LOOKS_AT_M * math.sin(yaw_rad)
            yield from self.planned(self._add_candidates((x, y, _LOOKS_UP_M), found, message))
        inside = [one for one in found if _is_inside(inputs.area_W, one)]
        return sorted(inside, key=lambda one: math.dist(one, (here.x_m, here.y_m)))

    def _add_candidates(
        self, point_W: tuple[float, float, float], found: list[tuple[float, float]], message: str
    ) -> Routine[None]:
        """Takes a picture towards a point, and adds where it shows skin."""
        images = yield from self.series(point_W, message, (0.0,))
        work = partial(candidates, images[0], self.context.localiser.estimate().X_WO)
        found += yield from self.compute(work, latency_s=_LATENCY_S, name="people", message=message)

    def _go_on(self, inputs: FindPersonInputs, stood: Sequence[Pose2D]) -> Routine[bool]:
        """Drives to the free position of the area that is farthest from all earlier ones; False without any."""
        yield from self.stow()
        footprint, costmap = ArmFootprint(self.context).now(), self.context.free_space()
        points = grid_inside(inputs.area_W, _GRID_M, first_m=_GRID_M / 2)
        away_m = np.min([np.hypot(*(points - (each.x_m, each.y_m)).T) for each in stood], axis=0)
        middle = points.mean(axis=0)
        for row in np.argsort(-away_m):
            x, y = (float(value) for value in points[row])
            pose = Pose2D(x, y, math.atan2(middle[1] - y, middle[0] - x))
            if away_m[row] < self.options.apart_m:
                return False
            if not footprint_clear(costmap, footprint, pose):
                continue
            if (yield from self.planned(go_to_one(self, [NavigateInputs(pose, 0.3, 0.5)]))) is None:
                return True
        return False


def _is_inside(area_W: Sequence[tuple[float, float]], place_W: tuple[float, float]) -> bool:
    """Returns whether a place is in an area, or at its edge."""
    import shapely

    return bool(shapely.Polygon(area_W).buffer(_AT_EDGE_M).covers(shapely.Point(place_W)))
