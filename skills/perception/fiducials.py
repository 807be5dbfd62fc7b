"""Fiducials: the AprilTags (family 36h11) that a picture shows, each with its pose.

The enlarged picture shows which tags there are; in an enlarged crop the edges of each give its corners to a tenth of a
pixel. A square has two poses that explain its corners almost equally well when it is small (Collins and Bartoli,
"Infinitesimal plane-based pose estimation", 2014). Both are fitted to the corners and to the depth inside the tag; the
better one counts. Depth decides the tilt where corners cannot.

The frame of a tag (T) is at its middle: x to the right and y up on the upright tag, z out of its face. The size of a
tag is the side of its black square.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.robot import FloatArray, Image, Picture

_SEARCHED_PX, _CROP_PX = 1280, 100
_WINDOWS: Final = {"adaptiveThreshWinSizeMin": 5, "adaptiveThreshWinSizeMax": 29, "adaptiveThreshWinSizeStep": 8}
_SMALL: Final = {"minMarkerPerimeterRate": 0.01}
_EDGES: Final = {"cornerRefinementMethod": cv2.aruco.CORNER_REFINE_APRILTAG}
_READ: Final = {"perspectiveRemovePixelPerCell": 8}
_CORNER_SIGMA_PX: Final = 0.2
_DEPTH_SIGMA_M, _DEPTH_SIGMA_PER_M = 0.002, 0.0015
_MOST_SIGMAS: Final = 3.0
_FEWEST_DEPTHS, _MOST_DEPTHS = 12, 400
_MOST_ERROR_PX: Final = 1.0
_SAME_RAD: Final = 0.05
"""Angle between two rotations below which both solutions are one."""


@dataclass(frozen=True)
class SeenTag:
    """A tag in one picture: its pose in the odometry frame at capture, and its corners (4, 2) in pixels.

    `error_px` is the root mean square of the corners' reprojection errors. `ambiguity` is the likelihood of the other
    pose relative to this one, from 0 to 1.
    """

    id: int
    stamp_s: float
    X_OT: RigidTransform
    corners: FloatArray
    error_px: float
    ambiguity: float


def find_tags(image: Image, sizes_m: Mapping[int, float]) -> tuple[SeenTag, ...]:
    """Finds the tags of these sizes (m) by id in a picture; other tags, and what only resembles a tag, are ignored."""
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
    """Yields the tags of a picture with their corners, from the upper left one on clockwise."""
    scale = max(1, round(_SEARCHED_PX / grey.shape[1]))
    for tag, corners in _detected(_enlarged(grey, scale), {**_WINDOWS, **_SMALL}):
        quad = _refined(grey, tag, (corners + 0.5) / scale - 0.5)
        if quad is not None:
            yield tag, quad


def _refined(grey: Picture, tag: int, corners: FloatArray) -> FloatArray | None:
    """Corners by the straight lines through the edges in an enlarged crop; None where the tag is not found again."""
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
    """Pose of a tag by the better of both solutions; None for corners that no pose explains."""
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
    rotation, *_ = rotations = [_rotation(fit[0]) for fit in fits]
    others = [
        fit
        for fit, turned in zip(fits, rotations, strict=True)
        if (rotation.inverse() @ turned).ToAngleAxis().angle() > _SAME_RAD
    ]
    X_OT = image.frames.pose(image.camera_frame) @ RigidTransform(rotation, pose[3:])
    ambiguity = max((float(np.exp(cost - other[1])) for other in others), default=0.0)
    return SeenTag(tag, image.stamp_s, X_OT, corners, error_px, ambiguity)


def _rotation(pose: FloatArray) -> RotationMatrix:
    return RotationMatrix.ProjectToRotationMatrix(cv2.Rodrigues(pose[:3])[0])


def _fitted(
    start: FloatArray, square: FloatArray, corners: FloatArray, K: FloatArray, points_C: FloatArray
) -> tuple[FloatArray, float, float]:
    """Fits a pose (rotation vector, position) to corners and depth: the pose, half the chi square, the error (px)."""
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
    """Points (N, 3) that the depth image shows inside a tag, in the camera frame; none where it shows too few."""
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
