"""What a picture shows of a surface: its plane, and the points above it grouped on a grid, whatever they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Surface
from skills.detection import box_overlap
from skills.geometry import inside_polygon
from skills.perception.detection_3d import Detection3D
from skills.perception.plane import LevelPlane
from skills.perception.point_cloud import PointCloud, camera_pose_W, cloud_from_image, grid_labels
from skills.perception.shape import SeenShape, measure
from skills.perception.touching import touching_parts
from skills.robot import FloatArray, Image

_CELL_M = 0.008
_LOWEST_M = 0.008
_HIGHEST_M = 0.4
_FEWEST_POINTS = 40
_PLANE_BAND_M = 0.05
_PLANE_POINTS = 6000
_SAME_THING_M = 0.06
_LEAST_OVERLAP = 0.2
_LEAST_PART = 0.15
_GAP_PX = 11
_APART_M = 0.035
_COLUMN_M, _UNDER_HANGING_M, _LOWEST_HIDDEN_M = 0.04, 0.12, 0.28
_COLUMN_STRIDES = np.array([1 << 20, 1])


@dataclass(frozen=True)
class Cluster:
    """The points of one object, the plane that it stands on, its shape and its box (u0, v0, u1, v1) in the picture."""

    points: PointCloud
    surface: str
    plane: LevelPlane
    shape: SeenShape
    box: tuple[int, int, int, int]

    @property
    def base_m(self) -> float:
        """Height of the surface under the object."""
        return float(self.plane.z(np.array([self.shape.centre]))[0])


@dataclass(frozen=True)
class SurfaceView:
    """What one picture shows of a surface: the plane, its own points, and the clusters on it."""

    plane: LevelPlane
    plane_points: PointCloud
    clusters: tuple[Cluster, ...]


def view_surface(image: Image, X_WO: RigidTransform, surface: Surface, margin_m: float = 0.03) -> SurfaceView | None:
    """Plane and clusters of one surface in a picture; None when too little of the surface is seen."""
    return next(view_surfaces(image, X_WO, (surface,), margin_m))


def view_surfaces(
    image: Image, X_WO: RigidTransform, surfaces: Sequence[Surface], margin_m: float = 0.03
) -> Iterator[SurfaceView | None]:
    """The same for each of some surfaces."""
    levels_m = [surface.height_m for surface in surfaces]
    band_m = (min(levels_m, default=0.0) - _PLANE_BAND_M, max(levels_m, default=0.0) + _HIGHEST_M)
    cloud, p_WC = cloud_from_image(image, X_WO, heights_m=band_m), camera_pose_W(image, X_WO).translation()
    return (_view(cloud, p_WC, surface, margin_m) for surface in surfaces)


def _view(cloud: PointCloud, p_WC: FloatArray, surface: Surface, margin_m: float) -> SurfaceView | None:
    above = cloud.p_W[:, 2] - surface.height_m
    over = (above > -_PLANE_BAND_M) & (above < _HIGHEST_M)
    over[over] = inside_polygon(cloud.p_W[over, :2], surface.polygon_W, margin_m)
    cloud = cloud.where(over)
    plane = fit_plane(cloud.p_W, surface.height_m)
    if plane is None:
        return None
    height = cloud.p_W[:, 2] - plane.z(cloud.p_W[:, :2])
    standing = height > max(_LOWEST_M, 3.0 * plane.noise_m)
    standing[standing] = resting(cloud.p_W[standing, :2], height[standing])
    clusters = tuple(_cluster(points, surface.name, plane, p_WC) for points in _groups(cloud.where(standing)))
    return SurfaceView(plane, cloud.where(np.abs(height) < max(_LOWEST_M, 3.0 * plane.noise_m)), clusters)


def resting(xy: FloatArray, height_m: FloatArray) -> NDArray[np.bool_]:
    """Which points at places (N, 2) and heights (N,) over a surface may belong to something that rests on it.

    What hangs over it does not, as the board above on a shelf: there is a gap below it.
    """
    columns = np.floor(xy / _COLUMN_M).astype(np.int64) @ _COLUMN_STRIDES
    order = np.lexsort((height_m, columns))
    column, height = columns[order], height_m[order]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = column[1:] != column[:-1]
    gap = np.where(first, height > _LOWEST_HIDDEN_M, np.diff(height, prepend=0.0) > _UNDER_HANGING_M)
    gaps = np.cumsum(gap)
    before = np.maximum.accumulate(np.where(first, gaps - gap, 0))
    found = np.empty(len(order), dtype=np.bool_)
    found[order] = gaps == before
    return found


def fit_plane(points_W: FloatArray, height_m: float) -> LevelPlane | None:
    """The plane near a surveyed height, robust against objects standing on it; None when too few points show it."""
    near = points_W[np.abs(points_W[:, 2] - height_m) < _PLANE_BAND_M]
    if len(near) < 80:
        return None
    near = near[:: max(1, len(near) // _PLANE_POINTS)]
    counts, edges = np.histogram(near[:, 2], bins=np.arange(height_m - _PLANE_BAND_M, height_m + _PLANE_BAND_M, 0.004))
    smooth = np.convolve(counts, [1, 2, 1], mode="same")
    level = float(edges[int(np.argmax(smooth))] + 0.002)
    origin = near[:, :2].mean(axis=0)
    plane = LevelPlane((float(origin[0]), float(origin[1])), level, (0.0, 0.0), 0.004)
    for _ in range(4):
        plane = plane.refined(near, max(0.006, 2.5 * plane.noise_m)) or plane
    return plane


def _groups(points: PointCloud) -> list[PointCloud]:
    """Points grouped by neighbourhood on a grid seen from above."""
    if len(points) < _FEWEST_POINTS:
        return []
    labels, count = grid_labels(points.p_W[:, :2], _CELL_M, fewest=2, dilated=True)
    groups = [points.where(labels == k) for k in range(1, count)]
    return [group for group in groups if len(group) >= _FEWEST_POINTS]


def _cluster(points: PointCloud, surface: str, plane: LevelPlane, p_WC: FloatArray) -> Cluster:
    (u0, v0), (u1, v1) = points.pixels.min(axis=0), points.pixels.max(axis=0)
    shape = measure(points.p_W, plane.z(points.p_W[:, :2]), p_WC)
    return Cluster(points, surface, plane, shape, (int(u0), int(v0), int(u1), int(v1)))


def parted(view: SurfaceView, detected: Detection3D) -> SurfaceView:
    """The view with a detected object cut out of a cluster that holds others as well, such as two objects that touch.

    What is above or below it is a part of it that its box left out.
    """
    whole = cluster_of(view.clusters, detected)
    if whole is None or len(detected.pixels) == 0:
        return view
    own = _own(whole.points.pixels, detected.pixels)
    if min(np.count_nonzero(own), np.count_nonzero(~own)) < max(_FEWEST_POINTS, _LEAST_PART * len(own)):
        return view
    halves = (whole.points.where(own), whole.points.where(~own))
    middles = [np.median(points.p_W[:, :2], axis=0) for points in halves]
    if float(np.linalg.norm(middles[0] - middles[1])) < _APART_M:
        return view
    parts = tuple(_cluster(points, whole.surface, whole.plane, detected.eye_W) for points in halves)
    others = tuple(each for each in view.clusters if each is not whole)
    return SurfaceView(view.plane, view.plane_points, (*parts, *others))


def apart(view: SurfaceView, p_WC: FloatArray) -> SurfaceView:
    """The view, seen from p_WC, with objects that touch as clusters of their own, whatever they are."""
    return SurfaceView(
        view.plane, view.plane_points, tuple(one for each in view.clusters for one in _split(each, p_WC))
    )


def _split(cluster: Cluster, p_WC: FloatArray) -> tuple[Cluster, ...]:
    labels, count = touching_parts(cluster.points.p_W[:, :2])
    if count == 1:
        return (cluster,)
    parts = (cluster.points.where(labels == k) for k in range(count))
    return tuple(_cluster(points, cluster.surface, cluster.plane, p_WC) for points in parts)


def _own(pixels: NDArray[np.int64], of_thing: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which pixels (N, 2) lie among those of an object, which may be only every few of them."""
    width, height = np.maximum(pixels.max(axis=0), of_thing.max(axis=0)) + 1
    mask = np.zeros((height, width), dtype=np.uint8)
    mask[of_thing[:, 1], of_thing[:, 0]] = 1
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((_GAP_PX, _GAP_PX), np.uint8))
    return np.asarray(closed[pixels[:, 1], pixels[:, 0]] > 0)


def cluster_of(clusters: tuple[Cluster, ...], detected: Detection3D) -> Cluster | None:
    """The cluster that a detected object is: the one near it whose box overlaps the detection's most; None if none."""
    near = [one for one in clusters if _apart(one, detected) < _SAME_THING_M + 0.5 * one.shape.length_m]
    overlaps = {id(one): box_overlap(one.box, detected.detection.box) for one in near}
    best = max(near, key=lambda one: overlaps[id(one)], default=None)
    return best if best is not None and overlaps[id(best)] > _LEAST_OVERLAP else None


def _apart(cluster: Cluster, detected: Detection3D) -> float:
    return float(np.linalg.norm(np.array(cluster.shape.centre) - detected.position_W[:2]))
