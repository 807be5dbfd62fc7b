"""Detection of people by the body cameras that face the direction of motion."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Detection, Detector, Job, ObstacleLayerView, SkillContext
from skills.geometry import relative_pose
from skills.perception.class_forms import PERSON
from skills.perception.detector.camera_images import detect_class_in_grey
from skills.perception.people import SeenPerson, add_person
from skills.perception.point_cloud import camera_pose_W, project
from skills.perception.position import locate
from skills.quantities import Count, Delay, Duration, Length, Margin, Share, Turn
from skills.robot import CameraCapabilities, FloatArray, Image, NoImageError, Pose2D

PEOPLE_TOPIC: Final = "people"
_HEIGHTS_M: Final = (0.2, 0.6, 1.0)
_NEAREST_M: Final = 0.3
_WELL_INSIDE: Final = 0.35
_SAME_PLACE_M: Final = 0.05
_SAME_YAW_RAD: Final = 0.05


@dataclass(frozen=True)
class PeopleOptions:
    """Periods of the watch (s), the latency of a detection (s), and conditions for a person to count.

    A camera takes a picture every `period_s` while it may show a person: a known one, or a cell of the costmap that the
    map does not explain, within `near_m` and within `view_rad` of its axis. Every `idle_s` all cameras take one. A
    person counts when two views within `same_m` show them with `least_score`; the second view follows after `again_s`.
    The watch forgets a person whom `misses` pictures should show and do not. Out of view, it remembers a person for
    `memory_s`, and for `beside_s` as long as the costmap has an obstacle within `beside_m` of the position.
    """

    period_s: Duration = 0.5
    idle_s: Duration = 2.0
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


@dataclass(frozen=True)
class _Look:
    """People in pictures taken at one time, and these pictures.

    `suspected` pictures have no depth and show a person; the next ones are taken at once, with depth.
    """

    found: tuple[SeenPerson, ...]
    images: tuple[Image, ...]
    X_WO: RigidTransform
    here_W: Pose2D
    suspected: bool = False

    def shows(self, one: SeenPerson, reach_m: float) -> bool:
        """Returns whether a still person would be visible: from the pose of the last view, or well in a picture."""
        off = relative_pose(one.here_W, self.here_W)
        if math.hypot(off.x_m, off.y_m) < _SAME_PLACE_M and abs(off.yaw_rad) < _SAME_YAW_RAD:
            return True
        upright_W = np.array([[*one.place_W, height_m] for height_m in _HEIGHTS_M])
        return any(_is_inside(image, self.X_WO, upright_W, reach_m) for image in self.images)


class PeopleWatch:
    """Watch for people near the robot. Does nothing without cameras, or when the detector has no class of people."""

    def __init__(self, context: SkillContext, options: PeopleOptions | None = None) -> None:
        self._context = context
        self._options = options or PeopleOptions()
        knows = PERSON in context.detector.class_names
        self._cameras = context.robot.capabilities().body_cameras if knows else ()
        self._looked_s = self._all_looked_s = -math.inf
        self._soon = self._suspected = False
        self._job: Job[_Look] | None = None
        self._seen: tuple[SeenPerson, ...] = ()

    def people(self) -> tuple[SeenPerson, ...]:
        """People who count now."""
        return tuple(one for one in self._seen if one.looks > 1 and self._remembered(one))

    def step(self, velocity: FloatArray) -> None:
        """Processes finished views, and starts the next one towards a body-frame velocity (3,). Never blocks."""
        if self._job is not None:
            if self._job.done():
                job, self._job = self._job, None
                with contextlib.suppress(NoImageError):
                    self._update(job.result())
            return
        now_s = self._context.clock.now()
        cameras, with_depth = self._due(cameras_towards(velocity, self._cameras), now_s)
        if cameras:
            self._looked_s, self._soon = now_s, False
            X_WO, here_W, robot = self._context.localiser.estimate().X_WO, self._context.pose(), self._context.robot
            self._job = self._context.worker.sense(
                lambda: [robot.image(camera.source, depth=with_depth) for camera in cameras],
                lambda images: self._look(images, X_WO, here_W, with_depth),
                latency_s=self._options.latency_s,
                name="look for people",
            )

    def _due(self, cameras: Sequence[CameraCapabilities], now_s: float) -> tuple[Sequence[CameraCapabilities], bool]:
        """Cameras whose next picture is due, and whether it needs depth."""
        options, since_s = self._options, now_s - self._looked_s
        if self._suspected:
            return cameras, True
        if now_s >= self._all_looked_s + options.idle_s:
            self._all_looked_s = now_s
            return cameras, bool(self._may_show_person(cameras))
        period_s = options.again_s if self._soon else options.period_s
        return (self._may_show_person(cameras) if since_s >= period_s else ()), True

    def _may_show_person(self, cameras: Sequence[CameraCapabilities]) -> Sequence[CameraCapabilities]:
        """Cameras with a known person or an unexplained obstacle in view; all of them without a layered costmap."""
        costmap, here = self._context.costmap, self._context.pose()
        if not isinstance(costmap, ObstacleLayerView):
            return cameras
        places_W = np.vstack([costmap.obstacle_cells(), np.array([one.place_W for one in self._seen]).reshape(-1, 2)])
        off_W = places_W - (here.x_m, here.y_m)
        near_W = off_W[np.linalg.norm(off_W, axis=1) < self._options.near_m]
        bearings_rad = np.arctan2(near_W[:, 1], near_W[:, 0]) - here.yaw_rad
        return [each for each in cameras if _is_near_axis(bearings_rad - each.heading_rad, self._options.view_rad)]

    def _look(self, images: Sequence[Image], X_WO: RigidTransform, here_W: Pose2D, with_depth: bool) -> _Look:
        """Detects people in one picture of each camera; without depth, only whether there are any."""
        detector, options = self._context.detector, self._options
        if not with_depth:
            suspected = bool(people_detections(detector, images, options.least_score))
            return _Look((), tuple(images), X_WO, here_W, suspected=suspected)
        detected = people_detections(detector, images, options.least_score)
        found = located_people(detected, X_WO, here_W, options.reach_m)
        return _Look(tuple(found), tuple(images), X_WO, here_W)

    def _update(self, look: _Look) -> None:
        """Updates and publishes the known people; schedules the next view early for a new one."""
        before, stamp_s = self._seen, self._context.clock.now()
        for one in look.found:
            stamp_s = one.stamp_s
            self._seen = add_person(self._seen, one, self._options.same_m)
        self._seen = tuple(self._count_miss(one, look, stamp_s) for one in self._seen)
        self._seen = tuple(one for one in self._seen if self._remembered(one))
        self._suspected = look.suspected
        self._soon = look.suspected or any(one.looks == 1 for one in self._seen)
        if look.found or before:
            self._context.publish(PEOPLE_TOPIC, self._message())

    def _count_miss(self, one: SeenPerson, look: _Look, stamp_s: float) -> SeenPerson:
        """Counts a miss of a person whom the view should have shown and did not."""
        due = one.stamp_s < stamp_s and look.shows(one, self._options.reach_m)
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
            ],
        }


def people_detections(detector: Detector, images: Sequence[Image], least_score: float) -> list[tuple[Image, Detection]]:
    """Detects people in pictures; pairs each with its picture."""
    found = detect_class_in_grey(detector, images, PERSON)
    pairs = ((image, one) for image, ones in zip(images, found, strict=True) for one in ones)
    return [(image, one) for image, one in pairs if one.class_name == PERSON and one.score >= least_score]


def located_people(
    detected: Sequence[tuple[Image, Detection]], X_WO: RigidTransform, here_W: Pose2D, reach_m: float
) -> list[SeenPerson]:
    """Locates detected people, except those beyond reach_m from the camera, or without depth."""
    seen = (_located(image, one, X_WO, here_W, reach_m) for image, one in detected)
    return [one for one in seen if one is not None]


def _located(image: Image, one: Detection, X_WO: RigidTransform, here_W: Pose2D, reach_m: float) -> SeenPerson | None:
    """Locates a detected person; None when out of reach, or without depth."""
    position = locate(image, one)
    if position is None:
        return None
    p_OC = image.frames.pose(image.camera_frame).translation()
    if float(np.hypot(*(position.p_OT - p_OC)[:2])) > reach_m:
        return None
    x, y, _ = (float(value) for value in X_WO @ position.p_OT)
    turn = X_WO.rotation().matrix()
    covariance = (turn @ position.covariance_O @ turn.T)[:2, :2]
    return SeenPerson((x, y), covariance, one.score, image.stamp_s, here_W)


def _is_inside(image: Image, X_WO: RigidTransform, points_W: FloatArray, reach_m: float) -> bool:
    """Returns whether any of some points (N, 3) lies well inside a picture, within reach of its camera."""
    lens, p_C = image.intrinsics, camera_pose_W(image, X_WO).inverse().multiply(points_W.T).T
    u, v = project(np.maximum(p_C, [-np.inf, -np.inf, 1e-6]), lens)
    inside = (np.abs(u / lens.width - 0.5) < _WELL_INSIDE) & (np.abs(v / lens.height - 0.5) < _WELL_INSIDE)
    return bool(np.any(inside & (p_C[:, 2] > _NEAREST_M) & (p_C[:, 2] < reach_m)))


def _is_near_axis(off_axis_rad: FloatArray, view_rad: float) -> bool:
    """Returns whether any of some bearings lies within view_rad of a camera's axis."""
    return bool(np.any(np.cos(off_axis_rad) > math.cos(view_rad)))


def cameras_towards(velocity: FloatArray, known: Sequence[CameraCapabilities]) -> tuple[CameraCapabilities, ...]:
    """Body cameras that face the direction of a body-frame velocity; the front ones when the robot stands or turns."""
    vx, vy = float(velocity[0]), float(velocity[1])
    heading_rad = 0.0
    if abs(vy) > 2.0 * abs(vx):
        heading_rad = math.copysign(math.pi / 2, vy)
    elif vx < 0.0:
        heading_rad = math.pi
    return tuple(camera for camera in known if camera.looks_towards(heading_rad))
