"""Detection of people in LiDAR scans and in pictures of the body cameras, with positions in the world.

In a scan, a person is an upright cluster as wide as shoulders; for a single-ring LiDAR, a pair of legs or one leg.
Where a survey of the site explains walls and furniture, only the other returns count. Elsewhere only a person who
stands alone is detected.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Detection, Detector, ObjectKind, ObjectObservation, SurveyView
from skills.estimate.scan_points import placed_points, scan_points
from skills.perception.detector.camera_images import detect_class_in_grey, fresh_image
from skills.perception.point_cloud import grid_labels
from skills.perception.position import locate
from skills.robot import CameraCapabilities, Clock, FloatArray, Image, NoImageError, Pose2D, Robot, Scan
from skills.world_model import PERSON

_PERSON_SIZE_M = (0.5, 0.5, 1.7)
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
_BODY_HEIGHTS_M = (0.3, 1.9)
_BODY_WIDTH_M = (0.12, 0.9)
_BODY_TOP_M = 0.95
_BODY_TALL_M = 0.25
_BODY_FEWEST_POINTS = 8
_SHOULDERS_M = 0.6
"""Greatest width of one of several people side by side."""
_MOST_ABREAST = 3
_COLUMNS = 450
_FRONT_TO_AXIS_M = 0.1
_AXIS_SIGMA_M = 0.08
_OWN_M = (0.1, 0.05)
"""Reach of the robot beyond its outline: behind, to the sides."""
STOWED_AHEAD_M = 0.05
"""Reach of the robot beyond its outline ahead, with a stowed, empty arm."""
ARM_AHEAD_M = 0.19
"""The same with any other arm."""


@dataclass(frozen=True)
class SeenPerson:
    """A person: the vertical axis (x, y) in the world (m), its covariance (2, 2), and the time of the last detection.

    `here_W` is the robot's pose at that time. `looks` counts the pictures that showed the person, the last one at
    `picture_s`; `missed` counts later pictures that should have. A tracker sets `track`, a number above 0, the velocity
    (m/s), the number of `scans` that showed the person, the height `top_m` up to which they did, and how far the person
    has `moved_m` since the first of them.
    """

    place_W: tuple[float, float]
    covariance: FloatArray
    score: float
    stamp_s: float
    here_W: Pose2D
    looks: int = 1
    missed: int = 0
    picture_s: float = -math.inf
    track: int = 0
    velocity_W: tuple[float, float] = (0.0, 0.0)
    scans: int = 0
    top_m: float = 0.0
    moved_m: float = 0.0

    @property
    def distance_m(self) -> float:
        """Distance between the person and the robot at the last detection, in metres."""
        return math.dist(self.place_W, (self.here_W.x_m, self.here_W.y_m))


def people_in_scan(
    scan: Scan,
    X_WB: RigidTransform,
    footprint_m: Sequence[tuple[float, float]],
    furthest_m: float = 3.5,
    costmap: object = None,
    *,
    ahead_m: float = ARM_AHEAD_M,
    abreast: bool = False,
) -> list[SeenPerson]:
    """Detects people in a LiDAR scan, nearest first; ignores points inside and just outside the robot's footprint.

    With a `costmap` that has a survey of the site, what the survey explains is nobody, and a person may stand at a
    wall; without one, only who stands alone counts. With `abreast`, returns too wide for one person are several people.
    """
    corners = np.array(footprint_m)
    own_m = np.array([corners.min(axis=0) - (_OWN_M[0], _OWN_M[1]), corners.max(axis=0) + (ahead_m, _OWN_M[1])])
    if isinstance(costmap, SurveyView) and len(scan.elevations_rad) > 1:
        clusters = _unexplained_clusters(scan, X_WB, own_m, furthest_m, costmap)
        clusters = [one for each in clusters for one in (_abreast(each) if abreast else (each,))]
        people = [_person(scan.stamp_s, X_WB, cluster) for cluster in clusters if _is_body_sized(cluster)]
    else:
        people = _lone_people(scan, X_WB, own_m, furthest_m)
    return sorted((p for p in people if p.distance_m < furthest_m), key=lambda person: person.distance_m)


def _unexplained_clusters(
    scan: Scan, X_WB: RigidTransform, own_m: FloatArray, furthest_m: float, survey: SurveyView
) -> list[FloatArray]:
    """Clusters of returns that the survey does not explain, in the levelled body frame."""
    points = scan_points(scan, azimuths=_COLUMNS, heights_m=_BODY_HEIGHTS_M, max_range_m=furthest_m + 0.5)[:, :3]
    points = points[~_is_own(points, own_m)]
    here = Pose2D.from_transform(X_WB)
    return _clusters(points[survey.is_unexplained(placed_points(points, here))], _CELL_M)


def _lone_people(scan: Scan, X_WB: RigidTransform, own_m: FloatArray, furthest_m: float) -> list[SeenPerson]:
    """Detects people who stand alone in a scan, at a site without a survey."""
    points_B = scan.points_B()
    level = points_B @ scan.X_OB.rotation().matrix().T
    height = level[:, 2] + scan.X_OB.translation()[2]
    distance = np.hypot(points_B[:, 0], points_B[:, 1])
    planar = len(scan.elevations_rad) == 1
    tall = (height > (_LEGS_LOWEST_M if planar else _LOWEST_M)) & (height < _HIGHEST_M)
    near = tall & (distance < furthest_m + 0.5) & ~_is_own(points_B, own_m)
    clusters = _clusters(points_B[near], _LEGS_CELL_M if planar else _CELL_M)
    is_sized = _is_leg_sized if planar else _is_person_sized
    return [
        _person(scan.stamp_s, X_WB, cluster)
        for k, cluster in enumerate(clusters)
        if is_sized(cluster) and _is_alone(cluster, [other for j, other in enumerate(clusters) if j != k])
    ]


def _is_own(points_B: FloatArray, own_m: FloatArray) -> NDArray[np.bool_]:
    """Mask of the points in the robot's own rectangle, given by its lowest and highest x and y (2, 2)."""
    (x, y), (low, high) = points_B[:, :2].T, own_m
    return np.asarray((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]))


