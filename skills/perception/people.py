"""Positions of people, and their detection by the body cameras that face the direction of motion, and in LiDAR scans.

In a scan, a person is an upright cluster as wide as shoulders that stands alone; for a LiDAR of one ring, a pair of
legs, or one leg, that stands alone.
"""

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Detection, Detector, Job, ObstacleLayerView, SkillContext
from skills.geometry import relative_pose
from skills.perception.class_forms import PERSON
from skills.perception.detector.camera_images import detect_class_in_grey
from skills.perception.point_cloud import camera_pose_W, grid_labels, project
from skills.perception.position import locate
from skills.quantities import Count, Delay, Duration, Length, Margin, Share, Turn
from skills.robot import CameraCapabilities, FloatArray, Image, NoImageError, Pose2D, Scan

_CELL_M = 0.05
_LOWEST_M = 0.8
_HIGHEST_M = 1.8
_WIDTH_M = (0.15, 0.75)
_ALONE_M = 0.2
_FEWEST_POINTS = 12
_LEGS_LOWEST_M = 0.1
_LEGS_CELL_M = 0.12
_LEGS_WIDTH_M = (0.08, 0.6)
_LEGS_FEWEST_POINTS = 6
_FRONT_TO_AXIS_M = 0.1
_AXIS_SIGMA_M = 0.08
_OWN_M = (0.1, 0.19, 0.05)
"""Reach of the arm and the held object beyond the robot's outline: behind, ahead, to the sides."""


@dataclass(frozen=True)
class SeenPerson:
    """A person: the upright axis (x, y) in the world (m), its covariance (2, 2), and the time of the last view.

    `here_W` is the robot's pose at that time, `looks` the number of views that showed the person, and `missed` the
    number of views since then that should have.
    """

    place_W: tuple[float, float]
    covariance: FloatArray
    score: float
    stamp_s: float
    here_W: Pose2D
    looks: int = 1
    missed: int = 0

    @property
    def distance_m(self) -> float:
        """Distance of the person from the robot at the last view, in metres."""
        return math.dist(self.place_W, (self.here_W.x_m, self.here_W.y_m))


def add_person(known: Sequence[SeenPerson], new: SeenPerson, same_m: float) -> tuple[SeenPerson, ...]:
    """Adds a person to those known: replaces the nearest within same_m, or is one more.

    The newer position counts, since people walk. Two cameras that see a person at once count as one view.
    """
    near = [one for one in known if math.dist(one.place_W, new.place_W) <= same_m]
    if not near:
        return (*known, new)
    old = min(near, key=lambda one: math.dist(one.place_W, new.place_W))
    again = old.looks + (new.stamp_s > old.stamp_s)
    return tuple(replace(new, looks=again) if one is old else one for one in known)


def people_in_scan(
    scan: Scan, X_WB: RigidTransform, footprint_m: Sequence[tuple[float, float]], furthest_m: float = 3.5
) -> list[SeenPerson]:
    """Detects people in a LiDAR scan, nearest first; ignores points in and right around the robot's footprint."""
    points_B = scan.points_B()
    level = points_B @ scan.X_OB.rotation().matrix().T
    height = level[:, 2] + scan.X_OB.translation()[2]
    distance = np.hypot(points_B[:, 0], points_B[:, 1])
    own = _is_own(points_B, np.array(footprint_m))
    planar = len(scan.elevations_rad) == 1
    near = (
        (height > (_LEGS_LOWEST_M if planar else _LOWEST_M))
        & (height < _HIGHEST_M)
        & (distance < furthest_m + 0.5)
        & ~own
    )
    clusters = _clusters(points_B[near], _LEGS_CELL_M if planar else _CELL_M)
    is_sized = _is_leg_sized if planar else _is_person_sized
    people = [
        _person(scan.stamp_s, X_WB, cluster)
        for k, cluster in enumerate(clusters)
        if is_sized(cluster) and _is_alone(cluster, [other for j, other in enumerate(clusters) if j != k])
    ]
    return sorted((p for p in people if p.distance_m < furthest_m), key=lambda person: person.distance_m)


def _is_own(points_B: FloatArray, corners: FloatArray) -> NDArray[np.bool_]:
    """Returns which points belong to the robot's own arm and the held object."""
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    behind, ahead, aside = _OWN_M
    x, y = points_B[:, 0], points_B[:, 1]
    return np.asarray((x > x0 - behind) & (x < x1 + ahead) & (y > y0 - aside) & (y < y1 + aside))


def _clusters(points_B: FloatArray, cell_m: float) -> list[FloatArray]:
    """Clusters points (N, 3) by neighbourhood on a grid seen from above."""
    if len(points_B) == 0:
        return []
    labels, count = grid_labels(points_B[:, :2], cell_m, dilated=True)
    groups = [points_B[labels == k] for k in range(1, count)]
    return [group for group in groups if len(group) >= 3]


def _is_person_sized(points_B: FloatArray) -> bool:
    spans = np.ptp(points_B[:, :2] - points_B[:, :2].mean(axis=0), axis=0)
    width = float(np.hypot(*spans))
    tall = float(np.ptp(points_B[:, 2])) > 0.1
    return len(points_B) >= _FEWEST_POINTS and _WIDTH_M[0] < width < _WIDTH_M[1] and tall


def _is_leg_sized(points_B: FloatArray) -> bool:
    width = float(np.hypot(*np.ptp(points_B[:, :2], axis=0)))
    return len(points_B) >= _LEGS_FEWEST_POINTS and _LEGS_WIDTH_M[0] < width < _LEGS_WIDTH_M[1]


def _is_alone(points_B: FloatArray, others: list[FloatArray]) -> bool:
    """Returns whether no other cluster is close; walls and cupboards seldom stand alone."""
    centre = points_B[:, :2].mean(axis=0)
    reach = float(np.max(np.linalg.norm(points_B[:, :2] - centre, axis=1))) + _ALONE_M
    return all(float(np.min(np.linalg.norm(other[:, :2] - centre, axis=1))) > reach for other in others)


def _person(stamp_s: float, X_WB: RigidTransform, points_B: FloatArray) -> SeenPerson:
    """Person whose front is a cluster: the axis is a little behind its middle."""
    centre = points_B[:, :2].mean(axis=0)
    behind = centre + _FRONT_TO_AXIS_M * centre / max(float(np.linalg.norm(centre)), 1e-6)
    x, y, _ = (float(value) for value in X_WB @ np.array([*behind, 0.0]))
    return SeenPerson((x, y), _AXIS_SIGMA_M**2 * np.eye(2), 1.0, stamp_s, Pose2D.from_transform(X_WB))


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
        least = math.cos(self._options.view_rad)
        return [each for each in cameras if np.any(np.cos(bearings_rad - each.heading_rad) > least)]

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


def cameras_towards(velocity: FloatArray, known: Sequence[CameraCapabilities]) -> tuple[CameraCapabilities, ...]:
    """Body cameras that face the direction of a body-frame velocity; the front ones when the robot stands or turns."""
    vx, vy = float(velocity[0]), float(velocity[1])
    heading_rad = 0.0
    if abs(vy) > 2.0 * abs(vx):
        heading_rad = math.copysign(math.pi / 2, vy)
    elif vx < 0.0:
        heading_rad = math.pi
    return tuple(camera for camera in known if camera.looks_towards(heading_rad))
