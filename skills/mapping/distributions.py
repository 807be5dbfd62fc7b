"""Submap of normal distributions (NDT: Biber and Strasser, 2003), to which scans are matched.

Each cell holds the moments of the points in the 3 x 3 cells about it. Only where these lie on a line, the distance
across it counts (point to line), so that a submap of noisy scans has surfaces much finer than the noise, and the
pattern of the beams does not pull. Each quarter of directions that a surface can face has its own moments, so that the
two sides of a thin wall stay apart.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.estimate.matching import add_residual
from skills.robot import FloatArray, Pose2D

CELL_M = 0.1
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
    moments: Moments,
    low: float,
    points: FloatArray,
    pose: FloatArray,
    weight: float,
    outlier_m: float,
    inlier_m: float,
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
