"""Camera targets on surfaces, and boxes around surfaces and clusters for the arm's collision checks."""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Surface
from skills.geometry import grid_inside
from skills.manipulation.arm.collision import Box
from skills.perception.point_cloud import distinct_cells
from skills.perception.surface_segmentation import Cluster
from skills.robot import FloatArray

NEAREST_M = 0.35
FURTHEST_M = 3.2
_HALF_WIDTH_RAD = 0.42
_HALF_HEIGHT_RAD = 0.34
_CAMERA_HEIGHT_M = 0.5
_CAMERA_RADIUS_M = 0.22
_BEARING_LIMIT_RAD = 2.3
_CELL_M = 0.03
_WHOLE_M = 0.15
_LEAST_FILLED = 0.5
_SPLITS = 5
_LOWEST_TOP_M = 0.06
"""Height below which a surface is the floor."""


def look_targets(surface: Surface, X_WB: RigidTransform, p_BS: FloatArray) -> list[FloatArray]:
    """Points p_BT on a surface whose views cover the part visible from the shoulder p_BS, the middle ones first.

    Empty when no part lies between NEAREST_M and FURTHEST_M and within the arm's rotation.
    """
    xy = np.concatenate([np.asarray(surface.polygon_W, dtype=float), grid_inside(surface.polygon_W, 0.1)])
    samples = np.column_stack([xy, np.full(len(xy), surface.height_m)])
    offsets = samples @ X_WB.inverse().rotation().matrix().T + X_WB.inverse().translation() - p_BS
    bearing, distance = np.arctan2(offsets[:, 1], offsets[:, 0]), np.hypot(offsets[:, 0], offsets[:, 1])
    seen = (distance > NEAREST_M) & (distance < FURTHEST_M) & (np.abs(bearing) < _BEARING_LIMIT_RAD)
    if not np.any(seen):
        return []
    height = float(offsets[:, 2].mean())
    pitch = np.arctan2(_CAMERA_HEIGHT_M - height, np.maximum(distance - _CAMERA_RADIUS_M, 0.05))
    aims = [
        (aim, tilt)
        for aim, column in _bins(bearing, seen, _HALF_WIDTH_RAD)
        for tilt, _ in _bins(pitch, column, _HALF_HEIGHT_RAD)
    ]
    middle = float(np.median(bearing[seen]))
    reaches = [_CAMERA_RADIUS_M + (_CAMERA_HEIGHT_M - height) / np.tan(tilt) for _, tilt in aims]
    targets = [
        (abs(aim - middle), p_BS + [reach * np.cos(aim), reach * np.sin(aim), height])
        for (aim, _), reach in zip(aims, reaches, strict=True)
    ]
    return [target for _, target in sorted(targets, key=lambda entry: entry[0])]


def _bins(values: FloatArray, among: NDArray[np.bool_], half_rad: float) -> list[tuple[float, NDArray[np.bool_]]]:
    """Centres of the fewest angle ranges that cover the values in a mask, each with the mask of its values."""
    low, high = float(values[among].min()), float(values[among].max())
    count = max(1, int(np.ceil((high - low) / (2 * half_rad))))
    half = max(0.5 * (high - low) / count, 1e-6)
    middles = [low + (2 * k + 1) * half for k in range(count)]
    masks = [among & (np.abs(values - middle) <= half + 1e-9) for middle in middles]
    return [(middle, mask) for middle, mask in zip(middles, masks, strict=True) if np.any(mask)]


def surface_boxes(surfaces: Iterable[Surface], X_WB: RigidTransform) -> list[Box]:
    """Solid boxes from just above the floor to the tops of surfaces, in the body frame."""
    standing = (s for s in surfaces if s.height_m > _LOWEST_TOP_M)
    return [_standing_box(np.asarray(s.polygon_W, dtype=float), 0.05, s.height_m, X_WB) for s in standing]


def cluster_boxes(clusters: Iterable[Cluster], X_WB: RigidTransform, grow_m: float = 0.01) -> list[Box]:
    """Bounding boxes of clusters, in the body frame; several for a cluster that fills one box poorly."""
    parts = ((cluster, xy) for cluster in clusters for xy in standing_parts(cluster.points.p_W[:, :2]))
    return [part_box(cluster, xy, X_WB, grow_m) for cluster, xy in parts]


def standing_parts(xy: FloatArray, depth: int = _SPLITS) -> list[FloatArray]:
    """Splits points (N, 2) into groups that fill their rectangles; two walls at a corner are two groups.

    Splits a mostly empty rectangle in the middle of its longer side, at most `depth` times.
    """
    (x, y), (width, height), angle_deg = cv2.minAreaRect((middled := xy - xy.mean(axis=0)).astype(np.float32))
    cells = distinct_cells(np.floor(xy / _CELL_M).astype(np.int64))
    filled = len(cells) * _CELL_M**2 >= _LEAST_FILLED * width * height
    if depth == 0 or filled or max(width, height) < _WHOLE_M:
        return [xy]
    along_rad = np.radians(angle_deg + (0.0 if width >= height else 90.0))
    before = (middled - [x, y]) @ [np.cos(along_rad), np.sin(along_rad)] < 0.0
    halves = [half for half in (xy[before], xy[~before]) if len(half)]
    return [part for half in halves for part in standing_parts(half, depth - 1)]


def part_box(cluster: Cluster, xy: FloatArray, X_WB: RigidTransform, grow_m: float = 0.01) -> Box:
    """Bounding box of the points (N, 2) of a cluster, grown by grow_m, in the body frame."""
    top_m = cluster.base_m + cluster.shape.height_m + grow_m
    return _standing_box(xy, cluster.base_m, top_m, X_WB, grow_m)


def _standing_box(xy: FloatArray, bottom_m: float, top_m: float, X_WB: RigidTransform, grow_m: float = 0.0) -> Box:
    """Upright bounding box in B of points (x, y) in W."""
    middle = xy.mean(axis=0)
    (x, y), (width, depth), angle = cv2.minAreaRect((xy - middle).astype(np.float32))
    centre = [middle[0] + x, middle[1] + y, 0.5 * (bottom_m + top_m)]
    X_WG = RigidTransform(RotationMatrix.MakeZRotation(float(np.radians(angle))), centre)
    size = (max(width, 0.01) + 2 * grow_m, max(depth, 0.01) + 2 * grow_m, top_m - bottom_m)
    return Box(X_WB.inverse() @ X_WG, size)
