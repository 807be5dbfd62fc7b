"""Solid cells of the world within the arm's reach, from depth images and the map, and boxes around them."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.compiled import compiled
from skills.estimate.scan_points import segment_distance
from skills.grid_map import CELL_M, LEVELS, Cells
from skills.inputs.plugins import installed_plugins
from skills.manipulation.arm.collision import ArmScene, Box, gaps_m
from skills.manipulation.arm.kinematics import arm_model
from skills.perception.point_cloud import MIN_DEPTH_M, camera_pose_W, lens_rays
from skills.robot import FloatArray, FrameTree, Image, Intrinsics

_SEVEN_JOINTS: Final = "fetch"
_NEAREST_M = 0.28
"""Distance from the camera below which depth is not used."""
_FURTHEST_M = 2.5
"""Depth beyond which points are not used."""
_FEWEST_POINTS = 4
"""Number of points from which on a cell is solid."""
_SEEN_PAST_M = 0.08
"""Depth behind a cell beyond which a picture proves the cell empty."""
_SHADOW_CELLS = 8
"""Number of cells behind a seen one that count as solid."""
_FLOOR_M = 0.05
"""Height up to which points belong to the floor."""
_SPAN = 1 << 20
"""Number of cells along each axis that a key can tell apart."""
_OFFSET = _SPAN // 2
_STRIDES = np.array([_SPAN**2, _SPAN, 1])
_STRIDE_PX = 8
"""Distance in pixels between the rows and columns of a stored view."""
_MOST_VIEWS = 32
"""Number of views that are stored."""
_AT_ARM_M = 0.12
"""Solid cells nearer to the arm's axis than this are the arm itself."""
_AT_HELD_M = 0.05
"""Distance from the held object within which solid cells are the object itself, or in contact with it."""

View = tuple[Image, RigidTransform]
"""Depth picture, and the X_WO of its time."""


@dataclass(frozen=True)
class Outline:
    """Outline of the robot from above: the rectangle between two corners (2,) in the body frame, at a pose X_WB."""

    X_WB: RigidTransform
    low_m: FloatArray
    high_m: FloatArray

    def holds(self, points_W: FloatArray) -> NDArray[np.bool_]:
        """Mask (N,) of the world points within the outline."""
        points_B = (points_W - self.X_WB.translation()) @ self.X_WB.rotation().matrix()[:, :2]
        return np.asarray(np.all((points_B > self.low_m) & (points_B < self.high_m), axis=1))


@dataclass(frozen=True)
class OwnSpace:
    """Space that the robot itself occupies: its outline, and the space around its arm (`lines_W`) and the held object.

    `lines_W` (3, K) are points along the arm. It includes the boxes between corners in `known_W`, and the box about the
    corners (N, 3) of the object in `held_W`, with their pose X_WH.
    """

    outline: Outline
    lines_W: tuple[FloatArray, ...]
    known_W: tuple[tuple[FloatArray, FloatArray], ...] = ()
    held_W: tuple[RigidTransform, FloatArray] | None = None

    def holds(self, points_W: FloatArray) -> NDArray[np.bool_]:
        """Mask (N,) of the world points in this space."""
        within = self.outline.holds(points_W)
        for start, end in chain.from_iterable(pairwise(line_W.T) for line_W in self.lines_W):
            within |= segment_distance(points_W, start, end) < _AT_ARM_M
        for low, high in self.known_W:
            within |= np.all((points_W > low) & (points_W < high), axis=1)
        if self.held_W is not None:
            X_WH, held_H = self.held_W
            X_HW = X_WH.inverse()
            p_H = points_W @ X_HW.rotation().matrix().T + X_HW.translation()
            low, high = held_H.min(axis=0) - _AT_HELD_M, held_H.max(axis=0) + _AT_HELD_M
            within |= np.all((p_H > low) & (p_H < high), axis=1)
        return within


def add_picture(cells: Cells, image: Image, X_WO: RigidTransform, own: Outline) -> Cells:
    """Returns the cells (N, 3) after a depth image: adds cells that contain points, clears cells that it sees through.

    Ignores points within the outline `own`.
    """
    X_WC, (x_C, y_C) = camera_pose_W(image, X_WO), lens_rays(image.depth_intrinsics)
    eye, body = X_WC.GetAsMatrix34(), own.X_WB.GetAsMatrix34()
    runs, lengths = _keys(image.depth_m, x_C, y_C, eye, body, own.low_m, own.high_m)
    keys, at = np.unique(runs, return_inverse=True)
    counts = np.bincount(at, weights=lengths, minlength=len(keys))
    still = cells[~_seen_past(cells, image, X_WO)]
    solid = np.vstack([still, _cells(keys[counts >= _FEWEST_POINTS])])
    return _cells(np.unique(((solid + _OFFSET) * _STRIDES).sum(axis=1)))


