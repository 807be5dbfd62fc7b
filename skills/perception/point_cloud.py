"""Depth images as point clouds, points as pixels, clusters of points, and points that rest on a surface.

Also visibility: which points and surfaces are seen or occluded, and what changed between two images.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Surface
from skills.geometry import grid_inside
from skills.robot import FloatArray, Image, Intrinsics

MIN_DEPTH_M = 0.15
MAX_DEPTH_M = 4.0
_COLUMN_M = 0.04
_UNDER_HANGING_M = 0.12
_LOWEST_HIDDEN_M = 0.28
_STUCK_OUT_GAP_M: Final = 0.02
"""Difference of heights within which pieces of neighbouring columns touch."""
_MOST_STUCK_OUT_M: Final = 0.16
"""Length from which on what hangs over a surface is no part that sticks out of an object, but a board."""
_COLUMN_STRIDES = np.array([1 << 20, 1])
_GAP_PX = 11

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class PointCloud:
    """Points p_W (N, 3) in m, their pixels (N, 2) as (u, v) in the colour picture, colours (N, 3) RGB uint8."""

    p_W: FloatArray
    pixels: NDArray[np.int64]
    colours: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.p_W)

    def where(self, mask: Mask) -> PointCloud:
        """Points that a mask (N,) selects."""
        rows = np.flatnonzero(mask)  # a mask of rows would be expanded for each array
        return PointCloud(self.p_W.take(rows, 0), self.pixels.take(rows, 0), self.colours.take(rows, 0))


def camera_pose_W(image: Image, X_WO: RigidTransform) -> RigidTransform:
    """Pose X_WC of the camera at capture time."""
    return X_WO @ image.frames.pose(image.camera_frame)


def cloud_from_image(
    image: Image,
    X_WO: RigidTransform,
    max_depth_m: float = MAX_DEPTH_M,
    heights_m: tuple[float, float] = (-math.inf, math.inf),
) -> PointCloud:
    """Back-projects all valid depth pixels between two heights to the world; a grey picture gives grey points."""
    colour = np.repeat(image.grey[..., None], 3, axis=2) if image.colour is None else image.colour
    depth, X_WC = image.depth_m, camera_pose_W(image, X_WO)
    x_C, y_C = lens_rays(image.depth_intrinsics)
    R_WC, p_WC = X_WC.rotation().matrix(), X_WC.translation()
    height = depth * (R_WC[2, 0] * x_C + R_WC[2, 1] * y_C[:, None] + R_WC[2, 2]).astype(np.float32) + p_WC[2]
    low_m, high_m = heights_m
    valid = (depth > MIN_DEPTH_M) & (depth < max_depth_m) & (height > low_m) & (height < high_m)
    rows, columns = np.nonzero(valid)
    rays = np.column_stack([x_C[columns], y_C[rows]])
    z = depth[valid].astype(np.float64)[:, None]
    p_W = z * (rays @ R_WC[:, :2].T + R_WC[:, 2]) + p_WC
    lens = image.intrinsics
    pixels = nearest_pixels(rays[:, 0] * lens.fx + lens.cx, rays[:, 1] * lens.fy + lens.cy, lens)
    return PointCloud(p_W, pixels, colour[pixels[:, 1], pixels[:, 0]])


@lru_cache(maxsize=8)
def lens_rays(lens: Intrinsics) -> tuple[FloatArray, FloatArray]:
    """Ray slopes of a lens: x/z of each column (W,), and y/z of each row (H,)."""
    return (np.arange(lens.width, dtype=np.float64) - lens.cx) / lens.fx, (
        np.arange(lens.height, dtype=np.float64) - lens.cy
    ) / lens.fy


def project(p_C: FloatArray, lens: Intrinsics) -> tuple[FloatArray, FloatArray]:
    """Projects points (..., 3) in the camera frame to pixel coordinates u and v."""
    z = p_C[..., 2]
    return p_C[..., 0] / z * lens.fx + lens.cx, p_C[..., 1] / z * lens.fy + lens.cy


def nearest_pixels(u: FloatArray, v: FloatArray, lens: Intrinsics) -> NDArray[np.int64]:
    """Pixels (..., 2) of a picture nearest to the coordinates u and v."""
    columns, rows = np.clip(np.rint(u), 0, lens.width - 1), np.clip(np.rint(v), 0, lens.height - 1)
    return np.stack([columns, rows], axis=-1).astype(np.int64)


def closed_mask(pixels: NDArray[np.int64], height: int, width: int) -> Mask:
    """Mask (height, width) of pixels (N, 2) after morphological closing."""
    mask = np.zeros((height, width), dtype=np.uint8)
    mask[pixels[:, 1], pixels[:, 0]] = 1
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((_GAP_PX, _GAP_PX), np.uint8)) > 0)


def grid_labels(
    xy: FloatArray, cell_m: float, *, fewest: int = 1, dilated: bool = False
) -> tuple[NDArray[np.int32], int]:
    """Clusters points (N, 2) by neighbourhood on a grid: a label per point, 0 for none, and the number of labels.

    Cells with fewer than `fewest` points are empty; `dilated` also joins clusters across a gap of one or two cells.
    """
    cells = np.floor((xy - xy.min(axis=0)) / cell_m).astype(np.int64)
    return cell_labels(cells, fewest=fewest, reach=int(dilated))


def cell_labels(cells: NDArray[np.int64], *, fewest: int = 1, reach: int = 0) -> tuple[NDArray[np.int32], int]:
    """Clusters grid cells (N, 2), with repetitions: a label per cell, 0 for none, and the number of labels.

    Cells that occur fewer than `fewest` times are empty; clusters that `reach` cells of dilation connect are joined.
    """
    rows, columns = (cells - cells.min(axis=0) + reach + 1).T
    height, width = int(rows.max()) + reach + 2, int(columns.max()) + reach + 2
    counts = np.bincount(rows * width + columns, minlength=height * width).reshape(height, width)
    occupied = (counts >= fewest).astype(np.uint8)
    joined = cv2.dilate(occupied, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) if reach else occupied
    count, grid = cv2.connectedComponents(joined, connectivity=8)
    return np.asarray(np.where(occupied > 0, grid, 0)[rows, columns]), int(count)


def distinct_cells(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the distinct cells among (N, D), sorted."""
    if len(cells) == 0:
        return cells
    low = cells.min(axis=0)
    keys = np.ravel_multi_index(tuple((cells - low).T), tuple(cells.max(axis=0) - low + 1))
    return cells[np.unique(keys, return_index=True)[1]]


