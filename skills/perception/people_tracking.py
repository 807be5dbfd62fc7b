"""Tracking of people by LiDAR scans and body camera pictures together, and the watch that provides both.

Each person is a Kalman filter with constant velocity; detections are assigned to filters at the lowest total cost.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Job, ObstacleLayerView, SkillContext, SurveyView
from skills.geometry import relative_pose
from skills.perception.people import (
    ARM_AHEAD_M,
    STOWED_AHEAD_M,
    SeenPerson,
    cameras_towards,
    located_people,
    people_detections,
    people_in_scan,
    pictures_with_depth,
)
from skills.perception.point_cloud import camera_pose_W, project
from skills.quantities import Count, Delay, Duration, Length, Margin, Share, Turn
from skills.robot import CameraCapabilities, FloatArray, Image, Pose2D
from skills.world_model import PERSON

_ACCELERATION_M_S2 = 1.5
_SPEED_SIGMA_M_S = 1.0
_LEAST_SIGMA_M = 0.05
_PREDICTED_S = 1.5
"""Longest time over which a person is taken to keep the velocity."""
_GATE = 16.0
"""Largest squared Mahalanobis distance of a detection from its track."""
_GROWTH_M_S = 0.5
"""Growth of the largest distance to a track's prediction while the person is hidden."""
_MOST_GROWTH_M = 1.0
_NO_MATCH = 1e6


@dataclass(frozen=True)
class _Track:
    """One person: last detection, the state (x, y, vx, vy) then, its covariance (4, 4), and where the track began."""

    seen: SeenPerson
    state: FloatArray
    covariance: FloatArray
    begun_W: tuple[float, float]

    def at(self, stamp_s: float) -> tuple[FloatArray, FloatArray]:
        """Predicts state and covariance at a time not before the last detection."""
        dt_s = max(0.0, stamp_s - self.seen.stamp_s)
        move = np.eye(4)
        move[0, 2] = move[1, 3] = min(dt_s, _PREDICTED_S)
        gain = np.array([[0.5 * dt_s**2, 0.0], [0.0, 0.5 * dt_s**2], [dt_s, 0.0], [0.0, dt_s]])
        state = move @ self.state
        return state, move @ self.covariance @ move.T + _ACCELERATION_M_S2**2 * gain @ gain.T


def predicted_place_W(one: SeenPerson, now_s: float) -> tuple[float, float]:
    """Position (x, y) of a person now, with the last velocity continued for a short time at most."""
    ahead_s = min(max(0.0, now_s - one.stamp_s), _PREDICTED_S)
    return one.place_W[0] + ahead_s * one.velocity_W[0], one.place_W[1] + ahead_s * one.velocity_W[1]


