"""The record that the referee judges by: object histories and paths of robots and people; the error of a trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from plant.referee.object_history import ObjectHistory
from skills.robot import FloatArray, Pose2D

PATH_STEP_M = 0.02
Point = tuple[float, float]
ON_TRAY_GAP_S = 0.5


@dataclass(frozen=True)
class TimedPath:
    """Path of a robot or a person: points (m, world) with the times (s) at which they were reached, (N, 4)."""

    points: FloatArray

    def position_at(self, time_s: float) -> FloatArray:
        """Position (3,) at a time."""
        return self.points[self._index(time_s), :3]

    def positions_between(self, from_s: float, until_s: float) -> FloatArray:
        """Positions (N, 3) from just before one time until another."""
        first = max(0, int(np.searchsorted(self.points[:, 3], from_s)) - 1)
        return self.points[first : self._index(until_s) + 1, :3]

    def _index(self, time_s: float) -> int:
        return max(0, int(np.searchsorted(self.points[:, 3], time_s, side="right")) - 1)


@dataclass(frozen=True)
class Truth:
    """Record up to `now_s`: histories of the objects, and the paths of robots and people by name.

    `given` has the intervals (s) in which an object rested on a person's tray, by object and person. `doors` has the
    times (s) and states of each sliding door by its position (x, y): 0 open, 1 closed, between while it moves. Any
    other door is open.
    """

    now_s: float
    histories: tuple[ObjectHistory, ...]
    robots: Mapping[str, TimedPath]
    persons: Mapping[str, TimedPath]
    given: Mapping[tuple[str, str], Sequence[tuple[float, float]]]
    doors: Mapping[Point, Sequence[tuple[float, float]]] = field(default_factory=dict)


def extend_path(path: list[FloatArray], p_W: FloatArray, time_s: float) -> None:
    """Adds a point with its time to a path when it is `PATH_STEP_M` from the last point."""
    if not path or float(np.linalg.norm(p_W[:2] - path[-1][:2])) >= PATH_STEP_M:
        path.append(np.append(p_W, time_s))


def extend_stays(stays: list[tuple[float, float]], time_s: float) -> None:
    """Extends the last interval on a tray to time_s, or begins another when the last ended some time ago."""
    goes_on = bool(stays) and time_s - stays[-1][1] <= ON_TRAY_GAP_S
    first_s = stays.pop()[0] if goes_on else time_s
    stays.append((first_s, time_s))


def trajectory_error_m(estimated: Sequence[Pose2D], true: Sequence[Pose2D]) -> float:
    """Absolute trajectory error (m): root mean square distance after alignment (Umeyama, 1991, without scale)."""
    moved = align(_positions(estimated), estimated, true)
    return float(np.sqrt(np.mean(np.sum((moved - _positions(true)) ** 2, axis=1))))


def align(points: FloatArray, estimated: Sequence[Pose2D], true: Sequence[Pose2D]) -> FloatArray:
    """Transforms points (N, 2) of the estimate's frame by the best alignment of two trajectories."""
    ours, theirs = _positions(estimated), _positions(true)
    middle_ours, middle_theirs = ours.mean(axis=0), theirs.mean(axis=0)
    a, b = ours - middle_ours, theirs - middle_theirs
    yaw = math.atan2(float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])), float(np.sum(a * b)))
    c, s = math.cos(yaw), math.sin(yaw)
    return np.asarray((points - middle_ours) @ np.array([[c, s], [-s, c]]) + middle_theirs)


def _positions(poses: Sequence[Pose2D]) -> FloatArray:
    return np.array([(pose.x_m, pose.y_m) for pose in poses], dtype=np.float64).reshape(-1, 2)