def may_rest(xy: FloatArray, height_m: FloatArray) -> Mask:
    """Mask of the points, at (N, 2) and heights (N,) above a surface, that may belong to an object resting on it.

    Points above a gap may not: they hang over the surface, as the next board of a shelf does. A small part that
    protrudes from what rests may, such as the lever of an extinguisher.
    """
    if len(xy) == 0:
        return np.zeros(0, dtype=np.bool_)
    cells = np.floor(xy / _COLUMN_M).astype(np.int64)
    columns = cells @ _COLUMN_STRIDES
    order = np.lexsort((height_m, columns))
    column, height = columns[order], height_m[order]
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = column[1:] != column[:-1]
    gap = np.where(first, height > _LOWEST_HIDDEN_M, np.diff(height, prepend=0.0) > _UNDER_HANGING_M)
    gaps = np.cumsum(gap)
    before = np.maximum.accumulate(np.where(first, gaps - gap, 0))
    starts = np.flatnonzero(first | gap)
    rests = _with_parts_that_stick_out(
        cells[order][starts], height[starts], np.maximum.reduceat(height, starts), (gaps == before)[starts]
    )
    found = np.empty(len(order), dtype=np.bool_)
    found[order] = np.repeat(rests, np.diff(starts, append=len(order)))
    return found


