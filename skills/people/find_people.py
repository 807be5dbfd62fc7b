"""The find_people skill: searches an area for people, turns in place, and drives to further viewpoints."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Cause, Detection, ObjectObservation, Part, Running, SkillContext, Succeeded
from skills.descriptions import count_sentence
from skills.detect.messages import detections_message
from skills.footprint import SAFE_MARGIN_M, Footprint, footprint_clear, footprint_clearance_m, pose_array
from skills.geometry import grid_inside, line_of_sight, wrap
from skills.manipulation.approach.base_placement import go_to_one
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.base import MovingSkill
from skills.navigate.surroundings import NavigateInputs
from skills.navigate.trip_planning import place_text
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, is_dark, turn_upright
from skills.perception.people import (
    SeenPerson,
    located_people,
    people_detections,
    people_in_scan,
    person_observation,
    pictures_with_depth,
)
from skills.perception.people_tracking import SCAN_APART_M, PeopleTracker
from skills.perception.point_cloud import camera_pose_W, project
from skills.quantities import Coordinate, Count, Delay, Length, Share, Tries, Turn, TurnRate
from skills.robot import FloatArray, Image, Pose2D
from skills.routine import PATIENCE_S, Patience, Routine, SkillFailure
from skills.world_model import PERSON

_SCAN_AGE_S = 1.0
_AHEAD_RAD = 0.2
"""Turn ahead over which the footprint must stay clear."""
_AVOID_M = 0.9
"""Distance within which somebody counts as a person who is already known."""
_PERSON_CLEAR_M = 0.2
"""Clearance of a position where a person may stand."""
_GRID_M = 0.4
"""Distance between such positions."""
_OWN_M = 0.3
"""Distance from the robot's centre within which an obstacle hides nothing."""
_AGAIN_S = 0.3
"""Pause before the robot takes pictures again, because a camera gave an old one or one without depth."""
_HEIGHTS_M = (0.1, 0.5, 0.9, 1.3, 1.7)
"""Heights of a standing person, one of which a picture must show."""
_NEAREST_M = 0.05
"""Least distance of what a picture shows."""
_VISIBLE = 0.65
"""Least length of a person in a picture, as a fraction of that of a whole person."""
_AXIS_ASIDE = 0.2
"""Largest distance of a person's axis from the box, as a fraction of its length."""
_VIEWS = 3
"""Number of looks that must show a position if a camera has a fault, because a single one may miss somebody.

As many pictures that show a body with its top, and no person there, show that it is no person, if it is low.
"""
_WHOLE_M = (1.8, 4.5)
"""Distances from which a picture may show a body with its top, and with depth."""
_TALL_M = 1.3
"""Height above which a body may be a person though a detector recognises none: it misses some."""
_STEP_M = 0.2
"""Distance between the positions at which the least such distance is sought; also the tolerance of a viewpoint."""
_BESIDE_PERSON_M = 1.0
"""Distance from a detected person within which a detector may miss another."""
_BODY_M = 0.45
"""Distance from a body's axis within which an obstacle is that body."""
_CLOSE_M = 2.5
"""Distance to which the robot approaches positions where depth may be missing because they are far."""
_BESIDE_M = 0.5
"""Distance from the robot's centre within which nobody else stands."""
_BEST_VIEWPOINTS = 4
"""Number of best viewpoints to which the robot tries to drive."""
_YAWS_RAD = (0.0, 0.8, -0.8, 1.6, -1.6, math.pi)
"""Turns of the robot at a viewpoint from the hidden positions, the best first."""


@dataclass(frozen=True)
class FindPeopleInputs:
    """Area to search: the corners (x, y) `area_W`, and its name `place`.

    `person`: name of the wanted person, for messages; any person counts, since the skill recognises no faces. `count`:
    how many people are wanted; 0 counts all. `avoid`: people near these positions do not count. `unpictured`: bodies
    that two scans show count too, after all people that a picture shows. `moves`: the robot drives to viewpoints that
    show the rest of the area, until enough people are found.
    """

    area_W: tuple[tuple[Coordinate, Coordinate], ...]
    place: str
    person: str = PERSON
    count: Tries = 1
    avoid: tuple[ObjectObservation, ...] = ()
    unpictured: bool = False
    moves: bool = False


