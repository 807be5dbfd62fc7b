"""Adaptive Monte Carlo localisation; scan matching refines the estimate."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.math import RigidTransform

from skills.api import LocalisationEstimate
from skills.estimate.localiser import LocaliserOptions, ScanMatchingLocaliser
from skills.estimate.matching import Match, match
from skills.estimate.particle_filter import MODE_RADIUS_M, MODE_TURN_RAD, FilterOptions, Mode, ParticleFilter
from skills.geometry import compose, inverse, relative_pose, wrap
from skills.grid_map import GridMap
from skills.quantities import Count, Length, Share, Turn
from skills.robot import FloatArray, Pose2D, Scan

_SPREAD = np.diag([0.05**2, 0.05**2, 0.03**2])
_BASIN = np.diag([0.2**2, 0.2**2, 0.15**2])
_MOST_AT_REST = 3


@dataclass(frozen=True)
class MonteCarloOptions:
    """Monte Carlo localisation: a particle filter finds the region of the pose, scan matching the pose within it.

    `update_m` and `update_rad`: motion after which particles are weighted. `patience_scans`: at rest, while the pose is
    unknown, they are weighted every so many scans, but a few times only, since all these scans have the same error.
    `sure_mass` and `sure_updates`: the pose is known once one mode has this weight for so many updates in a row.
    `unsure_mass`, `better_share` and `better_updates`: when that mode has less weight, the belief moves to a mode where
    the scan fits better by this fraction; while scan matching explains most of the scan, only after so many such
    updates. `surprise`, `injected`, `hypotheses` and `draws`: where scans are this unlikely, or the pose is unknown, so
    many particles join about each of the best hypotheses among `draws` random poses, refined by scan matching.
    `alike_share`: a search finds no pose when two fit within this difference.
    """

    tracking: LocaliserOptions = field(default_factory=LocaliserOptions)
    particles: FilterOptions = field(default_factory=FilterOptions)
    update_m: Length = 0.1
    update_rad: Turn = 0.1
    patience_scans: Count = 5
    sure_mass: Share = 0.85
    sure_updates: Count = 3
    unsure_mass: Share = 0.4
    better_share: Share = 0.1
    better_updates: Count = 10
    surprise: Share = 0.25
    draws: Count = 10_000
    hypotheses: Count = 12
    injected: Count = 25
    alike_share: Share = 0.05

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> MonteCarloLocaliser:
        """Creates a localiser that starts at a pose, reliable or only probable, or anywhere (None)."""
        if surely or start is None:
            return MonteCarloLocaliser(grid, start, self)
        wide = replace(self.tracking, initial_sigma=self.tracking.unsure_sigma)
        return MonteCarloLocaliser(grid, start, replace(self, tracking=wide))


class MonteCarloLocaliser(ScanMatchingLocaliser):
    """Adaptive Monte Carlo localisation; implements `skills.api.SearchingLocaliser`.

    Scan matching updates the belief as long as the particles near it have enough weight; when they gather elsewhere,
    the belief moves there. With `initial` None the robot may be anywhere.
    """

    def __init__(self, grid: GridMap, initial: Pose2D | None, options: MonteCarloOptions | None = None) -> None:
        self._own = options or MonteCarloOptions()
        super().__init__(grid, initial, self._own.tracking)
        self.particles = ParticleFilter(grid, self._own.particles)
        if initial is None:
            self.particles.scatter()
        else:
            self.particles.place(initial, self._covariance)
        self._lost_covariance = self.particles.covariance
        self._weighed_at: Pose2D | None = None
        self._scans = self._at_rest = self._contrary_updates = 0
        self._agreeing = 0 if initial is None else self._own.sure_updates
        self._mass = 0.0 if initial is None else 1.0
        self._expected = initial is not None

    def particles_W(self, most: int) -> FloatArray:
        """Sample poses of the particles; see `skills.api.ParticleView`."""
        weights = np.cumsum(self.particles.weights)
        ends = (np.arange(most) + 0.5) / most * weights[-1]
        return np.asarray(self.particles.poses[np.unique(np.searchsorted(weights, ends))])

    def accept(self, estimate: LocalisationEstimate) -> None:
        """Replaces the belief by an estimate; all particles move there."""
        super().accept(estimate)
        if self._X_OB is not None:
            self.particles.place(compose(self._X_WO, self._X_OB), estimate.covariance + _SPREAD)
            self._weighed_at = self._X_OB
        self._mass, self._agreeing = 1.0, self._own.sure_updates

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> LocalisationEstimate | None:
        """Searches for the pose where a scan fits the map; None also when two poses fit equally well.

        Before the first fix, the expected pose wins among poses that fit equally well.
        """
        here = compose(Pose2D.from_transform(belief.X_WO), scan.pose)
        found = self._matches(self._points(scan), here, radius_m)
        best = max(found, key=lambda each: each.inlier_share, default=None)
        if best is not None and self._expected and _same_place(here, best.pose):
            found = [best]
        if best is None or best.inlier_share < self._options.found_share:
            return None
        competing = (each for each in found if each.inlier_share > best.inlier_share - self._own.alike_share)
        if not all(_same_place(each.pose, best.pose) for each in competing):
            return None
        X_WO: RigidTransform = compose(best.pose, inverse(scan.pose)).transform()
        return LocalisationEstimate(scan.stamp_s, X_WO, best.covariance, True, best.inlier_share)

    def _take_in(self, points_F: FloatArray) -> None:
        """Updates the belief by scan matching, and weights the particles when that is due."""
        if self._localised:
            self._expected = False
        if self._placed:
            knew = self._localised
            self._correct(points_F)
            self._localised = self._localised and knew
        self._scans += 1
        if self._due():
            self._weigh(points_F)

    def _spread(self) -> FloatArray:
        """Covariance of the estimate; that of all particles while the pose is unknown."""
        return self._covariance if self._localised else self._lost_covariance

    def _health(self) -> float:
        return self._mass * self._inlier_share if self._placed else 0.0

    def _due(self) -> bool:
        """Returns whether to weight the particles: the robot moved enough, or waits at rest to be localised."""
        assert self._X_OB is not None
        if self._weighed_at is None:
            return True
        step = relative_pose(self._weighed_at, self._X_OB)
        if math.hypot(step.x_m, step.y_m) > self._own.update_m or abs(step.yaw_rad) > self._own.update_rad:
            self._at_rest = 0
            return True
        waits = not self._localised and self._scans >= self._own.patience_scans
        return waits and self._at_rest < _MOST_AT_REST

    def _weigh(self, points_F: FloatArray) -> None:
        """Updates the filter and the belief by one scan."""
        assert self._X_OB is not None
        particles, self._scans = self.particles, 0
        self._at_rest += 1
        particles.move(relative_pose(self._weighed_at or self._X_OB, self._X_OB))
        self._weighed_at = self._X_OB
        count = min(self._own.particles.beams, len(points_F))
        beams = points_F[np.linspace(0, len(points_F) - 1, count).astype(np.int64)]
        particles.weigh(beams)
        self._judge(points_F)
        particles.resample(self._injected(points_F, beams))
        self._lost_covariance = particles.covariance

    def _judge(self, points_F: FloatArray) -> None:
        """Moves the belief to where the particles are, and decides whether the pose is known."""
        assert self._X_OB is not None
        options = self._own
        self._mass = self.particles.mass_near(compose(self._X_WO, self._X_OB)) if self._placed else 0.0
        if self._mass < options.unsure_mass:
            self._go_to(self.particles.mode(), points_F)
        sure = self._mass >= options.sure_mass and self._inlier_share >= self._options.found_share
        self._agreeing = self._agreeing + 1 if sure or (self._localised and self._mass >= options.unsure_mass) else 0
        if sure and self._agreeing >= options.sure_updates:
            self._localised, self._poor_scans = True, 0

    def _go_to(self, mode: Mode, points_F: FloatArray) -> None:
        """Moves the belief to a mode where the scan fits; leaves a good fit only after many better updates."""
        found = match(self._surfaces, points_F, mode.mean, mode.covariance + _SPREAD, self._options.matching)
        fits = mode.mass > self._mass and found.inlier_share >= self._options.lost_share
        better = fits and found.inlier_share > self._inlier_share + self._own.better_share
        self._contrary_updates = self._contrary_updates + 1 if better else 0
        doubted = self._inlier_share < self._options.found_share or self._contrary_updates >= self._own.better_updates
        if fits and (not self._localised or (better and doubted)):
            self._believe(found)
            self._placed, self._localised, self._contrary_updates = True, False, 0
            self._expected = False
            self._mass, self._inlier_share = mode.mass, found.inlier_share

    def _injected(self, points_F: FloatArray, beams: FloatArray) -> FloatArray | None:
        """Particles near the belief and, when scans are unlikely, near hypotheses anywhere; None without any."""
        assert self._X_OB is not None
        options, particles = self._own, self.particles
        hypotheses = [compose(self._X_WO, self._X_OB)] if self._placed else []
        if particles.surprise > options.surprise or not self._localised:
            hypotheses += [each.pose for each in self._hypotheses(points_F, beams)]
        drawn = [particles.sample_around(pose, _SPREAD, options.injected) for pose in hypotheses]
        return np.concatenate(drawn) if drawn else None

    def _hypotheses(self, points_F: FloatArray, beams: FloatArray) -> list[Match]:
        """The best of many random poses, refined by scan matching."""
        best = self.particles.likeliest_poses(self._own.draws, self._own.hypotheses, beams)
        surfaces, options = self._surfaces, self._options.matching
        found = [match(surfaces, points_F, Pose2D(*pose), _BASIN, options) for pose in best.tolist()]
        return [each for each in found if each.inlier_share >= self._options.lost_share]


def _same_place(a: Pose2D, b: Pose2D) -> bool:
    near = math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) < MODE_RADIUS_M
    return near and abs(wrap(a.yaw_rad - b.yaw_rad)) < MODE_TURN_RAD