def _with_parts_that_stick_out(cells: NDArray[np.int64], low_m: FloatArray, high_m: FloatArray, rests: Mask) -> Mask:
    """Adds small groups of hanging column pieces (cells (M, 2), from low_m to high_m) that touch resting ones."""
    hanging, resting = np.flatnonzero(~rests), np.flatnonzero(rests)
    if len(hanging) == 0:
        return rests
    beside = np.max(np.abs(cells[hanging, None] - cells[resting]), axis=2) <= 1
    level = (low_m[hanging, None] < high_m[resting] + _STUCK_OUT_GAP_M) & (
        low_m[resting] < high_m[hanging, None] + _STUCK_OUT_GAP_M
    )
    labels, _ = cell_labels(cells[hanging])
    found = rests.copy()
    for label in np.unique(labels[np.any(beside & level, axis=1)]):
        group = hanging[labels == label]
        found[group] = np.all(np.ptp(cells[group], axis=0) < _MOST_STUCK_OUT_M / _COLUMN_M)
    return found


_CELL_M = 0.05
_OUT = 0
_HIDDEN = 1
_SEEN = 2
_NEAR_M = 0.04
_NEAR_PER_M = 0.02
_MUCH_HIDDEN = 0.04
_LEAST_DEPTH_M = 0.05
_EDGE_M = 0.05
_PLAIN_M = 2.0
_BEFORE_M = 0.08

APART_S: Final = (0.4, 0.25)
"""Least times between a picture and the next ones that are compared with it."""
LEAST_CHANGED: Final = 24
"""Pixels that change where an object moves; noise changes fewer."""
_TOLERANCE_M = 0.008
_TOLERANCE_PER_M = 0.008
_AROUND_PX = 5
_NEAREST_M = 0.1


