"""Frontiers: where free ground ends at ground that was never seen (Yamauchi, A Frontier-Based Approach, 1997)."""

from __future__ import annotations

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
"""Every so many cells of the grid are searched."""
_TIGHT_FACTOR: Final = 5.0


@dataclass(frozen=True)
class Frontier:
    """A stretch of the border to the unknown: its nearest cell, where to stand for it, and the way there (m)."""

    at: tuple[float, float]
    stand: tuple[float, float]
    cost_m: float
    length_m: float


class Ground:
    """What can be reached on a grid whose unknown cells are blocked, from a place (x, y).

    The robot's middle needs `clear_m` to all that is blocked; frontiers end the ground that was `explored`.
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
        """All that are at least so long and within so far of where the robot can stand; the nearest first."""
        beside = cv2.dilate((~self._explored).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        border = self._explored & beside & (self._grid.distance > 0.1)
        _, labels = cv2.connectedComponents(border.astype(np.uint8), connectivity=8)
        rows, columns = np.nonzero(labels)
        found = []
        for label, cells in _grouped(labels[rows, columns].astype(np.int32), np.column_stack([rows, columns])):
            length_m = len(cells) * self._grid.resolution_m
            if label == 0 or length_m < least_m:
                continue
            nearest = self._nearest(cells, within_m)
            if nearest is not None:
                found.append(Frontier(*nearest, length_m=length_m))
        return sorted(found, key=lambda each: each.cost_m)

    def stands_near(self, x: float, y: float, *, most: int, apart_m: float) -> list[tuple[float, float]]:
        """Reachable places nearest to a point, the nearest first, at least so far apart."""
        xy = self._grid.centres(np.argwhere(self._stands) * _STEP)
        xy = xy[np.argsort(np.hypot(xy[:, 0] - x, xy[:, 1] - y), kind="stable")]
        chosen: list[tuple[float, float]] = []
        while len(xy) > 0 and len(chosen) < most:
            chosen.append((float(xy[0, 0]), float(xy[0, 1])))
            xy = xy[np.hypot(*(xy - xy[0]).T) >= apart_m]
        return chosen

    def cost_to(self, x: float, y: float) -> float:
        """The way (m) to a place; infinite when it cannot be reached."""
        row, column = self._grid.cells(np.array([(x, y)]))[0] // _STEP
        rows, columns = self.cost_m.shape
        return float(self.cost_m[row, column]) if 0 <= row < rows and 0 <= column < columns else math.inf

    def _nearest(
        self, cells: NDArray[np.int64], within_m: float
    ) -> tuple[tuple[float, float], tuple[float, float], float] | None:
        """The cell of a frontier with the shortest way, where to stand for it, and that way."""
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


def _grouped(labels: NDArray[np.int32], cells: NDArray[np.int64]) -> list[tuple[int, NDArray[np.int64]]]:
    """The cells of each label."""
    order = np.argsort(labels, kind="stable")
    values, firsts = np.unique(labels[order], return_index=True)
    return list(zip(values.tolist(), np.split(cells[order], firsts[1:]), strict=True))


@compiled
def _spread(
    stands: NDArray[np.bool_], free: NDArray[np.bool_], row: int, column: int, cell_m: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Dijkstra from a cell: cost (m) of each free cell, and the last cell on the way there where the robot can stand.

    Cells too tight to stand in are dearer; once among them, the way does not come out again.
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
        begin = here < 0.8
        for a in range(max(0, i - 1), min(rows, i + 2)):
            for b in range(max(0, j - 1), min(columns, j + 2)):
                if not free[a, b] or (stands[a, b] and not stands[i, j] and not begin):
                    continue
                way = math.hypot(a - i, b - j) * cell_m * (1.0 if stands[a, b] or begin else _TIGHT_FACTOR)
                if here + way < cost[a, b]:
                    cost[a, b] = here + way
                    stand[a, b] = a * columns + b if stands[a, b] or begin else stand[i, j]
                    heapq.heappush(heap, (cost[a, b], a * columns + b))
    return cost, stand
