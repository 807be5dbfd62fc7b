"""What stands within the arm's reach, as depth pictures show it: solid cells of the world, given as boxes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.arm.collision import Box
from skills.perception.point_cloud import camera_pose_W, cloud_from_image
from skills.robot import FloatArray, Image, Intrinsics

CELL_M: Final = 0.04
_NEAREST_M, _FURTHEST_M = 0.28, 2.5
_FEWEST_POINTS = 4
_SEEN_PAST_M = 0.08
_SHADOW_CELLS = 8
_FLOOR_M = 0.05
_SPAN = 1 << 20
_OFFSET = _SPAN // 2
_STRIDES = np.array([_SPAN**2, _SPAN, 1])
_THINNED, _VIEWS_KEPT = 8, 32

Cells = NDArray[np.int64]
Run = tuple[int, int]
View = tuple[Image, RigidTransform]
"""A depth picture and the X_WO of its time."""


def with_picture(
    cells: Cells, image: Image, X_WO: RigidTransform, own: Callable[[FloatArray], NDArray[np.bool_]]
) -> Cells:
    """The cells (N, 3) of before without those that a depth picture sees past, and those in which it has points.

    `own` says which world points (N, 3) belong to the robot.
    """
    points = cloud_from_image(image, X_WO, _FURTHEST_M, (_FLOOR_M, np.inf)).p_W
    eye_W = camera_pose_W(image, X_WO).translation()
    points = points[np.linalg.norm(points - eye_W, axis=1) > _NEAREST_M]
    found, counts = _unique(np.floor(points[~own(points)] / CELL_M).astype(np.int64))
    kept = cells[~_seen_past(cells, image, X_WO)]
    return _unique(np.vstack([kept, found[counts >= _FEWEST_POINTS]]))[0]


def solid_boxes(
    cells: Cells, X_WB: RigidTransform, reach_m: float, left_out: Callable[[FloatArray], NDArray[np.bool_]]
) -> list[Box]:
    """Boxes in the body frame about the cells within a reach, but those whose middles p_W (N, 3) are `left_out`.

    What is behind a cell, up to 32 cm and within the reach, is unknown and counts as solid, too: of a board only the
    edge is seen.
    """
    middles, origin_W = _middles(cells), X_WB.translation()
    middles = middles[np.linalg.norm((middles - origin_W)[:, :2], axis=1) < reach_m]
    middles = middles[~left_out(middles)]
    if len(middles) == 0:
        return []
    away = (middles - origin_W) * [1.0, 1.0, 0.0]
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-6)
    deep = np.concatenate([middles + n * CELL_M * away for n in range(_SHADOW_CELLS)])
    deep = deep[np.linalg.norm(deep - origin_W, axis=1) < reach_m]
    X_BW = X_WB.inverse()
    solid = np.floor(deep[~left_out(deep)] / CELL_M).astype(np.int64)
    return [_box(low, high, X_BW) for low, high in merged(solid)]


def boxes_of(cells: Cells, X_WB: RigidTransform, chosen: Callable[[FloatArray], NDArray[np.bool_]]) -> list[Box]:
    """Boxes in the body frame about those cells alone whose middles p_W (N, 3) are `chosen`."""
    X_BW = X_WB.inverse()
    return [_box(low, high, X_BW) for low, high in merged(cells[chosen(_middles(cells))])]


def _middles(cells: Cells) -> FloatArray:
    """The middles (N, 3) of cells, m."""
    return np.asarray((cells + 0.5) * CELL_M, dtype=np.float64)


def _unique(cells: Cells) -> tuple[Cells, NDArray[np.int64]]:
    """Each cell once, in order, and how often it was there."""
    keys, counts = np.unique(((cells + _OFFSET) * _STRIDES).sum(axis=1), return_counts=True)
    return np.stack([keys // _STRIDES[0], keys // _STRIDES[1] % _SPAN, keys % _SPAN], axis=1) - _OFFSET, counts


def with_view(views: Sequence[View], image: Image, X_WO: RigidTransform) -> tuple[View, ...]:
    """The last views with one more, of which each eighth row and column of the depth is kept."""
    lens, thin = image.depth_intrinsics, _THINNED
    depth_m = image.depth_m[thin // 2 :: thin, thin // 2 :: thin]
    kept = Intrinsics(
        width=depth_m.shape[1],
        height=depth_m.shape[0],
        fx=lens.fx / thin,
        fy=lens.fy / thin,
        cx=(lens.cx - thin // 2) / thin,
        cy=(lens.cy - thin // 2) / thin,
    )
    nothing = np.empty((0, 0), dtype=np.uint8)
    thinned = replace(image, colour=None, grey=nothing, depth_m=depth_m, depth_intrinsics=kept)
    return (*views[1 - _VIEWS_KEPT :], (thinned, X_WO))


def never_seen(points_W: FloatArray, views: Iterable[View]) -> NDArray[np.bool_]:
    """Which world points (N, 3) lie in no view, or far behind what it shows: just behind it all counts as solid."""
    unseen = np.ones(len(points_W), dtype=np.bool_)
    for image, X_WO in views:
        inside, z, depth = _at_pixels(points_W, image, X_WO)
        unseen &= ~(inside & ((depth == 0.0) | (depth > z - _SHADOW_CELLS * CELL_M)))
    return unseen


def _seen_past(cells: Cells, image: Image, X_WO: RigidTransform) -> NDArray[np.bool_]:
    """Which cells lie clearly before what the picture shows at their pixel."""
    inside, z, depth = _at_pixels(_middles(cells), image, X_WO)
    return np.asarray(inside & (depth > z + _SEEN_PAST_M))


def _at_pixels(
    points_W: FloatArray, image: Image, X_WO: RigidTransform
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Which points (N, 3) a depth picture covers, how far ahead of the camera they are, and its depth there (m)."""
    X_CW = camera_pose_W(image, X_WO).inverse()
    p_C = points_W @ X_CW.rotation().matrix().T + X_CW.translation()
    lens = image.depth_intrinsics
    z = np.maximum(p_C[:, 2], 1e-6)
    u = np.rint(p_C[:, 0] / z * lens.fx + lens.cx).astype(np.int64)
    v = np.rint(p_C[:, 1] / z * lens.fy + lens.cy).astype(np.int64)
    inside = (p_C[:, 2] > _NEAREST_M) & (u >= 0) & (u < lens.width) & (v >= 0) & (v < lens.height)
    depth = np.zeros(len(points_W))
    depth[inside] = image.depth_m[v[inside], u[inside]]
    return inside, z, depth


