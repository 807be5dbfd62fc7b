"""Detections in 3D: position, size, surface and colours of detected objects in the world."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RollPitchYaw

from skills.api import FLOOR, Detection, LocalisationEstimate, ObjectKind, ObjectObservation, Surface
from skills.class_forms import MEANS_BIG, NON, class_form, class_forms, colour_words
from skills.geometry import inside_polygon
from skills.perception.point_cloud import Mask, camera_pose_W, closed_mask, project
from skills.perception.position import Position, locate
from skills.robot import FloatArray, Image

_SURFACE_MARGIN_M = 0.05
_SURFACE_HEIGHT_M = 0.10
_FLOOR_HEIGHT_M = 0.08
_FAR_TOO_LARGE = 1.5
_LEAST_COLOUR_SHARE = 0.3
_DEEP_M = 0.1
"""Extent in depth of the points that belong to one object."""


@dataclass(frozen=True)
class Detection3D:
    """One detection with its position in the world.

    `covariance` (3, 3) of position_W comes from the camera alone; `place_covariance` adds the localisation's. `size_m`
    and `yaw_rad` are as in `ObjectObservation`. `eye_W` is the camera's position. `pixels` (N, 2) as (u, v) are the
    object's own, according to depth, with their `colours` (N, 3), which are empty in a grey picture. `surface` is the
    name of the surface below it, "floor" for the floor, None when unknown. `is_segmented`: depth shows the object as a
    cluster of its own; `shape` is then the likelihood of each class by its shape, None when unknown.
    """

    stamp_s: float
    detection: Detection
    position_W: FloatArray
    covariance: FloatArray
    place_covariance: FloatArray
    size_m: tuple[float, float, float]
    yaw_rad: float
    eye_W: FloatArray
    pixels: NDArray[np.int64]
    colours: NDArray[np.uint8]
    surface: str | None
    is_segmented: bool = False
    shape: Mapping[str, float] | None = None

    @property
    def class_name(self) -> str:
        """Class of the detection."""
        return self.detection.class_name


def detections_3d(
    image: Image, localisation: LocalisationEstimate, detections: Iterable[Detection], surfaces: Sequence[Surface]
) -> tuple[Detection3D, ...]:
    """Locates detections in the world.

    Omits detections without depth, and those far larger than the longest objects in their class.
    """
    found = list(detections)
    placed = zip(found, _positions(image, found), strict=True)
    return tuple(
        _detection_3d(image, localisation, detection, position, surfaces)
        for detection, position in placed
        if position is not None
        if position.spanned_m <= _FAR_TOO_LARGE * class_form(detection.class_name).length_m[1]
    )


def _positions(image: Image, detections: Sequence[Detection]) -> list[Position | None]:
    """Locates each detection; long objects last, without the pixels of others, which may lie between their ends."""
    shape = (image.intrinsics.height, image.intrinsics.width)
    taken: Mask = np.zeros(shape, dtype=bool)
    found = dict[int, Position | None]()
    for k in sorted(range(len(detections)), key=lambda k: _is_long(detections[k])):
        long = _is_long(detections[k])
        position = found[k] = locate(image, detections[k], taken if long else None)
        if position is not None and not long:
            taken |= closed_mask(position.segment.pixels, *shape)
    return [found[k] for k in range(len(detections))]


def _is_long(detection: Detection) -> bool:
    return class_form(detection.class_name).form == "long"


def _detection_3d(
    image: Image,
    localisation: LocalisationEstimate,
    detection: Detection,
    position: Position,
    surfaces: Sequence[Surface],
) -> Detection3D:
    X_WO, extents = localisation.X_WO, position.extents
    R_WO = X_WO.rotation().matrix()
    p_W = np.asarray(X_WO @ position.p_OT)
    covariance = R_WO @ position.covariance_O @ R_WO.T
    p_WB = X_WO @ image.frames.pose("body").translation() if "body" in image.frames.edges else X_WO.translation()
    pixels = position.segment.pixels
    return Detection3D(
        stamp_s=image.stamp_s,
        detection=detection,
        position_W=p_W,
        covariance=covariance,
        place_covariance=covariance + place_covariance(p_W, p_WB, localisation.covariance),
        size_m=(extents.length_m, extents.width_m, extents.height_m),
        yaw_rad=extents.yaw_rad + float(RollPitchYaw(X_WO.rotation()).yaw_angle()),
        eye_W=camera_pose_W(image, X_WO).translation(),
        pixels=pixels,
        colours=np.empty((0, 3), np.uint8) if image.colour is None else image.colour[pixels[:, 1], pixels[:, 0]],
        surface=surface_below(p_W, p_W[2] - 0.5 * extents.height_m, surfaces),
    )


def at_points(
    detection: Detection, image: Image, localisation: LocalisationEstimate, points_W: FloatArray, surface: str
) -> Detection3D | None:
    """Locates a detection without depth by the nearest of the points (N, 3) on a surface that lie in its box, or below
    it where the gripper hides the object's lower part.

    Returns None when no points do, or the box is far too large. The sizes are those that are usual in its class.
    """
    X_WC, (u0, v0, u1, v1) = camera_pose_W(image, localisation.X_WO), detection.box
    points_C = (points_W - X_WC.translation()) @ X_WC.rotation().matrix()
    (u, v), range_m, form = project(points_C, image.intrinsics), points_C[:, 2], class_form(detection.class_name)
    whole = np.maximum(v1, v0 + form.length_m[1] * image.intrinsics.fy / np.maximum(range_m, _DEEP_M))
    inside = (u > u0) & (u < u1) & (v > v0) & (v < whole) & (range_m > 0.0)
    nearest_m = float(np.min(range_m[inside], initial=np.inf))
    if (u1 - u0) * nearest_m / image.intrinsics.fx > _FAR_TOO_LARGE * form.length_m[1]:
        return None
    p_W = np.median(points_W[inside & (range_m < nearest_m + _DEEP_M)], axis=0)
    covariance, empty = np.diag([_DEEP_M**2] * 3), np.empty((0, 2), np.int64)
    size_m = (form.width_m[1], form.width_m[1], form.usual_m)
    at = (p_W, covariance, covariance, size_m, 0.0, X_WC.translation(), empty, np.empty((0, 3), np.uint8), surface)
    return Detection3D(image.stamp_s, detection, *at)


def place_covariance(p_W: FloatArray, p_WB: FloatArray, covariance: FloatArray) -> FloatArray:
    """Covariance (3, 3) of a point p_W seen from p_WB that results from the robot's pose covariance (x, y, yaw)."""
    dx, dy = p_W[0] - p_WB[0], p_W[1] - p_WB[1]
    jacobian = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 0.0]])
    return np.asarray(jacobian @ covariance @ jacobian.T)


