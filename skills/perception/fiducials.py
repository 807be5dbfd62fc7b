"""Fiducials: the AprilTags (family 36h11) in a picture, each with its pose.

The enlarged picture shows which tags there are; lines fitted to the edges in an enlarged crop give the corners to a
tenth of a pixel. A small square has two poses that explain its corners almost equally well (Collins and Bartoli,
"Infinitesimal plane-based pose estimation", 2014). Both are fitted to the corners and to the depth inside the tag; the
better one is used. Depth decides the tilt where corners cannot.

The origin of a tag's frame (T) is its centre: x to the right and y up on the upright tag, z out of its face. The size
of a tag is the side of its black square. A detector adds the objects with tags to those that another detector finds.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.class_forms import class_form
from skills.detection import Detection, Detections, Detector, DetectorWrapper, box_overlap
from skills.perception.object_segmentation import Box, Window, groups_in_picture, in_plane, level_planes, window_about
from skills.robot import FloatArray, Image, Picture
from skills.routine import Routine, RoutineSkill
from skills.world_model import Tag

_SEARCHED_PX = 1280
"""Width to which a smaller picture is enlarged for the search."""
_CROP_PX = 100
"""Side to which a smaller marker is enlarged to be read."""
_WINDOWS: Final = {"adaptiveThreshWinSizeMin": 5, "adaptiveThreshWinSizeMax": 29, "adaptiveThreshWinSizeStep": 8}
_SMALL: Final = {"minMarkerPerimeterRate": 0.01}
_EDGES: Final = {"cornerRefinementMethod": cv2.aruco.CORNER_REFINE_APRILTAG}
_READ: Final = {"perspectiveRemovePixelPerCell": 8}
_CORNER_SIGMA_PX: Final = 0.2
_DEPTH_SIGMA_M = 0.002
_DEPTH_SIGMA_PER_M = 0.0015
"""Growth of that deviation with the square of the depth."""
_MOST_SIGMAS: Final = 3.0
_FEWEST_DEPTHS = 12
_MOST_DEPTHS = 400
_MOST_ERROR_PX: Final = 1.0
_SAME_RAD: Final = 0.05
"""Angle between two rotations below which both solutions are one."""


@dataclass(frozen=True)
class SeenTag:
    """A tag in one picture: its pose in the odometry frame at capture, and its corners (4, 2) in pixels.

    `error_px` is the root mean square reprojection error of the corners. `ambiguity` is the likelihood of the competing
    pose relative to this one, from 0 to 1.
    """

    id: int
    stamp_s: float
    X_OT: RigidTransform
    corners: FloatArray
    error_px: float
    ambiguity: float


def find_tags(image: Image, sizes_m: Mapping[int, float]) -> tuple[SeenTag, ...]:
    """Finds the tags whose ids and sizes (m) are in `sizes_m`; ignores other tags and what only resembles a tag."""
    found = (_located(image, tag, corners, sizes_m[tag]) for tag, corners in _quads(image.grey) if tag in sizes_m)
    return tuple(each for each in found if each is not None)


@lru_cache(maxsize=1)
def _family() -> Any:
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


def _detected(picture: Picture, options: Mapping[str, Any]) -> Iterator[tuple[int, FloatArray]]:
    """Yields ids and corners (4, 2) of the tags in a picture, as OpenCV's detector finds them with these options."""
    parameters = cv2.aruco.DetectorParameters()
    for name, value in {**_READ, **options}.items():
        setattr(parameters, name, value)
    corners, ids, _ = cv2.aruco.ArucoDetector(_family(), parameters).detectMarkers(picture)
    for tag, quad in zip([] if ids is None else ids.ravel().tolist(), corners, strict=True):
        yield int(tag), np.asarray(quad, dtype=np.float64).reshape(4, 2)


def _quads(grey: Picture) -> Iterator[tuple[int, FloatArray]]:
    """Yields the tags in a picture with their corners, clockwise from the upper left one."""
    scale = max(1, round(_SEARCHED_PX / grey.shape[1]))
    for tag, corners in _detected(_enlarged(grey, scale), {**_WINDOWS, **_SMALL}):
        quad = _refined(grey, tag, (corners + 0.5) / scale - 0.5)
        if quad is not None:
            yield tag, quad