class PeopleTracker:
    """Tracks people and gives each a number that stays; detections farther than `same_m` are other people."""

    def __init__(self, same_m: float = 0.7) -> None:
        self._same_m = same_m
        self._tracks: list[_Track] = []
        self._count = 0

    @property
    def people(self) -> tuple[SeenPerson, ...]:
        """All people, by track number."""
        return tuple(track.seen for track in self._tracks)

    def revise(self, change: Callable[[SeenPerson], SeenPerson | None]) -> None:
        """Replaces each person by what `change` returns; removes the person when that is None."""
        revised = [(track, change(track.seen)) for track in self._tracks]
        self._tracks = [replace(track, seen=seen) for track, seen in revised if seen is not None]

    def update(self, found: Sequence[SeenPerson], *, by_scan: bool, apart_m: float, births: bool = True) -> None:
        """Updates with the people in one scan or picture; with `births` those without a track begin one.

        A second detection within apart_m of a person who is detected at the same time is the same person.
        """
        matched = self._assigned(found)
        for index, one in enumerate(found):
            if index in matched:
                self._tracks[matched[index]] = _corrected(self._tracks[matched[index]], one, by_scan)
        for index, one in enumerate(found):
            if index not in matched and births and not self._is_known(one, apart_m):
                self._count += 1
                self._tracks.append(_begun(one, self._count, by_scan))

    def _is_known(self, one: SeenPerson, apart_m: float) -> bool:
        """Returns whether a detection is a person who was detected at the same time."""
        people = (seen for seen in self.people if seen.stamp_s >= one.stamp_s)
        return any(math.dist(seen.place_W, one.place_W) <= apart_m for seen in people)

    def _assigned(self, found: Sequence[SeenPerson]) -> dict[int, int]:
        """Assigns detections to tracks: the index of the track by the index of the detection."""
        if not found or not self._tracks:
            return {}
        costs = np.array([[self._cost(track, one) for track in self._tracks] for one in found])
        if 1 in costs.shape:
            rows, columns = np.unravel_index([np.argmin(costs)], costs.shape)
        else:
            from scipy.optimize import linear_sum_assignment  # takes half a second

            rows, columns = linear_sum_assignment(costs)
        return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if costs[i, j] < _NO_MATCH}

    def _cost(self, track: _Track, one: SeenPerson) -> float:
        """Cost of assigning a detection to a track: its negative log likelihood."""
        state, covariance = track.at(one.stamp_s)
        off = _place_then(track, one) - state[:2]
        hidden_s = max(0.0, one.stamp_s - track.seen.stamp_s - _PREDICTED_S)
        if math.hypot(*off) > self._same_m + min(_MOST_GROWTH_M, _GROWTH_M_S * hidden_s):
            return _NO_MATCH
        spread = covariance[:2, :2] + _sigma2(one)
        distance = float(off @ np.linalg.solve(spread, off))
        return distance + math.log(max(float(np.linalg.det(spread)), 1e-12)) if distance < _GATE else _NO_MATCH


def _sigma2(one: SeenPerson) -> FloatArray:
    """Covariance (2, 2) of a detection, with a lower limit."""
    return np.asarray(one.covariance + _LEAST_SIGMA_M**2 * np.eye(2))


def _place_then(track: _Track, one: SeenPerson) -> FloatArray:
    """Position of a detection, moved with the person if the track has a later detection already."""
    return np.array(one.place_W) + max(0.0, track.seen.stamp_s - one.stamp_s) * track.state[2:]


def _begun(one: SeenPerson, number: int, by_scan: bool) -> _Track:
    """New track for a person detected for the first time."""
    covariance = np.diag([0.0, 0.0, _SPEED_SIGMA_M_S**2, _SPEED_SIGMA_M_S**2])
    covariance[:2, :2] = _sigma2(one)
    picture_s = -math.inf if by_scan else one.stamp_s
    seen = replace(one, track=number, looks=int(not by_scan), scans=int(by_scan), picture_s=picture_s)
    return _Track(seen, np.array([*one.place_W, 0.0, 0.0]), covariance, one.place_W)


def _corrected(track: _Track, one: SeenPerson, by_scan: bool) -> _Track:
    """Track after the correction by a detection of the person."""
    before = track.seen
    state, covariance = track.at(one.stamp_s)
    gain = np.linalg.solve(covariance[:2, :2] + _sigma2(one), covariance[:2]).T
    state = state + gain @ (_place_then(track, one) - state[:2])
    covariance = covariance - gain @ covariance[:2]
    x, y, vx, vy = (float(value) for value in state)
    again = not by_scan and one.stamp_s > before.picture_s
    seen = replace(
        one,
        place_W=(x, y),
        covariance=covariance[:2, :2],
        stamp_s=max(one.stamp_s, before.stamp_s),
        looks=before.looks + int(again),
        picture_s=one.stamp_s if again else before.picture_s,
        missed=before.missed if by_scan else 0,
        score=before.score if by_scan else one.score,
        track=before.track,
        velocity_W=(vx, vy),
        scans=before.scans + int(by_scan),
        top_m=max(before.top_m, one.top_m),
        moved_m=max(before.moved_m, math.dist((x, y), track.begun_W)),
    )
    return replace(track, seen=seen, state=state, covariance=covariance)


