"""Planned paths: closely spaced poses, and the distance along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skills.robot import FloatArray, Pose2D

TURN_M_PER_RAD = 0.4
"""Metres of progress along a path for a turn of one radian."""


@dataclass(frozen=True)
class Path:
    """Poses (N, 3) x, y (m), yaw (rad, continuous, not wrapped) in the world frame, at most some centimetres apart.

    `clearance_m` (N,) is the footprint's clearance at each pose when the path was planned.
    """

    poses: FloatArray
    clearance_m: FloatArray

    def __post_init__(self) -> None:
        if self.poses.ndim != 2 or self.poses.shape[1] != 3 or len(self.poses) < 1:
            raise ValueError("Path: poses must be (N, 3) with at least one row")

    @property
    def start(self) -> Pose2D:
        """The first pose."""
        return Pose2D(*self.poses[0].tolist())

    @property
    def goal(self) -> Pose2D:
        """The last pose."""
        return Pose2D(*self.poses[-1].tolist())

    def progress_m(self) -> FloatArray:
        """Distance (m) up to each pose (N,), turns included by TURN_M_PER_RAD."""
        return progress_m(self.poses)


def progress_m(poses: FloatArray) -> FloatArray:
    """Distance (m) along poses (N, 3) with continuous yaw up to each of them (N,), turns included by TURN_M_PER_RAD."""
    steps = np.diff(poses, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1]) + TURN_M_PER_RAD * np.abs(steps[:, 2])
    return np.concatenate([[0.0], np.cumsum(lengths)])[: len(poses)]


def path_length(path: Path) -> float:
    """Length (m) of a path without its turns."""
    steps = np.diff(path.poses[:, :2], axis=0)
    return float(np.sum(np.hypot(steps[:, 0], steps[:, 1])))
