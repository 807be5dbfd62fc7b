"""Walkable ground: a grid of the world's fixed shapes, with shortest paths and free points."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant

from plant.sensors.ray_shapes import BAND_M, outlines_W
from plant.worlds.world import Point, WorldError
from skills.robot import FloatArray

SHOULDERS_M = 0.30
"""Clearance of a person's centre from obstacles on the path."""
LEAST_M = 0.20
"""Clearance of a person's centre from obstacles at a waypoint."""
_CELL_M = 0.05
_NEAR_WAYPOINT_M = 0.5
_STEPS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, math.sqrt(2.0)), (1, -1, math.sqrt(2.0)))


class Ground:
    """Walkable ground of a world: a grid with the clearance of each cell."""

    def __init__(self, outlines_W: Sequence[FloatArray], points_W: Iterable[Point]) -> None:
        """`outlines_W` are the convex outlines (K, 2) of obstacles; the grid covers these and `points_W`."""
        corners = np.concatenate([*outlines_W, np.array([*points_W], dtype=np.float64).reshape(-1, 2)])
        self._low = corners.min(axis=0) - 1.0
        columns, rows = np.ceil((corners.max(axis=0) + 1.0 - self._low) / _CELL_M).astype(int)
        self._free = np.full((rows, columns), 255, np.uint8)
        self._block(outlines_W)

    @staticmethod
    def from_plant(
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        points_W: Iterable[Point],
        band_m: tuple[float, float] = BAND_M,
    ) -> Ground:
        """Builds the ground of a finalized plant; the shapes fixed to the world in a band of heights are obstacles."""
        return Ground([outline for _, outline in outlines_W(plant, inspector, band_m)], points_W)

    def with_obstacles(self, outlines_W: Iterable[FloatArray]) -> Ground:
        """Returns the same ground with more obstacles."""
        other = copy.copy(self)
        other._free = self._free.copy()
        other._block(outlines_W)
        return other

    def _block(self, outlines_W: Iterable[FloatArray]) -> None:
        for outline in outlines_W:
            cells = np.round(((outline - self._low) / _CELL_M - 0.5) * 16).astype(np.int32)
            cv2.fillConvexPoly(self._free, cells, 0, shift=4)
        self._clearance_m = cv2.distanceTransform(self._free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _CELL_M

    def plan_path(self, start_W: Point, goal_W: Point, *, who: str) -> tuple[Point, ...]:
        """Plans the corners of a short path, start and goal included. Raises WorldError when `who` finds none."""
        for point in (start_W, goal_W):
            if self._clear_m(np.array([point]))[0] < LEAST_M:
                raise WorldError(f"{who} cannot stand at {_text(point)}: something is there; choose a free point")
        if self._straight(start_W, goal_W, (start_W, goal_W)):
            return (start_W, goal_W)
        cells = self._cells_between(start_W, goal_W)
        if cells is None:
            raise WorldError(f"{who} finds no path from {_text(start_W)} to {_text(goal_W)}; choose other waypoints")
        return self._shortened((start_W, *cells, goal_W))

    def plan_on(self, start_W: Point, goal_W: Point, *, who: str) -> tuple[Point, ...]:
        """Plans like `plan_path`; a person who stands too close to an obstacle first steps away from it."""
        if self._clear_m(np.array([start_W]))[0] >= LEAST_M:
            return self.plan_path(start_W, goal_W, who=who)
        cells = np.argwhere(self._clearance_m >= SHOULDERS_M)
        row, column = cells[int(np.argmin(np.hypot(*(cells - self._cell(start_W)).T)))]
        x, y = (np.array([column, row]) + 0.5) * _CELL_M + self._low
        return (start_W, *self.plan_path((float(x), float(y)), goal_W, who=who))

    def free_points(
        self, from_W: Point, least_m: float, clear_m: float, rng: np.random.Generator, count: int
    ) -> Iterator[Point]:
        """Yields up to `count` random points with a clearance (m), connected to a point and at least least_m away."""
        _, parts = cv2.connectedComponents((self._clearance_m >= LEAST_M).astype(np.uint8))
        row, column = self._cell(from_W)
        cells = np.argwhere((parts == parts[row, column]) & (self._clearance_m >= clear_m))
        for _ in range(count if len(cells) else 0):
            row, column = cells[int(rng.integers(len(cells)))]
            x, y = (np.array([column, row]) + 0.5) * _CELL_M + self._low
            if math.dist((x, y), from_W) >= least_m:
                yield float(x), float(y)

    def aside(self, from_W: Point, lines_W: Iterable[Sequence[Point]], clear_m: float) -> Point | None:
        """Returns the nearest free point connected to from_W at a distance (m) from lines; None when there is none."""
        lines = np.full(self._free.shape, 255, np.uint8)
        for line in lines_W:
            cv2.polylines(lines, [self._cell(np.array(line))[:, ::-1].astype(np.int32)], False, 0)
        _, parts = cv2.connectedComponents((self._clearance_m >= LEAST_M).astype(np.uint8))
        row, column = self._cell(from_W)
        free = (parts == parts[row, column]) & (self._clearance_m >= SHOULDERS_M)
        away_m = cv2.distanceTransform(lines, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _CELL_M
        points_W = (np.argwhere(free & (away_m >= clear_m))[:, ::-1] + 0.5) * _CELL_M + self._low
        if not len(points_W):
            return None
        x, y = points_W[int(np.argmin(np.hypot(*(points_W - from_W).T)))]
        return float(x), float(y)

    def sees(self, from_W: Point, to_W: Point) -> bool:
        """Returns whether no obstacle lies between two points."""
        points = np.linspace(from_W, to_W, max(2, math.ceil(math.dist(from_W, to_W) / _CELL_M)))
        return bool(np.all(self._clear_m(points) > 0.0))

    def _cells_between(self, start_W: Point, goal_W: Point) -> list[Point] | None:
        """Centres of the cells on a shortest path; None when no path exists."""
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
        """Mask of the cells that a person may enter on a path between these ends."""
        free: NDArray[np.bool_] = self._clearance_m >= SHOULDERS_M
        rows, columns = np.indices(free.shape)
        for end in ends_W:
            row, column = self._cell(end)
            near = np.hypot(rows - row, columns - column) * _CELL_M < _NEAR_WAYPOINT_M
            free |= near & (self._clearance_m >= LEAST_M)
        return free

    def _shortened(self, path: Sequence[Point]) -> tuple[Point, ...]:
        """The path without the corners that a straight line can skip."""
        ends, corners, here = (path[0], path[-1]), [path[0]], 0
        while here < len(path) - 1:
            after = len(path) - 1
            while after > here + 1 and not self._straight(path[here], path[after], ends):
                after = here + max(1, (after - here) // 2)
            while after < len(path) - 1 and self._straight(path[here], path[after + 1], ends):
                after += 1
            corners.append(path[after])
            here = after
        return tuple(corners)

    def _straight(self, a: Point, b: Point, ends_W: Sequence[Point]) -> bool:
        """Returns whether a person can walk straight from a to b; near the ends a smaller clearance suffices."""
        points = np.linspace(a, b, max(2, math.ceil(math.dist(a, b) / (0.5 * _CELL_M))))
        near = np.any([np.hypot(*(points - end).T) < _NEAR_WAYPOINT_M for end in ends_W], axis=0)
        return bool(np.all(self._clear_m(points) >= np.where(near, LEAST_M, SHOULDERS_M) - 0.5 * _CELL_M))

    def _clear_m(self, points_W: FloatArray) -> FloatArray:
        cells = self._cell(points_W)
        return np.asarray(self._clearance_m[cells[..., 0], cells[..., 1]])

    def _cell(self, points_W: Point | FloatArray) -> NDArray[np.int64]:
        """Row and column of a point, or of each point of an array."""
        cells: NDArray[np.int64] = np.floor((np.asarray(points_W) - self._low) / _CELL_M).astype(np.int64)
        return cells[..., ::-1]


def _text(point: Point) -> str:
    return f"({point[0]:g}, {point[1]:g})"