PEOPLE_TOPIC: Final = "people"
_HEIGHTS_M: Final = (0.2, 0.6, 1.0)
_NEAREST_M: Final = 0.3
_WELL_INSIDE: Final = 0.35
SCAN_APART_M: Final = 0.35
"""Distance within which two detections of one scan are one person."""
_SAME_PLACE_M: Final = 0.05
_SAME_YAW_RAD: Final = 0.05
_TRACKED_S: Final = 0.3
"""Age up to which a person counts as tracked: scans come three times as often."""
_FRESH_S: Final = 2.0
"""Age up to which an obstacle counts as seen now: both front cameras have looked for low ones in this time."""


@dataclass(frozen=True)
class PeopleOptions:
    """Periods of the watch (s), the latency of a detection (s), and conditions for a person to count.

    `period_s`: time between pictures of a camera that has, within `near_m` and `view_rad` of its axis, a known person
    or a costmap cell that the map does not explain; all other cameras take none. `known_s`: the same where nothing
    but known people is in view. `same_m` and `least_score`: a person counts when two views this near show them with
    this score. `again_s`: delay of the second view. `misses`: pictures that should show a person and do not until
    they are forgotten. `memory_s` and `beside_s`: how long a person out of view is remembered, and how long while the
    costmap has an obstacle within `beside_m`.

    LiDAR scans update known people. `track_m`: up to this distance scans also begin tracks (0: never), which are
    remembered for `hidden_s`, or for `fleeting_s` after fewer than `least_scans` scans.
    """

    period_s: Duration = 0.5
    known_s: Duration = 1.0
    near_m: Length = 5.0
    view_rad: Turn = 1.0
    again_s: Delay = 0.2
    latency_s: Delay = 0.15
    least_score: Share = 0.5
    reach_m: Length = 4.0
    same_m: Length = 0.7
    misses: Count = 3
    memory_s: Delay = 2.0
    beside_s: Delay = 10.0
    beside_m: Margin = 0.5
    track_m: Margin = 0.0
    hidden_s: Delay = 4.0
    fleeting_s: Delay = 0.5
    least_scans: Count = 4


@dataclass(frozen=True)
class _Look:
    """People located in pictures taken at one time, and the pictures in which nobody was detected without depth.

    `faults` say why other cameras gave no picture in which people can be located.
    """

    found: tuple[Sequence[SeenPerson], ...]
    images: tuple[Image, ...]
    faults: Sequence[str]
    X_WO: RigidTransform
    here_W: Pose2D

    def shows(self, one: SeenPerson, reach_m: float) -> bool:
        """Returns whether a still person would be visible: from the pose of the last view, or well in a picture."""
        off = relative_pose(one.here_W, self.here_W)
        again = not one.scans and not self.faults
        if again and math.hypot(off.x_m, off.y_m) < _SAME_PLACE_M and abs(off.yaw_rad) < _SAME_YAW_RAD:
            return True
        upright_W = np.array([[*one.place_W, height_m] for height_m in _HEIGHTS_M])
        return any(_is_inside(image, self.X_WO, upright_W, reach_m) for image in self.images)


