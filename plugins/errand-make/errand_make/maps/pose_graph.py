"""Keyframes (thinned LiDAR revolutions), and the pose graph of measurements between them, solved by GTSAM."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from skills.compiled import compiled
from skills.estimate.scan_points import SelfFilter, scan_points
from skills.geometry import relative_pose
from skills.robot import FloatArray, Pose2D, Robot, Scan, unit_rays

_HUBER_SIGMAS = 1.5
"""Residual, in standard deviations, above which a closure loses weight."""
BAND_M = (0.5, 1.6)
"""Band of heights (m) of the points that scans are matched by."""
_NEIGHBOURS: Final = 32


@dataclass(frozen=True)
class Keyframe:
    """A stored scan and its pose by odometry.

    `ranges_m` is (rings, azimuths) float32 with NaN for no return; `rotation` (3, 3) and `translation` (3,) are the
    LiDAR's pose in the levelled body frame F; `points_F` (N, 3) are the points that scans are matched by: x, y, and
    the direction (rad) in which the surface faces.
    """

    stamp_s: float
    X_OF: Pose2D
    ranges_m: NDArray[np.float32]
    elevations_rad: FloatArray
    azimuths_rad: FloatArray
    rotation: FloatArray
    translation: FloatArray
    points_F: FloatArray

    @staticmethod
    def of(scan: Scan, points_F: FloatArray, own: SelfFilter, robot: Robot, *, stride: int = 2) -> Keyframe:
        """Creates a keyframe of every `stride`-th column of a scan, without returns from the robot itself."""
        rotation, translation = scan.sensor_pose
        ranges, azimuths = scan.ranges_m[:, ::stride].copy(), scan.azimuths_rad[::stride]
        rays = unit_rays(scan.elevations_rad, azimuths) * np.nan_to_num(ranges, nan=0.0)[..., None]
        hits_F = rays.reshape(-1, 3) @ rotation.T + translation
        near = np.flatnonzero(np.hypot(hits_F[:, 0], hits_F[:, 1]) < 1.5)
        ranges.reshape(-1)[near[~own.foreign(hits_F[near], own.arm_F(robot, scan))]] = np.nan
        return Keyframe(
            stamp_s=scan.stamp_s,
            X_OF=scan.pose,
            ranges_m=ranges,
            elevations_rad=scan.elevations_rad,
            azimuths_rad=azimuths,
            rotation=rotation,
            translation=translation,
            points_F=points_F,
        )


def matching_points(scan: Scan, *, azimuths: int, most: int, max_range_m: float) -> FloatArray:
    """At most `most` points of a scan in the band that scans are matched by, as in `Keyframe.points_F`."""
    points = scan_points(scan, azimuths=azimuths, heights_m=BAND_M, max_range_m=max_range_m)
    chosen = np.arange(len(points))
    if len(points) > most:
        chosen = np.linspace(0, len(points) - 1, most).astype(np.int64)
    facing = _facing(points, chosen)
    known = np.isfinite(facing)
    return np.column_stack([points[chosen[known], :2], facing[known]])


@compiled
def _facing(points: FloatArray, chosen: NDArray[np.int64]) -> FloatArray:
    """Direction (rad) in which the surface at each chosen point faces: across the points about it, towards the sensor.

    The points are ordered by azimuth. NaN where the points about one make no line, or are of one column only, so that
    their spread is the noise of the range.
    """
    count = points.shape[0]
    facing = np.empty(chosen.shape[0])
    for m in range(chosen.shape[0]):
        n = chosen[m]
        x, y = points[n, 0], points[n, 1]
        reach = 0.15 + 0.03 * math.hypot(x, y)
        first, last = 1e9, -1e9
        near, u, v, xx, xy, yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(n - _NEIGHBOURS, n + _NEIGHBOURS + 1):
            dx, dy = points[k % count, 0] - x, points[k % count, 1] - y
            if dx * dx + dy * dy < reach * reach:
                near += 1
                first, last = min(first, points[k % count, 4]), max(last, points[k % count, 4])
                u, v, xx, xy, yy = u + dx, v + dy, xx + dx * dx, xy + dx * dy, yy + dy * dy
        u, v = u / near, v / near
        xx, xy, yy = xx / near - u * u, xy / near - u * v, yy / near - v * v
        middle, spread = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
        if near < 4 or last == first or middle + spread < 2.0 * (middle - spread):
            facing[m] = math.nan
            continue
        angle = 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi
        away = math.cos(angle) * x + math.sin(angle) * y > 0.0
        facing[m] = angle + math.pi if away else angle
    return facing


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
