"""A particle filter over planar poses on a grid: likelihood field with beam skipping, KLD-adaptive size, injection.

After Thrun, Burgard and Fox, Probabilistic Robotics, chapter 8: augmented Monte Carlo localisation.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.compiled import Triple, compiled
from skills.geometry import wrap
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.quantities import Count, Factor, Length, Margin, Share, Tries, Turn
from skills.robot import FloatArray, Pose2D

MODE_RADIUS_M = 0.5
MODE_TURN_RAD = 0.35
"""Particles nearer than both to a pose belong to the mode there."""
_AGREEMENT_PARTICLES = 200
"""Particles that vote on which beams the map explains."""
_IN_WALL = 5.0
"""Log likelihood that a pose loses where no robot can stand."""
_MOST_ANNEALING = 12
_LEAST_SHARE = 1e-6


@dataclass(frozen=True)
class FilterOptions:
    """Motion, weights and number of the particles.

    `beams` and `effective_beams`: points of a scan, and the number of independent ones to which they amount; fewer if
    needed so that the effective sample size is at least `least_effective`. `hit_sigma_m` and `random_share`: spread of
    a hit, and fraction of random returns. `skip_share`, `skip_m` and `skip_most`: a beam that a smaller fraction of the
    particles explain within `skip_m` is skipped, unless that were more than `skip_most` of the beams. `bin_m`,
    `bin_rad`, `kld_error` and `kld_quantile`: bins, bound on the KL divergence and normal quantile that set the number
    of particles. `slow` and `fast`: rates of the two averages of the likelihood. `drift_per_m`, `yaw_drift_rad_per_m`
    and `yaw_drift_per_rad`: odometry error. `roughening_m` and `roughening_rad`: noise that separates equal particles.
    """

    seed: Tries = 0
    beams: Count = 60
    min_particles: Count = 400
    max_particles: Count = 20_000
    kld_error: Factor = 0.05
    kld_quantile: Factor = 2.33
    bin_m: Length = 0.25
    bin_rad: Turn = 0.175
    effective_beams: Factor = 12.0
    least_effective: Factor = 40.0
    hit_sigma_m: Length = 0.1
    random_share: Share = 0.1
    skip_m: Length = 0.4
    skip_share: Share = 0.3
    skip_most: Share = 0.5
    slow: Share = 0.03
    fast: Share = 0.3
    drift_per_m: Share = 0.06
    yaw_drift_rad_per_m: Share = 0.04
    yaw_drift_per_rad: Share = 0.06
    roughening_m: Margin = 0.015
    roughening_rad: Margin = 0.008


@dataclass(frozen=True)
class Mode:
    """A cluster of particles: its fraction of the total weight, its mean, its covariance over x, y (m), yaw (rad)."""

    mass: float
    mean: Pose2D
    covariance: FloatArray


class ParticleFilter:
    """Weighted poses X_WB. Call `place` or `scatter` first; then `move`, `weigh` and `resample` in turn.

    The constructor raises InputError when the map has no free ground.
    """

    def __init__(self, grid: GridMap, options: FilterOptions) -> None:
        self._grid, self._options = grid, options
        self._rng = np.random.default_rng(options.seed)
        field, self._standable = _likelihood_field(grid, options), _standable(grid)
        self._fields = field, float(field.min()), self._standable
        if not self._standable.any():
            what = "the map has no free ground where a robot could be"
            raise InputError(what, hint="check its picture and thresholds")
        self._slow = self._fast = 0.0
        self.poses: FloatArray = np.empty((0, 3))
        self.weights: FloatArray = np.empty(0)

    @property
    def surprise(self) -> float:
        """Drop of the likelihood of recent scans: 0 for none, towards 1 for a kidnapped robot."""
        return max(0.0, 1.0 - self._fast / self._slow) if self._slow > 0.0 else 0.0

    @property
    def covariance(self) -> FloatArray:
        """Covariance of all particles."""
        return _spread(self.poses, self.weights)[1]

    def place(self, mean: Pose2D, covariance: FloatArray) -> None:
        """Draws all particles around a pose."""
        self._replace(self.sample_around(mean, covariance, self._options.min_particles))

    def scatter(self) -> None:
        """Spreads the maximum number of particles uniformly over the map."""
        self._replace(self.sample_anywhere(self._options.max_particles))

    def sample_around(self, mean: Pose2D, covariance: FloatArray, count: int) -> FloatArray:
        """Poses (count, 3) drawn around a pose."""
        drawn = self._rng.standard_normal((count, 3)) @ np.linalg.cholesky(covariance).T
        return np.asarray(drawn + [mean.x_m, mean.y_m, mean.yaw_rad])

    def sample_anywhere(self, count: int) -> FloatArray:
        """Poses (count, 3) drawn uniformly from the free cells."""
        free = np.empty((0, 2))
        while len(free) < count:
            drawn = self._rng.random((4 * count, 2)) * self._standable.shape
            rows, columns = drawn.astype(np.int64).T
            free = np.concatenate([free, drawn[self._standable[rows, columns]]])
        places = free[:count, ::-1] * self._grid.resolution_m + self._grid.origin_m
        return np.column_stack([places, self._rng.uniform(-math.pi, math.pi, count)])

    def likeliest_poses(self, draws: int, count: int, points_F: FloatArray) -> FloatArray:
        """The most likely `count` poses (count, 3) of `draws` random ones, at most one per position and heading bin."""
        drawn = self.sample_anywhere(draws)
        drawn = drawn[np.argsort(-self.log_likelihoods(drawn, points_F), kind="stable")]
        _, first = np.unique(_bins(drawn, MODE_RADIUS_M, MODE_TURN_RAD), return_index=True)
        return np.asarray(drawn[np.sort(first)[:count]])

    def move(self, step: Pose2D) -> None:
        """Moves each particle by an odometry step in the body frame, with sampled odometry errors."""
        options = self._options
        distance, turn = math.hypot(step.x_m, step.y_m), abs(step.yaw_rad)
        along = options.roughening_m + options.drift_per_m * distance
        yaw = options.roughening_rad + options.yaw_drift_rad_per_m * distance + options.yaw_drift_per_rad * turn
        noise = self._rng.standard_normal(self.poses.shape) * (along, along, yaw)
        dx, dy = step.x_m + noise[:, 0], step.y_m + noise[:, 1]
        c, s = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        self.poses[:, 0] += c * dx - s * dy
        self.poses[:, 1] += s * dx + c * dy
        self.poses[:, 2] = wrap(self.poses[:, 2] + step.yaw_rad + noise[:, 2])

    def weigh(self, points_F: FloatArray) -> None:
        """Weights each particle by the beams (M, 2) of a scan."""
        options = self._options
        everything = self.log_likelihoods(self.poses, points_F)
        fit = float(self.weights @ np.exp(everything))
        self._slow = self._slow + options.slow * (fit - self._slow) if self._slow > 0.0 else fit
        self._fast = self._fast + options.fast * (fit - self._fast) if self._fast > 0.0 else fit
        used = self._explained(points_F)
        logs = everything if used.all() else self.log_likelihoods(self.poses, points_F[used])
        power, steps = options.effective_beams, 0
        weights = self._weighed(logs, power)
        while 1.0 / float(weights @ weights) < options.least_effective and steps < _MOST_ANNEALING:
            power, steps = 0.6 * power, steps + 1
            weights = self._weighed(logs, power)
        self.weights = weights

    def log_likelihoods(self, poses: FloatArray, points_F: FloatArray) -> FloatArray:
        """The mean log likelihood (N,) of the beams at each pose."""
        return _log_likelihoods(self._fields, self._grid.frame, poses, points_F)

    def resample(self, injected: FloatArray | None = None) -> None:
        """Draws as many particles as the KL divergence requires; adds the `injected` ones (K, 3) with equal weights."""
        options = self._options
        drawn = self._draw(min(options.max_particles, 4 * max(len(self.poses), options.min_particles)))
        poses, bins = self.poses[drawn], (options.bin_m, options.bin_m, options.bin_rad)
        poses = poses[: _enough(poses, bins, options.min_particles, options.kld_error, options.kld_quantile)]
        self._replace(poses if injected is None else np.concatenate([poses, injected]), keep=True)

    def mass_near(self, pose: Pose2D) -> float:
        """Fraction of the weight in the mode at a pose."""
        return float(self.weights[self._near(pose)].sum())

    def mode(self) -> Mode:
        """The mode with the largest weight."""
        keys = _bins(self.poses, MODE_RADIUS_M, MODE_TURN_RAD)
        _, index = np.unique(keys, return_inverse=True)
        chosen = index == np.argmax(np.bincount(index, self.weights))
        for _ in range(3):
            mean, covariance = _spread(self.poses[chosen], self.weights[chosen])
            chosen = self._near(mean)
        return Mode(float(self.weights[chosen].sum()), mean, covariance)

    def _weighed(self, logs: FloatArray, power: float) -> FloatArray:
        weights = self.weights * np.exp(power * (logs - logs.max()))
        return np.asarray(weights / weights.sum())

    def _near(self, pose: Pose2D) -> NDArray[np.bool_]:
        off = self.poses - [pose.x_m, pose.y_m, pose.yaw_rad]
        near = np.hypot(off[:, 0], off[:, 1]) < MODE_RADIUS_M
        return np.asarray(near & (np.abs(wrap(off[:, 2])) < MODE_TURN_RAD))

    def _explained(self, points_F: FloatArray) -> NDArray[np.bool_]:
        """Mask (M,) of the beams that count; all of them when too many would be skipped."""
        options = self._options
        stride = max(1, len(self.poses) // _AGREEMENT_PARTICLES)
        poses = np.ascontiguousarray(self.poses[::stride])
        share = _agreement(self._grid.distance, self._grid.frame, poses, points_F, options.skip_m)
        used = share >= options.skip_share
        return used if 1.0 - used.mean() <= options.skip_most else np.ones_like(used)

    def _draw(self, count: int) -> NDArray[np.int64]:
        """Indices drawn by low-variance sampling, in random order."""
        steps = (np.arange(count) + self._rng.random()) / count
        drawn = np.searchsorted(np.cumsum(self.weights), steps).clip(max=len(self.weights) - 1)
        return self._rng.permutation(drawn)

    def _replace(self, poses: FloatArray, *, keep: bool = False) -> None:
        self.poses, self.weights = poses, np.full(len(poses), 1.0 / len(poses))
        if not keep:
            self._slow = self._fast = 0.0  # averages of the likelihood


def _likelihood_field(grid: GridMap, options: FilterOptions) -> NDArray[np.float32]:
    """Log likelihood of a beam that ends in each cell."""
    hits = np.exp(-0.5 * np.square(grid.distance / options.hit_sigma_m))
    field = np.log((1.0 - options.random_share) * hits + max(options.random_share, _LEAST_SHARE))
    return np.ascontiguousarray(field, dtype=np.float32)


def _standable(grid: GridMap) -> NDArray[np.bool_]:
    """Mask of the cells where the robot's centre can be: known, and away from occupied cells."""
    open_cells = grid.distance > 0.1
    return open_cells if grid.unknown is None else open_cells & ~grid.unknown


