"""Occupancy in layers of height: log-odds of every cell, from rays traced through the grid (Moravec and Elfes, 1985).

A beam that passes over a low table does not touch the table's layer, so both stay right in one grid. The two maps that
the robot needs are bands of its layers. Frontiers between free and unseen ground are places to explore (Yamauchi, A
Frontier-Based Approach, 1997).
"""

import heapq
import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_make.maps.pose_graph import Keyframe
from skills.compiled import compiled
from skills.grid_map import GridMap
from skills.robot import FloatArray, Pose2D

LOWEST_M: Final = 0.05
HIGHEST_M: Final = 1.3
BANDS_M: Final = {"scan": (0.7, 1.3), "keepout": (0.05, 1.0)}
"""Band of heights (m) of each map."""
UNIT: Final = 0.2
"""Log-odds of one step of a cell's value."""
_HIT = 4
"""Change of a cell's value where a beam ends."""
_MISS = -2
"""Change of a cell's value where a beam passes."""
_MOST = 120
_OCCUPIED = 4
"""Least value of an occupied cell."""
_SURE = 8
"""Least value of a cell that is surely occupied."""
_FRINGE_M: Final = 0.075
"""Distance to which the noise of the ranges fills cells beside an occupied one."""
_BLOCK_M: Final = 8.0
"""Step by which the grid grows."""
Values = NDArray[np.int8]
_STEP: Final = 2
"""Cells of the grid for each searched one, along both axes."""
_TIGHT_FACTOR: Final = 5.0
"""Cost of a metre among cells too tight to stand in."""
_BEGINNING_M: Final = 0.8
"""Within this cost of its start the robot may stand anywhere."""


