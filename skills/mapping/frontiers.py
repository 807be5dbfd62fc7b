"""Frontiers between free and unseen ground (Yamauchi, A Frontier-Based Approach, 1997)."""

import heapq
import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.estimate.grid_map import GridMap
from skills.robot import FloatArray

_STEP: Final = 2
"""Cells of the grid for each searched one, along both axes."""
_TIGHT_FACTOR: Final = 5.0
"""Cost of a metre among cells too tight to stand in."""
_BEGINNING_M: Final = 0.8
"""Within this cost of its start the robot may stand anywhere."""


@dataclass(frozen=True)
class Frontier:
    """Stretch of the border to the unknown: its nearest cell, where to stand for it, and the distance there (m)."""

    at: tuple[float, float]
    stand: tuple[float, float]
    cost_m: float
    length_m: float


class Ground:
    """The ground that the robot can reach from a position (x, y) on a grid whose unknown cells are blocked.

    The robot's middle needs `clear_m` of clearance; frontiers bound the `explored` cells.
    """

    def __init__(
        self, grid: GridMap, explored: NDArray[np.bool_], here: tuple[float, float], *, clear_m: float
    ) -> None:
        self._grid, self._cell_m = grid, _STEP * grid.resolution_m
        unknown = np.zeros_like(grid.occupied) if grid.unknown is None else grid.unknown
        self._explored = explored
        clear = grid.with_unknown_blocked().distance[::_STEP, ::_STEP]
        free = ~(grid.occupied | unknown)[::_STEP, ::_STEP]
        stands = free & (clear >= clear_m)
        row, column = grid.cells(np.array([here]))[0] // _STEP
        self.cost_m, self._stand = _spread(
            np.ascontiguousarray(stands), np.ascontiguousarray(free), int(row), int(column), self._cell_m
        )
        self._stands = stands & np.isfinite(self.cost_m)

    def frontiers(self, *, least_m: float, within_m: float) -> list[Frontier]:
        """Frontiers at least `least_m` long and within `within_m` of where the robot can stand, nearest first."""
        beside = cv2.dilate((~self._explored).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        border = self._explored & beside & (self._grid.distance > 0.1)
        _, labels = cv2.connectedComponents(border.astype(np.uint8), connectivity=8)
        rows, columns = np.nonzero(labels)
        found = []
        values = labels[rows, columns]
        order = np.argsort(values, kind="stable")
        _, firsts = np.unique(values[order], return_index=True)
        for cells in np.split(np.column_stack([rows, columns])[order], firsts[1:]):
            length_m = len(cells) * self._grid.resolution_m
            if length_m < least_m:
                continue
            nearest = self._nearest(cells, within_m)
            if nearest is not None:
                found.append(Frontier(*nearest, length_m=length_m))
        return sorted(found, key=lambda each: each.cost_m)

    def stands_near(self, x: float, y: float, *, most: int, apart_m: float) -> list[tuple[float, float]]:
        """Reachable positions near a point, nearest first, at most `most` and at least `apart_m` apart."""
        xy = self._grid.centres(np.argwhere(self._stands) * _STEP)
        xy = xy[np.argsort(np.hypot(xy[:, 0] - x, xy[:, 1] - y), kind="stable")]
        chosen: list[tuple[float, float]] = []
        while len(xy) > 0 and len(chosen) < most:
            chosen.append((float(xy[0, 0]), float(xy[0, 1])))
            xy = xy[np.hypot(*(xy - xy[0]).T) >= apart_m]
        return chosen

    def cost_to(self, x: float, y: float) -> float:
        """Distance (m) to drive to a position; infinite when it cannot be reached."""
        row, column = self._grid.cells(np.array([(x, y)]))[0] // _STEP
        rows, columns = self.cost_m.shape
        return float(self.cost_m[row, column]) if 0 <= row < rows and 0 <= column < columns else math.inf

    def _nearest(
        self, cells: NDArray[np.int64], within_m: float
    ) -> tuple[tuple[float, float], tuple[float, float], float] | None:
        """The nearest cell of a frontier, where to stand for it, and the distance there."""
        coarse = np.minimum(cells // _STEP, np.array(self.cost_m.shape) - 1)
        costs = self.cost_m[coarse[:, 0], coarse[:, 1]]
        best = int(np.argmin(costs))
        if not math.isfinite(costs[best]):
            return None
        index = int(self._stand[coarse[best, 0], coarse[best, 1]])
        stand_cell = np.array([divmod(index, self.cost_m.shape[1])]) * _STEP
        at, stand = self._grid.centres(cells[best][None])[0], self._grid.centres(stand_cell)[0]
        if math.hypot(*(at - stand)) > within_m:
            return None
        return (float(at[0]), float(at[1])), (float(stand[0]), float(stand[1])), float(costs[best])


@compiled
def _spread(
    stands: NDArray[np.bool_], free: NDArray[np.bool_], row: int, column: int, cell_m: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Cost (m) of each free cell by Dijkstra, and the last cell on the path there where the robot can stand.

    Cells too tight to stand in cost more; a path among them does not come out again.
    """
    rows, columns = free.shape
    cost = np.full((rows, columns), np.inf)
    stand = np.full((rows, columns), -1, dtype=np.int64)
    heap = [(0.0, row * columns + column)]
    if not (0 <= row < rows and 0 <= column < columns):
        return cost, stand
    cost[row, column] = 0.0
    stand[row, column] = row * columns + column
    while len(heap) > 0:
        here, index = heapq.heappop(heap)
        i, j = index // columns, index % columns
        if here > cost[i, j]:
            continue
        begin = here < _BEGINNING_M
        for a in range(max(0, i - 1), min(rows, i + 2)):
            for b in range(max(0, j - 1), min(columns, j + 2)):
                if not free[a, b] or (stands[a, b] and not stands[i, j] and not begin):
                    continue
                length = math.hypot(a - i, b - j) * cell_m * (1.0 if stands[a, b] or begin else _TIGHT_FACTOR)
                if here + length < cost[a, b]:
                    cost[a, b] = here + length
                    stand[a, b] = a * columns + b if stands[a, b] or begin else stand[i, j]
                    heapq.heappush(heap, (cost[a, b], a * columns + b))
    return cost, stand