def _bins(poses: FloatArray, size_m: float, size_rad: float) -> NDArray[np.int64]:
    """Bin number of each pose."""
    cells = np.floor(poses / (size_m, size_m, size_rad)).astype(np.int64)
    cells -= cells.min(axis=0)
    _, rows, turns = cells.max(axis=0) + 1
    return np.asarray((cells[:, 0] * rows + cells[:, 1]) * turns + cells[:, 2])


@compiled
def _enough(poses: FloatArray, bins: Triple, least: int, error: float, quantile: float) -> int:
    """Sufficient number of drawn poses by KLD sampling (Fox, 2003): the more bins are filled, the more poses."""
    filled = set()
    for n in range(poses.shape[0]):
        x, y, yaw = poses[n, 0] / bins[0], poses[n, 1] / bins[1], poses[n, 2] / bins[2]
        filled.add((math.floor(x), math.floor(y), math.floor(yaw)))
        degrees = max(len(filled) - 1.0, 1.0)
        part = 2.0 / (9.0 * degrees)
        if n + 1 >= max(least, degrees / (2.0 * error) * (1.0 - part + math.sqrt(part) * quantile) ** 3):
            return n + 1
    return len(poses)


def _spread(poses: FloatArray, weights: FloatArray) -> tuple[Pose2D, FloatArray]:
    """Mean and covariance of weighted poses, with the circular mean of the headings."""
    share = weights / weights.sum()
    yaw = math.atan2(float(share @ np.sin(poses[:, 2])), float(share @ np.cos(poses[:, 2])))
    x, y = share @ poses[:, :2]
    off = poses - [x, y, yaw]
    off[:, 2] = wrap(off[:, 2])
    covariance = (off * share[:, None]).T @ off + np.diag([1e-6, 1e-6, 1e-6])
    return Pose2D(float(x), float(y), yaw), covariance


