"""Ways for people around what stands fast: shortest paths on a grid of the world's collision shapes."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from plant.sensors.ray_shapes import ShapeKind, shape_row
from plant.worlds.world import Point, WorldError
from skills.robot import FloatArray

BAND_M = (0.05, 1.8)
"""What lies between these heights is in a person's way."""
SHOULDERS_M = 0.30
"""A person keeps so far from it with their middle."""
LEAST_M = 0.20
"""At a waypoint the person may come so near to it."""
_CELL_M = 0.05
_NEAR_WAYPOINT_M = 0.5
_ROUND_SIDES = 16
_STEPS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2.0)), (1, -1, math.sqrt(2.0)))


class Ground:
    """Where a person can walk between some points of a world."""

    def __init__(self, outlines_W: Sequence[FloatArray], points_W: Iterable[Point]) -> None:
        """`outlines_W` are convex, (K, 2) each, of what stands in the way; `points_W` are to lie on the ground."""
        corners = np.concatenate([*outlines_W, np.array([*points_W], dtype=np.float64).reshape(-1, 2)])
        self._low = corners.min(axis=0) - 1.0
        columns, rows = np.ceil((corners.max(axis=0) + 1.0 - self._low) / _CELL_M).astype(int)
        self._free = np.full((rows, columns), 255, np.uint8)
        self._block(outlines_W)

    @staticmethod
    def of(plant: MultibodyPlant, inspector: SceneGraphInspector, points_W: Iterable[Point]) -> Ground:
        """The ground of a finalized plant: what is fixed to the world is in the way."""
        return Ground([*_outlines_W(plant, inspector)], points_W)

    def around(self, outlines_W: Iterable[FloatArray]) -> Ground:
        """The same with something more in the way."""
        other = copy.copy(self)
        other._free = self._free.copy()
        other._block(outlines_W)
        return other

    def _block(self, outlines_W: Iterable[FloatArray]) -> None:
        for outline in outlines_W:
            cells = np.round(((outline - self._low) / _CELL_M - 0.5) * 16).astype(np.int32)
            cv2.fillConvexPoly(self._free, cells, 0, shift=4)
        self._clearance_m = cv2.distanceTransform(self._free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _CELL_M

    def way(self, start_W: Point, goal_W: Point, *, who: str) -> tuple[Point, ...]:
        """The corners of a short way, start and goal included. Raises WorldError: there is none for `who`."""
        for point in (start_W, goal_W):
            if self._clear_m(np.array([point]))[0] < LEAST_M:
                raise WorldError(f"{who} cannot stand at {_told(point)}: something is there; choose a free point")
        if self._straight(start_W, goal_W, (start_W, goal_W)):
            return (start_W, goal_W)
        cells = self._cells_between(start_W, goal_W)
        if cells is None:
            raise WorldError(f"{who} finds no way from {_told(start_W)} to {_told(goal_W)}; choose other waypoints")
        return self._shortened((start_W, *cells, goal_W))

    def _cells_between(self, start_W: Point, goal_W: Point) -> list[Point] | None:
        """Centres of the cells of a shortest way; None when there is none."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import dijkstra

        rows, columns = self._clearance_m.shape
        free = self._free_for((start_W, goal_W))
        index = np.arange(rows * columns).reshape(rows, columns)
        a, b, lengths = [], [], []
        for down, right, length in _STEPS:
            here = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
            there = (slice(down, rows), slice(max(0, right), columns - max(0, -right)))
            both = free[here] & free[there]
            a.append(index[here][both])
            b.append(index[there][both])
            lengths.append(np.full(np.count_nonzero(both), length))
        graph = coo_array(
            (np.concatenate(lengths), (np.concatenate(a), np.concatenate(b))), shape=(index.size, index.size)
        ).tocsr()
        begin, end = (int(index[tuple(self._cell(point))]) for point in (start_W, goal_W))
        _, before = dijkstra(graph, directed=False, indices=begin, return_predecessors=True)
        cells = [end]
        while cells[-1] != begin:
            if before[cells[-1]] < 0:
                return None
            cells.append(int(before[cells[-1]]))
        row, column = np.divmod(np.array(cells[::-1]), columns)
        return [(float(x), float(y)) for x, y in (np.column_stack([column, row]) + 0.5) * _CELL_M + self._low]

    def _free_for(self, ends_W: Sequence[Point]) -> NDArray[np.bool_]:
        """The cells where a person can be who stands at these points before or after."""
        free: NDArray[np.bool_] = self._clearance_m >= SHOULDERS_M
        rows, columns = np.indices(free.shape)
        for end in ends_W:
            row, column = self._cell(end)
            near = np.hypot(rows - row, columns - column) * _CELL_M < _NEAR_WAYPOINT_M
            free |= near & (self._clearance_m >= LEAST_M)
        return free

    def _shortened(self, way: Sequence[Point]) -> tuple[Point, ...]:
        """The way without the corners that can be cut."""
        ends, kept, here = (way[0], way[-1]), [way[0]], 0
        while here < len(way) - 1:
            after = len(way) - 1
            while after > here + 1 and not self._straight(way[here], way[after], ends):
                after = here + max(1, (after - here) // 2)
            while after < len(way) - 1 and self._straight(way[here], way[after + 1], ends):
                after += 1
            kept.append(way[after])
            here = after
        return tuple(kept)

    def _straight(self, a: Point, b: Point, ends_W: Sequence[Point]) -> bool:
        """Whether a person can go straight from a to b; near the ends, things may be nearer."""
        points = np.linspace(a, b, max(2, math.ceil(math.dist(a, b) / (0.5 * _CELL_M))))
        near = np.any([np.hypot(*(points - end).T) < _NEAR_WAYPOINT_M for end in ends_W], axis=0)
        return bool(np.all(self._clear_m(points) >= np.where(near, LEAST_M, SHOULDERS_M) - 0.5 * _CELL_M))

    def _clear_m(self, points_W: FloatArray) -> FloatArray:
        cells = self._cell(points_W)
        return np.asarray(self._clearance_m[cells[..., 0], cells[..., 1]])

    def _cell(self, points_W: Point | FloatArray) -> NDArray[np.int64]:
        """Row and column of a point, or of each of some."""
        cells: NDArray[np.int64] = np.floor((np.asarray(points_W) - self._low) / _CELL_M).astype(np.int64)
        return cells[..., ::-1]


def _outlines_W(plant: MultibodyPlant, inspector: SceneGraphInspector) -> Iterable[FloatArray]:
    """Outlines from above of the shapes that are fixed to the world and stand in the band."""
    context = plant.CreateDefaultContext()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        if not plant.IsAnchored(body):
            continue
        X_WB = plant.EvalBodyPoseInWorld(context, body)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            kind, half_m, X_BG = shape_row(inspector, geometry)
            corners_W = (X_WB @ X_BG).multiply((_unit_corners(kind) * half_m).T).T
            if corners_W[:, 2].max() > BAND_M[0] and corners_W[:, 2].min() < BAND_M[1]:
                yield cv2.convexHull(corners_W[:, :2].astype(np.float32)).reshape(-1, 2).astype(np.float64)


def _unit_corners(kind: ShapeKind) -> FloatArray:
    """Points around a shape of half extents 1."""
    turn = np.arange(_ROUND_SIDES) * math.tau / _ROUND_SIDES
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=np.float64)
    if kind is not ShapeKind.BOX:
        ring = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(len(ring), z)]) for z in (-1.0, 1.0)])


def _told(point: Point) -> str:
    return f"({point[0]:g}, {point[1]:g})"
