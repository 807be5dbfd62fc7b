"""Segmentation of a surface in a depth image: its plane, and the clusters of points of the objects on it.

Objects that touch are split by their outline from above, at a narrow neck between two parts that bulge: the outline is
eroded until it falls into cores, and each cell goes to its nearest core. The parts count as objects only when each is
nearly convex and the whole is not: a wrench has a neck, too, but its halves are not convex. Boxes flush side by side
have no neck and stay one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Detection, LocalisationEstimate, Surface
from skills.detection import box_overlap
from skills.geometry import inside_polygon
from skills.perception.class_forms import ANY_OBJECT
from skills.perception.detection_3d import Detection3D, place_covariance
from skills.perception.fitting import LevelPlane, SeenShape, measure
from skills.perception.point_cloud import (
    Mask,
    PointCloud,
    camera_pose_W,
    closed_mask,
    cloud_from_image,
    grid_labels,
)
from skills.robot import FloatArray, Image

_CELL_M = 0.008
_LOWEST_M = 0.008
_HIGHEST_M = 0.4
_FEWEST_POINTS = 40
_PLANE_BAND_M = 0.05
_PLANE_POINTS = 6000
_FEWEST_PLANE_POINTS = 80
_SAME_OBJECT_M = 0.06
_LEAST_OVERLAP = 0.2
_LEAST_PART = 0.15
_APART_M = 0.035
_COLUMN_M = 0.04
_UNDER_HANGING_M = 0.12
_LOWEST_HIDDEN_M = 0.28
_COLUMN_STRIDES = np.array([1 << 20, 1])

_OUTLINE_CELL_M: Final = 0.004
_BORDER_CELLS: Final = 4
_MOST_ERODED_M: Final = 0.03
_LEAST_CORE_M2: Final = 0.00008
_LEAST_PART_M2: Final = 0.0003
_CONVEX: Final = 0.87
_MORE_CONVEX: Final = 0.03

_SEGMENT_SCORE = 0.7
"""Probability that a segment is an object: one picture may show noise, or a part of one."""
_RIM_M = 0.02
_BORDER_PX = 2
_LONGEST_M = 0.6
_SIGMA_M = (0.012, 0.012, 0.008)


@dataclass(frozen=True)
class Cluster:
    """The points of one object, the plane below it, its shape and its box (u0, v0, u1, v1) in the picture."""

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
    """A surface in one picture: its plane, the points of the plane, and the clusters on it."""

    plane: LevelPlane
    plane_points: PointCloud
    clusters: tuple[Cluster, ...]


def segment_surface(image: Image, X_WO: RigidTransform, surface: Surface, margin_m: float = 0.03) -> SurfaceView | None:
    """Segments one surface in a picture; None when too little of the surface is visible."""
    return next(segment_surfaces(image, X_WO, (surface,), margin_m))


def segment_surfaces(
    image: Image, X_WO: RigidTransform, surfaces: Sequence[Surface], margin_m: float = 0.03
) -> Iterator[SurfaceView | None]:
    """Segments each surface in a picture; None for a surface of which too little is visible."""
    levels_m = [surface.height_m for surface in surfaces]
    band_m = (min(levels_m, default=0.0) - _PLANE_BAND_M, max(levels_m, default=0.0) + _HIGHEST_M)
    cloud, p_WC = cloud_from_image(image, X_WO, heights_m=band_m), camera_pose_W(image, X_WO).translation()
    return (_segment(cloud, p_WC, surface, margin_m) for surface in surfaces)


def _segment(cloud: PointCloud, p_WC: FloatArray, surface: Surface, margin_m: float) -> SurfaceView | None:
    above = cloud.p_W[:, 2] - surface.height_m
    over = (above > -_PLANE_BAND_M) & (above < _HIGHEST_M)
    over[over] = inside_polygon(cloud.p_W[over, :2], surface.polygon_W, margin_m)
    cloud = cloud.where(over)
    plane = _fit_plane(cloud.p_W, surface.height_m)
    if plane is None:
        return None
    height = cloud.p_W[:, 2] - plane.z(cloud.p_W[:, :2])
    standing = height > max(_LOWEST_M, 3.0 * plane.noise_m)
    standing[standing] = may_rest(cloud.p_W[standing, :2], height[standing])
    groups = _split_on_grid(cloud.where(standing))
    clusters = tuple(_cluster(points, surface.name, plane, p_WC) for points in groups)
    return SurfaceView(plane, cloud.where(np.abs(height) < max(_LOWEST_M, 3.0 * plane.noise_m)), clusters)


def may_rest(xy: FloatArray, height_m: FloatArray) -> Mask:
    """Returns which points at (N, 2) and heights (N,) over a surface may belong to an object that rests on it.

    Points above a gap do not: they hang over the surface, as the next board of a shelf does.
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