def depth_at_points(image: Image, X_WO: RigidTransform, points_W: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Depth of points (N, 3) from the camera (NaN out of view), and the picture's depth there (NaN where unknown)."""
    lens, X_CW = image.depth_intrinsics, camera_pose_W(image, X_WO).inverse()
    p_C = points_W @ X_CW.rotation().matrix().T + X_CW.translation()
    p_C[p_C[:, 2] <= _LEAST_DEPTH_M, 2] = np.nan
    with np.errstate(invalid="ignore"):
        u, v = project(p_C, lens)
        rows, columns = image.depth_m.shape[:2]
        inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    seen = np.full(len(points_W), np.nan)
    found = image.depth_m[np.rint(v[inside]).astype(int), np.rint(u[inside]).astype(int)].astype(np.float64)
    seen[inside] = np.where(np.isfinite(found) & (found > 0.0), found, np.nan)
    return np.where(inside, p_C[:, 2], np.nan), seen


def in_plain_view(image: Image, X_WO: RigidTransform, p_W: FloatArray, reach_m: float = 0.0) -> bool:
    """Returns whether a picture should show an object at a point: well inside, near, and not occluded.

    The object reaches `reach_m` beyond the point; a picture whose edge cuts it off need not show it.
    """
    edge_m = max(_EDGE_M, reach_m)
    beside = p_W + np.array([[0.0, 0.0, 0.0], *(edge_m * np.eye(3)), *(-edge_m * np.eye(3))])
    depth, seen = depth_at_points(image, X_WO, beside)
    if not np.all(np.isfinite(depth)) or depth[0] > _PLAIN_M:
        return False
    return bool(np.isfinite(seen[0]) and seen[0] > depth[0] - _BEFORE_M)


@dataclass(frozen=True)
class SurfaceShares:
    """Fractions of a surface that were seen, were occluded, or were never in view; they add up to 1."""

    seen: float
    hidden: float

    @property
    def out_of_view(self) -> float:
        """Fraction that no picture showed, or for which there was no depth."""
        return max(0.0, 1.0 - self.seen - self.hidden)

    def __str__(self) -> str:
        unseen = (self.hidden, "hidden"), (self.out_of_view, "out of view")
        parts = [f"{100 * share:.0f} % {how}" for share, how in unseen if share >= 0.005]
        return ", ".join([f"{100 * self.seen:.0f} % seen", *parts])


class Coverage:
    """Coverage of surfaces over several pictures."""

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self._points = {surface.name: _cells(surface) for surface in surfaces}
        self._states = {name: np.zeros(len(points), dtype=np.int8) for name, points in self._points.items()}

    def add(self, image: Image, X_WO: RigidTransform) -> None:
        """Adds a picture."""
        for name, points in self._points.items():
            depth, seen = depth_at_points(image, X_WO, points)
            with np.errstate(invalid="ignore"):
                state = np.where(seen < depth - _NEAR_M - _NEAR_PER_M * depth, _HIDDEN, _SEEN)
            state = np.where(np.isfinite(depth) & np.isfinite(seen), state, _OUT)
            self._states[name] = np.maximum(self._states[name], state.astype(np.int8))

    def hidden_middle_W(self) -> Mapping[str, FloatArray]:
        """Centre (3,) of the occluded part of each surface where that part is large, by the surface's name."""
        hidden = {name: self._points[name][states == _HIDDEN] for name, states in self._states.items()}
        large = {n: points for n, points in hidden.items() if len(points) > _MUCH_HIDDEN * len(self._points[n])}
        return {n: points.mean(axis=0) for n, points in large.items()}

    def shares(self) -> Mapping[str, SurfaceShares]:
        """Fractions for each surface by its name."""
        return {
            name: SurfaceShares(float(np.mean(states == _SEEN)), float(np.mean(states == _HIDDEN)))
            for name, states in self._states.items()
        }


def _cells(surface: Surface) -> FloatArray:
    """Points (N, 3) spread over a surface; only its centre when it is small."""
    inside = grid_inside(surface.polygon_W, _CELL_M, first_m=0.5 * _CELL_M)
    xy = inside if len(inside) else np.mean(surface.polygon_W, axis=0)[None]
    return np.column_stack([xy, np.full(len(xy), surface.height_m)])


def is_at_rest(first: Image, second: Image, X_WO: RigidTransform, p_W: FloatArray, within_m: float) -> bool:
    """Returns whether two pictures of a still camera show no change around a world point p_W (3,).

    A pixel has changed when its depth differs by more than noise and its neighbouring pixels explain.
    """
    lens, p_C = second.depth_intrinsics, camera_pose_W(second, X_WO).inverse() @ p_W
    z = p_C[2]
    if z < _NEAREST_M or first.depth_m.shape != second.depth_m.shape:
        return True
    half_px, middle = within_m / z * np.array([lens.fx, lens.fy]), np.array(project(p_C, lens))
    (left, top), (right, bottom) = (np.clip(middle + side * half_px, 0, None).astype(int) for side in (-1.0, 1.0))
    before, after = (image.depth_m[top:bottom, left:right] for image in (first, second))
    if before.size == 0:
        return True
    tolerance_m = _TOLERANCE_M + _TOLERANCE_PER_M * z
    differs = _differs(before, after, tolerance_m) | _differs(after, before, tolerance_m)
    near = (np.abs(before - z) < within_m) | (np.abs(after - z) < within_m)
    seen = (before > 0.0) & (after > 0.0)
    return int(np.count_nonzero(differs & near & seen)) < LEAST_CHANGED


def _differs(depth_m: NDArray[np.float32], other_m: NDArray[np.float32], tolerance_m: float) -> Mask:
    """Mask of the depths beyond all depths in another picture at and right beside their pixel; skips holes."""
    kernel = np.ones((_AROUND_PX, _AROUND_PX), np.uint8)
    least = cv2.erode(np.where(other_m > 0.0, other_m, np.float32(np.inf)), kernel)
    most = cv2.dilate(other_m, kernel)
    return np.asarray((depth_m < least - tolerance_m) | (depth_m > most + tolerance_m))
