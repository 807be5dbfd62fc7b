"""Scan matching: robust Gauss-Newton from a prior on any map of surfaces, and scores of many poses on a grid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skills.compiled import Triple, bilinear, compiled
from skills.geometry import wrap
from skills.grid_map import GridMap
from skills.quantities import Count, Factor, Length
from skills.robot import FloatArray, Pose2D

_CONVERGED = 1e-4
"""A step of less than this (m plus rad) ends the iterations."""


@dataclass(frozen=True)
class MatchOptions:
    """Weights of the points.

    `sigma_m`: noise of one point against the map. `effective_points`: number of independent points to which all points
    amount, because neighbours have similar errors. `outlier_m` and `coarse_outlier_m`: points farther off have no
    weight, and the same in the first third of the iterations. `inlier_m`: the map explains a point this near to a
    surface.
    """

    sigma_m: Length = 0.05
    effective_points: Factor = 80.0
    outlier_m: Length = 0.25
    coarse_outlier_m: Length = 0.5
    inlier_m: Length = 0.15
    iterations: Count = 12


@dataclass(frozen=True)
class Match:
    """The matched pose X_WF, its covariance over x, y (m), yaw (rad), and the fraction of points explained."""

    pose: Pose2D
    covariance: FloatArray
    inlier_share: float


Linearise = Callable[[FloatArray, FloatArray, float, float, float], tuple[FloatArray, FloatArray, int]]
"""Hessian (3, 3) and gradient (3,) of the points' weighted squares on a map of surfaces, and the count of inliers.

Parameters are the points (N, 2 or more columns), the pose (3,), the weight of a point, outlier_m and inlier_m.
"""


def grid_surfaces(grid: GridMap) -> Linearise:
    """Returns the `Linearise` function for a surveyed grid, which uses the grid's distance field."""
    return partial(_linearise, grid.distance, grid.frame)


def match(
    surfaces: Linearise, points_F: FloatArray, prior: Pose2D, covariance: FloatArray, options: MatchOptions
) -> Match:
    """The pose X_WF at which the points (N, 2 or more columns) fit the surfaces best, given a prior."""
    mean = np.array([prior.x_m, prior.y_m, prior.yaw_rad])
    weight = min(1.0, options.effective_points / max(1, len(points_F))) / options.sigma_m**2
    information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    pose, hessian, inliers, coarse = mean.copy(), information.copy(), 0, options.iterations // 3
    for iteration in range(options.iterations):
        outlier_m = options.coarse_outlier_m if iteration < coarse else options.outlier_m
        hessian, gradient, inliers = surfaces(points_F, pose, weight, outlier_m, options.inlier_m)
        hessian += information
        step = np.linalg.solve(hessian, gradient + information @ (pose - mean))  # a compiled loop would import SciPy
        pose -= step
        if np.abs(step).sum() < _CONVERGED and iteration > coarse:
            break
    matched = Pose2D(float(pose[0]), float(pose[1]), wrap(float(pose[2])))
    return Match(matched, np.asarray(np.linalg.inv(hessian), dtype=np.float64), inliers / max(1, len(points_F)))


def score_poses(grid: GridMap, points_F: FloatArray, poses: FloatArray, reach_m: float = 0.3) -> FloatArray:
    """Scores of poses (K, 3) x, y, yaw: 1 when all points lie on surfaces, 0 when none lies within reach_m of one."""
    return _score(grid.distance, grid.frame, points_F, poses, reach_m)


@compiled
def add_residual(
    hessian: FloatArray,
    gradient: FloatArray,
    normal: tuple[float, float],
    offset: tuple[float, float],
    residual: float,
    weight: float,
    outlier_m: float,
) -> None:
    """Adds one point's residual along a surface normal, weighted by Tukey's biweight, in place.

    `offset` is the point relative to the pose, in the axes of the map.
    """
    turn = normal[1] * offset[0] - normal[0] * offset[1]
    jacobian = (normal[0], normal[1], turn)
    robust = weight * (1.0 - (residual / outlier_m) ** 2) ** 2
    for k in range(3):
        gradient[k] += robust * residual * jacobian[k]
        for m in range(3):
            hessian[k, m] += robust * jacobian[k] * jacobian[m]


@compiled
def _linearise(
    distance: NDArray[np.float32],
    frame: Triple,
    points: FloatArray,
    pose: FloatArray,
    weight: float,
    outlier_m: float,
    inlier_m: float,
) -> tuple[FloatArray, FloatArray, int]:
    """Compiled loop of `grid_surfaces`; see `Linearise`."""
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    rows, columns = distance.shape
    c, s, inliers = math.cos(pose[2]), math.sin(pose[2]), 0
    for n in range(points.shape[0]):
        dx, dy = c * points[n, 0] - s * points[n, 1], s * points[n, 0] + c * points[n, 1]
        u = (pose[0] + dx - frame[1]) / frame[0] - 0.5
        v = (pose[1] + dy - frame[2]) / frame[0] - 0.5
        if not (0.0 <= u < columns - 1.0 and 0.0 <= v < rows - 1.0):
            continue
        residual = bilinear(distance, u, v)
        if abs(residual) >= outlier_m:
            continue
        inliers += abs(residual) < inlier_m
        i, j = int(v), int(u)
        a, b = u - j, v - i
        low, high = distance[i, j + 1] - distance[i, j], distance[i + 1, j + 1] - distance[i + 1, j]
        left, right = distance[i + 1, j] - distance[i, j], distance[i + 1, j + 1] - distance[i, j + 1]
        normal = ((1.0 - b) * low + b * high) / frame[0], ((1.0 - a) * left + a * right) / frame[0]
        add_residual(hessian, gradient, normal, (dx, dy), residual, weight, outlier_m)
    return hessian, gradient, inliers


@compiled
def _score(
    distance: NDArray[np.float32], frame: Triple, points: FloatArray, poses: FloatArray, reach: float
) -> FloatArray:
    """Compiled loop of `score_poses`; nearest cell, no interpolation."""
    scores = np.zeros(poses.shape[0])
    rows, columns = distance.shape
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for n in range(points.shape[0]):
            x = poses[k, 0] + c * points[n, 0] - s * points[n, 1]
            y = poses[k, 1] + s * points[n, 0] + c * points[n, 1]
            j, i = int((x - frame[1]) / frame[0]), int((y - frame[2]) / frame[0])
            if 0 <= j < columns and 0 <= i < rows:
                scores[k] += max(0.0, 1.0 - (distance[i, j] / reach) ** 2)
    scores /= max(1, points.shape[0])
    return scores


def match_scan() -> None:
    """Localises in a small map, so that the code is compiled (`errand.kernels`)."""
    score_poses(GridMap(np.eye(4, dtype=bool), 0.05, (0.0, 0.0)), np.ones((2, 3)), np.ones((1, 3)))
