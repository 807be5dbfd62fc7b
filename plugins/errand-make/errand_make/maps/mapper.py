"""Simultaneous localisation and mapping from LiDAR and odometry: submaps, keyframes, loop closures.

Each scan is matched to the current submap from the pose by odometry. A keyframe is stored every few decimetres and
joins the pose graph by its pose in the submap; it also goes into the next submap, which takes over when the current one
is full (as in Hess et al., 2016). Keyframes are searched for in old submaps as well; a closure counts once another
keyframe agrees with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np

from errand_make.maps.pose_graph import Edge, Keyframe, PoseGraph, matching_points
from errand_make.maps.submap_matching import Distributions, Window, find_pose
from skills.api import LocalisationEstimate
from skills.estimate.localiser import moved_covariance
from skills.estimate.matching import Match, MatchOptions, match
from skills.estimate.scan_points import SelfFilter, has_moved
from skills.geometry import compose, inverse, relative_pose
from skills.grid_map import GridMap
from skills.robot import FloatArray, Pose2D, Robot, Scan

_FIELD_CELL_M = 0.05
_SEARCH_POINTS = 150
"""Points by which a submap is searched; all of them refine the pose."""


@dataclass(frozen=True)
class MapperOptions:
    """Options of the mapper; distances in metres, angles in radians.

    A scan is matched every `period_s`. A keyframe is stored after `keyframe_m` or `keyframe_rad`; a submap is full
    after `submap_m`. Odometry is expected to err by `drift_per_m` of each step (with much more, the beams' pattern
    holds the robot back in bare corridors), by `yaw_drift_rad_per_m` and by `yaw_drift_per_rad` of a turn. Scans of
    which the submap explains less than `least_share` do not count. Loops are searched for every `closure_m`, within
    `closure_window` plus `window_per_m` for each metre since the last closure.
    """

    azimuths: int = 450
    most_points: int = 550
    period_s: float = 0.09
    least_points: int = 40
    max_range_m: float = 24.0
    keyframe_m: float = 0.3
    keyframe_rad: float = 0.25
    submap_m: float = 6.0
    submap_keyframes: int = 60
    drift_per_m: float = 0.02
    yaw_drift_rad_per_m: float = 0.02
    yaw_drift_per_rad: float = 0.02
    least_share: float = 0.35
    closure_m: float = 1.0
    closure_reach_m: float = 8.0
    closure_window: Window = field(default_factory=lambda: Window(0.4, 0.05))
    window_per_m: Window = field(default_factory=lambda: Window(0.02, 0.002))
    recognised_window: Window = field(default_factory=lambda: Window(1.5, 0.5))
    recognised_in: int = 3
    widest: Window = field(default_factory=lambda: Window(4.0, 0.35))
    closure_score: float = 0.55
    closure_share: float = 0.6
    competing_share: float = 0.9
    agree_m: float = 0.10
    agree_rad: float = 0.02
    agree_within_m: float = 8.0
    most_sigmas: float = 5.0
    least_sigma_m: float = 0.01
    least_sigma_rad: float = 0.003
    matching: MatchOptions = field(
        default_factory=partial(MatchOptions, sigma_m=0.03, outlier_m=0.12, coarse_outlier_m=0.3, inlier_m=0.1)
    )


@dataclass
class Submap:
    """Keyframes matched to one another: `anchor` is the keyframe whose frame it has, `members` are the poses in it."""

    anchor: int
    distributions: Distributions | None
    members: dict[int, Pose2D]
    driven_m: float = 0.0


class Mapper:
    """Mapper of one drive; `start` is the robot's first pose in the map's frame.

    `revision` counts corrections of earlier poses; `blind_since_s` is the time since which no scan could be used.
    """

    def __init__(self, start: Pose2D, options: MapperOptions | None = None) -> None:
        self._options = options or MapperOptions()
        self._start = start
        self.graph = PoseGraph()
        self.keyframes: list[Keyframe] = []
        self.submaps: list[Submap] = []
        self.revision = 0
        self.driven_m = 0.0
        self.dropped = 0
        self.blind_since_s: float | None = None
        self._filter: SelfFilter | None = None
        self._scan: Scan | None = None
        self._X_OF = Pose2D(0.0, 0.0, 0.0)
        self._X_AF = Pose2D(0.0, 0.0, 0.0)
        self._covariance = np.diag([1e-6, 1e-6, 1e-6])
        self._since_keyframe = (0.0, 0.0)
        self._tried_at_m = 0.0
        self._closed_at_m = 0.0
        self._pending: list[Edge] = []
        self._matched_s = -math.inf
        self._active: list[Submap] = []
        self._returning = False
        self._joint: Edge | None = None

    @staticmethod
    def from_map(
        graph: PoseGraph, keyframes: list[Keyframe], submaps: list[Submap], options: MapperOptions | None = None
    ) -> Mapper:
        """Creates a mapper that continues an earlier map from its first pose."""
        mapper = Mapper(graph.poses[0], options)
        mapper.graph, mapper.keyframes, mapper.submaps = graph, keyframes, submaps
        mapper._returning = True
        return mapper

    @property
    def pose(self) -> Pose2D:
        """The robot's pose X_WF on the map."""
        if not self._active:
            return self._start
        return compose(self.graph.poses[self._current.anchor], self._X_AF)

    @property
    def since_closure_m(self) -> float:
        """Distance (m) driven since the last loop closure."""
        return self.driven_m - self._closed_at_m

    def estimate(self) -> LocalisationEstimate:
        """The pose as a localisation estimate."""
        X_WO = compose(self.pose, inverse(self._X_OF)).transform()
        stamp_s = -math.inf if self._scan is None else self._scan.stamp_s
        seeing = bool(self._active) and self.blind_since_s is None
        return LocalisationEstimate(stamp_s, X_WO, self._covariance.copy(), seeing)

    def update(self, robot: Robot) -> None:
        """Takes in the newest scan, if it is new."""
        scan = robot.scan()
        if scan is None or (self._scan is not None and scan.stamp_s <= self._scan.stamp_s):
            return
        self._filter = self._filter or SelfFilter.of(robot.capabilities())
        options, before, self._scan = self._options, self._scan, scan
        frozen = before is not None and scan.repeats(before) and has_moved(before, scan)
        step = Pose2D(0.0, 0.0, 0.0)
        X_OF, self._X_OF = self._X_OF, scan.pose
        if before is not None:
            step = relative_pose(X_OF, self._X_OF)
        self._predict(step)
        if self._active and scan.stamp_s - self._matched_s < options.period_s:
            return
        self._matched_s = scan.stamp_s
        points_F = matching_points(
            scan, azimuths=options.azimuths, most=options.most_points, max_range_m=options.max_range_m
        )
        if frozen or len(points_F) < options.least_points or not self._matched(points_F):
            self.blind_since_s = scan.stamp_s if self.blind_since_s is None else self.blind_since_s
            return
        self.blind_since_s = None
        driven_m, turn_rad = self._since_keyframe
        if not self._active or driven_m > options.keyframe_m or turn_rad > options.keyframe_rad:
            self._add_keyframe(Keyframe.of(scan, points_F, self._filter, robot))

    def _recognised(self, points_F: FloatArray) -> bool:
        """Localises the robot on the map to continue, about its first pose; returns whether that worked."""
        options, first = self._options, self.graph.poses[0]
        for submap in sorted(self.submaps, key=lambda each: self._off_m(each, first))[: options.recognised_in]:
            guess = relative_pose(self.graph.poses[submap.anchor], first)
            found = self.find_in(submap, points_F, guess, options.recognised_window)
            if found is not None:
                self._joint = Edge(submap.anchor, len(self.keyframes), found.pose, self._at_least(found.covariance))
                self._start = compose(self.graph.poses[submap.anchor], found.pose)
                return True
        return False

    @property
    def _current(self) -> Submap:
        return self._active[0]

    def _predict(self, step: Pose2D) -> None:
        """Moves the pose along with odometry and increases its covariance."""
        options = self._options
        step_m, turn = math.hypot(step.x_m, step.y_m), abs(step.yaw_rad)
        old, self._X_AF = self._X_AF, compose(self._X_AF, step)
        along = 5e-4 + options.drift_per_m * step_m
        yaw = 1e-3 + options.yaw_drift_rad_per_m * step_m + options.yaw_drift_per_rad * turn
        self._covariance = moved_covariance(self._covariance, old, self._X_AF, along, yaw)
        self.driven_m += step_m
        self._since_keyframe = (self._since_keyframe[0] + step_m, self._since_keyframe[1] + turn)

    def _matched(self, points_F: FloatArray) -> bool:
        """Matches a scan to the current submap; returns whether that explains enough of the scan."""
        if not self._active:
            return not self._returning or self._recognised(points_F)
        distributions = self._current.distributions
        assert distributions is not None
        found = match(distributions.linearise, points_F, self._X_AF, self._covariance, self._options.matching)
        if found.inlier_share < self._options.least_share:
            return False
        self._X_AF, self._covariance = found.pose, found.covariance
        return True

    def _add_keyframe(self, frame: Keyframe) -> None:
        """Adds a keyframe to the submaps and the graph, and searches for a loop."""
        index = len(self.keyframes)
        self.keyframes.append(frame)
        driven_m, self._since_keyframe = self._since_keyframe[0], (0.0, 0.0)
        if not self._active:
            self.graph.poses.append(self._start)
            self.graph.edges.extend([] if self._joint is None else [self._joint])
            self._begin_submap(index)
            return
        current = self._current
        self.graph.poses.append(self.pose)
        self.graph.edges.append(Edge(current.anchor, index, self._X_AF, self._at_least(self._covariance)))
        current.members[index] = self._X_AF
        self._add_to(current, index)
        current.driven_m += driven_m
        for follower in self._active[1:]:
            follower.members[index] = relative_pose(current.members[follower.anchor], self._X_AF)
            self._add_to(follower, index)
            follower.driven_m += driven_m
        self._change_submaps(index)
        if self.driven_m - self._tried_at_m > self._options.closure_m:
            self._tried_at_m = self.driven_m
            self._close_loops(index)

    def _add_to(self, submap: Submap, index: int) -> None:
        assert submap.distributions is not None
        submap.distributions.add(self.keyframes[index].points_F, submap.members[index])

    def _begin_submap(self, anchor: int) -> None:
        submap = Submap(anchor, Distributions(), {anchor: Pose2D(0.0, 0.0, 0.0)})
        self._add_to(submap, anchor)
        self.submaps.append(submap)
        self._active.append(submap)

    def _change_submaps(self, index: int) -> None:
        """Begins the next submap when the current one is half full, and changes to it when that is full."""
        current, options = self._current, self._options
        full = max(current.driven_m / options.submap_m, len(current.members) / options.submap_keyframes)
        if len(self._active) == 1 and full > 0.5:
            self._begin_submap(index)
        elif len(self._active) > 1 and full > 1.0:
            follower = self._active[1]
            X_AB = current.members[follower.anchor]
            self._X_AF = relative_pose(X_AB, self._X_AF)
            self._covariance = np.diag([1e-5, 1e-5, 1e-6])
            current.distributions = None
            self._active.pop(0)
            self._begin_submap(index)

    def _at_least(self, covariance: FloatArray) -> FloatArray:
        """The covariance enlarged by systematic errors."""
        place, yaw = self._options.least_sigma_m, self._options.least_sigma_rad
        return np.asarray(covariance + np.diag([place**2, place**2, yaw**2]))

    # ---- loop closures

    def _close_loops(self, index: int) -> None:
        """Searches for a keyframe in the nearest old submap; accepts closures that agree with one another."""
        found = self._closure_of(index)
        if found is None:
            return
        self._pending = [
            edge for edge in self._pending if self._distance_between(edge.second, index) < self._options.agree_within_m
        ]
        agreeing = [edge for edge in self._pending if self._agrees(edge, found)]
        if not agreeing:
            self._pending.append(found)
            return
        self._pending = [edge for edge in self._pending if edge not in agreeing]
        self._take_in([*agreeing, found])

    def _take_in(self, edges: list[Edge]) -> None:
        """Optimises the graph with new closures, and removes closures that the rest contradicts."""
        self.graph.edges.extend(edges)
        self.graph.optimise()
        self.dropped += len(self.graph.drop_outliers(self._options.most_sigmas))
        self.revision += 1
        self._closed_at_m = self.driven_m

    def _distance_between(self, first: int, second: int) -> float:
        return sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(self.graph.poses[first : second + 1]))

    def _agrees(self, edge: Edge, other: Edge) -> bool:
        """Returns whether two closures agree: the poses along both and between them form a closed loop."""
        if edge.second == other.second:
            return False
        poses = self.graph.poses
        through = compose(edge.measured, relative_pose(poses[edge.second], poses[other.second]))
        across = compose(relative_pose(poses[edge.first], poses[other.first]), other.measured)
        off = relative_pose(through, across)
        options = self._options
        return math.hypot(off.x_m, off.y_m) < options.agree_m and abs(off.yaw_rad) < options.agree_rad

    def _closure_of(self, index: int) -> Edge | None:
        """The closure of a keyframe with the nearest old submap, None when it is not found there."""
        submap = self._nearest_old(index)
        if submap is None:
            return None
        options = self._options
        driven_m = self.since_closure_m
        window = Window(
            min(options.widest.place_m, options.closure_window.place_m + options.window_per_m.place_m * driven_m),
            min(options.widest.yaw_rad, options.closure_window.yaw_rad + options.window_per_m.yaw_rad * driven_m),
        )
        guess = relative_pose(self.graph.poses[submap.anchor], self.graph.poses[index])
        found = self.find_in(submap, self.keyframes[index].points_F, guess, window)
        if found is None:
            return None
        return Edge(submap.anchor, index, found.pose, self._at_least(found.covariance), closure=True)

    def _nearest_old(self, index: int) -> Submap | None:
        """The old submap with the keyframe nearest to a keyframe, None when none is within reach."""
        here = self.graph.poses[index]
        old = [submap for submap in self.submaps if max(submap.members) < self._current.anchor]
        near = min(old, key=lambda each: self._off_m(each, here), default=None)
        return near if near is not None and self._off_m(near, here) < self._options.closure_reach_m else None

    def _off_m(self, submap: Submap, here: Pose2D) -> float:
        """Distance (m) from a pose to the nearest keyframe of a submap."""
        places = (self.graph.poses[member] for member in submap.members)
        return min(math.hypot(place.x_m - here.x_m, place.y_m - here.y_m) for place in places)

    def find_in(self, submap: Submap, points_F: FloatArray, guess: Pose2D, window: Window) -> Match | None:
        """Searches for a scan's pose in a submap; None unless the scan fits clearly at one place of the window only."""
        options = self._options
        distributions = self.distributions_of(submap)
        points_A = np.vstack([_placed(self.keyframes[i].points_F, pose) for i, pose in submap.members.items()])
        grid = _hit_grid(points_A)
        few = np.ascontiguousarray(points_F[:: max(1, len(points_F) // _SEARCH_POINTS)])
        coarse = find_pose(grid, few, guess, window, least=options.closure_score)
        if coarse is None or coarse.competing_score > options.competing_share * coarse.score:
            return None
        wide = np.diag([0.2**2, 0.2**2, 0.05**2])
        found = match(distributions.linearise, points_F, coarse.pose, wide, options.matching)
        return found if found.inlier_share >= options.closure_share else None

    def distributions_of(self, submap: Submap) -> Distributions:
        """The distributions of a submap, computed again where a full submap has dropped them."""
        if submap.distributions is not None:
            return submap.distributions
        distributions = Distributions()
        for index, pose in submap.members.items():
            distributions.add(self.keyframes[index].points_F, pose)
        return distributions


def _placed(points_F: FloatArray, X_AF: Pose2D) -> FloatArray:
    c, s = math.cos(X_AF.yaw_rad), math.sin(X_AF.yaw_rad)
    return np.asarray(points_F[:, :2] @ np.array([[c, s], [-s, c]]) + [X_AF.x_m, X_AF.y_m])


def _hit_grid(points: FloatArray) -> GridMap:
    """Grid of the cells in which points lie."""
    low = points.min(axis=0) - 1.0
    columns, rows = np.ceil((points.max(axis=0) + 1.0 - low) / _FIELD_CELL_M).astype(int)
    occupied = np.zeros((rows, columns), dtype=np.bool_)
    cells = ((points - low) / _FIELD_CELL_M).astype(int)
    occupied[cells[:, 1], cells[:, 0]] = True
    return GridMap(occupied, _FIELD_CELL_M, (float(low[0]), float(low[1])))