@compiled
def _log_likelihoods(
    fields: tuple[NDArray[np.float32], float, NDArray[np.bool_]],
    geometry: Triple,
    poses: FloatArray,
    points: FloatArray,
) -> FloatArray:
    """Compiled loop of `log_likelihoods`. A pose where no robot can stand loses _IN_WALL."""
    field, least, standable = fields  # `least` is that of a beam that ends beyond the field
    rows, columns = field.shape
    sums = np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        x0, y0 = (poses[k, 0] - geometry[1]) / geometry[0], (poses[k, 1] - geometry[2]) / geometry[0]
        c, s = math.cos(poses[k, 2]) / geometry[0], math.sin(poses[k, 2]) / geometry[0]
        total = 0.0
        for n in range(points.shape[0]):
            u, v = x0 + c * points[n, 0] - s * points[n, 1], y0 + s * points[n, 0] + c * points[n, 1]
            if 0.0 <= u < columns and 0.0 <= v < rows:
                total += field[int(v), int(u)]
            else:
                total += least
        sums[k] = total / max(1, points.shape[0])
        if not (0.0 <= x0 < columns and 0.0 <= y0 < rows and standable[int(y0), int(x0)]):
            sums[k] -= _IN_WALL
    return sums


@compiled
def _agreement(
    distance: NDArray[np.float32], geometry: Triple, poses: FloatArray, points: FloatArray, near_m: float
) -> FloatArray:
    """Fraction (M,) of the poses at which each beam ends near a surface."""
    rows, columns = distance.shape
    counts = np.zeros(points.shape[0])
    for k in range(poses.shape[0]):
        x0, y0 = (poses[k, 0] - geometry[1]) / geometry[0], (poses[k, 1] - geometry[2]) / geometry[0]
        c, s = math.cos(poses[k, 2]) / geometry[0], math.sin(poses[k, 2]) / geometry[0]
        for n in range(points.shape[0]):
            u, v = x0 + c * points[n, 0] - s * points[n, 1], y0 + s * points[n, 0] + c * points[n, 1]
            if 0.0 <= u < columns and 0.0 <= v < rows and abs(distance[int(v), int(u)]) < near_m:
                counts[n] += 1.0
    counts /= max(1, poses.shape[0])
    return counts