def _refined(grey: Picture, tag: int, corners: FloatArray) -> FloatArray | None:
    """Intersects lines fitted to the edges in an enlarged crop; None when the tag is not found again."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = float((high - low).max())
    u0, v0 = np.maximum(np.floor(low - 0.5 * side - 2.0).astype(int), 0)
    u1, v1 = np.ceil(high + 0.5 * side + 2.0).astype(int)
    scale = max(1, int(np.ceil(_CROP_PX / side)))
    again = dict(_detected(_enlarged(grey[v0 : v1 + 1, u0 : u1 + 1], scale), _EDGES))
    return again[tag] / scale - 0.5 + [u0, v0] if tag in again else None  # edges count from the border of a pixel


def _enlarged(grey: Picture, scale: int) -> Picture:
    if scale == 1:
        return np.ascontiguousarray(grey)
    return np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def _located(image: Image, tag: int, corners: FloatArray, size_m: float) -> SeenTag | None:
    """Pose of a tag: the better of both solutions; None when no pose explains the corners."""
    square = 0.5 * size_m * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
    lens = image.intrinsics
    K = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    _, turns, places, _ = cv2.solvePnPGeneric(square, corners, K, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    points_C = _points_inside(image, corners, size_m)
    starts = [np.concatenate([r.ravel(), t.ravel()]) for r, t in zip(turns, places, strict=True)]
    fits = sorted((_fitted(start, square, corners, K, points_C) for start in starts), key=lambda fit: fit[1])
    if not fits or fits[0][2] > _MOST_ERROR_PX:
        return None
    pose, cost, error_px = fits[0]
    rotation, *_ = rotations = [RotationMatrix.ProjectToRotationMatrix(cv2.Rodrigues(fit[0][:3])[0]) for fit in fits]
    others = [
        fit
        for fit, turned in zip(fits, rotations, strict=True)
        if (rotation.inverse() @ turned).ToAngleAxis().angle() > _SAME_RAD
    ]
    X_OT = image.frames.pose(image.camera_frame) @ RigidTransform(rotation, pose[3:])
    ambiguity = max((float(np.exp(cost - other[1])) for other in others), default=0.0)
    return SeenTag(tag, image.stamp_s, X_OT, corners, error_px, ambiguity)


def _fitted(
    start: FloatArray, square: FloatArray, corners: FloatArray, K: FloatArray, points_C: FloatArray
) -> tuple[FloatArray, float, float]:
    """Fits a pose (rotation vector, position) to corners and depth; returns it, half the chi square, the error (px)."""
    from scipy.optimize import least_squares

    depth_sigma_m = _DEPTH_SIGMA_M + _DEPTH_SIGMA_PER_M * points_C[:, 2] ** 2

    def off_px(pose: FloatArray) -> FloatArray:
        p_C = square @ cv2.Rodrigues(pose[:3])[0].T + pose[3:]
        uvw = p_C @ K.T
        return np.asarray(uvw[:, :2] / uvw[:, 2:] - corners)

    def residuals(pose: FloatArray) -> FloatArray:
        off_plane = (points_C - pose[3:]) @ cv2.Rodrigues(pose[:3])[0][:, 2] / depth_sigma_m
        near = np.clip(off_plane, -_MOST_SIGMAS, _MOST_SIGMAS)
        return np.concatenate([off_px(pose).ravel() / _CORNER_SIGMA_PX, near])

    fit = least_squares(residuals, start)
    return fit.x, float(fit.cost), float(np.sqrt(np.mean(np.square(off_px(fit.x)))))


def _points_inside(image: Image, corners: FloatArray, size_m: float) -> FloatArray:
    """Points (N, 3) inside a tag from the depth image, in the camera frame; none when there are too few."""
    depth, lens, fine = image.depth_m, image.depth_intrinsics, image.intrinsics
    if depth.size == 0:
        return np.empty((0, 3))
    scale = np.array([lens.fx / fine.fx, lens.fy / fine.fy])
    quad = (corners - [fine.cx, fine.cy]) * scale + [lens.cx, lens.cy]
    inside = np.zeros(depth.shape, dtype=np.uint8)
    cv2.fillConvexPoly(inside, np.rint(quad * 16).astype(np.int32), 1, shift=4)
    rows, columns = np.nonzero((inside > 0) & (depth > 0.0))
    if len(rows) < _FEWEST_DEPTHS:
        return np.empty((0, 3))
    z = depth[rows, columns].astype(np.float64)
    points = np.column_stack([(columns - lens.cx) / lens.fx * z, (rows - lens.cy) / lens.fy * z, z])
    near = points[np.abs(z - np.median(z)) < size_m]
    return np.asarray(near[:: max(1, len(near) // _MOST_DEPTHS)])


FIND_LATENCY_S: Final = 0.2
MOST_AMBIGUITY: Final = 0.3
"""Ambiguity of a tag's pose beyond which its picture does not count."""


