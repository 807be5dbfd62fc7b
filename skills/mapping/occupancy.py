"""Occupancy in layers of height: log-odds of every cell, from rays traced through the grid (Moravec and Elfes, 1985).

A beam that passes over a low table does not touch the table's layer, so both stay right in one grid. The two maps that
the robot needs are bands of its layers.
"""

import math
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.mapping.keyframe import Keyframe
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