def _clusters(points_B: FloatArray, cell_m: float) -> list[FloatArray]:
    """Clusters points (N, 3) by neighbourhood on a grid seen from above."""
    if len(points_B) == 0:
        return []
    labels, count = grid_labels(points_B[:, :2], cell_m, dilated=True)
    groups = [points_B[labels == k] for k in range(1, count)]
    return [group for group in groups if len(group) >= 3]


def _is_person_sized(points_B: FloatArray) -> bool:
    spans = np.ptp(points_B, axis=0)
    width, is_tall = float(np.hypot(spans[0], spans[1])), float(spans[2]) > 0.1
    return len(points_B) >= _FEWEST_POINTS and _WIDTH_M[0] < width < _WIDTH_M[1] and is_tall


def _is_body_sized(points: FloatArray) -> bool:
    """Returns whether unexplained returns are as wide and tall as a person, who may be partly occluded."""
    width, tall = float(np.hypot(*np.ptp(points[:, :2], axis=0))), float(np.ptp(points[:, 2]))
    sized = _BODY_WIDTH_M[0] < width < _BODY_WIDTH_M[1] and tall > _BODY_TALL_M
    return len(points) >= _BODY_FEWEST_POINTS and sized and float(points[:, 2].max()) > _BODY_TOP_M


