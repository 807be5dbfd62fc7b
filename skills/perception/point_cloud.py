"""Depth images as point clouds, points as pixels, clusters of points, and points that rest on a surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

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
        return PointCloud(self.p_W[mask], self.pixels[mask], self.colours[mask])


def camera_pose_W(image: Image, X_WO: RigidTransform) -> RigidTransform:
    """Pose X_WC of the camera when it took the picture."""
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
    """Projects points (..., 3) of the camera frame to pixel coordinates u and v."""
    z = p_C[..., 2]
    return p_C[..., 0] / z * lens.fx + lens.cx, p_C[..., 1] / z * lens.fy + lens.cy


def nearest_pixels(u: FloatArray, v: FloatArray, lens: Intrinsics) -> NDArray[np.int64]:
    """Pixels (..., 2) of a picture nearest to the coordinates u and v."""
    columns, rows = np.clip(np.rint(u), 0, lens.width - 1), np.clip(np.rint(v), 0, lens.height - 1)
    return np.stack([columns, rows], axis=-1).astype(np.int64)


def closed_mask(pixels: NDArray[np.int64], height: int, width: int) -> Mask:
    """Mask (height, width) of some pixels (N, 2) with the gaps between them closed."""
    mask = np.zeros((height, width), dtype=np.uint8)
    mask[pixels[:, 1], pixels[:, 0]] = 1
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((_GAP_PX, _GAP_PX), np.uint8)) > 0)


def grid_labels(
    xy: FloatArray, cell_m: float, *, fewest: int = 1, dilated: bool = False
) -> tuple[NDArray[np.int32], int]:
    """Clusters points (N, 2) by neighbourhood on a grid: label of each, 0 for none, and the number of labels.

    Cells with fewer than `fewest` points are empty; `dilated` also joins clusters across a gap of a cell or two.
    """
    cells = np.floor((xy - xy.min(axis=0)) / cell_m).astype(np.int64)
    return cell_labels(cells, fewest=fewest, reach=int(dilated))


def cell_labels(cells: NDArray[np.int64], *, fewest: int = 1, reach: int = 0) -> tuple[NDArray[np.int32], int]:
    """Clusters grid cells (N, 2), with repetitions: label of each, 0 for none, and the number of labels.

    Cells that occur less than `fewest` times are empty; clusters that `reach` cells of dilation connect are joined.
    """
    cells = cells - cells.min(axis=0) + reach + 1
    counts = np.zeros(cells.max(axis=0) + reach + 2, dtype=np.int32)
    np.add.at(counts, (cells[:, 0], cells[:, 1]), 1)
    occupied = (counts >= fewest).astype(np.uint8)
    joined = cv2.dilate(occupied, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) if reach else occupied
    count, grid = cv2.connectedComponents(joined, connectivity=8)
    return np.asarray(np.where(occupied > 0, grid, 0)[cells[:, 0], cells[:, 1]]), int(count)


def may_rest(xy: FloatArray, height_m: FloatArray) -> Mask:
    """Returns which points at (N, 2) and heights (N,) over a surface may belong to an object that rests on it.

    Points above a gap do not: they hang over the surface, as the next board of a shelf does. A small part that sticks
    out of what rests does, such as the lever of an extinguisher.
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
        cells[order][starts],
        height[starts],
        np.maximum.reduceat(height, starts),
        (gaps == before)[starts],
    )
    found = np.empty(len(order), dtype=np.bool_)
    found[order] = np.repeat(rests, np.diff(starts, append=len(order)))
    return found


def _with_parts_that_stick_out(cells: NDArray[np.int64], low_m: FloatArray, high_m: FloatArray, rests: Mask) -> Mask:
    """Adds small groups of hanging pieces of columns (cells (M, 2), heights from low_m to high_m) that touch others."""
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