def look_for_tags(
    skill: RoutineSkill[Any], source: str, sizes_m: Mapping[int, float], message: str
) -> Routine[list[SeenTag]]:
    """Takes a picture; returns the tags in it with ids and sizes (m) in `sizes_m` whose poses are unambiguous.

    Raises SkillFailure when the camera returns no picture.
    """
    robot = skill.context.robot
    image = yield from skill.sense(lambda: robot.image(source), latency_s=0.0, name="picture", message=message)
    found = yield from skill.compute(
        lambda: find_tags(image, sizes_m), latency_s=FIND_LATENCY_S, name="find tags", message=message
    )
    return [each for each in found if each.ambiguity <= MOST_AMBIGUITY]


TAG_SCORE: Final = 0.97
_LEAST_OVERLAP: Final = 0.5
_BELOW_M: Final = 0.004
"""Distance by which the surface below an object lies at least below its tag."""


def with_tags(detector: Detector, folders: Sequence[Path], tags: Sequence[Tag]) -> Detector:
    """Returns a detector that also recognises the objects with these tags; the same one when no object has a tag."""
    carried = {tag.id: tag for tag in tags if tag.on is not None and tag.p_W is None}
    return TagDetector(detector, tuple(carried.values())) if carried else detector


class TagDetector(DetectorWrapper):
    """Detector that adds the objects with known tags to the detections of the wrapped detector.

    In a picture without depth no tag is located.
    """

    def __init__(self, detector: Detector, tags: Sequence[Tag]) -> None:
        super().__init__(detector)
        self._sizes_m = {tag.id: tag.size_m for tag in tags}
        self._classes = {tag.id: str(tag.on) for tag in tags}

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes of the wrapped detector, and those with tags."""
        return tuple(dict.fromkeys((*self._detector.class_names, *self._classes.values())))

    def detect_with_depth(self, image: Image, found: Detections) -> Detections:
        """Adds the objects with tags; a tag replaces the wrapped detector's detections of the same object."""
        others, tagged = super().detect_with_depth(image, found), list[Detection]()
        for seen in find_tags(image, self._sizes_m):
            name = self._classes[seen.id]
            tagged += _unless_same([Detection(name, TAG_SCORE, box_of_carrier(image, seen, name))], tagged)
        return (*tagged, *_unless_same(others, tagged))


def _unless_same(found: Iterable[Detection], known: Sequence[Detection]) -> list[Detection]:
    """Detections of other objects than the known ones."""
    return [one for one in found if all(box_overlap(one.box, other.box) < _LEAST_OVERLAP for other in known)]


def box_of_carrier(image: Image, tag: SeenTag, class_name: str) -> Box:
    """Box of the object that carries a tag: the points connected with the tag above the surface below.

    Without depth it is the box of the tag.
    """
    (u0, v0), (u1, v1) = tag.corners.min(axis=0), tag.corners.max(axis=0)
    own = (float(u0), float(v0), float(u1), float(v1))
    reach_m, X_OC = class_form(class_name).length_m[1], image.frames.pose(image.camera_frame)
    p_CT = X_OC.inverse() @ tag.X_OT.translation()
    u, v, reach_px = 0.5 * (u0 + u1), 0.5 * (v0 + v1), reach_m * image.intrinsics.fx / p_CT[2]
    window = window_about(image, (u - reach_px, v - reach_px, u + reach_px, v + reach_px))
    if window is None:
        return own
    boxes = list(_boxes(window, tag, own, reach_m))
    return min(boxes, key=lambda box: (box[2] - box[0]) * (box[3] - box[1]), default=own)


def _boxes(window: Window, tag: SeenTag, own: Box, reach_m: float) -> Iterator[Box]:
    """Yields the box of the points connected with a tag, above each level plane below the tag, or without a plane."""
    near = window.valid & (np.linalg.norm(window.p_O - tag.X_OT.translation(), axis=-1) < reach_m)
    lowest_m = float(tag.X_OT.translation()[2])
    u0, v0, u1, v1 = own
    on_tag = (window.u >= u0) & (window.u <= u1) & (window.v >= v0) & (window.v <= v1)
    below = (plane for plane in level_planes(replace(window, inside=on_tag)) if plane.height_m < lowest_m - _BELOW_M)
    for plane in (*below, None):
        labels, _ = groups_in_picture(window, near & ~in_plane(window, plane))
        counts = np.bincount(labels[on_tag & (labels > 0)], minlength=1)
        if counts.sum() == 0:
            continue
        mask = labels == int(np.argmax(counts))
        yield (
            min(u0, float(window.u[mask].min())),
            min(v0, float(window.v[mask].min())),
            max(u1, float(window.u[mask].max())),
            max(v1, float(window.v[mask].max())),
        )