def merged(cells: Cells) -> list[tuple[Cells, Cells]]:
    """Few boxes (first cell, cell after the last) that cover exactly these cells: runs, joined where they are equal."""
    columns: dict[tuple[int, int], list[int]] = {}
    for x, y, z in _unique(cells)[0].tolist():
        columns.setdefault((x, y), []).append(z)
    rows: dict[tuple[int, Run], list[int]] = {}
    for (x, y), heights in columns.items():
        for run in _runs(heights):
            rows.setdefault((x, run), []).append(y)
    plates: dict[tuple[Run, Run], list[int]] = {}
    for (x, height), ys in rows.items():
        for run in _runs(ys):
            plates.setdefault((run, height), []).append(x)
    return [
        (np.array([x0, y0, z0]), np.array([x1, y1, z1]))
        for ((y0, y1), (z0, z1)), xs in sorted(plates.items())
        for x0, x1 in _runs(xs)
    ]


def _runs(numbers: Iterable[int]) -> list[Run]:
    """First and after the last of each run of consecutive numbers."""
    ordered = np.array(sorted(numbers))
    cuts = np.flatnonzero(np.diff(ordered) > 1)
    firsts, lasts = np.append(0, cuts + 1), np.append(cuts, len(ordered) - 1)
    return [(int(ordered[a]), int(ordered[b]) + 1) for a, b in zip(firsts, lasts, strict=True)]


def _box(low: Cells, high: Cells, X_BW: RigidTransform) -> Box:
    size = (high - low) * CELL_M
    middle = 0.5 * (low + high) * CELL_M
    return Box(X_BW @ RigidTransform(middle), (float(size[0]), float(size[1]), float(size[2])))