class PeopleWatch:
    """Watches for people near the robot. Does nothing without cameras, or when the detector has no class of people."""

    def __init__(self, context: SkillContext, options: PeopleOptions | None = None) -> None:
        self._context = context
        self._options = options or PeopleOptions()
        knows = PERSON in context.detector.class_names
        self._cameras = context.robot.capabilities().body_cameras if knows else ()
        self._asked_s = self._looked_s = -math.inf
        self._soon = False
        self._job: Job[_Look] | None = None
        self.faults: Sequence[str] = ()
        """Why cameras gave no picture in which people can be located, at the last view."""
        self._tracker = PeopleTracker(self._options.same_m)
        self._scan_s, costmap = -math.inf, context.costmap
        self._survey = costmap if isinstance(costmap, SurveyView) else None
        self._obstacles = costmap if isinstance(costmap, ObstacleLayerView) else None

    def people(self) -> tuple[SeenPerson, ...]:
        """People who count now (see `PeopleOptions`)."""
        return tuple(one for one in self._seen if one.looks > 1 and self._remembered(one))

    def tracks(self) -> tuple[SeenPerson, ...]:
        """All people detected often enough, or recently, in scans or pictures; see `PeopleOptions.track_m`."""
        return tuple(one for one in self._seen if one.looks > 1 or one.scans >= self._options.least_scans)

    @property
    def _seen(self) -> tuple[SeenPerson, ...]:
        return self._tracker.people

    def step(self, velocity: FloatArray) -> None:
        """Processes finished views, and starts the next one towards a body-frame velocity (3,). Never blocks."""
        self._take_scan()
        if self._job is not None:
            if self._job.done():
                job, self._job = self._job, None
                self._update(job.result())
            return
        now_s, options = self._context.clock.now(), self._options
        due_s = self._looked_s + (options.again_s if self._soon else options.period_s)
        if now_s < max(due_s, self._asked_s + options.again_s):
            return
        self._asked_s = now_s
        again = self._soon or now_s >= self._looked_s + options.known_s
        if cameras := self._may_show_person(cameras_towards(velocity, self._cameras), again=again):
            self._looked_s, self._soon = now_s, False
            X_WO, here_W = self._context.localiser.estimate().X_WO, self._context.pose()
            self._job = self._context.worker.sense(
                lambda: pictures_with_depth(self._context.robot, self._context.clock, cameras),
                lambda taken: self._look(*taken, X_WO, here_W),
                latency_s=options.latency_s,
                name="look for people",
            )

    def _take_scan(self) -> None:
        """Updates with the newest scan, when it is new and people may be found in it."""
        options, scan = self._options, self._context.robot.scan()
        tracks_all = options.track_m > 0.0
        if scan is None or scan.stamp_s <= self._scan_s or not (tracks_all or self._seen):
            return
        self._scan_s = scan.stamp_s
        self._tracker.update(self.scanned(), by_scan=True, apart_m=SCAN_APART_M, births=tracks_all)
        if tracks_all:
            self._tracker.revise(lambda one: one if self._is_tracked(one) else None)

    def scanned(self) -> Sequence[SeenPerson]:
        """Returns what has the shape of a person in the newest scan, whether or not a picture shows a person."""
        robot = self._context.robot
        scan = robot.scan()
        if scan is None:
            return ()
        X_WB = self._context.localiser.estimate().X_WO @ scan.X_OB
        ahead_m = ARM_AHEAD_M if robot.gripper().holding else STOWED_AHEAD_M
        reach_m, footprint_m = self._options.track_m or self._options.reach_m, robot.capabilities().footprint_m
        return people_in_scan(scan, X_WB, footprint_m, reach_m, self._survey, ahead_m=ahead_m)

    def _is_tracked(self, one: SeenPerson) -> bool:
        """Returns whether a person is still tracked."""
        options, age_s = self._options, self._context.clock.now() - one.stamp_s
        often = one.looks > 1 or one.scans >= options.least_scans
        return age_s <= (options.hidden_s if often else options.fleeting_s) or (one.looks > 1 and self._remembered(one))

    def _may_show_person(self, cameras: Sequence[CameraCapabilities], *, again: bool) -> Sequence[CameraCapabilities]:
        """Cameras with an unexplained obstacle or a person in view; all cameras if no obstacles are known.

        Unless `again`, people whom scans track right now, and the obstacles that they are, do not count.
        """
        if self._obstacles is None:
            return cameras
        here, tracked_s = self._context.pose(), math.inf if again else self._context.clock.now() - _TRACKED_S
        seen_W = np.array([one.place_W for one in self._seen]).reshape(-1, 2)
        places_W = np.vstack([self._obstacles.obstacle_cells(_FRESH_S), seen_W])
        for one in self.people():
            if one.stamp_s >= tracked_s:
                places_W = places_W[np.linalg.norm(places_W - one.place_W, axis=1) > self._options.same_m]
        off_W = places_W - (here.x_m, here.y_m)
        near_W = off_W[np.linalg.norm(off_W, axis=1) < self._options.near_m]
        bearings_rad = np.arctan2(near_W[:, 1], near_W[:, 0]) - here.yaw_rad
        least = math.cos(self._options.view_rad)
        return [each for each in cameras if np.any(np.cos(bearings_rad - each.heading_rad) > least)]

    def _look(self, images: Sequence[Image], faults: Sequence[str], X_WO: RigidTransform, here_W: Pose2D) -> _Look:
        """Detects people in one picture of each camera that has no fault."""
        options = self._options
        detected = people_detections(self._context.detector, images, options.least_score)
        results = [
            located_people([each for each in detected if each[0] is image], X_WO, here_W, options.reach_m)
            for image in images
        ]
        whole = tuple(image for image, (_, without_depth) in zip(images, results, strict=True) if not without_depth)
        return _Look(tuple(found for found, _ in results), whole, faults, X_WO, here_W)

    def _update(self, look: _Look) -> None:
        """Updates and publishes the known people; schedules the next view early when a person is new."""
        self.faults = look.faults
        before, stamp_s, options = self._seen, self._context.clock.now(), self._options
        for found in look.found:
            stamp_s = found[0].stamp_s if found else stamp_s
            self._tracker.update(found, by_scan=False, apart_m=options.same_m)
        self._tracker.revise(lambda one: self._count_miss(one, look, stamp_s))
        tracks = self._options.track_m > 0.0
        self._tracker.revise(lambda one: one if self._remembered(one) or (tracks and self._is_tracked(one)) else None)
        self._soon = any(one.looks == 1 and one.track not in {each.track for each in before} for one in self._seen)
        if any(look.found) or any(one.looks for one in before):
            self._context.publish(PEOPLE_TOPIC, self._message())

    def _count_miss(self, one: SeenPerson, look: _Look, stamp_s: float) -> SeenPerson:
        """Counts a miss when the view should have shown a person and did not."""
        due = one.picture_s < stamp_s and look.shows(one, self._options.reach_m)
        return replace(one, missed=one.missed + 1) if due else one

    def _remembered(self, one: SeenPerson) -> bool:
        """Returns whether the watch still remembers a person."""
        options = self._options
        age_s = self._context.clock.now() - one.stamp_s
        if one.missed >= options.misses or age_s > options.beside_s:
            return False
        if age_s <= options.memory_s or one.missed > 0:
            return True
        return float(self._context.costmap.clearance_m(np.array([one.place_W]))[0]) < options.beside_m

    def _message(self) -> dict[str, object]:
        return {
            "stamp": self._context.clock.now(),
            "robot": self._context.robot.name,
            "people": [
                {
                    "position_W": [round(value, 3) for value in one.place_W],
                    "covariance": [round(float(value), 5) for value in one.covariance.ravel()],
                    "score": round(one.score, 3),
                    "looks": one.looks,
                }
                for one in self._seen
                if one.looks
            ],
        }


def _is_inside(image: Image, X_WO: RigidTransform, points_W: FloatArray, reach_m: float) -> bool:
    """Returns whether any of the points (N, 3) lies well inside a picture, within reach_m of its camera."""
    lens, p_C = image.intrinsics, camera_pose_W(image, X_WO).inverse().multiply(points_W.T).T
    u, v = project(np.maximum(p_C, [-np.inf, -np.inf, 1e-6]), lens)
    inside = (np.abs(u / lens.width - 0.5) < _WELL_INSIDE) & (np.abs(v / lens.height - 0.5) < _WELL_INSIDE)
    return bool(np.any(inside & (p_C[:, 2] > _NEAREST_M) & (p_C[:, 2] < reach_m)))
