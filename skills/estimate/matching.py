"""Matching of planar points to a distance field: robust Gauss-Newton from a guess, and scoring of many guesses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import bilinear, compiled
from skills.estimate.grid_map import GridMap
from skills.geometry import wrap
from skills.quantities import Count, Factor, Length
from skills.robot import FloatArray, Pose2D

INLIER_M = 0.15
"""A point nearer than this to the surveyed surface (m) is explained by the map."""


@dataclass(frozen=True)
class MatchOptions:
    """How points are weighed.

    `sigma_m` is the noise of one point against the map; neighbouring points err alike, so all of them together count
    as `effective_points` independent ones. Points further off than `outlier_m` have no weight.
    """

    sigma_m: Length = 0.05
    effective_points: Factor = 80.0
    outlier_m: Length = 0.25
    coarse_outlier_m: Length = 0.5
    iterations: Count = 12


@dataclass(frozen=True)
class Match:
    """The matched pose X_WF, its covariance over x, y (m), yaw (rad), and the share of points that the map explains."""

    pose: Pose2D
    covariance: FloatArray
    inlier_share: float


def match(grid: GridMap, points_F: FloatArray, prior: Pose2D, covariance: FloatArray, options: MatchOptions) -> Match:
    """The pose X_WF at which points_F (N, 2 or more columns) best lie on the grid's surfaces, given a prior."""
    mean = np.array([prior.x_m, prior.y_m, prior.yaw_rad])
    weight = min(1.0, options.effective_points / max(1, len(points_F))) / options.sigma_m**2
    field = (grid.resolution_m, grid.origin_m[0], grid.origin_m[1])
    caps = (options.coarse_outlier_m, options.outlier_m)
    information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    pose, hessian, share = _gauss_newton(
        grid.distance, field, points_F, mean, information, weight, caps, options.iterations
    )
    matched = Pose2D(float(pose[0]), float(pose[1]), wrap(float(pose[2])))
    return Match(matched, np.asarray(np.linalg.inv(hessian), dtype=np.float64), share)


def score_poses(grid: GridMap, points_F: FloatArray, poses: FloatArray, reach_m: float = 0.3) -> FloatArray:
    """How well points_F fit at each of (K, 3) poses x, y, yaw: 1 is all on surfaces, 0 none within reach_m."""
    return _score(grid.distance, (grid.resolution_m, grid.origin_m[0], grid.origin_m[1]), points_F, poses, reach_m)


@compiled
def _gauss_newton(
    distance: NDArray[np.float32],
    field: tuple[float, float, float],
    points: FloatArray,
    mean: FloatArray,
    information: FloatArray,
    weight: float,
    caps: tuple[float, float],
    iterations: int,
) -> tuple[FloatArray, FloatArray, float]:
    """Pose, Hessian there, share of inliers. The outlier cap narrows after a third of the iterations."""
    pose = mean.copy()
    hessian, inliers = information.copy(), 0
    for iteration in range(iterations):
        cap = caps[0] if iteration < iterations // 3 else caps[1]
        hessian, gradient, inliers = _linearise(distance, field, points, pose, weight, cap)
        hessian += information
        gradient += information @ (pose - mean)
        step = np.linalg.solve(hessian, gradient)
        pose -= step
        if iteration > iterations // 3 and abs(step[0]) + abs(step[1]) + abs(step[2]) < 1e-4:
            break
    return pose, hessian, inliers / max(1, points.shape[0])


@compiled
def _linearise(
    distance: NDArray[np.float32],
    field: tuple[float, float, float],
    points: FloatArray,
    pose: FloatArray,
    weight: float,
    cap: float,
) -> tuple[FloatArray, FloatArray, int]:
    """Hessian and gradient of the points' weighted squares at a pose (Tukey's biweight), and the count of inliers."""
    hessian, gradient, jacobian = np.zeros((3, 3)), np.zeros(3), np.empty(3)
    rows, columns = distance.shape
    c, s, inliers = math.cos(pose[2]), math.sin(pose[2]), 0
    for n in range(points.shape[0]):
        dx, dy = c * points[n, 0] - s * points[n, 1], s * points[n, 0] + c * points[n, 1]
        u = (pose[0] + dx - field[1]) / field[0] - 0.5
        v = (pose[1] + dy - field[2]) / field[0] - 0.5
        if not (0.0 <= u < columns - 1.0 and 0.0 <= v < rows - 1.0):
            continue
        residual = bilinear(distance, u, v)
        if abs(residual) >= cap:
            continue
        inliers += abs(residual) < INLIER_M
        i, j = int(v), int(u)
        a, b = u - j, v - i
        low, high = distance[i, j + 1] - distance[i, j], distance[i + 1, j + 1] - distance[i + 1, j]
        left, right = distance[i + 1, j] - distance[i, j], distance[i + 1, j + 1] - distance[i, j + 1]
        jacobian[0] = ((1.0 - b) * low + b * high) / field[0]
        jacobian[1] = ((1.0 - a) * left + a * right) / field[0]
        jacobian[2] = jacobian[1] * dx - jacobian[0] * dy
        robust = weight * (1.0 - (residual / cap) ** 2) ** 2
        for k in range(3):
            gradient[k] += robust * residual * jacobian[k]
            for m in range(3):
                hessian[k, m] += robust * jacobian[k] * jacobian[m]
    return hessian, gradient, inliers


@compiled
def _score(
    distance: NDArray[np.float32],
    field: tuple[float, float, float],
    points: FloatArray,
    poses: FloatArray,
    reach: float,
) -> FloatArray:
    """The loop of `score_poses`; nearest cell, no interpolation."""
    scores = np.zeros(poses.shape[0])
    rows, columns = distance.shape
    for k in range(poses.shape[0]):
        c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for n in range(points.shape[0]):
            x = poses[k, 0] + c * points[n, 0] - s * points[n, 1]
            y = poses[k, 1] + s * points[n, 0] + c * points[n, 1]
            j, i = int((x - field[1]) / field[0]), int((y - field[2]) / field[0])
            if 0 <= j < columns and 0 <= i < rows:
                scores[k] += max(0.0, 1.0 - (distance[i, j] / reach) ** 2)
    scores /= max(1, points.shape[0])
    return scores
