"""Localisers: LiDAR scans matched to the surveyed grid, or odometry alone where there is no map."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from skills.api import LocalisationEstimate
from skills.estimate.matching import Match, MatchOptions, grid_surfaces, match, score_poses
from skills.estimate.scan_points import has_moved, outside_discs, placed_points, scan_points
from skills.geometry import compose, inverse, relative_pose
from skills.grid_map import GridMap
from skills.quantities import Count, Duration, Height, Length, Share, Turn
from skills.robot import FloatArray, Odometry, Pose2D, Robot, Scan

_EXACT_S = 1e-6
_HEIGHTS_M = (0.7, 1.3)
"""The band of a grid that does not name its own."""


@dataclass(frozen=True)
class LocaliserOptions:
    """Scan matching on the surveyed grid, within `height_band_m` above the floor (None: the grid's own band).

    `initial_sigma`: standard deviations of the start pose in x, y (m) and yaw (rad); `unsure_sigma` and
    `unsure_radius_m` replace it when the robot may have been moved. `drift_per_m`, `yaw_drift_rad_per_m` and
    `yaw_drift_per_rad`: expected odometry error, as a fraction of the distance, per metre and per turn. `lost_share`,
    `lost_scans` and `found_share`: the robot is lost when the map explains a smaller fraction of the points for so many
    scans in a row, and found at `found_share`. `alike_share`: poses whose fractions differ by less compete. `rest_m`,
    `rest_rad` and `rest_s`: a localised robot that has moved less since the last match uses no scan before this time.
    """

    height_band_m: tuple[Height, Height] | None = None
    max_range_m: Length = 15.0
    azimuths: Count = 200
    max_points: Count = 500
    min_points: Count = 40
    initial_sigma: tuple[Length, Length, Turn] = (0.15, 0.15, 0.1)
    drift_per_m: Share = 0.03
    yaw_drift_rad_per_m: Share = 0.02
    yaw_drift_per_rad: Share = 0.03
    unsure_sigma: tuple[Length, Length, Turn] = (0.5, 0.5, 0.3)
    unsure_radius_m: Length = 4.0
    lost_share: Share = 0.4
    found_share: Share = 0.6
    alike_share: Share = 0.02
    lost_scans: Count = 5
    search_radius_m: Length = 1.5
    search_every_scans: Count = 10
    rest_m: Length = 0.005
    rest_rad: Turn = 0.005
    rest_s: Duration = 0.3
    matching: MatchOptions = field(default_factory=MatchOptions)

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> ScanMatchingLocaliser:
        """Creates a localiser that starts at a pose, reliable or only probable, or anywhere (None)."""
        if surely or start is None:
            return ScanMatchingLocaliser(grid, start, self)
        wide = replace(self, initial_sigma=self.unsure_sigma, search_radius_m=self.unsure_radius_m)
        return ScanMatchingLocaliser(grid, start, wide)


class ScanMatchingLocaliser:
    """Localiser by odometry, corrected with every new scan; implements `skills.api.Localiser`.

    `initial` is X_WB at the first update; when it is None, the localiser waits until `accept` is called. The estimate
    is `localised` once a scan has agreed with the map, and no longer when several in a row do not; the localiser then
    searches around its belief.
    """

    def __init__(self, grid: GridMap, initial: Pose2D | None, options: LocaliserOptions | None = None) -> None:
        self.grid, self._surfaces = grid, grid_surfaces(grid)
        self._options = options or LocaliserOptions()
        heights_m = self._options.height_band_m or grid.height_band_m or _HEIGHTS_M
        beams, most = self._options.azimuths, self._options.max_points
        within_m = self._options.max_range_m
        self._points = partial(scan_points, azimuths=beams, heights_m=heights_m, max_range_m=within_m, most=most)
        self._initial = initial
        self._placed = initial is not None
        (x, y), (width, height) = grid.origin_m, grid.size_m
        self._X_WO = initial or Pose2D(x + 0.5 * width, y + 0.5 * height, 0.0)
        self._X_OB: Pose2D | None = None
        anywhere_sigma = (width / math.sqrt(12.0), height / math.sqrt(12.0), math.pi / math.sqrt(3.0))
        self._covariance = np.diag(np.square(self._options.initial_sigma if initial else anywhere_sigma))
        self._inlier_share = 0.0
        self._stamp_s = -math.inf
        self._scan: Scan | None = None
        self._poor_scans = 0
        self._localised = False
        self._estimate: LocalisationEstimate | None = None
        self._left_out_W: FloatArray = np.empty((0, 3))

    def estimate(self) -> LocalisationEstimate:
        """The latest estimate, with the stamp of the last scan used (minus infinity before the first)."""
        if self._estimate is None:
            X_WO, covariance = self._X_WO.transform(), self._spread().copy()
            self._estimate = LocalisationEstimate(self._stamp_s, X_WO, covariance, self._localised, self._health())
        return self._estimate

    def update(self, robot: Robot) -> None:
        """Updates with the newest scan, when it is new."""
        if self._initial is not None:
            self._X_WO = compose(self._initial, inverse(robot.odometry().pose))
            self._initial = self._estimate = None
        if self._rests(robot.odometry()):
            return
        scan = robot.scan()
        if scan is None or scan.stamp_s <= self._stamp_s or self._frozen(scan):
            return
        self._stamp_s, self._estimate = scan.stamp_s, None
        self._predict(scan.pose)
        points_F = self._points(scan)
        if len(points_F) < self._options.min_points:
            self._note_poor(0.0)
            return
        rest_F = self._outside_robots(points_F)
        if len(rest_F) >= self._options.min_points:
            self._take_in(rest_F)

    def exclude_robots(self, discs_W: FloatArray) -> None:
        """Ignores, in later scans, points within these discs, rows of x, y and radius (m, world).

        The estimated pose places the discs. A scan with too few remaining points neither confirms nor refutes that
        pose.
        """
        self._left_out_W = discs_W

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> LocalisationEstimate | None:
        """Searches for the pose where a scan fits the map, within radius_m of a belief or anywhere (None).

        Changes nothing. Takes a few milliseconds for a small radius and some hundred for a whole flat.
        """
        here = compose(Pose2D.from_transform(belief.X_WO), scan.pose)
        found = self._best_match(self._points(scan), here, radius_m)
        if found is None:
            return None
        X_WO = compose(found.pose, inverse(scan.pose))
        return LocalisationEstimate(scan.stamp_s, X_WO.transform(), found.covariance, True)

    def accept(self, estimate: LocalisationEstimate) -> None:
        """Replaces the belief by an estimate; the next scans confirm or refute it."""
        self._X_WO = Pose2D.from_transform(estimate.X_WO)
        self._covariance = estimate.covariance.copy()
        self._poor_scans, self._localised, self._placed = 0, True, True
        self._estimate = None

    def _take_in(self, points_F: FloatArray) -> None:
        """Corrects the belief by a scan; searches around the belief once scans no longer agree."""
        if not self._placed:
            return
        self._correct(points_F)
        if not self._localised and self._poor_scans > 0 and self._poor_scans % self._options.search_every_scans == 0:
            self._search(points_F, self._options.search_radius_m)

    def _spread(self) -> FloatArray:
        """Covariance of the estimate."""
        return self._covariance

    def _health(self) -> float:
        """Confidence in the estimate, 0 to 1."""
        return self._inlier_share if self._localised else 0.0

    def _outside_robots(self, points_F: FloatArray) -> FloatArray:
        """The points outside the discs of other robots."""
        if not (self._placed and len(self._left_out_W)):
            return points_F
        assert self._X_OB is not None
        points_W = placed_points(points_F, compose(self._X_WO, self._X_OB))
        return np.ascontiguousarray(points_F[outside_discs(points_W, self._left_out_W)])

    def _predict(self, X_OB: Pose2D) -> None:
        """Moves the belief along with odometry and increases its covariance."""
        before, self._X_OB = self._X_OB or X_OB, X_OB
        step = relative_pose(before, X_OB)
        distance, turn = math.hypot(step.x_m, step.y_m), abs(step.yaw_rad)
        old, new = compose(self._X_WO, before), compose(self._X_WO, X_OB)
        options = self._options
        along = 5e-4 + options.drift_per_m * distance
        yaw = 5e-4 + options.yaw_drift_rad_per_m * distance + options.yaw_drift_per_rad * turn
        self._covariance = moved_covariance(self._covariance, old, new, along, yaw)

    def _correct(self, points_F: FloatArray) -> None:
        """Matches a scan, starting from the belief; counts a poor match instead of using it."""
        assert self._X_OB is not None
        prior = compose(self._X_WO, self._X_OB)
        found = match(self._surfaces, points_F, prior, self._covariance, self._options.matching)
        if found.inlier_share < self._options.lost_share:
            self._note_poor(found.inlier_share)
            return
        self._inlier_share = found.inlier_share
        if self._localised or found.inlier_share >= self._options.found_share:
            self._poor_scans = 0
            self._localised = True
        else:
            self._poor_scans += 1
        self._believe(found)

    def _note_poor(self, inlier_share: float) -> None:
        """Counts a scan when the map explains too small a fraction of it."""
        self._inlier_share = inlier_share
        self._poor_scans += 1
        self._localised = self._localised and self._poor_scans < self._options.lost_scans

    def _rests(self, odometry: Odometry) -> bool:
        """Returns whether a localised robot has hardly moved since the last match, and this is not long ago."""
        due_s = self._stamp_s + self._options.rest_s - _EXACT_S
        if self._X_OB is None or not self._localised or self._poor_scans or odometry.stamp_s >= due_s:
            return False
        step = relative_pose(self._X_OB, odometry.pose)
        return math.hypot(step.x_m, step.y_m) < self._options.rest_m and abs(step.yaw_rad) < self._options.rest_rad

    def _frozen(self, scan: Scan) -> bool:
        """Returns whether a scan repeats an earlier one, noise included, although the robot has moved since."""
        if self._scan is None or not scan.repeats(self._scan):
            self._scan = scan
            return False
        return has_moved(self._scan, scan)

    def _believe(self, found: Match) -> None:
        assert self._X_OB is not None
        self._X_WO = compose(found.pose, inverse(self._X_OB))
        self._covariance = found.covariance

    def _search(self, points_F: FloatArray, radius_m: float) -> None:
        """Searches around the belief, and adopts a pose that fits."""
        assert self._X_OB is not None
        found = self._best_match(points_F, compose(self._X_WO, self._X_OB), radius_m)
        if found is not None:
            self._believe(found)
            self._poor_scans, self._localised = 0, True

    def _best_match(self, points_F: FloatArray, centre: Pose2D, radius_m: float | None) -> Match | None:
        """The match that explains the largest fraction of the points; None when that is too small.

        Of several that explain about as much, returns the one nearest to the centre.
        """
        options, matches = self._options, self._matches(points_F, centre, radius_m)
        most = max((found.inlier_share for found in matches), default=0.0)
        if most < options.found_share:
            return None
        alike = (found for found in matches if found.inlier_share >= most - options.alike_share)
        return min(alike, key=lambda m: math.hypot(m.pose.x_m - centre.x_m, m.pose.y_m - centre.y_m))

    def _matches(self, points_F: FloatArray, centre: Pose2D, radius_m: float | None) -> list[Match]:
        """Scores many poses and refines the best few."""
        options = self._options
        if len(points_F) < options.min_points:
            return []
        poses = candidate_poses(self.grid, centre, radius_m)
        few = np.ascontiguousarray(points_F[:: max(1, len(points_F) // 120)])
        best = poses[np.argsort(-score_poses(self.grid, few, poses), kind="stable")[:20]]
        spread = np.diag([0.2**2, 0.2**2, 0.15**2])
        return [match(self._surfaces, points_F, Pose2D(*pose), spread, options.matching) for pose in best.tolist()]


def moved_covariance(
    covariance: FloatArray, before: Pose2D, after: Pose2D, sigma_m: float, sigma_rad: float
) -> FloatArray:
    """Covariance over x, y (m), yaw (rad) after a motion that odometry measures with these standard deviations."""
    jacobian = np.array([[1.0, 0.0, before.y_m - after.y_m], [0.0, 1.0, after.x_m - before.x_m], [0.0, 0.0, 1.0]])
    return np.asarray(jacobian @ covariance @ jacobian.T + np.diag([sigma_m**2, sigma_m**2, sigma_rad**2]))


def candidate_poses(grid: GridMap, centre: Pose2D, radius_m: float | None) -> FloatArray:
    """Poses (K, 3) on free ground, 0.2 m and 10 degrees apart, within radius_m of a pose (None: on the whole grid).

    With a radius, headings stay within 60 degrees of the centre's heading.
    """
    low, size = np.array(grid.origin_m), np.array(grid.size_m)
    high = low + size
    if radius_m is not None:
        middle = np.array([centre.x_m, centre.y_m])
        low, high = np.maximum(low, middle - radius_m), np.minimum(high, middle + radius_m)
    x, y = (np.arange(low[axis], high[axis] + 0.2, 0.2) for axis in (0, 1))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    places = places[grid.distance_m(places) > 0.1]
    turns = np.deg2rad(np.arange(-180.0, 180.0, 10.0) if radius_m is None else np.arange(-60.0, 61.0, 10.0))
    yaws = centre.yaw_rad + turns
    return np.column_stack([np.repeat(places, len(yaws), axis=0), np.tile(yaws, len(places))])


_START_VARIANCE = 1e-4


@dataclass(frozen=True)
class DeadReckoning:
    """Odometry alone, without a map: goals are relative to the start, and the error grows with the distance.

    `drift_per_m` and `yaw_drift_rad_per_m`: expected error of the odometry per metre.
    """

    drift_per_m: Share = 0.01
    yaw_drift_rad_per_m: Share = 0.005

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> OdometryLocaliser:
        """Creates a localiser that ignores the grid; an unknown start becomes the origin."""
        return OdometryLocaliser(start or Pose2D(0.0, 0.0, 0.0), self)


class OdometryLocaliser:
    """Localiser by odometry alone; implements `skills.api.Localiser`. `start` is X_WB at the first update."""

    def __init__(self, start: Pose2D, options: DeadReckoning | None = None) -> None:
        self._start, self._options = start, options or DeadReckoning()
        self._X_WO = start
        self._last: Pose2D | None = None
        self._driven_m = 0.0
        self._stamp_s = -math.inf

    def estimate(self) -> LocalisationEstimate:
        """The latest estimate; its covariance grows with the distance from the start."""
        along = self._options.drift_per_m * self._driven_m
        yaw = self._options.yaw_drift_rad_per_m * self._driven_m
        across = 0.5 * yaw * self._driven_m
        variance = np.array([along**2 + across**2, along**2 + across**2, yaw**2]) + _START_VARIANCE
        return LocalisationEstimate(self._stamp_s, self._X_WO.transform(), np.diag(variance), self._last is not None)

    def update(self, robot: Robot) -> None:
        """Updates with the newest odometry."""
        odometry = robot.odometry()
        if self._last is None:
            self._X_WO = compose(self._start, inverse(odometry.pose))
            self._last = odometry.pose
        step = relative_pose(self._last, odometry.pose)
        self._driven_m += math.hypot(step.x_m, step.y_m)
        self._last, self._stamp_s = odometry.pose, odometry.stamp_s
