"""The followed person: the track of one person through crossings and gaps, and the trail behind them."""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Final

import numpy as np

from skills.api import FreeSpace
from skills.doorway import Doorway
from skills.geometry import bearing_rad, inside_polygon, line_of_sight, wrap
from skills.perception.people import SeenPerson
from skills.perception.people_tracking import PeopleOptions, predicted_place_W
from skills.quantities import Delay, Duration, Factor, Length, Speed, Tries, Turn
from skills.robot import FloatArray, Pose2D

_TRAIL_STEP_M = 0.1
_ONE_BODY_M = 0.6
"""Distance within which two tracks may be parts of one person."""
_TRAIL_POINTS = 100
_BACK_M = 3.0
"""Length of the trail on which the robot looks for a free pose."""
_ROUND: Final = np.array([0.3 * (n // 2) * (-1) ** n for n in range(1, 22)])
"""Angles (rad) round a person, from the nearest to the farthest."""
_BODY_M = 0.4
_STANDS_M_S = 0.2
_FACES_RAD = 0.9
"""Bearing up to which the robot faces a person."""
_LOST_M = 5.0
"""A person farther from the robot is lost."""
_GAP_M = 1.5
"""Distance from the trail at which a person was seen again and a new trail begins."""
_LOOP_M = 0.4
"""Distance from an earlier point of the trail at which the person has come back to it."""
_LOOP_POINTS = 8
"""Number of last points of the trail that are not earlier ones."""
_POSE_STEP_M = 0.15
"""Distance of poses along the trail."""
_BEYOND_DOOR_M = (1.0, 1.4, 0.7, -0.8)
"""Distances beyond a door from which the robot looks for the person."""
_AHEAD_COUNTS_M = 1.5
"""Distance by which a door straight ahead of a lost person counts as nearer."""
_SCAN_S = 0.2
"""Time between two scans, by which a view may be late."""
_LINE_POINTS = 20


@dataclass(frozen=True)
class TargetOptions:
    """Conditions under which a new track continues the person's track after a gap.

    `hidden_s`: without a detection for this long, the person is hidden. `again_m`, `again_m_s` and `farthest_m`:
    largest distance of a later track from the prediction, its growth per second, and its limit. `sure_s`: longest gap
    after which the person is not doubtful; a track farther than `again_m`, or another person within `close_m`, also
    makes them doubtful. `still_s` and `still_m`: a person stands still while all positions in this time lie within this
    distance.
    """

    hidden_s: Delay = 0.6
    sure_s: Delay = 1.0
    close_m: Length = 0.9
    again_m: Length = 0.8
    again_m_s: Speed = 0.7
    farthest_m: Length = 3.0
    still_s: Delay = 5.0
    still_m: Length = 0.5


def people_about(
    people: Sequence[SeenPerson], here: Pose2D, place_W: tuple[float, float] | None, reach_m: float, ahead_rad: float
) -> list[SeenPerson]:
    """People within reach_m, the nearest first: of a place, or if it is None of the robot and only ahead of it."""
    centre_W = (here.x_m, here.y_m) if place_W is None else place_W
    about = (one for one in people if math.dist(one.place_W, centre_W) <= reach_m)
    ahead = [one for one in about if place_W is not None or abs(bearing_rad(here, one.place_W)) < ahead_rad]
    return sorted(ahead, key=lambda one: math.dist(one.place_W, centre_W))


def is_addressed(one: SeenPerson, near: Sequence[SeenPerson], here: Pose2D, *, still: bool, in_sight: bool) -> bool:
    """Returns whether only this person would answer a question; `near` are all people nearby, sorted by distance.

    The person must be the nearest, and ahead of the robot. A person who stands `still` may also be the nearest one
    ahead, not occluded (`in_sight`), or the nearest of all if nobody is ahead.
    """
    faced = [each for each in near if abs(bearing_rad(here, each.place_W)) < _FACES_RAD]
    first = next(iter(faced or near if still else faced), None)
    is_first = first is not None and first.place_W == one.place_W
    return is_first and (near[0].place_W == one.place_W or (still and in_sight))


@dataclass(frozen=True)
class FollowPersonOptions:
    """Distances (m) between the centres of robot and person, and patience (s).

    `behind_m`, `ahead_s` and `replan_s`: the robot drives to this distance behind where the person will be after
    `ahead_s`, and plans again every `replan_s`. `close_m`: it slows down to stand here. `near_m` and `turn_rad`: it
    stays while a standing person is this near, and turns to one farther to the side. `meeting_m`, `aside_m` and
    `aside_s`: for a person who comes towards it, when, how far and how long it goes aside. `lost_s` and `gone_s`: a
    hidden person is lost after this time, or after `gone_s` once the robot stands at the last known position. `doors`,
    `search_s`, `plans` and `again_s`: it then searches beyond so many doors and in the named place, each for this time
    or number of plans; `asking_s`: then it asks and listens. `hearing_m`, `answer_s` and `silences`: a doubtful person
    within this distance is asked for the name, has this time, and is rejected after so many silences. `doubtful_s`: it
    fails when others have been near a doubtful person for longer. `standing_s`: it also asks a person who stands this
    long outside the named place. `finding_s`: time to find the person at the beginning. `tries` and `longest_loss_s`:
    it fails after so many failed drives in a row, and at the end when the person was out of sight for longer.
    """

    behind_m: Length = 1.6
    close_m: Length = 1.35
    near_m: Length = 2.0
    meeting_m: Length = 2.5
    aside_m: Length = 4.0
    aside_s: Delay = 5.0
    ahead_s: Duration = 0.8
    replan_s: Duration = 0.5
    gain: Factor = 1.0
    lost_s: Delay = 6.0
    gone_s: Delay = 1.5
    finding_s: Delay = 8.0
    asking_s: Delay = 12.0
    search_s: Delay = 20.0
    plans: Tries = 6
    again_s: Duration = 1.0
    hearing_m: Length = 2.8
    answer_s: Delay = 5.0
    standing_s: Delay = 30.0
    silences: Tries = 2
    doubtful_s: Duration = 20.0
    doors: Tries = 3
    tries: Tries = 60
    longest_loss_s: Delay = 12.0
    max_speed_m_s: Speed = 1.2
    ahead_rad: Turn = 1.2
    turn_rad: Turn = 0.6
    ahead_m: Length = 4.0
    target: TargetOptions = field(default_factory=TargetOptions)
    people: PeopleOptions = field(default_factory=lambda: PeopleOptions(period_s=1.0, track_m=7.0))


class Target:
    """The followed person: the last detection `seen`, and how far (`farthest_m`) a track that continues it may be.

    `doubted` is the last reliable detection while the present person is doubtful. `longest_loss_s` is the longest time
    without the person near the robot.
    """

    def __init__(self, first: SeenPerson, here: Pose2D, options: TargetOptions) -> None:
        self.seen, self._options, self.farthest_m = first, options, options.farthest_m
        self.doubted: SeenPerson | None = None
        self.longest_loss_s, self._near_s, self._walked_s = 0.0, first.stamp_s, first.stamp_s
        self._trail = [(here.x_m, here.y_m), first.place_W]
        self._others: set[int] = set()
        self._others_before: frozenset[int] = frozenset()
        self._others_W: list[tuple[float, float]] = []
        self._places: deque[tuple[float, tuple[float, float]]] = deque([(first.stamp_s, first.place_W)])

    @property
    def speed_m_s(self) -> float:
        """Speed of the person at the last detection."""
        return math.hypot(*self.seen.velocity_W)

    @property
    def trail(self) -> FloatArray:
        """Points (N, 2) on the person's path up to the last detection, beginning at the robot; loops are removed."""
        return np.array(self._trail)

    def hidden_s(self, now_s: float) -> float:
        """Time since the last detection; 0 while the person is in view."""
        age_s = now_s - self.seen.stamp_s
        return age_s if age_s > self._options.hidden_s else 0.0

    def place_W(self, now_s: float) -> tuple[float, float]:
        """Predicted position (x, y) of the person now."""
        return predicted_place_W(self.seen, now_s)

    def stands_still(self, now_s: float) -> bool:
        """Returns whether the person has stood still for `still_s`."""
        long_enough = now_s - self._places[0][0] >= self._options.still_s - _SCAN_S
        last_W = self.seen.place_W
        return long_enough and all(math.dist(place, last_W) < self._options.still_m for _, place in self._places)

    def standing_s(self, now_s: float) -> float:
        """Time for which the person has stood still since the robot last confirmed them."""
        return now_s - self._walked_s

    def away_m_s(self, here: Pose2D) -> float:
        """Speed at which the person moves away from the robot; negative towards it."""
        off = np.array(self.seen.place_W) - (here.x_m, here.y_m)
        return float(off @ self.seen.velocity_W) / max(float(np.linalg.norm(off)), 1e-3)

    def update(self, tracks: Sequence[SeenPerson], others: Sequence[SeenPerson], now_s: float) -> None:
        """Updates the person from the present tracks; `others` are tracks known to be other people."""
        self.longest_loss_s = max(self.longest_loss_s, now_s - self._near_s)
        one = next((one for one in tracks if one.track == self.seen.track), None)
        if one is None or now_s - one.stamp_s > self._options.hidden_s:
            one = self._again(tracks, now_s) or one
        if one is not None and one.stamp_s > self.seen.stamp_s:
            off_m = math.dist(one.place_W, self.place_W(now_s))
            strange = one.track != self.seen.track or off_m > self._options.again_m
            again = strange and self.hidden_s(now_s) > self._options.sure_s
            if again and math.dist(self._trail[-1], one.place_W) > _GAP_M:
                self._trail = [(one.here_W.x_m, one.here_W.y_m)]
            if again or any(math.dist(each.place_W, one.place_W) < self._options.close_m for each in others):
                self.doubt()
            self.seen = one
            self._near_s = one.stamp_s if one.distance_m < _LOST_M else self._near_s
            self._note(one)
            apart = (each for each in tracks if math.dist(each.place_W, one.place_W) > _ONE_BODY_M)
            self._others |= {each.track for each in apart if now_s - each.stamp_s < self._options.hidden_s}

    def doubt(self) -> None:
        """Marks the person in view as doubtful."""
        if self.doubted is None:
            self.doubted, self._others_before = self.seen, frozenset(self._others)

    def trust(self) -> None:
        """Accepts the present person as the followed one."""
        self.doubted, self.farthest_m, self._walked_s = None, self._options.farthest_m, self.seen.stamp_s

    def reject(self, before: SeenPerson) -> None:
        """Marks the present person as another one; the followed person was last detected in `before`."""
        self._others = {*self._others_before, self.seen.track}
        self._others_W.append(self.seen.place_W)
        self._near_s = before.stamp_s
        self.seen, self.doubted = replace(before, track=0), None

    def _note(self, one: SeenPerson) -> None:
        """Extends the trail to the person; removes a loop."""
        if math.dist(self._trail[-1], one.place_W) >= _TRAIL_STEP_M:
            old = self._trail[:-_LOOP_POINTS]
            back = next((n for n, point in enumerate(old) if math.dist(point, one.place_W) < _LOOP_M), None)
            self._trail = [*(self._trail if back is None else self._trail[: back + 1]), one.place_W][-_TRAIL_POINTS:]
        self._places.append((one.stamp_s, one.place_W))
        if not self.stands_still(one.stamp_s):
            self._walked_s = one.stamp_s
        while self._places[0][0] < one.stamp_s - self._options.still_s:
            self._places.popleft()

    def _again(self, people: Sequence[SeenPerson], now_s: float) -> SeenPerson | None:
        """Continuation of the person's track after a gap: the nearest track to the prediction, without other people."""
        options, expected_W = self._options, self.place_W(now_s)
        reach_m = min(options.again_m + options.again_m_s * self.hidden_s(now_s), self.farthest_m)
        new = [
            each
            for each in people
            if each.track not in self._others and each.stamp_s > self.seen.stamp_s and not self._was_rejected(each)
        ]
        near = [each for each in new if math.dist(each.place_W, expected_W) <= reach_m]
        return min(near, key=lambda each: math.dist(each.place_W, expected_W), default=None)

    def _was_rejected(self, one: SeenPerson) -> bool:
        """Returns whether a person stands at the position of a rejected one."""
        stands = math.hypot(*one.velocity_W) < _STANDS_M_S
        return stands and any(math.dist(one.place_W, place_W) < _ONE_BODY_M for place_W in self._others_W)


def poses_behind(trail: FloatArray, behind_m: float) -> Iterator[tuple[float, float, float]]:
    """Poses on a trail at least behind_m before its end, nearest first: along the trail, and facing its end."""
    end, back_m = trail[-1], 0.0
    for n in range(len(trail) - 1, 0, -1):
        length = float(np.linalg.norm(trail[n] - trail[n - 1]))
        back_m += length
        if back_m - length > behind_m + _BACK_M:
            return
        along = math.atan2(*(trail[n] - trail[n - 1])[::-1])
        for point in np.linspace(trail[n], trail[n - 1], max(1, math.ceil(length / _POSE_STEP_M)), endpoint=False):
            if np.linalg.norm(end - point) >= behind_m:
                for yaw in (along, math.atan2(*(end - point)[::-1])) if n < len(trail) - 1 else (along,):
                    yield float(point[0]), float(point[1]), yaw


def poses_around(
    person_W: FloatArray, here: Pose2D, away_m: Sequence[float], costmap: FreeSpace
) -> Iterator[tuple[float, float, float]]:
    """Poses at the distances `away_m` that face a person (2,) without occlusion, nearest to `here` first."""
    angles = math.atan2(*(np.array((here.x_m, here.y_m)) - person_W)[::-1]) + _ROUND
    for distance_m in away_m:
        points_W = person_W + distance_m * np.column_stack([np.cos(angles), np.sin(angles)])
        visible = line_of_sight(costmap, person_W, points_W, beyond_m=_BODY_M)
        for (x, y), angle in zip(points_W[visible], angles[visible], strict=True):
            yield float(x), float(y), wrap(float(angle) + math.pi)


def poses_to_search(
    target: Target,
    doors: Sequence[Doorway],
    until_W: tuple[tuple[float, float], ...] | None,
    most_doors: int,
    here: Callable[[], Pose2D],
    free: Callable[[FloatArray], Pose2D | None],
) -> Iterator[Pose2D]:
    """Yields poses beyond the likeliest door, in the area until_W if the person headed there, and beyond more doors.

    `free` returns the first pose with enough clearance.
    """
    likely = filter(None, map(free, _poses_beyond_doors(target, doors, most_doors, here)))
    yield from islice(likely, 1)
    for door in doors if until_W else ():
        for yaw in (door.through_rad, wrap(door.through_rad + math.pi)):
            beyond = _poses_beyond(door, yaw)
            if inside_polygon(beyond[:1, :2], until_W or ()).all() and (pose := free(beyond)) is not None:
                yield pose
    yield from likely


def _poses_beyond_doors(
    target: Target, doors: Sequence[Doorway], most: int, here: Callable[[], Pose2D]
) -> Iterator[FloatArray]:
    """Yields poses (N, 3) beyond each door that the person may have taken: from room to room by the likeliest door."""
    place_W, heading, left = np.array(target.seen.place_W), np.array(target.seen.velocity_W), [*doors]

    def unlikely_m(door: Doorway) -> float:
        off = np.array(door.middle_W) - place_W
        along = float(off @ heading) / max(float(np.linalg.norm(off) * np.linalg.norm(heading)), 1e-3)
        return float(np.linalg.norm(off)) - _AHEAD_COUNTS_M * along

    for _ in range(min(most, len(left))):
        door = min(left, key=unlikely_m)
        left.remove(door)
        pose, middle_W = here(), np.array(door.middle_W)
        heading = np.array([math.cos(door.through_rad), math.sin(door.through_rad)])
        heading *= math.copysign(1.0, float((middle_W - (pose.x_m, pose.y_m)) @ heading))
        place_W = middle_W + heading
        yield _poses_beyond(door, math.atan2(*heading[::-1]))


def _poses_beyond(door: Doorway, yaw_rad: float) -> FloatArray:
    """Poses (N, 3) beyond a door in a direction; the last is in front of it, where the robot sees into the room."""
    x, y = door.middle_W
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([(x + far_m * c, y + far_m * s, yaw_rad) for far_m in _BEYOND_DOOR_M])


def line_through(one: SeenPerson, here: Pose2D, beyond_m: float) -> FloatArray:
    """Points (20, 2) on the line from a person through the robot, extended by beyond_m."""
    off = np.array((here.x_m, here.y_m)) - one.place_W
    return np.array(
        one.place_W
        + np.linspace(0.0, 1.0 + beyond_m / max(float(np.linalg.norm(off)), 1e-3), _LINE_POINTS)[:, None] * off
    )