@compiled
def _keys(
    depth_m: NDArray[np.float32],
    x_C: FloatArray,
    y_C: FloatArray,
    X_WC: FloatArray,
    X_WB: FloatArray,
    low_B: FloatArray,
    high_B: FloatArray,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Keys of the cells that contain points of a depth image, without the robot's own; poses are (3, 4) matrices.

    Neighbouring pixels of a row in one cell are a run: returns the key of each run, and its number of pixels. `x_C` and
    `y_C` are x/z of each column and y/z of each row.
    """
    keys, lengths = np.empty(depth_m.size, dtype=np.int64), np.empty(depth_m.size, dtype=np.int64)
    found, last = 0, -1
    for v in range(depth_m.shape[0]):
        for u in range(depth_m.shape[1]):
            z = np.float64(depth_m[v, u])
            if not MIN_DEPTH_M < z < _FURTHEST_M:
                continue
            dx = z * (X_WC[0, 0] * x_C[u] + X_WC[0, 1] * y_C[v] + X_WC[0, 2])
            dy = z * (X_WC[1, 0] * x_C[u] + X_WC[1, 1] * y_C[v] + X_WC[1, 2])
            dz = z * (X_WC[2, 0] * x_C[u] + X_WC[2, 1] * y_C[v] + X_WC[2, 2])
            x, y, height = dx + X_WC[0, 3], dy + X_WC[1, 3], dz + X_WC[2, 3]
            if height <= _FLOOR_M or dx * dx + dy * dy + dz * dz <= _NEAREST_M * _NEAREST_M:
                continue
            bx, by, bz = x - X_WB[0, 3], y - X_WB[1, 3], height - X_WB[2, 3]
            ahead = bx * X_WB[0, 0] + by * X_WB[1, 0] + bz * X_WB[2, 0]
            left = bx * X_WB[0, 1] + by * X_WB[1, 1] + bz * X_WB[2, 1]
            if low_B[0] < ahead < high_B[0] and low_B[1] < left < high_B[1]:
                continue
            i, j, k = math.floor(x / CELL_M), math.floor(y / CELL_M), math.floor(height / CELL_M)
            key = ((i + _OFFSET) * _SPAN + j + _OFFSET) * _SPAN + k + _OFFSET
            if key == last:
                lengths[found - 1] += 1
                continue
            keys[found], lengths[found], last = key, 1, key
            found += 1
    return keys[:found], lengths[:found]


def solid_boxes(
    cells: Cells, X_WB: RigidTransform, reach_m: float, left_out: Callable[[FloatArray], NDArray[np.bool_]]
) -> list[Box]:
    """Boxes in the body frame around the cells within reach, except cells with a centre p_W (N, 3) that is `left_out`.

    Space behind a cell, up to 32 cm and within the reach, is unknown and counts as solid too, because the camera sees
    only the edge of a board.
    """
    middles, origin_W = cell_centres(cells), X_WB.translation()
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
    return [_box(low, high, X_BW) for low, high in merge_cells(solid)]


def boxes_around(cells: Cells, X_WB: RigidTransform, chosen: Callable[[FloatArray], NDArray[np.bool_]]) -> list[Box]:
    """Boxes in the body frame around the cells for whose centre p_W (N, 3) `chosen` is true."""
    X_BW = X_WB.inverse()
    return [_box(low, high, X_BW) for low, high in merge_cells(cells[chosen(cell_centres(cells))])]


def column_boxes(
    columns: Cells, X_WB: RigidTransform, reach_m: float, left_out: Callable[[FloatArray], NDArray[np.bool_]]
) -> list[Box]:
    """Boxes in the body frame around the solid columns within reach, except cells for which `left_out` is true."""
    off_m = (columns[:, :2] + 0.5) * CELL_M - X_WB.translation()[:2]
    near = columns[np.linalg.norm(off_m, axis=1) < reach_m]
    cells = np.column_stack([np.repeat(near, len(LEVELS), axis=0), np.tile(LEVELS, len(near))])
    cells = cells[cells[:, 3] < cells[:, 2]][:, [0, 1, 3]]
    return boxes_around(cells, X_WB, lambda p_W: ~left_out(p_W))


def hidden_boxes(
    p_W: FloatArray, views: Iterable[View], X_WB: RigidTransform, left_out: Callable[[FloatArray], NDArray[np.bool_]]
) -> list[Box]:
    """Boxes in the body frame around the cells beside and above p_W (3,) that no view shows, except those left out."""
    beside = np.arange(-_SHADOW_CELLS, _SHADOW_CELLS + 1)
    grid = np.stack(np.meshgrid(beside, beside, np.arange(2 * _SHADOW_CELLS)), axis=-1).reshape(-1, 3)
    cells = grid + np.floor(p_W / CELL_M).astype(np.int64)
    return boxes_around(cells[never_seen(cell_centres(cells), views)], X_WB, lambda p_W: ~left_out(p_W))


def cell_centres(cells: Cells) -> FloatArray:
    """Centres (N, 3) of cells (m)."""
    return np.asarray((cells + 0.5) * CELL_M, dtype=np.float64)


def _cells(keys: NDArray[np.int64]) -> Cells:
    """Returns the cells (N, 3) that belong to keys (N,)."""
    return np.stack([keys // _STRIDES[0], keys // _STRIDES[1] % _SPAN, keys % _SPAN], axis=1) - _OFFSET


def add_view(views: Sequence[View], image: Image, X_WO: RigidTransform) -> tuple[View, ...]:
    """Returns the last views and a new one, with every eighth row and column of the image's depth."""
    lens, thin = image.depth_intrinsics, _STRIDE_PX
    depth_m = image.depth_m[thin // 2 :: thin, thin // 2 :: thin].copy()  # a slice would keep the whole image
    lens = Intrinsics(
        width=depth_m.shape[1],
        height=depth_m.shape[0],
        fx=lens.fx / thin,
        fy=lens.fy / thin,
        cx=(lens.cx - thin // 2) / thin,
        cy=(lens.cy - thin // 2) / thin,
    )
    nothing = np.empty((0, 0), dtype=np.uint8)
    thinned = replace(image, colour=None, grey=nothing, depth_m=depth_m, depth_intrinsics=lens)
    return (*views[1 - _MOST_VIEWS :], (thinned, X_WO))


def never_seen(points_W: FloatArray, views: Iterable[View]) -> NDArray[np.bool_]:
    """Mask (N,) of the world points that no view shows.

    A point just behind a view's depth counts as shown, because all space there counts as solid.
    """
    unseen = np.ones(len(points_W), dtype=np.bool_)
    for image, X_WO in views:
        inside, z, depth = _at_pixels(points_W, image, X_WO)
        unseen &= ~(inside & ((depth == 0.0) | (depth > z - _SHADOW_CELLS * CELL_M)))
    return unseen


def _seen_past(cells: Cells, image: Image, X_WO: RigidTransform) -> NDArray[np.bool_]:
    """Mask (N,) of the cells that lie clearly in front of the depth at their pixel."""
    inside, z, depth = _at_pixels(cell_centres(cells), image, X_WO)
    return np.asarray(inside & (depth > z + _SEEN_PAST_M))


def _at_pixels(
    points_W: FloatArray, image: Image, X_WO: RigidTransform
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray]:
    """Mask (N,) of the points inside a depth image, their depth, and the image's depth at their pixel (m)."""
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


def merge_cells(cells: Cells) -> list[tuple[Cells, Cells]]:
    """Returns few boxes (first cell, one past the last cell) that exactly cover the cells: runs, merged if equal."""
    boxes = np.concatenate([cells, cells + 1], axis=1)
    for axis, others in ((2, (0, 1, 3, 4)), (1, (0, 2, 3, 5)), (0, (1, 4, 2, 5))):
        boxes = _joined(boxes, axis, others)
    return [(low, high) for low, high in zip(boxes[:, :3], boxes[:, 3:], strict=True)]


def _joined(boxes: Cells, axis: int, others: Sequence[int]) -> Cells:
    """Joins boxes (N, 6) along an axis where the next begins at or before the end, and the columns `others` are equal.

    The boxes must be sorted by the columns `others`, then along the axis.
    """
    boxes = boxes[np.lexsort([boxes[:, each] for each in (axis, *reversed(others))])]
    begins = np.ones(len(boxes), dtype=np.bool_)
    begins[1:] = (boxes[1:, others] != boxes[:-1, others]).any(axis=1) | (boxes[1:, axis] > boxes[:-1, axis + 3])
    firsts = np.flatnonzero(begins)
    joined, lasts = boxes[firsts], np.append(firsts[1:], len(boxes))[: len(firsts)] - 1
    joined[:, axis + 3] = boxes[lasts, axis + 3]
    return joined


def _box(low: Cells, high: Cells, X_BW: RigidTransform) -> Box:
    x, y, z = (high - low) * CELL_M
    return Box(X_BW @ RigidTransform(0.5 * (low + high) * CELL_M), (float(x), float(y), float(z)))


def solve_arm() -> None:
    """Solves the inverse kinematics of an arm with seven joints, and checks it for collisions with a box."""
    (kind,) = installed_plugins("errand.robots").select(name=_SEVEN_JOINTS)
    robot_kind: Any = kind.load()
    capabilities = robot_kind.capabilities()
    model = arm_model(capabilities)
    q_rad = np.full(7, 0.5)
    model.inverse(model.X_BH(q_rad))
    scene, box = ArmScene(capabilities, model, {}), Box(RigidTransform([2.0, 0.0, 0.0]), (0.1, 0.1, 0.1))
    scene.set_boxes([box])
    scene.edge_free(q_rad, q_rad)
    gaps_m(box, [box], np.zeros((1, 3)))


def map_cells() -> None:
    """Adds a depth picture to the arm's occupied cells."""
    lens, depth_m = Intrinsics(2, 2, 1.0, 1.0, 1.0, 1.0), np.ones((2, 2), dtype=np.float32)
    image = Image(0.0, "hand", "odom", lens, lens, None, np.zeros((2, 2), dtype=np.uint8), depth_m, FrameTree({}))
    own = Outline(RigidTransform(), np.zeros(2), np.zeros(2))
    add_picture(np.empty((0, 3), dtype=np.int64), image, RigidTransform(), own)
    segment_distance(np.ones((3, 2)).T, np.zeros(3), np.ones(3))