class LayeredOccupancy:
    """Occupancy grid that grows with each keyframe. `values` (layers, rows, columns) are log-odds in steps of UNIT.

    Layers must be thinner than a table top, since beams pass below it in a thicker one.
    """

    def __init__(self, resolution_m: float, max_range_m: float = 8.0, *, layer_m: float = 0.05) -> None:
        self.resolution_m, self._max_range_m, self._layer_m = resolution_m, max_range_m, layer_m
        self.origin_m = (0.0, 0.0)
        self.values: Values = np.zeros((round((HIGHEST_M - LOWEST_M) / layer_m), 0, 0), dtype=np.int8)

    def insert(self, frame: Keyframe, X_WF: Pose2D, *, stride: int = 1, first: int = 0) -> None:
        """Traces the beams of every `stride`-th column, from the `first` on, of a keyframe at a pose."""
        self._reach(X_WF)
        c, s = math.cos(X_WF.yaw_rad), math.sin(X_WF.yaw_rad)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        sensor = turn @ frame.translation + np.array([X_WF.x_m, X_WF.y_m, 0.0])
        _trace(
            self.values,
            _Frame(*self.origin_m, self.resolution_m, self._layer_m, self._max_range_m),
            frame.ranges_m[:, first::stride].copy(),
            frame.elevations_rad,
            frame.azimuths_rad[first::stride].copy(),
            np.ascontiguousarray(turn @ frame.rotation),
            sensor,
        )

    def probability(self, band: str) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Probability that a cell is occupied anywhere in a band of heights, and whether it was observed at all."""
        layers = self.values[self._layers(BANDS_M[band])]
        observed = (layers != 0).any(axis=0)
        odds = self._greatest(layers).astype(np.float32) * np.float32(UNIT)
        probability = 1.0 / (1.0 + np.exp(-odds))
        return np.where(observed, probability, 0.5).astype(np.float32), observed

    def ground(self, window: tuple[slice, slice], low_m: float) -> tuple[NDArray[np.bool_], ...]:
        """Returns whether each cell of a window is occupied for the body, was observed, and was observed below low_m.

        Occupied cells count as observed below.
        """
        values = self.values[:, window[0], window[1]]
        layers = values[self._layers(BANDS_M["keepout"])]
        occupied = self._greatest(layers) >= _OCCUPIED
        low = (values[self._layers((LOWEST_M, low_m))] != 0).any(axis=0)
        return occupied, (layers != 0).any(axis=0), low | occupied

    def window(self, x_m: float, y_m: float, half_m: float) -> tuple[slice, slice]:
        """The rows and columns of the cells within half_m of a point along both axes."""
        columns, rows = (
            slice(
                max(0, math.floor((at_m - half_m - start_m) / self.resolution_m)),
                math.ceil((at_m + half_m - start_m) / self.resolution_m),
            )
            for at_m, start_m in zip((x_m, y_m), self.origin_m, strict=True)
        )
        return rows, columns

    def _layers(self, band_m: tuple[float, float]) -> slice:
        """The layers of which more than half lies in a band of heights."""
        first, last = ((height - LOWEST_M) / self._layer_m for height in band_m)
        return slice(math.floor(first + 0.5), math.ceil(last - 0.5))

    def _greatest(self, layers: Values) -> Values:
        """Greatest value of the observed layers; -128 where none was observed.

        A cell that is hardly occupied beside one that surely is comes from the noise of ranges, and counts as free.
        """
        greatest = np.where(layers == 0, np.int8(-128), layers).max(axis=0)
        sure = (greatest >= _SURE).astype(np.uint8)
        reach = 2 * math.floor(_FRINGE_M / self.resolution_m + 1e-6) + 1
        beside = cv2.dilate(sure, np.ones((reach, reach), np.uint8)) > sure
        return np.asarray(np.where(beside, np.minimum(greatest, np.int8(_MISS)), greatest), dtype=np.int8)

    def _reach(self, X_WF: Pose2D) -> None:
        """Grows the grid to cover all cells within the range of a pose."""
        rows, columns = self.values.shape[1:]
        need = [
            (
                math.floor((at - self._max_range_m - 1.0) / _BLOCK_M),
                math.ceil((at + self._max_range_m + 1.0) / _BLOCK_M),
            )
            for at in (X_WF.x_m, X_WF.y_m)
        ]
        block = round(_BLOCK_M / self.resolution_m)
        if rows == 0:
            self.origin_m = (need[0][0] * _BLOCK_M, need[1][0] * _BLOCK_M)
        have = [
            (round(start / _BLOCK_M), round(start / _BLOCK_M) + size // block)
            for start, size in zip(self.origin_m, (columns, rows), strict=True)
        ]
        pads = [
            (max(0, had[0] - want[0]) * block, max(0, want[1] - had[1]) * block)
            for had, want in zip(have, need, strict=True)
        ]
        if any(pads[0]) or any(pads[1]):
            self.values = np.ascontiguousarray(np.pad(self.values, ((0, 0), pads[1], pads[0])))
            low = [start - before * self.resolution_m for start, (before, _) in zip(self.origin_m, pads, strict=True)]
            self.origin_m = (low[0], low[1])


class _Frame(NamedTuple):
    """Corner of the grid, sizes of its cells and layers, and the range of the beams."""

    x0_m: float
    y0_m: float
    cell_m: float
    layer_m: float
    range_m: float


@compiled
def _trace(
    values: Values,
    frame: _Frame,
    ranges: NDArray[np.float32],
    elevations: FloatArray,
    azimuths: FloatArray,
    rotation: FloatArray,
    sensor: FloatArray,
) -> None:
    """The loop of `LayeredOccupancy.insert`: misses along each beam, a hit at its end."""
    layers = values.shape[0]
    for i in range(elevations.shape[0]):
        ce, se = math.cos(elevations[i]), math.sin(elevations[i])
        for j in range(azimuths.shape[0]):
            r = float(ranges[i, j])
            if not r > 0.0:
                continue
            ca, sa = ce * math.cos(azimuths[j]), ce * math.sin(azimuths[j])
            dx = rotation[0, 0] * ca + rotation[0, 1] * sa + rotation[0, 2] * se
            dy = rotation[1, 0] * ca + rotation[1, 1] * sa + rotation[1, 2] * se
            dz = rotation[2, 0] * ca + rotation[2, 1] * sa + rotation[2, 2] * se
            flat = math.hypot(dx, dy)
            end = min(r, frame.range_m / max(flat, 1e-3))
            last_row = math.floor((sensor[1] + r * dy - frame.y0_m) / frame.cell_m)
            last_column = math.floor((sensor[0] + r * dx - frame.x0_m) / frame.cell_m)
            steps = math.floor(end * flat / frame.cell_m)
            before_row, before_column, before_layer = -1, -1, -1
            u, v = (sensor[0] - frame.x0_m) / frame.cell_m, (sensor[1] - frame.y0_m) / frame.cell_m
            w, du, dv = (sensor[2] - LOWEST_M) / frame.layer_m, dx / flat, dy / flat
            dw = dz / flat * frame.cell_m / frame.layer_m
            for n in range(steps):
                height = w + (n + 0.5) * dw
                if height < 0.0 or height >= layers:
                    break
                layer, row, column = int(height), int(v + (n + 0.5) * dv), int(u + (n + 0.5) * du)
                if row == last_row and column == last_column:
                    break
                if row == before_row and column == before_column and layer == before_layer:
                    continue
                before_row, before_column, before_layer = row, column, layer
                values[layer, row, column] = max(values[layer, row, column] + _MISS, -_MOST)
            layer = math.floor((sensor[2] + r * dz - LOWEST_M) / frame.layer_m)
            if end == r and 0 <= layer < layers:
                old = values[layer, last_row, last_column]
                values[layer, last_row, last_column] = min(old + _HIT, _MOST)


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