def surface_below(p_W: FloatArray, base_m: float, surfaces: Sequence[Surface]) -> str | None:
    """Name of the surface below an object at p_W with its base at `base_m`: "floor" for the floor, None if unknown."""
    above = (one for one in surfaces if inside_polygon(p_W[None, :2], one.polygon_W, _SURFACE_MARGIN_M)[0])
    off = {surface.name: abs(base_m - surface.height_m) for surface in above}
    near = [name for name in sorted(off, key=lambda name: off[name]) if off[name] < _SURFACE_HEIGHT_M]
    return near[0] if near else FLOOR if abs(base_m) < _FLOOR_HEIGHT_M else None


def observation(detected: Detection3D, attributes: tuple[str, ...] = ()) -> ObjectObservation:
    """Converts a 3D detection to an observation."""
    x, y, z = (float(value) for value in detected.position_W)
    return ObjectObservation(
        stamp_s=detected.stamp_s,
        kind=ObjectKind(detected.class_name, attributes),
        position_W=(x, y, z),
        size_m=detected.size_m,
        yaw_rad=detected.yaw_rad,
        score=round(detected.detection.score, 3),
        surface=detected.surface,
    )


def has_attribute(detected: Detection3D, attribute: str) -> bool:
    """Returns whether a detected object has an attribute, by the colours of its own pixels or by its size in its class.

    Raises KeyError for an unknown word.
    """
    word = attribute.lower()
    if word.startswith(NON):
        return len(detected.colours) > 0 and not has_attribute(detected, word.removeprefix(NON))
    if word in MEANS_BIG:
        form = class_forms().get(detected.class_name)
        if form is None:
            return False
        is_big = max(detected.size_m) > math.sqrt(form.length_m[0] * form.length_m[1])
        return is_big is MEANS_BIG[word]
    return len(detected.colours) > 0 and colour_words()[word].share(detected.colours) > _LEAST_COLOUR_SHARE
