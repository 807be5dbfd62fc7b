"""The pose graph of the keyframes and the measurements between pairs of them, solved by GTSAM."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from skills.geometry import relative_pose
from skills.robot import FloatArray, Pose2D

_HUBER_SIGMAS = 1.5
"""Residual, in standard deviations, above which a closure loses weight."""


class MappingExtraMissingError(ImportError):
    """GTSAM is not installed."""


@dataclass(frozen=True)
class Edge:
    """Measured pose of keyframe `second` in the frame of `first`, with covariance; a `closure` may be removed again."""

    first: int
    second: int
    measured: Pose2D
    covariance: FloatArray
    closure: bool = False

    def sigmas(self, poses: list[Pose2D]) -> float:
        """Distance of the poses from the measurement, in standard deviations (Mahalanobis)."""
        off = relative_pose(self.measured, relative_pose(poses[self.first], poses[self.second]))
        error = np.array([off.x_m, off.y_m, off.yaw_rad])
        return math.sqrt(float(error @ np.linalg.solve(self.covariance, error)))


class PoseGraph:
    """Poses of keyframes in the map's frame and the edges between them; the first pose is fixed."""

    def __init__(self, poses: list[Pose2D] | None = None, edges: list[Edge] | None = None) -> None:
        self.poses: list[Pose2D] = poses or []
        self.edges: list[Edge] = edges or []

    @property
    def closures(self) -> list[Edge]:
        """The loop closures."""
        return [edge for edge in self.edges if edge.closure]

    def optimise(self) -> None:
        """Moves the poses to where all edges fit best: first by least squares, then with Huber's loss for closures."""
        for robust in (False, True) if self.closures else (False,):
            solved = gtsam_module().LevenbergMarquardtOptimizer(self._factors(robust), self._values()).optimize()
            found = (solved.atPose2(index) for index in range(len(self.poses)))
            self.poses = [Pose2D(pose.x(), pose.y(), pose.theta()) for pose in found]

    def drop_outliers(self, most_sigmas: float) -> list[Edge]:
        """Removes and returns closures that the rest contradicts, the worst first; optimises after each."""
        dropped: list[Edge] = []
        while self.closures:
            worst = max(self.closures, key=lambda edge: edge.sigmas(self.poses))
            if worst.sigmas(self.poses) <= most_sigmas:
                break
            self.edges = [edge for edge in self.edges if edge is not worst]
            dropped.append(worst)
            self.optimise()
        return dropped

    def covariance(self, index: int) -> FloatArray:
        """Marginal covariance of a pose over x, y (m) and yaw (rad), in its own axes."""
        gtsam = gtsam_module()
        marginals = gtsam.Marginals(self._factors(False), self._values())
        return np.asarray(marginals.marginalCovariance(index))

    def _values(self) -> Any:
        gtsam = gtsam_module()
        values = gtsam.Values()
        for index, pose in enumerate(self.poses):
            values.insert(index, gtsam.Pose2(pose.x_m, pose.y_m, pose.yaw_rad))
        return values

    def _factors(self, robust: bool) -> Any:
        gtsam = gtsam_module()
        factors, noise = gtsam.NonlinearFactorGraph(), gtsam.noiseModel
        first = self.poses[0]
        anchor = noise.Diagonal.Sigmas(np.full(3, 1e-4))
        factors.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(first.x_m, first.y_m, first.yaw_rad), anchor))
        for edge in self.edges:
            model = noise.Gaussian.Covariance(edge.covariance)
            if robust and edge.closure:
                model = noise.Robust.Create(noise.mEstimator.Huber.Create(_HUBER_SIGMAS), model)
            seen = gtsam.Pose2(edge.measured.x_m, edge.measured.y_m, edge.measured.yaw_rad)
            factors.add(gtsam.BetweenFactorPose2(edge.first, edge.second, seen, model))
        return factors


def gtsam_module() -> Any:
    """The GTSAM module, imported on demand. Raises MappingExtraMissingError when it is not installed."""
    try:
        import gtsam
    except ImportError as error:
        raise MappingExtraMissingError("GTSAM is not installed") from error
    return gtsam
