"""Error of a trajectory against the truth, after the best alignment of both."""

import math
from collections.abc import Sequence

import numpy as np

from skills.robot import FloatArray, Pose2D


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
