"""Segmentation of a surface in a depth image: its plane, and the point clusters of the objects on it.

Objects that touch are split by their outline from above, at a narrow neck between two parts that bulge: the outline is
eroded until it falls into cores, and each cell goes to its nearest core. The parts count as objects when each is nearly
convex and the whole is not, or when the neck is short and their heights or colours differ beside it: a wrench has a
neck, too, but a long one, and a hammer's peen has the height and colour of its head. Boxes flush side by side have no
neck and remain one object.
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
from skills.class_forms import ANY_OBJECT
from skills.detection import box_overlap
from skills.geometry import inside_polygon
from skills.perception.detection_3d import Detection3D, place_covariance
from skills.perception.fitting import LevelPlane, SeenShape, measure
from skills.perception.point_cloud import (
    Mask,
    PointCloud,
    camera_pose_W,
    closed_mask,
    cloud_from_image,
    grid_labels,
    may_rest,
)
from skills.perception.shape_model import shape_features
from skills.robot import FloatArray, Image

_CELL_M = 0.005
_CELL_PX = 4.0
"""Least side of a cell of the grid, in pixels of the depth picture."""
_LOW_M = 0.025
"""Height up to which an object counts as low."""
_LOWEST_M = 0.008
HIGHEST_M = 0.4
"""Height (m) over a surface up to which points usually count."""
_FEWEST_POINTS = 40
_PLANE_BAND_M = 0.05
_PLANE_POINTS = 6000
_FEWEST_PLANE_POINTS = 80
_SAME_OBJECT_M = 0.06
_LEAST_OVERLAP = 0.2
_LEAST_PART = 0.15
_APART_M = 0.035
_MOSTLY_AMONG = 0.8
"""Fraction of a cluster's pixels from which on it counts as a part of a detected object."""

_OUTLINE_CELL_M: Final = 0.003
_BORDER_CELLS: Final = 4
_MOST_ERODED_M: Final = 0.03
_LEAST_CORE_M2: Final = 0.00005
_LEAST_PART_M2: Final = 0.0003
_CONVEX: Final = 0.87
_MORE_CONVEX: Final = 0.03
_NECK_SHARE: Final = 0.6
"""Largest half width of a neck, as a fraction of the narrower object's."""
_LEAST_NECK_M2: Final = 0.0001
"""Area that a short neck may always have."""
_BESIDE_NECK_M: Final = 0.015
"""Distance from the other part within which heights and colours are compared."""
_FEWEST_BESIDE: Final = 4
"""Number of cells from which on they are compared."""
_OTHER_HEIGHT_M: Final = 0.012
_OTHER_COLOUR: Final = 25.0
"""Difference of colours in CIELAB from which on they are different."""

_SEGMENT_SCORE = 0.7
"""Probability that a segment is an object: one picture may show noise, or a part of one."""
_RIM_M = 0.02
_BORDER_PX = 2
LONGEST_M = 0.6
"""Length (m) from which on a segment is no object, but a wall or furniture."""
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

    def features(self, p_WC: FloatArray) -> FloatArray:
        """Features of the object's shape, seen from a camera at p_WC (3,); see `shape_features`."""
        p_W = self.points.p_W
        return shape_features(p_W, p_W[:, 2] - self.plane.z(p_W[:, :2]), self.shape, p_WC)


@dataclass(frozen=True)
class SurfaceView:
    """A surface in one picture: its plane, the points in the plane, and the clusters on it."""

    plane: LevelPlane
    plane_points: PointCloud
    clusters: tuple[Cluster, ...]


def segment_surface(
    image: Image, X_WO: RigidTransform, surface: Surface, margin_m: float = 0.03, highest_m: float = HIGHEST_M
) -> SurfaceView | None:
    """Segments one surface in a picture up to a height above it; None when too little of the surface is visible."""
    return next(segment_surfaces(image, X_WO, (surface,), margin_m, highest_m))


