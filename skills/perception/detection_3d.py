"""Detections with a place: where in the world each object is, how large, on which surface, of which colours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw

from skills.api import FLOOR, Detection, LocalisationEstimate, ObjectKind, ObjectObservation, Surface
from skills.geometry import inside_polygon
from skills.perception.class_forms import class_forms
from skills.perception.point_cloud import camera_pose_W
from skills.perception.position import Position, position_of
from skills.robot import FloatArray, Image

_SURFACE_MARGIN_M = 0.05
_SURFACE_HEIGHT_M = 0.10
_FLOOR_HEIGHT_M = 0.08
_FAR_TOO_LARGE = 1.5


@dataclass(frozen=True)
class Detection3D:
    """One detection with its place in the world.

    `covariance` (3, 3) is that of position_W from the camera at capture; `place_covariance` adds the localisation's.
    `size_m` and `yaw_rad` are as in `ObjectObservation`; `eye_W` is where the camera was; `pixels` (N, 2) as (u, v) are
    the object's own, as far as depth tells, and `colours` (N, 3) theirs, none in a grey picture; `surface` is what it
    rests on, "floor" for the floor, None for what is not known.
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

    @property
    def class_name(self) -> str:
        """The class of the detection."""
        return self.detection.class_name


def detections_3d(
    image: Image, localisation: LocalisationEstimate, detections: Iterable[Detection], surfaces: Sequence[Surface]
) -> tuple[Detection3D, ...]:
    """The detections that have a place.

    Left out are those where no depth is seen, of classes without a form, and those that span far more than the longest
    objects of their class do.
    """
    known = [detection for detection in detections if detection.class_name in class_forms()]
    placed = zip(known, _positions(image, known), strict=True)
    return tuple(
        _detection_3d(image, localisation, detection, position, surfaces)
        for detection, position in placed
        if position is not None and not _is_far_too_large(detection, position)
    )


def _is_far_too_large(detection: Detection, position: Position) -> bool:
    return position.spanned_m > _FAR_TOO_LARGE * class_forms()[detection.class_name].length_m[1]


def _positions(image: Image, detections: Sequence[Detection]) -> list[Position | None]:
    """The place of each detection; what long objects lie between or behind is found first, and is none of theirs."""
    shape = (image.intrinsics.height, image.intrinsics.width)
    taken, found = np.zeros(shape, dtype=bool), dict[int, Position | None]()
    for k in sorted(range(len(detections)), key=lambda k: _is_long(detections[k])):
        long = _is_long(detections[k])
        position = found[k] = position_of(image, detections[k], taken if long else None)
        if position is not None and not long:
            taken |= position.segment.pixel_mask(*shape)
    return [found[k] for k in range(len(detections))]


def _is_long(detection: Detection) -> bool:
    return class_forms()[detection.class_name].form == "long"


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
    pixels = _pixels(image, position)
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


def place_covariance(p_W: FloatArray, p_WB: FloatArray, covariance: FloatArray) -> FloatArray:
    """What the robot's uncertain place (x, y, yaw) does to a point seen from there: covariance (3, 3)."""
    dx, dy = p_W[0] - p_WB[0], p_W[1] - p_WB[1]
    jacobian = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 0.0]])
    return np.asarray(jacobian @ covariance @ jacobian.T)


def surface_below(p_W: FloatArray, base_m: float, surfaces: Sequence[Surface]) -> str | None:
    """The surface on which an object at p_W rests whose base is at a height (m), "floor", or None."""
    off = {surface.name: abs(base_m - surface.height_m) for surface in surfaces if _above(surface, p_W)}
    near = [name for name in sorted(off, key=lambda name: off[name]) if off[name] < _SURFACE_HEIGHT_M]
    return near[0] if near else FLOOR if abs(base_m) < _FLOOR_HEIGHT_M else None


def _above(surface: Surface, p_W: FloatArray) -> bool:
    return bool(inside_polygon(p_W[None, :2], surface.polygon_W, _SURFACE_MARGIN_M)[0])


def _pixels(image: Image, position: Position) -> NDArray[np.int64]:
    """The object's own pixels (N, 2)."""
    window, mask = position.segment.window, position.segment.mask
    u = np.clip(np.rint(window.u[mask]), 0, image.intrinsics.width - 1)
    v = np.clip(np.rint(window.v[mask]), 0, image.intrinsics.height - 1)
    return np.stack([u, v], axis=1).astype(np.int64)


def observation(detected: Detection3D, attributes: tuple[str, ...] = ()) -> ObjectObservation:
    """A 3D detection as an observation."""
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


def depth_ahead_m(image: Image, X_WO: RigidTransform, points_W: FloatArray) -> tuple[FloatArray, FloatArray]:
    """For points (N, 3): how deep they are in the picture (NaN outside of it), and how deep it is there (NaN: none)."""
    lens, X_CW = image.depth_intrinsics, camera_pose_W(image, X_WO).inverse()
    p_C = points_W @ X_CW.rotation().matrix().T + X_CW.translation()
    z = np.where(p_C[:, 2] > 0.05, p_C[:, 2], np.nan)
    with np.errstate(invalid="ignore"):
        u, v = p_C[:, 0] / z * lens.fx + lens.cx, p_C[:, 1] / z * lens.fy + lens.cy
        rows, columns = image.depth_m.shape[:2]
        inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    z = np.where(inside, z, np.nan)
    seen = np.full(len(points_W), np.nan)
    found = image.depth_m[np.rint(v[inside]).astype(int), np.rint(u[inside]).astype(int)].astype(np.float64)
    seen[inside] = np.where(np.isfinite(found) & (found > 0.0), found, np.nan)
    return z, seen
