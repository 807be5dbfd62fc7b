"""The follow_person skill: keeps behind a walking person, searches for a lost person, and asks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from errand_people.followed_person import (
    FollowPersonOptions,
    Target,
    is_addressed,
    line_through,
    people_about,
    poses_around,
    poses_behind,
    poses_to_search,
)
from errand_people.listening import ListeningSkill
from skills.api import Cause, ClearableCostmap, Failed, Part, Running, SkillContext, Succeeded, say
from skills.footprint import SAFE_MARGIN_M, NoObstacles, footprint_clearance_m, with_discs
from skills.geometry import bearing_rad, inside_polygon, wrap
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.giving_way import GivingWayOptions, pose_aside
from skills.navigate.skill import Navigate
from skills.navigate.surroundings import Company, NavigateInputs
from skills.navigate.trip_planning import place_text
from skills.perception.people import SeenPerson
from skills.perception.people_tracking import PeopleWatch
from skills.quantities import Coordinate, Duration, Speed
from skills.robot import FloatArray, Pose2D
from skills.routine import Routine, SkillFailure
from skills.world_model import PERSON

_SURELY_M = 0.1
"""Distance inside the edge of a place beyond which a person is certainly in it."""
_SAME_PLACE_M = 1.5
"""Distance from the place where the person was seen last at which somebody is that person."""
_WALKS_M_S = 0.25
"""Speed from which on a person walks."""
_IN_VIEW_S = 0.6
"""Age of the last view up to which a person is in view."""
_AT_POSE_M = 0.4
"""Distance from a pose of the search at which the robot is there; a radian counts half a metre."""
_NEW_GOAL_M = 0.3
"""Distance of a goal from which on the robot sets off; while it drives, the next one is that from the last goal."""
_CHANGED_GOAL_M = 0.1
_FAILED_DRIVES = 3
"""Number of drives in a row that failed after which another person may be in the way."""
_TRIED_AGAIN = (Cause.PLANNING, Cause.POSTCONDITION, Cause.EXECUTION)
_CLEARED_POINTS = 20
"""Number of last points of the trail about which the costmap is cleared."""
_CLEARED_M = 0.45
"""Radius about each of them."""
_LEFT_M = 0.7
"""Distance from the person beyond which the trail is cleared."""
_PERSON_M = 0.3
"""Radius of a person on a path."""
_BY_DOOR_M = 1.2
"""Distance from a doorway at which robot or person may stand in its way."""
_WAITED_SHARE = 0.25
"""Fraction of the search at the beginning after which a standing person without a picture is followed, too."""
_COMES_SHARE = 0.6
"""Fraction of a person's speed towards the robot from which on they come to it."""
_BETWEEN_M = 0.5
"""Distance beyond `near_m` up to which a person who stands in the named place is there."""


@dataclass(frozen=True)
class FollowPersonInputs:
    """The person's name for messages, and where the person was last seen, `place_W` (x, y); None: the nearest ahead.

    With the place `until` and its corners `until_W`, the skill ends once the person has stood there for 5 s. It also
    ends when somebody tells the robot to, and after `time_limit_s`.
    """

    person: str = "the person"
    place_W: tuple[Coordinate, Coordinate] | None = None
    until_W: tuple[tuple[Coordinate, Coordinate], ...] | None = None
    until: str = ""
    time_limit_s: Duration = 600.0
    max_speed_m_s: Speed = 1.2


def _at_pace(context: SkillContext, max_speed_m_s: float) -> SkillContext:
    """The context with its controller limited to walking speed, if the controller has a speed limit."""
    controller: Any = context.stack.controller
    if controller.max_speed_m_s == math.inf:
        return context
    limit_m_s = min(max_speed_m_s, context.robot.capabilities().max_speed_m_s)
    return replace(context, stack=replace(context.stack, controller=replace(controller, max_speed_m_s=limit_m_s)))


class _Told(Exception):  # noqa: N818 - no program error
    """Raised when somebody tells the robot to end."""