@dataclass(frozen=True)
class FindPeopleOptions:
    """Search in `looks` directions, with turns of `turn_rad` in between.

    `same_m`: two detections this near confirm a person, from two directions, or from one by both a camera and the
    LiDAR. `least_score` and `reach_m`: score of a detection, and its largest distance from the camera. `viewpoints`:
    how many more viewpoints a robot that may move drives to. `hidden`: it stops when at most this fraction of people's
    possible positions was out of view.
    """

    looks: Count = 5
    turn_rad: Turn = 0.5
    turn_rad_s: TurnRate = 0.4
    settle_s: Delay = 0.5
    same_m: Length = 0.7
    least_score: Share = 0.5
    reach_m: Length = 6.0
    viewpoints: Tries = 4
    hidden: Share = 0.15


class FindPeople(MovingSkill[FindPeopleInputs]):
    """Searches for people with body cameras and LiDAR; only with the LiDAR if the detector has no class of people."""

    name = "find_people"
    Inputs = FindPeopleInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    outputs: ClassVar[Mapping[str, type]] = {
        "observation": ObjectObservation,
        "observations": tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan",
        Cause.EXECUTION: "it is dark, a camera gives no picture, an old one or no depth, the robot refuses to turn, or "
        "part of the area is hidden",
        Cause.POSTCONDITION: "nobody is seen, or fewer than asked for",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}
    Options: ClassVar[type] = FindPeopleOptions
    options: FindPeopleOptions

    def run(self, inputs: FindPeopleInputs) -> Routine[Succeeded]:
        """Searches until enough people were detected twice; from further viewpoints if the robot may move."""
        view, tracker = _View(self.context, inputs, self.options), PeopleTracker(self.options.same_m)
        knows, self._waited_s = PERSON in self.context.detector.class_names, 0.0
        self._cameras = self.context.robot.capabilities().body_cameras if knows else ()
        found = yield from self._look_round(inputs, tracker, view)
        for _ in range(self.options.viewpoints if inputs.moves else 0):
            if 0 < inputs.count <= len(found) or not view.gap(moves=True) or not (goals := view.goals()):
                break
            try:
                yield from go_to_one(self, goals)
            except SkillFailure as failure:
                if failure.cause in (Cause.ERROR, Cause.PRECONDITION):
                    raise
                break
            found = yield from self._look_round(inputs, tracker, view)
        return self._ended(inputs, tuple(person_observation(one, inputs.person, inputs.place) for one in found), view)

    def _look_round(self, inputs: FindPeopleInputs, tracker: PeopleTracker, view: "_View") -> Routine[list[SeenPerson]]:
        """Looks and turns in place until enough people were detected twice; returns them."""
        area, message = shapely.Polygon(inputs.area_W), f"looking for people in the {inputs.place}"
        found, sure = list[SeenPerson](), list[SeenPerson]()
        area = area.difference(shapely.MultiPoint([one.position_W[:2] for one in inputs.avoid]).buffer(_AVOID_M))
        for look in range(self.options.looks):
            if look:
                yield from self._turn()
            by_lidar = yield from self._in_scan(message, abreast=bool(self._cameras) and not inputs.unpictured)
            by_camera = yield from self._in_pictures(view, message)
            if by_camera is not None and not by_camera and not inputs.unpictured:
                raise SkillFailure(Cause.EXECUTION, view.fault)
            tracker.update(by_lidar, by_scan=True, apart_m=SCAN_APART_M)
            for people in by_camera or ():
                tracker.update(people, by_scan=False, apart_m=SCAN_APART_M)
            shown = [one.place_W for people in by_camera or () for one in people]
            tracker.revise(partial(view.note_missed, shown=shown))
            if inputs.unpictured:
                again = yield from self._in_scan(message)
                tracker.update(again, by_scan=True, apart_m=SCAN_APART_M)
            least = 0 if by_camera is None or inputs.unpictured else 1
            sure = [one for one in tracker.people if one.looks >= least and one.looks + one.scans > 1]
            found = [one for one in sure if area.covers(shapely.Point(one.place_W))]
            found.sort(key=lambda one: by_camera is not None and one.looks == 0)
            if 0 < inputs.count <= len(found):
                break
        unsure = [one for one in tracker.people if one not in sure and area.covers(shapely.Point(one.place_W))]
        view.end_round(sure, unsure)
        return found

    def _turn(self) -> Routine[None]:
        """Turns in place as far as the footprint stays clear of obstacles."""
        turn_rad_s, for_s = self.options.turn_rad_s, self.options.turn_rad / self.options.turn_rad_s
        costmap, footprint = self.context.free_space(), ArmFootprint(self.context).now()

        def lacks_clearance() -> bool:
            here = self.context.pose()
            ahead = replace(here, yaw_rad=here.yaw_rad + math.copysign(_AHEAD_RAD, turn_rad_s))
            here_m, ahead_m = footprint_clearance_m(costmap, footprint, pose_array([here, ahead]))
            return bool(ahead_m < min(here_m, SAFE_MARGIN_M))

        command, rest_s = (0.0, 0.0, turn_rad_s), self.options.settle_s
        yield from self.move(command, for_s, "turning to see more", settle_s=rest_s, enough=lacks_clearance)

    def _ended(self, inputs: FindPeopleInputs, found: tuple[ObjectObservation, ...], view: "_View") -> Succeeded:
        """Returns the result. Raises SkillFailure when too few people were found, or part of the area was hidden."""
        enough = len(found) >= max(1, inputs.count)
        else_ = " else" if inputs.avoid else ""
        few = count_sentence(found, ()) if found else f"nobody{else_} is seen in the {inputs.place} from here"
        outputs = {"observation": found[0], "observations": found} if found else {}
        if not (enough and inputs.count) and (gap := view.gap(moves=inputs.moves)):
            raise SkillFailure(Cause.EXECUTION, f"{few}, {gap}", outputs)
        if not enough:
            raise SkillFailure(Cause.POSTCONDITION, few)
        who = "somebody" if found[0].kind.name == PERSON else found[0].kind.name
        said = f"saw {who} in the {found[0].surface}" if inputs.count == 1 else count_sentence(found, ())
        return Succeeded(said, outputs)

    def _in_pictures(self, view: "_View", message: str) -> Routine[Sequence[Sequence[SeenPerson]] | None]:
        """Detects people in pictures of the body cameras, and publishes each picture with people, or else the first.

        Returns None when the detector has no class of people.
        """
        detector, options = self.context.detector, self.options
        if not self._cameras:
            view.look(None, self.context.localiser.estimate().X_WO)
            return None
        images, faults = yield from self._pictures(message)
        X_WO, here_W = self.context.localiser.estimate().X_WO, self.context.pose()
        view.look(images, X_WO, faults)
        detected = yield from self.compute(
            lambda: people_detections(detector, images, options.least_score),
            latency_s=DETECTION_LATENCY_S,
            name="look for people",
            message=message,
        )
        for shown in [each for each in images if any(image is each for image, _ in detected)] or images[:1]:
            picture, found = turn_upright(shown, [one for image, one in detected if image is shown])
            self.context.publish("detections", {**detections_message(shown, found, ()), "image": picture})
        people = []
        for image in images:
            each = [one for one in detected if one[0] is image]
            located, without_depth = located_people(each, X_WO, here_W, options.reach_m)
            view.note_unlocated(image, X_WO, without_depth, located)
            people.append(located)
        return people

    def _pictures(self, message: str) -> Routine[tuple[list[Image], Sequence[str]]]:
        """Takes the pictures in which people can be located; returns also why other cameras gave none.

        Tries again while a camera has a fault; one attempt of the skill waits `PATIENCE_S` in total.
        """
        robot, clock = self.context.robot, self.context.clock
        while True:
            begun_s = clock.now()
            taken = yield from self.sense(
                lambda: pictures_with_depth(robot, clock, self._cameras),
                latency_s=0.0,
                name="pictures",
                message=message,
            )
            images = [image for image in taken[0] if not is_dark(image)]
            faults = ["it is too dark to see anybody"] * (len(taken[0]) - len(images)) + taken[1]
            if not faults or self._waited_s > PATIENCE_S:
                return images, faults
            yield from self.pause(_AGAIN_S, f"{faults[0]}; {message}")
            self._waited_s += clock.now() - begun_s

    def _in_scan(self, message: str, *, abreast: bool = False) -> Routine[Sequence[SeenPerson]]:
        """Detects people in the newest scan. Raises SkillFailure when there is no new scan."""
        robot, patience = self.context.robot, Patience(self.context.clock)
        while (scan := robot.scan()) is None or scan.stamp_s < self.context.clock.now() - _SCAN_AGE_S:
            if not patience.is_left():
                raise SkillFailure(Cause.PRECONDITION, "there is no new scan to see people in")
            yield Running(f"{message}; waits for a scan")
        X_WB, footprint_m = self.context.localiser.estimate().X_WO @ scan.X_OB, robot.capabilities().footprint_m
        return people_in_scan(scan, X_WB, footprint_m, costmap=self.context.costmap, abreast=abreast)


