"""Matching of scans to submaps: normal distributions that a pose is refined on, and a search for the pose in a window.

Normal distributions (NDT: Biber and Strasser, 2003): each cell holds the moments of the points in the 3 x 3 cells about
it. Only where these lie on a line, the distance across it counts (point to line), so that a submap of noisy scans has
surfaces much finer than the noise, and the pattern of the beams does not pull. Each quarter of directions that a
surface can face has its own moments, so that the two sides of a thin wall stay apart.

Search: branch and bound over positions, at many headings. The bound comes from the distance field: nowhere in a square
is a point nearer to a surface than its distance at the middle less half the diagonal (Hess et al., Real-Time Loop
Closure in 2D LIDAR SLAM, 2016, use a pyramid of grids).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.compiled import compiled
from skills.estimate.matching import add_residual
from skills.grid_map import GridMap
from skills.robot import FloatArray, Pose2D

CELL_M = 0.1
_FINEST_M = 0.1
"""Half the width of the squares at which the search ends."""
_QUARTERS = 4
_LEAST_SPREAD_M = 0.05
"""Least standard deviation along a line; the noise of the range alone has less."""
_QUARTER_RAD = 0.5 * math.pi
Moments = NDArray[np.float32]


class Distributions:
    """Submap about the origin of its own frame A, `half_m` to all sides."""

    def __init__(self, half_m: float = 30.0) -> None:
        cells = math.ceil(2.0 * half_m / CELL_M)
        self._low_m = -0.5 * cells * CELL_M
        self._moments: Moments = np.zeros((cells, cells, _QUARTERS, 6), dtype=np.float32)

    def add(self, points_F: FloatArray, X_AF: Pose2D) -> None:
        """Adds points (N, 3) of a scan at a pose: x, y, and the direction in which the surface faces (rad)."""
        _add(self._moments, self._low_m, points_F, np.array([X_AF.x_m, X_AF.y_m, X_AF.yaw_rad]))

    def linearise(
        self, points_F: FloatArray, pose: FloatArray, weight: float, outlier_m: float, inlier_m: float
    ) -> tuple[FloatArray, FloatArray, int]:
        """See `skills.estimate.matching.Linearise`; points are as in `add`."""
        return _linearise(self._moments, self._low_m, points_F, pose, weight, outlier_m, inlier_m)


@compiled
def _add(moments: Moments, low: float, points: FloatArray, pose: FloatArray) -> None:
    """The loop of `Distributions.add`: count, x, y, xx, xy, yy, relative to each cell's centre."""
    cells = moments.shape[0]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for n in range(points.shape[0]):
        x = pose[0] + c * points[n, 0] - s * points[n, 1]
        y = pose[1] + s * points[n, 0] + c * points[n, 1]
        column, row = math.floor((x - low) / CELL_M), math.floor((y - low) / CELL_M)
        if not (1 <= column < cells - 1 and 1 <= row < cells - 1):
            continue
        quarter = math.floor((points[n, 2] + pose[2]) / _QUARTER_RAD + 0.5) % _QUARTERS
        for i in range(row - 1, row + 2):
            for j in range(column - 1, column + 2):
                u, v = x - low - (j + 0.5) * CELL_M, y - low - (i + 0.5) * CELL_M
                cell = moments[i, j, quarter]
                cell[0] += 1.0
                cell[1] += u
                cell[2] += v
                cell[3] += u * u
                cell[4] += u * v
                cell[5] += v * v


@compiled
def _linearise(
    moments: Moments, low: float, points: FloatArray, pose: FloatArray, weight: float, outlier_m: float, inlier_m: float
) -> tuple[FloatArray, FloatArray, int]:
    """The loop of `Distributions.linearise`."""
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    cells, inliers = moments.shape[0], 0
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for n in range(points.shape[0]):
        dx, dy = c * points[n, 0] - s * points[n, 1], s * points[n, 0] + c * points[n, 1]
        x, y = pose[0] + dx - low, pose[1] + dy - low
        column, row = math.floor(x / CELL_M), math.floor(y / CELL_M)
        if not (0 <= column < cells and 0 <= row < cells):
            continue
        cell = moments[row, column, math.floor((points[n, 2] + pose[2]) / _QUARTER_RAD + 0.5) % _QUARTERS]
        count = float(cell[0])
        if count < 5.0:
            continue
        mx, my = cell[1] / count, cell[2] / count
        xx, xy, yy = cell[3] / count - mx * mx, cell[4] / count - mx * my, cell[5] / count - my * my
        ex, ey = x - (column + 0.5) * CELL_M - mx, y - (row + 0.5) * CELL_M - my
        middle, spread = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
        narrow, wide = max(0.0, middle - spread), middle + spread
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
        if wide < max(3.0 * narrow, _LEAST_SPREAD_M**2):
            continue
        nx, ny = math.cos(angle), math.sin(angle)
        residual = nx * ex + ny * ey
        if abs(residual) >= outlier_m:
            continue
        inliers += abs(residual) < inlier_m
        add_residual(hessian, gradient, (nx, ny), (dx, dy), residual, weight, outlier_m)
    return hessian, gradient, inliers