class FollowPerson(ListeningSkill[FollowPersonInputs]):
    """Keeps behind a walking person by LiDAR and body cameras; searches for a lost person, and asks. Uses navigate."""

    name = "follow_person"
    Inputs = FollowPersonInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE, Part.VOICE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nobody is seen, localisation is lost, or the robot refuses to drive",
        Cause.PLANNING: "no path leads to the person",
        Cause.EXECUTION: "the person is lost, or not told apart from others, a camera is at fault, or the robot loses "
        "localisation or its LiDAR, or refuses to drive on",
        Cause.TIMEOUT: "the person has not stood still in the place within the time limit",
    }
    default_timeout_s: ClassVar[float] = 1800.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}
    Options: ClassVar[type] = FollowPersonOptions
    options: FollowPersonOptions

    def __init__(self, context: SkillContext, options: FollowPersonOptions | None = None) -> None:
        super().__init__(context, options)
        self._target: Target | None = None
        self._company = Company(PeopleWatch(context, self.options.people))
        self._navigate = Navigate(_at_pace(context, self.options.max_speed_m_s), None, self._company)
        self._goal: Pose2D | None = None
        self._aside: Pose2D | None = None

    def begin(self, inputs: FollowPersonInputs) -> None:
        """Starts to look for the person."""
        super().begin(inputs)
        self._inputs, self._limit_s = inputs, self.context.clock.now() + inputs.time_limit_s
        self._outline, self._tries, self._silences = ArmFootprint(self.context).now(), 0, 0
        self._planned_s = self._aside_until_s = self._told_apart_s = -math.inf
        self._aside, self._made_way = None, False
        self._company.watch = PeopleWatch(self.context, self.options.people)

    def end(self) -> None:
        """Stops the base and stops listening."""
        self._halt()
        super().end()

    def suspend(self) -> None:
        """Stops the base; the person may walk on."""
        self._halt()
        super().suspend()

    def resume(self, inputs: FollowPersonInputs) -> None:
        """Looks for the person again, first at the last known position."""
        last_W = inputs.place_W if self._target is None else self._target.place_W(self.context.clock.now())
        self.begin(replace(inputs, place_W=last_W))

    def run(self, inputs: FollowPersonInputs) -> Routine[Succeeded]:
        """Finds the person and keeps behind them to the end. Raises SkillFailure when the person is not found."""
        try:
            self._target = yield from self._find(inputs)
            while not (yield from self._keep_behind(self._target)):
                self._target.doubt()
                yield from self._search(self._target)
        except _Told as told:
            return Succeeded(f'stopped following {self._inputs.person} when told "{told}"')
        self._halt()
        yield from self.pause(0.5, "coming to rest")
        if (lost_s := self._target.longest_loss_s) > self.options.longest_loss_s:
            why = f"is with {inputs.person} in the {inputs.until}, but had lost them for {lost_s:.0f} s on the way"
            raise SkillFailure(Cause.POSTCONDITION, why)
        return Succeeded(f"followed {self._inputs.person} to the {inputs.until or 'place'}")

    def _now(self) -> float:
        return self.context.clock.now()

    def _tick(self, message: str) -> Routine[None]:
        """Waits for a tick; looks and listens. Raises SkillFailure at the time limit, and _Told when told to end."""
        yield Running(message)
        company = self._company
        company.watch.step(np.zeros(3))
        if self._target is not None:
            self._target.update(company.watch.tracks(), company.others(), self._now())
            company.track = self._target.seen.track
        if self.remark is not None:
            raise _Told(self.remark)
        if self._now() > self._limit_s:
            for_s = f"for {self._inputs.time_limit_s:.0f} s"
            raise SkillFailure(Cause.TIMEOUT, f"followed {self._inputs.person} {for_s}")

    def _find(self, inputs: FollowPersonInputs) -> Routine[Target]:
        """Looks for the person to follow. Raises SkillFailure when nobody is seen."""
        self._target, begun_s = None, self._now()
        while self._now() < begun_s + self.options.finding_s:
            waited = self._now() - begun_s > _WAITED_SHARE * self.options.finding_s
            if (first := self._first(inputs, waited)) is not None:
                say(self.context, "I follow you.")
                return Target(first, self.context.pose(), self.options.target)
            yield from self._tick(f"looking for {self._inputs.person}")
        if faults := self._company.watch.faults:
            raise SkillFailure(Cause.EXECUTION, f"cannot see {self._inputs.person}: {faults[0]}")
        where = "ahead" if inputs.place_W is None else f"at {place_text(inputs.place_W)}"
        raise SkillFailure(Cause.PRECONDITION, f"nobody is seen {where}, so {self._inputs.person} cannot be followed")

    def _first(self, inputs: FollowPersonInputs, waited: bool) -> SeenPerson | None:
        """The nearest person ahead, or at the inputs' place; after a wait also a standing one that only scans show."""
        tracks, ahead_rad = self._company.watch.tracks(), self.options.ahead_rad
        reach_m = self.options.ahead_m if inputs.place_W is None else _SAME_PLACE_M * (2.0 if waited else 1.0)
        near = people_about(tracks, self.context.pose(), inputs.place_W, reach_m, ahead_rad)
        sure = {one.track for one in self._company.others()}
        known = [one for one in near if waited or one.track in sure]
        return min(known, key=lambda one: one.track not in sure, default=None)

    def _keep_behind(self, target: Target) -> Routine[bool]:
        """Follows until the person stands in the place (returns True), or is lost (returns False)."""
        place, self._told_apart_s = self._inputs.until_W, self._now()
        while (hidden_s := target.hidden_s(self._now())) < self.options.lost_s:
            if hidden_s > self.options.gone_s and self._goal is None:
                return False
            here, seen_W = self.context.pose(), target.seen.place_W
            if target.doubted is None:
                self._told_apart_s = self._now()
            elif not (yield from self._is_right(target, target.doubted)):
                return False
            near = not hidden_s and math.dist((here.x_m, here.y_m), seen_W) < self.options.near_m + _BETWEEN_M
            rests = near and target.doubted is None and target.stands_still(self._now())
            if rests and place and inside_polygon(np.array([seen_W]), place, -_SURELY_M).all():
                return True
            if rests and target.standing_s(self._now()) > self.options.standing_s:
                target.doubt()
            if self._now() >= self._planned_s + self.options.replan_s:
                self._planned_s = self._now()
                self._clear_trail(target, hidden_s)
                self._plan(self._next_pose(target, hidden_s))
            self._company.most_m_s = math.inf if hidden_s else self._speed_m_s(target)
            doing = f"following {self._inputs.person}" if not hidden_s else f"going to where {self._inputs.person} went"
            yield from self._tick(self._drive(doing))
        return False

    def _is_right(self, target: Target, before: SeenPerson) -> Routine[bool]:
        """Asks a doubtful person for their name, unless another person might answer.

        A person who says no, or is silent too often, is rejected. Raises SkillFailure with cause EXECUTION when other
        people have been near a doubtful person for too long.
        """
        here, seen, stands = self.context.pose(), target.seen, target.stands_still(self._now())
        tracks = [one for one in self._company.watch.tracks() if one.stamp_s > self._now() - _IN_VIEW_S]
        near = people_about(tracks, here, None, self.options.hearing_m, math.pi)
        if self._inputs.place_W is None:  # the person before the robot has no name
            target.doubted = None
        if target.doubted is None or len(near) < 2:
            self._told_apart_s = self._now()
        elif (unclear_s := self._now() - self._told_apart_s) > self.options.doubtful_s:
            why = f"{self._inputs.person} could not be told apart from others for {unclear_s:.0f} s"
            raise SkillFailure(Cause.EXECUTION, why)
        in_sight = self._is_clear(np.array([(here.x_m, here.y_m), seen.place_W]))
        unnamed = self._inputs.person == PERSON  # nobody without a name can say that it is them
        if target.doubted is None or unnamed or not is_addressed(seen, near, here, still=stands, in_sight=in_sight):
            return True
        if stands:
            self._halt()
            self._plan(self._turned(here, seen.place_W))
        answer = yield from self.ask_for_name(
            self._inputs.person,
            self.options.answer_s,
            tick=lambda: self._tick(self._drive("asking who it is")),
            enough=lambda: not stands and target.hidden_s(self._now()) > 0.0,
        )
        if answer is None:
            return True
        self._silences = self._silences + 1 if answer not in ("yes", "no") else 0
        if answer == "yes":
            target.trust()
        elif answer == "no" or self._silences >= self.options.silences:
            self._silences = 0
            target.reject(before)
            return False
        return True

    def _search(self, target: Target) -> Routine[None]:
        """Searches doors where a lost person was heading, then asks. Raises SkillFailure when they are not found."""
        say(self.context, "I have lost sight of you.")
        self._company.most_m_s = math.inf
        if self._inputs.place_W is not None and self._inputs.person != PERSON:  # the robot asks for the name
            target.farthest_m = math.inf
        doors, here = self.context.doors, self.context.pose
        for goal in poses_to_search(target, doors, self._inputs.until_W, self.options.doors, here, self._free):
            self._halt()
            until_s, tries = self._now() + self.options.search_s, 0
            while _apart_m(goal, self.context.pose()) > _AT_POSE_M and self._now() < until_s:
                if self._goal is None and self._now() >= self._planned_s + self.options.again_s:
                    if (tries := tries + 1) > self.options.plans:
                        break
                    self._planned_s = self._now()
                    self._plan(goal)
                yield from self._tick(self._drive(f"searching {self._inputs.person}"))
                if not target.hidden_s(self._now()):
                    return
        self._halt()
        say(self.context, "I lost you. Where are you?")
        until_s = self._now() + self.options.asking_s
        while self._now() < until_s:
            yield from self._tick(f"waiting for {self._inputs.person}")
            if not target.hidden_s(self._now()):
                return
        last = f"seen last at {place_text(target.seen.place_W)} {target.hidden_s(self._now()):.0f} s ago"
        raise SkillFailure(Cause.EXECUTION, f"{self._inputs.person} is lost, {last}")

    def _plan(self, goal: Pose2D | None) -> None:
        """Starts or changes the drive to a goal; None keeps the present goal."""
        now = self._goal or self.context.pose()
        if goal is None or _apart_m(goal, now) < (_CHANGED_GOAL_M if self._goal else _NEW_GOAL_M):
            return
        inputs = NavigateInputs(goal, 0.15, 0.35, self._inputs.max_speed_m_s)
        if self._goal is None:
            self._navigate.begin(inputs)
        elif not self._navigate.retarget(inputs):
            return
        else:
            self._tries = 0
        self._goal = goal

    def _drive(self, doing: str) -> str:
        """Drives for one tick; returns the message. Raises SkillFailure when the robot cannot drive any longer."""
        if self._goal is None:
            return doing
        step = self._navigate.step()
        if isinstance(step, Running):
            return f"{doing}: {step.message}"
        self._halt()
        self._tries = self._tries + 1 if isinstance(step, Failed) else 0
        if isinstance(step, Failed):
            self._planned_s = self._now() + self.options.replan_s
            if step.cause not in _TRIED_AGAIN or self._tries > self.options.tries:
                raise SkillFailure(step.cause, step.message)
        return doing

    def _halt(self) -> None:
        """Stops the drive."""
        self._goal = None
        self._navigate.end()

    def _speed_m_s(self, target: Target) -> float:
        """Speed limit that keeps the distance to the person; unlimited on a path that leads away from them."""
        here, options, place_W = self.context.pose(), self.options, target.place_W(self._now())
        distance_m = math.dist((here.x_m, here.y_m), place_W)
        if self._goal is None or math.dist((self._goal.x_m, self._goal.y_m), place_W) > distance_m:
            return math.inf
        return max(0.0, target.away_m_s(here)) + options.gain * max(0.0, distance_m - options.close_m)

    def _next_pose(self, target: Target, hidden_s: float) -> Pose2D | None:
        """The next goal: behind the person, or aside when the person comes towards the robot.

        After `_FAILED_DRIVES` drives that failed in a row, it is aside from the path of the nearest other person.
        """
        here, now_s, options = self.context.pose(), self._now(), self.options
        near = not hidden_s and math.dist((here.x_m, here.y_m), target.seen.place_W) < options.meeting_m
        away_m_s, blocks = target.away_m_s(here), near and self._blocks_door(target, here)
        if blocks or (near and away_m_s < -max(_WALKS_M_S, _COMES_SHARE * target.speed_m_s)):
            if now_s >= self._aside_until_s:
                self._aside = self._pose_aside(np.vstack([target.trail, line_through(target.seen, here, 0.0)]), here)
            self._aside_until_s = now_s + options.aside_s
        elif self._tries >= _FAILED_DRIVES and now_s >= self._aside_until_s:
            others = people_about(self._company.others(), here, None, options.meeting_m, math.pi)
            self._aside = self._pose_aside(line_through(others[0], here, options.meeting_m), here) if others else None
            self._aside_until_s = now_s + options.aside_s if self._aside else -math.inf
        elif away_m_s > _WALKS_M_S:
            self._aside_until_s = -math.inf
        return self._aside if now_s < self._aside_until_s else self._pose_behind(target, hidden_s)

    def _blocks_door(self, target: Target, here: Pose2D) -> bool:
        """Returns True once when the person has stood still by a doorway, perhaps because the robot blocks it."""
        made_way, self._made_way = self._made_way, target.stands_still(self._now())
        if made_way or not self._made_way:
            return False
        places_W = (here.x_m, here.y_m), target.seen.place_W
        return any(door.distance_m(place_W) < _BY_DOOR_M for door in self.context.doors for place_W in places_W)

    def _pose_aside(self, path_W: FloatArray, here: Pose2D) -> Pose2D | None:
        """The nearest pose off a person's path (N, 2)."""
        paths = with_discs(NoObstacles(), np.column_stack([path_W, np.full(len(path_W), _PERSON_M)]))
        giving_way = GivingWayOptions(reach_m=self.options.aside_m)
        return pose_aside(self.context.free_space(), paths, self._outline, here, giving_way)

    def _pose_behind(self, target: Target, hidden_s: float) -> Pose2D | None:
        """The nearest free pose behind the person on their trail; None when the robot should stay.

        While the person is hidden, it is relative to their last known position.
        """
        here, options, walks = self.context.pose(), self.options, target.speed_m_s > _WALKS_M_S
        end_W = np.array(target.place_W(self._now() + (options.ahead_s if walks and not hidden_s else 0.0)))
        distance_m = math.dist((here.x_m, here.y_m), end_W)
        near_m = options.behind_m if walks else options.near_m
        if not hidden_s and (options.close_m - 0.1 if not walks else 0.0) < distance_m < near_m:
            return self._turned(here, target.seen.place_W)
        trail = target.trail if hidden_s else np.vstack([target.trail, end_W])
        behind_m = 0.0 if hidden_s else options.behind_m
        straight = np.array([(here.x_m, here.y_m), end_W])
        if not hidden_s and distance_m > behind_m and self._is_clear(straight):
            trail = straight
        away_m = (options.behind_m, options.close_m, options.near_m) if behind_m else ()
        along, around = poses_behind(trail, behind_m), poses_around(end_W, here, away_m, self.context.costmap)
        poses = [*along, *around] if walks else [*around, *along]
        return self._free(np.array(poses).reshape(-1, 3))

    def _turned(self, here: Pose2D, place_W: tuple[float, float]) -> Pose2D | None:
        """Pose on the spot that faces a person; None when the robot nearly faces them already or cannot turn."""
        turn_rad = bearing_rad(here, place_W)
        if abs(turn_rad) < self.options.turn_rad:
            return None
        return self._free(np.array([(here.x_m, here.y_m, wrap(here.yaw_rad + turn_rad))]))

    def _clear_trail(self, target: Target, hidden_s: float) -> None:
        """Clears the costmap where the person has walked: behind a jamb the LiDAR cannot see that they have left."""
        trail = target.trail[-_CLEARED_POINTS:]
        left = np.linalg.norm(trail - target.seen.place_W, axis=1) > (-1.0 if hidden_s else _LEFT_M)
        if isinstance(self.context.costmap, ClearableCostmap) and left.any():
            self.context.costmap.clear_obstacles(np.column_stack([trail[left], np.full(left.sum(), _CLEARED_M)]))

    def _is_clear(self, straight: FloatArray) -> bool:
        """Returns whether the robot can drive straight from one point to `close_m` before another one (2, 2)."""
        start, along = straight[0], straight[1] - straight[0]
        length_m = float(np.linalg.norm(along))
        share = max(0.0, 1.0 - self.options.close_m / max(length_m, 1e-3))
        points = np.linspace(start, start + share * along, 1 + math.ceil(length_m / 0.1))
        return bool(self.context.free_space().clearance_m(points).min() > self._outline.inscribed_m + SAFE_MARGIN_M)

    def _free(self, poses: FloatArray) -> Pose2D | None:
        """The first pose in (N, 3) with enough clearance."""
        clear = footprint_clearance_m(self.context.free_space(), self._outline, poses) > SAFE_MARGIN_M
        return Pose2D(*poses[int(np.argmax(clear))].tolist()) if clear.any() else None


def _apart_m(a: Pose2D, b: Pose2D) -> float:
    """Distance between two poses (m); a radian counts as half a metre."""
    return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) + 0.5 * abs(wrap(a.yaw_rad - b.yaw_rad))