def segment_surfaces(
    image: Image,
    X_WO: RigidTransform,
    surfaces: Sequence[Surface],
    margin_m: float = 0.03,
    highest_m: float = HIGHEST_M,
) -> Iterator[SurfaceView | None]:
    """Segments each surface in a picture; yields None for a surface of which too little is visible."""
    levels_m = [surface.height_m for surface in surfaces]
    band_m = (min(levels_m, default=0.0) - _PLANE_BAND_M, max(levels_m, default=0.0) + highest_m)
    cloud, p_WC = cloud_from_image(image, X_WO, heights_m=band_m), camera_pose_W(image, X_WO).translation()
    pixel_rad = 1.0 / image.depth_intrinsics.fx
    return (_segment(cloud, p_WC, surface, (margin_m, highest_m), pixel_rad) for surface in surfaces)


def _segment(
    cloud: PointCloud, p_WC: FloatArray, surface: Surface, within_m: tuple[float, float], pixel_rad: float
) -> SurfaceView | None:
    margin_m, highest_m = within_m
    above = cloud.p_W[:, 2] - surface.height_m
    over = (above > -_PLANE_BAND_M) & (above < highest_m)
    over[over] = inside_polygon(cloud.p_W.compress(over, axis=0)[:, :2], surface.polygon_W, margin_m)
    cloud = cloud.where(over)
    plane = _fit_plane(cloud.p_W, surface.height_m)
    if plane is None:
        return None
    height = cloud.p_W[:, 2] - plane.z(cloud.p_W[:, :2])
    standing = height > max(_LOWEST_M, 3.0 * plane.noise_m)
    standing[standing] = may_rest(cloud.p_W.compress(standing, axis=0)[:, :2], height[standing])
    groups = _split_on_grid(cloud.where(standing), height[standing], p_WC, pixel_rad)
    clusters = tuple(_cluster(points, surface.name, plane, p_WC) for points in groups)
    return SurfaceView(plane, cloud.where(np.abs(height) < max(_LOWEST_M, 3.0 * plane.noise_m)), clusters)