def _abreast(points: FloatArray) -> list[FloatArray]:
    """Splits returns that are too wide for one person into equally wide ones, along their length."""
    off = points[:, :2] - points[:, :2].mean(axis=0)
    along = off @ np.linalg.svd(off, full_matrices=False)[2][0]
    width = float(np.ptp(along))
    count = math.ceil(width / _SHOULDERS_M) if width > _WIDTH_M[1] else 1
    if not 1 < count <= _MOST_ABREAST:
        return [points]
    numbers = np.minimum((along - along.min()) * count // width, count - 1)
    return [points[numbers == number] for number in range(count)]


def _is_leg_sized(points_B: FloatArray) -> bool:
    width = float(np.hypot(*np.ptp(points_B[:, :2], axis=0)))
    return len(points_B) >= _LEGS_FEWEST_POINTS and _LEGS_WIDTH_M[0] < width < _LEGS_WIDTH_M[1]


def _is_alone(points_B: FloatArray, others: list[FloatArray]) -> bool:
    """Returns whether no other cluster is close; walls and cupboards seldom stand alone."""
    x, y, _ = points_B.mean(axis=0)
    reach = float(np.max(np.hypot(points_B[:, 0] - x, points_B[:, 1] - y))) + _ALONE_M
    return all(float(np.min(np.hypot(other[:, 0] - x, other[:, 1] - y))) > reach for other in others)


def _person(stamp_s: float, X_WB: RigidTransform, points_B: FloatArray) -> SeenPerson:
    """Person whose front is a cluster: the axis is a little behind its centre."""
    centre = points_B[:, :2].mean(axis=0)
    behind = centre + _FRONT_TO_AXIS_M * centre / max(float(np.linalg.norm(centre)), 1e-6)
    x, y, _ = (float(value) for value in X_WB @ np.array([*behind, 0.0]))
    covariance, here_W, top_m = _AXIS_SIGMA_M**2 * np.eye(2), Pose2D.from_transform(X_WB), float(points_B[:, 2].max())
    return SeenPerson((x, y), covariance, 1.0, stamp_s, here_W, top_m=top_m)


def pictures_with_depth(
    robot: Robot, clock: Clock, cameras: Sequence[CameraCapabilities]
) -> tuple[list[Image], list[str]]:
    """Takes a picture with each camera; returns those in which people can be located, and why others are useless."""
    images, faults = list[Image](), list[str]()
    for camera in cameras:
        try:
            image = fresh_image(robot, clock, camera.source, camera.source)
        except NoImageError as error:
            faults.append(str(error))
            continue
        if np.any(image.depth_m > 0.0):
            images.append(image)
        else:
            faults.append(f"the {camera.source} camera gives pictures without depth")
    return images, faults


def people_detections(detector: Detector, images: Sequence[Image], least_score: float) -> list[tuple[Image, Detection]]:
    """Detects people in pictures; pairs each detection with its picture."""
    found = detect_class_in_grey(detector, images, PERSON) if images else []
    pairs = ((image, one) for image, ones in zip(images, found, strict=True) for one in ones)
    return [(image, one) for image, one in pairs if one.class_name == PERSON and one.score >= least_score]


def located_people(
    detected: Sequence[tuple[Image, Detection]], X_WO: RigidTransform, here_W: Pose2D, reach_m: float
) -> tuple[list[SeenPerson], list[Detection]]:
    """Locates detected people within reach_m of the camera; returns them, and the detections without depth."""
    located, without_depth = list[SeenPerson](), list[Detection]()
    for image, one in detected:
        if (position := locate(image, one)) is None:
            without_depth.append(one)
            continue
        p_OC = image.frames.pose(image.camera_frame).translation()
        if float(np.hypot(*(position.p_OT - p_OC)[:2])) <= reach_m:
            x, y, _ = (float(value) for value in X_WO @ position.p_OT)
            turn = X_WO.rotation().matrix()
            covariance = (turn @ position.covariance_O @ turn.T)[:2, :2]
            located.append(SeenPerson((x, y), covariance, one.score, image.stamp_s, here_W))
    return located, without_depth


def cameras_towards(velocity: FloatArray, known: Sequence[CameraCapabilities]) -> tuple[CameraCapabilities, ...]:
    """Body cameras that face the direction of a body velocity; the front ones when the robot stands or turns."""
    vx, vy = float(velocity[0]), float(velocity[1])
    heading_rad = 0.0
    if abs(vy) > 2.0 * abs(vx):
        heading_rad = math.copysign(math.pi / 2, vy)
    elif vx < 0.0:
        heading_rad = math.pi
    return tuple(camera for camera in known if camera.looks_towards(heading_rad))


def person_observation(seen: SeenPerson, name: str, place: str | None) -> ObjectObservation:
    """Observation of a person under a name."""
    middle_W = (*seen.place_W, _PERSON_SIZE_M[2] / 2)
    return ObjectObservation(seen.stamp_s, ObjectKind(name), middle_W, _PERSON_SIZE_M, 0.0, seen.score, place)
