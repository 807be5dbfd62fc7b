"""Search for the pose of a scan in a submap: branch and bound over positions, at many headings.

The bound comes from the distance field: nowhere in a square is a point nearer to a surface than its distance at the
middle less half the diagonal (Hess et al., Real-Time Loop Closure in 2D LIDAR SLAM, 2016, use a pyramid of grids).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.estimate.grid_map import GridMap
from skills.robot import FloatArray, Pose2D

_FINEST_M = 0.1


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
    rival_score: float


def find_pose(
    grid: GridMap,
    points_F: FloatArray,
    guess: Pose2D,
    window: Window,
    *,
    least: float = 0.4,
    reach_m: float = 0.25,
    rival_m: float = 0.5,
) -> SubmapMatch | None:
    """The pose about a guess where points (N, 2 or more columns) fit a grid best, None when not better than `least`.

    A rival lies farther than rival_m away.
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
    rival = _branch_and_bound(distance, frame, points_F, yaws, centre, window.place_m, bar, reach_m, place, rival_m)
    return SubmapMatch(Pose2D(place[0], place[1], float(best[3])), float(best[0]), float(rival[0]))


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