@dataclass(frozen=True)
class _Unlocated:
    """Somebody in a `box` of a picture without depth there: mask of possible positions, and who is `located` in it."""

    image: Image
    X_WO: RigidTransform
    box: tuple[float, float, float, float]
    located: Sequence[SeenPerson]
    at: NDArray[np.bool_]

    def is_among(self, people: Sequence[SeenPerson], same_m: float) -> bool:
        """Returns whether another picture has located the person."""
        own_W = [one.place_W for one in self.located]
        others_W = [one.place_W for one in people if all(math.dist(one.place_W, own) > same_m for own in own_W)]
        return bool(_may_show(self.image, self.X_WO, np.array(others_W).reshape(-1, 2), self.box).any())


class _View:
    """Possible positions of people in an area, with masks of those in view, and of those that faulty cameras missed."""

    def __init__(self, context: SkillContext, inputs: FindPeopleInputs, options: FindPeopleOptions) -> None:
        self._context, self._options = context, options
        points = grid_inside(inputs.area_W, _GRID_M, first_m=_GRID_M / 2)
        known_W = np.array([one.position_W[:2] for one in inputs.avoid]).reshape(-1, 2)
        away_m = np.linalg.norm(points[:, None] - known_W[None], axis=2)
        free = context.costmap.clearance_m(points) > _PERSON_CLEAR_M
        self._points: FloatArray = points[free & (away_m > _AVOID_M).all(axis=1)]
        self._count = max(1, int(free.sum()))
        self._views: NDArray[np.int64] = np.zeros(len(self._points), np.int64)
        self._missed, self._around, self.fault = self._views > 0, self._views > 0, ""
        self._unlocated, self._new = list[_Unlocated](), list[_Unlocated]()
        self._pictures, self._X_WO = list[Image](), RigidTransform()
        self._unsure, self._doubts = False, list[SeenPerson]()

    def gap(self, *, moves: bool) -> str:
        """Why there may be people whom the search missed; empty when it missed nobody."""
        if self._unlocated:
            return "but somebody is in a picture that has no depth there"
        if self.fault and (self._unsure or (self._missed & self._hidden()).any()):
            return f"but {self.fault}"
        if self._doubts:
            return f"but what stands at {place_text(self._doubts[0].place_W)} may be a person"
        hidden = float(self._hidden().sum()) / self._count
        return f"and {hidden:.0%} of it was never in view" if moves and hidden > self._options.hidden else ""

    def look(self, images: Sequence[Image] | None, X_WO: RigidTransform, faults: Sequence[str] = ()) -> None:
        """Marks the positions that images show from the robot's present pose; all in line of sight without cameras."""
        here = self._context.pose()
        here_W = np.array((here.x_m, here.y_m))
        self._pictures, self._X_WO = list(images or ()), X_WO
        shown = np.linalg.norm(self._points - here_W, axis=1) < (math.inf if images is None else _BESIDE_M)
        for image in images or ():
            shown |= _may_show(image, X_WO, self._points)
        self._around = self._shows(here_W, self._points, self._options.reach_m)
        self._views += self._around & shown
        if faults:
            self._missed, self.fault = self._missed | self._around, faults[0]

    def note_unlocated(
        self, image: Image, X_WO: RigidTransform, without_depth: Sequence[Detection], located: Sequence[SeenPerson]
    ) -> None:
        """Notes people whose depth a picture of the last look lacks, if they may be in the area."""
        for one in without_depth:
            if (at := self._around & _may_show(image, X_WO, self._points, one.box)).any():
                self._new.append(_Unlocated(image, X_WO, one.box, located, at))

    def _hidden(self) -> NDArray[np.bool_]:
        """Mask of the positions that too few pictures show: none, or fewer than `_VIEWS` where a camera has a fault."""
        return self._views < np.where(self._missed, _VIEWS, 1)

    def note_missed(self, one: SeenPerson, shown: Sequence[tuple[float, float]]) -> SeenPerson:
        """Counts a miss when a picture of the last look shows a body with its top, and no person there or beside it."""
        here = self._context.pose()
        if any(math.dist(one.place_W, each) < _BESIDE_PERSON_M for each in shown):
            return one  # two people side by side may be one detection
        whole = [image for image in self._pictures if image.stamp_s > one.picture_s]
        place_W, here_W = np.array([one.place_W]), np.array([(here.x_m, here.y_m)])
        whole = [image for image in whole if _may_show(image, self._X_WO, place_W, whole=True)[0]]
        return replace(one, missed=one.missed + 1) if whole and self._shows_body(here_W, one)[0] else one

    def _shows_body(self, points_W: FloatArray, one: SeenPerson, least_m: float = 0.0) -> NDArray[np.bool_]:
        """Mask (N,) of the positions (N, 2) at least `least_m` away from which a picture may show a body whole."""
        away_m = np.linalg.norm(points_W - one.place_W, axis=1)
        is_clear = line_of_sight(self._context.costmap, np.array(one.place_W), points_W, beyond_m=_BODY_M)
        return np.asarray((least_m <= away_m) & (away_m <= _WHOLE_M[1]) & is_clear)

    def _whole_from_m(self) -> float:
        """Least distance from which a camera of the last look shows a body whole; `_WHOLE_M[0]` if none ever does."""
        here, away_m, shown = self._context.pose(), np.arange(*_WHOLE_M, _STEP_M), np.zeros(0, bool)
        for image in self._pictures:
            ahead = camera_pose_W(image, self._X_WO).rotation().matrix()[:2, 2]
            ahead_W = (here.x_m, here.y_m) + np.outer(away_m, ahead / max(float(np.linalg.norm(ahead)), _NEAREST_M))
            shown = np.logical_or(shown if len(shown) else False, _may_show(image, self._X_WO, ahead_W, whole=True))
        return float(away_m[shown.argmax()] + _STEP_M) if shown.any() else _WHOLE_M[0]

    def end_round(self, people: Sequence[SeenPerson], unsure: Sequence[SeenPerson]) -> None:
        """Marks as hidden where people without depth may be, unless they are located by now or a later round looked.

        `unsure` are those in the area whom only scans or a single picture show. One of them whom a picture or two scans
        show may be a person, unless it is low and `_VIEWS` pictures show that it is none.
        """
        self._unsure = bool(unsure)
        seen = (one for one in unsure if one.looks > 0 or one.scans > 1)
        self._doubts = [one for one in seen if (one.missed < _VIEWS or one.top_m > _TALL_M) and self._pictures]
        hidden, same_m = self._options.hidden, self._options.same_m
        left = [one for one in self._unlocated if (one.at & self._hidden()).sum() > hidden * one.at.sum()]
        self._unlocated, self._new = [one for one in (*left, *self._new) if not one.is_among(people, same_m)], []
        for one in self._unlocated:
            self._views[one.at] = 0

    def goals(self) -> list[NavigateInputs]:
        """Free viewpoints, sorted by the number of unsure bodies or hidden positions that they bring into view."""
        here, hidden = self._context.pose(), self._points[self._hidden()]
        reach_m = _CLOSE_M if self._unlocated else self._options.reach_m
        shown = np.array([self._shows(point, hidden, reach_m) for point in self._points], bool)
        if self._doubts:
            hidden, least_m = np.array([one.place_W for one in self._doubts]), self._whole_from_m()
            shown = np.array([self._shows_body(self._points, one, least_m) for one in self._doubts], bool).T
        gains = shown.sum(axis=1)
        drives_m = np.linalg.norm(self._points - (here.x_m, here.y_m), axis=1)
        best = (n for n in np.lexsort((drives_m, -gains)) if gains[n] > 0)
        footprint = ArmFootprint(self._context).now()
        poses = (self._free_pose(self._points[n], hidden[shown[n]], footprint) for n in best)
        return [NavigateInputs(pose, 0.2, 0.4) for pose in islice(filter(None, poses), _BEST_VIEWPOINTS)]

    def _free_pose(self, at_W: FloatArray, hidden: FloatArray, footprint: Footprint) -> Pose2D | None:
        """A free pose at a position (2,), turned to the hidden positions if possible; None when no pose is free."""
        towards = hidden.mean(axis=0) - at_W
        (x, y), ahead_rad, costmap = at_W.tolist(), math.atan2(towards[1], towards[0]), self._context.free_space()
        poses = (Pose2D(x, y, wrap(ahead_rad + turn_rad)) for turn_rad in _YAWS_RAD)
        return next((pose for pose in poses if footprint_clear(costmap, footprint, pose)), None)

    def _shows(self, eye_W: FloatArray, points_W: FloatArray, reach_m: float) -> NDArray[np.bool_]:
        """Mask (N,) of the positions (N, 2) within reach of a viewpoint (2,) and not occluded."""
        is_near: NDArray[np.bool_] = np.linalg.norm(points_W - eye_W, axis=1) <= reach_m
        return is_near & line_of_sight(self._context.costmap, eye_W, points_W, beyond_m=_OWN_M)