def _fit_plane(points_W: FloatArray, height_m: float) -> LevelPlane | None:
    """Fits the plane near a surveyed height, robustly against objects on it; None for too few points."""
    near = points_W[np.abs(points_W[:, 2] - height_m) < _PLANE_BAND_M]
    if len(near) < _FEWEST_PLANE_POINTS:
        return None
    near = near[:: max(1, len(near) // _PLANE_POINTS)]
    counts, edges = np.histogram(near[:, 2], bins=np.arange(height_m - _PLANE_BAND_M, height_m + _PLANE_BAND_M, 0.004))
    smooth = np.convolve(counts, [1, 2, 1], mode="same")
    level = float(edges[int(np.argmax(smooth))] + 0.002)
    return LevelPlane.fit(near, level, noise_m=0.004, band_m=0.006, sigmas=2.5, steps=4)


def _split_on_grid(points: PointCloud) -> list[PointCloud]:
    """Clusters points by neighbourhood on a grid seen from above."""
    if len(points) < _FEWEST_POINTS:
        return []
    labels, count = grid_labels(points.p_W[:, :2], _CELL_M, fewest=2, dilated=True)
    groups = [points.where(labels == k) for k in range(1, count)]
    return [group for group in groups if len(group) >= _FEWEST_POINTS]


def _cluster(points: PointCloud, surface: str, plane: LevelPlane, p_WC: FloatArray) -> Cluster:
    (u0, v0), (u1, v1) = points.pixels.min(axis=0), points.pixels.max(axis=0)
    shape = measure(points.p_W, plane.z(points.p_W[:, :2]), p_WC)
    return Cluster(points, surface, plane, shape, (int(u0), int(v0), int(u1), int(v1)))


def matching_cluster(clusters: tuple[Cluster, ...], detected: Detection3D) -> Cluster | None:
    """Cluster near a detected object whose box overlaps the detection's most; None if none does."""
    near = [one for one in clusters if _apart(one, detected) < _SAME_OBJECT_M + 0.5 * one.shape.length_m]
    overlaps = {id(one): box_overlap(one.box, detected.detection.box) for one in near}
    best = max(near, key=lambda one: overlaps[id(one)], default=None)
    return best if best is not None and overlaps[id(best)] > _LEAST_OVERLAP else None


def _apart(cluster: Cluster, detected: Detection3D) -> float:
    return float(np.linalg.norm(np.array(cluster.shape.centre) - detected.position_W[:2]))


def split_detected(view: SurfaceView, detected: Detection3D) -> SurfaceView:
    """Splits a detected object from a cluster that holds others as well, such as one that touches it.

    A part right above or below the object is not split off, since its box has only left it out.
    """
    whole = matching_cluster(view.clusters, detected)
    if whole is None or len(detected.pixels) == 0:
        return view
    own = _are_among(whole.points.pixels, detected.pixels)
    if min(np.count_nonzero(own), np.count_nonzero(~own)) < max(_FEWEST_POINTS, _LEAST_PART * len(own)):
        return view
    halves = (whole.points.where(own), whole.points.where(~own))
    middles = [np.median(points.p_W[:, :2], axis=0) for points in halves]
    if float(np.linalg.norm(middles[0] - middles[1])) < _APART_M:
        return view
    parts = tuple(_cluster(points, whole.surface, whole.plane, detected.eye_W) for points in halves)
    others = tuple(each for each in view.clusters if each is not whole)
    return SurfaceView(view.plane, view.plane_points, (*parts, *others))


def _are_among(pixels: NDArray[np.int64], of_object: NDArray[np.int64]) -> Mask:
    """Returns which pixels (N, 2) lie among those of an object, of which only every few may be given."""
    width, height = np.maximum(pixels.max(axis=0), of_object.max(axis=0)) + 1
    return np.asarray(closed_mask(of_object, height, width)[pixels[:, 1], pixels[:, 0]])


def split_touching(view: SurfaceView, p_WC: FloatArray) -> SurfaceView:
    """Splits the clusters of a view from p_WC into the objects that touch, of any class."""
    clusters: list[Cluster] = []
    for each in view.clusters:
        labels, count = touching_parts(each.points.p_W[:, :2])
        parts = [each.points.where(labels == k) for k in range(count)]
        clusters += [each] if count == 1 else [_cluster(one, each.surface, each.plane, p_WC) for one in parts]
    return SurfaceView(view.plane, view.plane_points, tuple(clusters))


def touching_parts(xy: FloatArray) -> tuple[NDArray[np.int64], int]:
    """Labels the objects among connected points (N, 2) seen from above: the label of each, and their number."""
    cells = np.floor((xy - xy.min(axis=0)) / _OUTLINE_CELL_M).astype(np.int64) + _BORDER_CELLS
    outline = np.zeros(cells.max(axis=0) + _BORDER_CELLS + 1, dtype=np.uint8)
    outline[cells[:, 0], cells[:, 1]] = 1
    parts, count = _parts(_filled(outline))
    labels = parts[cells[:, 0], cells[:, 1]].astype(np.int64) - 1
    few = count > 1 and int(np.bincount(labels, minlength=count).min()) < _FEWEST_POINTS
    return (np.zeros(len(xy), dtype=np.int64), 1) if few else (labels, count)


def _parts(outline: NDArray[np.uint8]) -> tuple[NDArray[np.int32], int]:
    """Labels the parts of an outline from 1 on, 0 outside, and counts them; splits parts further."""
    halves = _halves(outline)
    if not halves:
        return outline.astype(np.int32), 1
    labels, count = np.zeros(outline.shape, dtype=np.int32), 0
    for half in halves:
        own, number = _parts(half)
        labels[own > 0] = own[own > 0] + count
        count += number
    return labels, count


def _halves(outline: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """Parts into which the least erosion splits an outline; empty when it is one object."""
    whole = _convexity(outline)
    inside_m = cv2.distanceTransform(outline, cv2.DIST_L2, 5) * _OUTLINE_CELL_M
    for eroded_m in np.arange(_OUTLINE_CELL_M, _MOST_ERODED_M, _OUTLINE_CELL_M):
        count, labels, stats, _ = cv2.connectedComponentsWithStats((inside_m > eroded_m).astype(np.uint8))
        areas_m2 = stats[:, cv2.CC_STAT_AREA] * _OUTLINE_CELL_M**2
        cores = [k for k in range(1, count) if areas_m2[k] >= _LEAST_CORE_M2]
        if len(cores) < 2:
            continue
        off = np.stack([cv2.distanceTransform((labels != k).astype(np.uint8), cv2.DIST_L2, 5) for k in cores])
        nearest = np.argmin(off, axis=0)
        parts = [((nearest == n) & (outline > 0)).astype(np.uint8) for n in range(len(cores))]
        if all(_is_object(part, max(_CONVEX, whole + _MORE_CONVEX)) for part in parts):
            return parts
    return []


def _is_object(part: NDArray[np.uint8], convex: float) -> bool:
    return int(part.sum()) * _OUTLINE_CELL_M**2 >= _LEAST_PART_M2 and _convexity(part) > convex


def _filled(seen: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Cells with points, and the cells between them, without bridges over a gap."""
    closed = cv2.morphologyEx(seen, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    borders, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros_like(closed), borders, -1, 1, thickness=cv2.FILLED))


def _convexity(part: NDArray[np.uint8]) -> float:
    """Share of its convex hull that an outline fills."""
    hull = cv2.convexHull(np.argwhere(part).astype(np.float32))
    # the hull passes through the middles of the cells: half a cell is missing all around
    hull_cells = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, closed=True) + 1.0
    return float(part.sum()) / max(float(hull_cells), 1.0)


def segments_3d(
    image: Image,
    place: LocalisationEstimate,
    views: Iterable[SurfaceView],
    labelled: Sequence[Detection3D],
    surfaces: Sequence[Surface],
) -> tuple[Detection3D, ...]:
    """Detections of `ANY_OBJECT` for the objects on some surfaces that none of the `labelled` detections explains.

    Leaves out segments that the picture's edge cuts off, that stand beside the surface, such as a wall, or that are
    longer than 0.6 m.
    """
    outlines = {surface.name: surface.polygon_W for surface in surfaces}
    p_WC = camera_pose_W(image, place.X_WO).translation()
    clusters = (cluster for view in views for cluster in _unlabelled(view, labelled, p_WC))
    whole = (one for one in clusters if _stands_on(one, outlines[one.surface]) and not _is_cut_off(one, image))
    return tuple(_segment_3d(one, image, place) for one in whole)


def _unlabelled(view: SurfaceView, labelled: Sequence[Detection3D], p_WC: FloatArray) -> Iterator[Cluster]:
    """Clusters of a view that match no detection, after the split of objects that touch."""
    view = split_touching(reduce(split_detected, labelled, view), p_WC)
    named = {id(matching_cluster(view.clusters, each)) for each in labelled}
    return (cluster for cluster in view.clusters if id(cluster) not in named)


def _stands_on(cluster: Cluster, outline_W: tuple[tuple[float, float], ...]) -> bool:
    centre = np.array([cluster.shape.centre])
    return cluster.shape.length_m < _LONGEST_M and bool(inside_polygon(centre, outline_W, -_RIM_M)[0])


def _is_cut_off(cluster: Cluster, image: Image) -> bool:
    u0, v0, u1, v1 = cluster.box
    lens = image.intrinsics
    return min(u0, v0, lens.width - 1 - u1, lens.height - 1 - v1) < _BORDER_PX


def _segment_3d(cluster: Cluster, image: Image, place: LocalisationEstimate) -> Detection3D:
    """A cluster as the detection of an object without a class."""
    shape, X_WO = cluster.shape, place.X_WO
    u0, v0, u1, v1 = (float(value) for value in cluster.box)
    p_W = np.array([*shape.centre, cluster.base_m + 0.5 * shape.height_m])
    covariance = np.diag(np.square(_SIGMA_M))
    return Detection3D(
        stamp_s=image.stamp_s,
        detection=Detection(ANY_OBJECT, _SEGMENT_SCORE, (u0, v0, u1, v1)),
        position_W=p_W,
        covariance=covariance,
        place_covariance=covariance + place_covariance(p_W, X_WO.translation(), place.covariance),
        size_m=(shape.length_m, shape.width_m, shape.height_m),
        yaw_rad=shape.yaw_rad,
        eye_W=camera_pose_W(image, X_WO).translation(),
        pixels=cluster.points.pixels,
        colours=cluster.points.colours,
        surface=cluster.surface,
    )