@dataclass(frozen=True)
class Window:
    """Search window: half the width of the square (m) and half the span of headings (rad)."""

    place_m: float
    yaw_rad: float


@dataclass(frozen=True)
class SubmapMatch:
    """The best pose, its score (0 to 1), and the score of the best pose at another place."""

    pose: Pose2D
    score: float
    competing_score: float


def find_pose(
    grid: GridMap,
    points_F: FloatArray,
    guess: Pose2D,
    window: Window,
    *,
    least: float = 0.4,
    reach_m: float = 0.25,
    apart_m: float = 0.5,
) -> SubmapMatch | None:
    """The pose about a guess where points (N, 2 or more columns) fit a grid best, None when not better than `least`.

    A competing pose lies farther than `apart_m` away.
    """
    distance, frame = grid.distance, (grid.resolution_m, *grid.origin_m)
    turns = max(1, math.ceil(window.yaw_rad / math.radians(1.5)))
    yaws = guess.yaw_rad + np.linspace(-window.yaw_rad, window.yaw_rad, 2 * turns + 1)
    centre = (guess.x_m, guess.y_m)
    nowhere = (math.inf, math.inf)
    best = _branch_and_bound(distance, frame, points_F, yaws, centre, window.place_m, least, reach_m, nowhere, 0.0)
    if best[0] <= least:
        return None
    place, bar = (float(best[1]), float(best[2])), 0.8 * float(best[0])
    competing = _branch_and_bound(distance, frame, points_F, yaws, centre, window.place_m, bar, reach_m, place, apart_m)
    return SubmapMatch(Pose2D(place[0], place[1], float(best[3])), float(best[0]), float(competing[0]))


@compiled
def _branch_and_bound(
    distance: NDArray[np.float32],
    frame: tuple[float, float, float],
    points: FloatArray,
    yaws: FloatArray,
    centre: tuple[float, float],
    half: float,
    least: float,
    reach: float,
    away: tuple[float, float],
    away_m: float,
) -> FloatArray:
    """Score, x, y, yaw of the best pose at least `away_m` from `away`; the score `least` when none is better."""
    best = np.array([least, 0.0, 0.0, 0.0])
    turned = np.empty((points.shape[0], 2))
    stack = np.empty((256, 3))
    for yaw in yaws:
        c, s = math.cos(yaw), math.sin(yaw)
        for n in range(points.shape[0]):
            turned[n, 0] = c * points[n, 0] - s * points[n, 1]
            turned[n, 1] = s * points[n, 0] + c * points[n, 1]
        stack[0] = (centre[0], centre[1], half)
        count = 1
        while count > 0:
            count -= 1
            x, y, h = stack[count]
            if math.hypot(x - away[0], y - away[1]) + h * math.sqrt(2.0) < away_m:
                continue
            fine = h <= _FINEST_M
            if fine and math.hypot(x - away[0], y - away[1]) < away_m:
                continue
            score = _bound(distance, frame, turned, x, y, 0.0 if fine else h * math.sqrt(2.0), reach, best[0])
            if score <= best[0]:
                continue
            if fine:
                best[0], best[1], best[2], best[3] = score, x, y, yaw
                continue
            q = 0.5 * h
            for a in (-1.0, 1.0):
                for b in (-1.0, 1.0):
                    stack[count, 0], stack[count, 1], stack[count, 2] = x + a * q, y + b * q, q
                    count += 1
    return best


@compiled
def _bound(
    distance: NDArray[np.float32],
    frame: tuple[float, float, float],
    points: FloatArray,
    x: float,
    y: float,
    slack: float,
    reach: float,
    least: float,
) -> float:
    """Greatest score of the points with their origin within `slack` of (x, y); 0 once that is below `least`."""
    rows, columns = distance.shape
    total, count = 0.0, points.shape[0]
    for n in range(count):
        if (n & 31) == 31 and total + count - n <= least * count:
            return 0.0
        u = math.floor((x + points[n, 0] - frame[1]) / frame[0])
        v = math.floor((y + points[n, 1] - frame[2]) / frame[0])
        i, j = min(max(v, 0), rows - 1), min(max(u, 0), columns - 1)
        outside = math.hypot(v - i, u - j) * frame[0]
        d = max(0.0, abs(distance[i, j]) + outside - slack)
        total += max(0.0, 1.0 - (d / reach) ** 2)
    return float(total / max(1, count))