def _fit_plane(points_W: FloatArray, height_m: float) -> LevelPlane | None:
    """Fits the plane near a surveyed height, robustly against objects on it; None when points are too few."""
    near = points_W.compress(np.abs(points_W[:, 2] - height_m) < _PLANE_BAND_M, axis=0)
    if len(near) < _FEWEST_PLANE_POINTS:
        return None
    near = near[:: max(1, len(near) // _PLANE_POINTS)]
    counts, edges = np.histogram(near[:, 2], bins=np.arange(height_m - _PLANE_BAND_M, height_m + _PLANE_BAND_M, 0.004))
    smooth = np.convolve(counts, [1, 2, 1], mode="same")
    level = float(edges[int(np.argmax(smooth))] + 0.002)
    return LevelPlane.fit(near, level, noise_m=0.004, band_m=0.006, sigmas=2.5, steps=4)


def _split_on_grid(points: PointCloud, height_m: FloatArray, p_WC: FloatArray, pixel_rad: float) -> list[PointCloud]:
    """Clusters points by neighbourhood on a grid seen from above.

    Gaps of a cell or two do not divide low objects, since the noise of the surface hides parts of them.
    """
    if len(points) < _FEWEST_POINTS:
        return []
    cell_m = max(_CELL_M, _CELL_PX * pixel_rad * float(np.median(np.linalg.norm(points.p_W - p_WC, axis=1))))
    labels, count = grid_labels(points.p_W[:, :2], cell_m, fewest=2)
    highest_m = np.zeros(count)
    np.maximum.at(highest_m, labels, height_m)
    low = highest_m[labels] < _LOW_M
    labels[low] = 0
    if np.any(low):
        found, _ = grid_labels(points.p_W[low, :2], cell_m, fewest=2, dilated=True)
        labels[low] = np.where(found > 0, found + count, 0)
    groups = [points.where(labels == k) for k in np.unique(labels[labels > 0])]
    return [group for group in groups if len(group) >= _FEWEST_POINTS]


def _cluster(points: PointCloud, surface: str, plane: LevelPlane, p_WC: FloatArray) -> Cluster:
    (u0, v0), (u1, v1) = points.pixels.min(axis=0), points.pixels.max(axis=0)
    shape = measure(points.p_W, plane.z(points.p_W[:, :2]), p_WC)
    return Cluster(points, surface, plane, shape, (int(u0), int(v0), int(u1), int(v1)))


def matching_cluster(clusters: tuple[Cluster, ...], detected: Detection3D) -> Cluster | None:
    """Cluster near a detected object whose box overlaps the detection's box most; None when none does."""
    centre, most_m = detected.position_W[:2], _SAME_OBJECT_M
    near = [one for one in clusters if np.linalg.norm(centre - one.shape.centre) < most_m + 0.5 * one.shape.length_m]
    overlaps = {id(one): box_overlap(one.box, detected.detection.box) for one in near}
    best = max(near, key=lambda one: overlaps[id(one)], default=None)
    return best if best is not None and overlaps[id(best)] > _LEAST_OVERLAP else None


def split_detected(view: SurfaceView, detected: Detection3D) -> SurfaceView:
    """Splits a detected object from a cluster that also contains others, such as one that touches it.

    A part right above or below the object is not split off, since the detected box has only missed it. Joins low
    clusters that the detected object contains.
    """
    view = _join_detected(view, detected)
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


def _join_detected(view: SurfaceView, detected: Detection3D) -> SurfaceView:
    """Joins the low clusters among a detected object's pixels, and those of its points that were taken for the surface.

    Where depth is lost, a wrench falls to pieces, and its handle may be lower than the noise of single points. Higher
    clusters are objects of their own, which a large box may contain as well.
    """
    low = [each for each in view.clusters if each.shape.height_m < _LOW_M]
    if len(detected.pixels) == 0 or not low:
        return view
    pixels = [view.plane_points.pixels, *(each.points.pixels for each in low)]
    flat, *among = np.split(
        _are_among(np.concatenate(pixels), detected.pixels), np.cumsum([len(each) for each in pixels])[:-1]
    )
    parts = [each for each, own in zip(low, among, strict=True) if np.mean(own) > _MOSTLY_AMONG]
    if not parts or (len(parts) == 1 and not np.any(flat)):
        return view
    clouds = [view.plane_points.where(flat), *(each.points for each in parts)]
    points = PointCloud(
        *(np.concatenate(each) for each in zip(*((c.p_W, c.pixels, c.colours) for c in clouds), strict=True))
    )
    whole = _cluster(points, parts[0].surface, parts[0].plane, detected.eye_W)
    rest = tuple(each for each in view.clusters if not any(each is part for part in parts))
    return SurfaceView(view.plane, view.plane_points.where(~flat), (whole, *rest))


def _are_among(pixels: NDArray[np.int64], of_object: NDArray[np.int64]) -> Mask:
    """Mask of the pixels (N, 2) that lie among those of an object, which may be subsampled."""
    width, height = np.maximum(pixels.max(axis=0), of_object.max(axis=0)) + 1
    return np.asarray(closed_mask(of_object, height, width)[pixels[:, 1], pixels[:, 0]])


def split_touching(view: SurfaceView, p_WC: FloatArray) -> SurfaceView:
    """Splits the clusters in a view from p_WC into the objects that touch, whatever their class."""
    clusters: list[Cluster] = []
    for each in view.clusters:
        labels, count = touching_parts(each.points.p_W, each.points.colours)
        parts = [each.points.where(labels == k) for k in range(count)]
        clusters += [each] if count == 1 else [_cluster(one, each.surface, each.plane, p_WC) for one in parts]
    return SurfaceView(view.plane, view.plane_points, tuple(clusters))


def touching_parts(p_W: FloatArray, colours: NDArray[np.uint8]) -> tuple[NDArray[np.int64], int]:
    """Labels the objects among connected points (N, 3) with colours (N, 3): a label per point, and their number."""
    cells = np.floor((p_W[:, :2] - p_W[:, :2].min(axis=0)) / _OUTLINE_CELL_M).astype(np.int64) + _BORDER_CELLS
    seen = _SeenCells.of(cells, p_W[:, 2], colours)
    parts, count = _parts(_filled((seen.points > 0).astype(np.uint8)), seen)
    labels = parts[cells[:, 0], cells[:, 1]].astype(np.int64) - 1
    few = count > 1 and int(np.bincount(labels, minlength=count).min()) < _FEWEST_POINTS
    return (np.zeros(len(p_W), dtype=np.int64), 1) if few else (labels, count)


@dataclass(frozen=True)
class _SeenCells:
    """Cells (X, Y) seen from above: number of points, height of the highest (m), mean colour (X, Y, 3) in CIELAB."""

    points: FloatArray
    top_m: FloatArray
    colour: FloatArray

    @classmethod
    def of(cls, cells: NDArray[np.int64], z_m: FloatArray, colours: NDArray[np.uint8]) -> _SeenCells:
        """Builds the cells (N, 2) from points at heights (N,), with colours (N, 3)."""
        shape, at = tuple(cells.max(axis=0) + _BORDER_CELLS + 1), (cells[:, 0], cells[:, 1])
        points, top_m, colour = np.zeros(shape), np.full(shape, -np.inf), np.zeros((*shape, 3))
        np.add.at(points, at, 1.0)
        np.maximum.at(top_m, at, z_m)
        np.add.at(colour, at, cv2.cvtColor(colours[None], cv2.COLOR_RGB2LAB)[0].astype(np.float64))
        return cls(points, top_m, colour / np.maximum(points, 1.0)[..., None])

    def differ(self, part: Mask, rest: Mask) -> bool:
        """Returns whether two parts of an outline differ in height, or in colour, where they are close together."""
        sides = [
            one & (_distance_m(other) < _BESIDE_NECK_M) & (self.points > 0)
            for one, other in ((part, rest), (rest, part))
        ]
        if min(map(np.count_nonzero, sides)) < _FEWEST_BESIDE:
            return False
        (top, colour), (other_top, other_colour) = (
            (np.percentile(self.top_m[side], 80), np.median(self.colour[side], axis=0)) for side in sides
        )
        return bool(abs(top - other_top) > _OTHER_HEIGHT_M or np.linalg.norm(colour - other_colour) > _OTHER_COLOUR)


def _distance_m(mask: Mask) -> FloatArray:
    """Distance of each cell from a mask of cells (m)."""
    return np.asarray(cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5) * _OUTLINE_CELL_M)


def _parts(outline: NDArray[np.uint8], seen: _SeenCells) -> tuple[NDArray[np.int32], int]:
    """Labels the parts of an outline from 1 on, 0 outside, and counts them; splits parts further."""
    halves = _halves(outline, seen)
    if not halves:
        return outline.astype(np.int32), 1
    labels, count = np.zeros(outline.shape, dtype=np.int32), 0
    for half in halves:
        own, number = _parts(half, seen)
        labels[own > 0] = own[own > 0] + count
        count += number
    return labels, count


def _halves(outline: NDArray[np.uint8], seen: _SeenCells) -> list[NDArray[np.uint8]]:
    """Parts into which the least erosion splits an outline; empty when it is one object."""
    whole = _convexity(outline)
    inside_m = cv2.distanceTransform(outline, cv2.DIST_L2, 5) * _OUTLINE_CELL_M
    for eroded_m in np.arange(_OUTLINE_CELL_M, _MOST_ERODED_M, _OUTLINE_CELL_M):
        count, labels, stats, _ = cv2.connectedComponentsWithStats((inside_m > eroded_m).astype(np.uint8))
        areas_m2 = stats[:, cv2.CC_STAT_AREA] * _OUTLINE_CELL_M**2
        cores = [k for k in range(1, count) if areas_m2[k] >= _LEAST_CORE_M2]
        if len(cores) < 2:
            continue
        off_m = np.stack([_distance_m(labels == k) for k in cores])
        nearest = np.argmin(off_m, axis=0)
        parts = [(nearest == n) & (outline > 0) for n in range(len(cores))]
        if min(map(np.count_nonzero, parts)) * _OUTLINE_CELL_M**2 < _LEAST_PART_M2:
            continue
        neck = (outline > 0) & (off_m.min(axis=0) > eroded_m + 1.5 * _OUTLINE_CELL_M)
        eroded_m2 = np.count_nonzero(neck) * _OUTLINE_CELL_M**2
        short = eroded_m2 < max(_LEAST_NECK_M2, 8.0 * eroded_m**2)
        narrow = eroded_m < _NECK_SHARE * min(float(inside_m[part].max()) for part in parts)
        convex = all(_convexity(part) > max(_CONVEX, whole + _MORE_CONVEX) for part in parts)
        if convex or (short and narrow and all(seen.differ(part, (outline > 0) & ~part) for part in parts)):
            return [part.astype(np.uint8) for part in parts]
    return []


def _filled(seen: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Cells with points, and the cells between them, without bridges over a gap."""
    closed = cv2.morphologyEx(seen, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)))
    borders, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros_like(closed), borders, -1, 1, thickness=cv2.FILLED))


def _convexity(part: NDArray[np.uint8] | Mask) -> float:
    """Fraction of its convex hull that an outline fills."""
    hull = cv2.convexHull(np.argwhere(part).astype(np.float32))
    # the hull passes through the middles of the cells: half a cell is missing all around
    hull_cells = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, closed=True) + 1.0
    return float(part.sum()) / max(float(hull_cells), 1.0)


def labelled_clusters(
    image: Image,
    place: LocalisationEstimate,
    views: Iterable[SurfaceView],
    labelled: Sequence[Detection3D],
    surfaces: Sequence[Surface],
) -> list[tuple[Cluster, Detection3D | None]]:
    """Clusters of the objects on surfaces, each with the detection that explains it, or None.

    Omits clusters without a detection that the picture's edge cuts off, that stand beside the surface, such as a wall,
    or that are longer than 0.6 m.
    """
    outlines = {surface.name: surface.polygon_W for surface in surfaces}
    p_WC = camera_pose_W(image, place.X_WO).translation()
    pairs = (pair for view in views for pair in _labelled(view, labelled, p_WC))
    return [
        (one, label)
        for one, label in pairs
        if label is not None or (_stands_on(one, outlines[one.surface]) and not is_cut_off(one, image))
    ]


def _labelled(
    view: SurfaceView, labelled: Sequence[Detection3D], p_WC: FloatArray
) -> Iterator[tuple[Cluster, Detection3D | None]]:
    """Clusters of a view with the detections that they match, after the split of objects that touch."""
    view = split_touching(reduce(split_detected, labelled, view), p_WC)
    named = {id(matching_cluster(view.clusters, each)): each for each in reversed(labelled)}
    return ((cluster, named.get(id(cluster))) for cluster in view.clusters)


def _stands_on(cluster: Cluster, outline_W: tuple[tuple[float, float], ...]) -> bool:
    centre = np.array([cluster.shape.centre])
    return cluster.shape.length_m < LONGEST_M and bool(inside_polygon(centre, outline_W, -_RIM_M)[0])


def is_cut_off(cluster: Cluster, image: Image) -> bool:
    """Returns whether the picture's edge may cut off a cluster."""
    u0, v0, u1, v1 = cluster.box
    lens = image.intrinsics
    return min(u0, v0, lens.width - 1 - u1, lens.height - 1 - v1) < _BORDER_PX


def segment_3d(cluster: Cluster, image: Image, place: LocalisationEstimate) -> Detection3D:
    """Converts a cluster to the detection of an object without a class."""
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
        is_segmented=True,
    )
