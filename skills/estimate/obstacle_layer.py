"""Marking and clearing of the cells that the LiDAR sees blocked."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.estimate.scan_points import sensor_pose
from skills.robot import FloatArray, Scan


def clear_cells(scan: Scan, centres_F: FloatArray, cell_m: float) -> NDArray[np.bool_]:
    """Returns whether the beams of a whole revolution see past each place (N, 3) at its height.

    A place counts as free when all beams that could have hit it go on for 0.3 m at least. A place that no beam can hit
    (too low, too near) shares the fate of a free place beside it: both were seen on one thing. Frame F is the levelled
    body frame of `scan_points`.
    """
    rotation, translation = sensor_pose(scan)
    places_L = np.ascontiguousarray((centres_F - translation) @ rotation)
    return _clear(np.ascontiguousarray(scan.ranges_m), scan.elevations_rad, scan.azimuths_rad, places_L, cell_m)


@compiled
def _clear(
    ranges: NDArray[np.float32],
    elevations: FloatArray,
    azimuths: FloatArray,
    places: FloatArray,
    cell_m: float,
) -> NDArray[np.bool_]:
    """The loop of `clear_cells`."""
    count = azimuths.shape[0]
    spacing = azimuths[1] - azimuths[0]
    ring_gap = abs(elevations[1] - elevations[0])
    lowest, highest = elevations.min() + 0.5 * ring_gap, elevations.max()
    free = np.zeros(places.shape[0], dtype=np.bool_)
    hidden = np.zeros(places.shape[0], dtype=np.bool_)
    for n in range(places.shape[0]):
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        flat = math.hypot(x, y)
        reach = math.hypot(flat, z)
        elevation = math.atan2(z, flat)
        if not lowest <= elevation <= highest:
            hidden[n] = True
            continue
        middle = round((math.atan2(y, x) - azimuths[0]) / spacing)
        half = math.ceil(cell_m / max(flat, 0.3) / abs(spacing))
        looked, blocked = 0, False
        for i in range(elevations.shape[0]):
            if abs(elevations[i] - elevation) > ring_gap:
                continue
            for j in range(middle - half, middle + half + 1):
                r = ranges[i, j % count]
                if not r > reach + 0.3:
                    blocked = True
                looked += 1
        free[n] = looked > 0 and not blocked
    return _spread(free, hidden, places, 3.0 * cell_m)


@compiled
def _spread(
    free: NDArray[np.bool_], hidden: NDArray[np.bool_], places: FloatArray, radius_m: float
) -> NDArray[np.bool_]:
    """The free places and the hidden ones that lie within radius_m of one of these."""
    gone = free.copy()
    for n in np.flatnonzero(hidden):
        for m in np.flatnonzero(free):
            if math.hypot(places[n, 0] - places[m, 0], places[n, 1] - places[m, 1]) <= radius_m:
                gone[n] = True
    return gone


@compiled
def mark_cells(
    cells: NDArray[np.int64],
    heights: FloatArray,
    times: tuple[float, float, float],
    candidate_s: FloatArray,
    until_s: FloatArray,
    height_m: FloatArray,
) -> bool:
    """Marks hit cells in place; True when any cell became blocked that was not.

    `times` is the scan's stamp, within how long another scan must have hit the cell or a neighbour, and how long a
    blocked cell is remembered (s).
    """
    stamp, confirm, memory = times
    rows, columns = until_s.shape
    changed = False
    for n in range(cells.shape[0]):
        i, j = cells[n, 0], cells[n, 1]
        for a in range(max(0, i - 1), min(rows, i + 2)):
            for b in range(max(0, j - 1), min(columns, j + 2)):
                if stamp - confirm <= candidate_s[a, b] < stamp:
                    fresh = until_s[i, j] <= stamp
                    changed |= fresh
                    until_s[i, j] = stamp + memory
                    height_m[i, j] = heights[n] if fresh else max(height_m[i, j], heights[n])
    for n in range(cells.shape[0]):
        candidate_s[cells[n, 0], cells[n, 1]] = stamp
    return changed