def _may_show(
    image: Image,
    X_WO: RigidTransform,
    points_W: FloatArray,
    box: tuple[float, float, float, float] | None = None,
    *,
    whole: bool = False,
) -> NDArray[np.bool_]:
    """Mask (N,) of the positions (N, 2) where a picture shows a standing person; with a box, one of its size in it.

    With `whole`, the top of the person is in the picture, and most of the length.
    """
    lens, X_CW = image.intrinsics, camera_pose_W(image, X_WO).inverse()
    p_C = np.stack([X_CW.multiply(np.insert(points_W, 2, z_m, axis=1).T).T for z_m in _HEIGHTS_M])
    u, v = project(np.maximum(p_C, [-np.inf, -np.inf, _NEAREST_M]), lens)
    whole_px = np.hypot(np.ptp(np.clip(u, 0.0, lens.width), axis=0), np.ptp(np.clip(v, 0.0, lens.height), axis=0))
    u0, v0, u1, v1 = box or (0.0, 0.0, lens.width, lens.height)
    long_px = max(u1 - u0, v1 - v0)
    edge_px = _AXIS_ASIDE * long_px if box else 0.0
    inside = (u > u0 - edge_px) & (u < u1 + edge_px) & (v > v0 - edge_px) & (v < v1 + edge_px)
    inside &= p_C[..., 2] > _NEAREST_M
    if whole:
        return np.asarray(inside[-1] & (whole_px >= _VISIBLE * np.hypot(np.ptp(u, axis=0), np.ptp(v, axis=0))))
    return np.asarray(inside.any(axis=0) & (long_px > _VISIBLE * whole_px))
