"""Simultaneous localisation and mapping from LiDAR and odometry: submaps, keyframes, loop closures.

Each scan is matched to the current submap from where odometry has the robot. A keyframe is kept every
few decimetres and joins the pose graph by its pose in the submap; it also goes into the submap that follows, which
takes over when the current one is full (as in Hess et al., 2016). Keyframes are looked for in old submaps as well: what
is found counts once another keyframe agrees with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np

from skills.api import LocalisationEstimate
from skills.estimate.grid_map import GridMap
from skills.estimate.localiser import moved_covariance
from skills.estimate.matching import Match, MatchOptions, match
from skills.estimate.scan_points import SelfFilter, has_moved
from skills.geometry import compose, inverse, relative
from skills.mapping.closures import Window, find_pose
from skills.mapping.distributions import Distributions
from skills.mapping.keyframe import Keyframe, matching_points
from skills.mapping.pose_graph import Edge, PoseGraph
from skills.robot import FloatArray, Pose2D, Robot, Scan

_FIELD_CELL_M = 0.05


@dataclass(frozen=True)
class MapperOptions:
    """Distances in metres, angles in radians.

    A scan is matched every `period_s`. A keyframe is kept after `keyframe_m` or `keyframe_rad`; a submap is full after
    `submap_m` of way. Odometry is expected to err by `drift_per_m` of each step (with much more, the beams' pattern
    holds the robot back in bare corridors), by `yaw_drift_rad_per_m` of the way and `yaw_drift_per_rad` of a turn.
    Scans of which the submap explains less than `least_share` do not count. Loops are looked for every `closure_m`,
    within `closure_window` plus `window_per_m` of the way since the last one found.
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
    rival_share: float = 0.9
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
    """Keyframes matched to one another: `anchor` is the one whose frame it has; `members` their poses in it."""

    anchor: int
    distributions: Distributions | None
    members: dict[int, Pose2D]
    way_m: float = 0.0


class Mapper:
    """Makes a map while the robot drives; `start` is where the robot stands at first, in the map's frame.

    `revision` counts how often earlier poses were corrected; `blind_since_s` is since when no scan could be used.
    """

    def __init__(self, start: Pose2D, options: MapperOptions | None = None) -> None:
        self._options = options or MapperOptions()
        self._start = start
        self.graph = PoseGraph()
        self.keyframes: list[Keyframe] = []
        self.submaps: list[Submap] = []
        self.revision = 0
        self.way_m = 0.0
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
    def going_on(
        graph: PoseGraph, keyframes: list[Keyframe], submaps: list[Submap], options: MapperOptions | None = None
    ) -> Mapper:
        """A mapper that goes on from an earlier map, from where that began."""
        mapper = Mapper(graph.poses[0], options)
        mapper.graph, mapper.keyframes, mapper.submaps = graph, keyframes, submaps
        mapper._returning = True
        return mapper

    @property
    def pose(self) -> Pose2D:
        """X_WF: where the robot is on the map."""
        if not self._active:
            return self._start
        return compose(self.graph.poses[self._current.anchor], self._X_AF)

    @property
    def way_since_closure_m(self) -> float:
        """How far the robot has driven since it last recognised a place."""
        return self.way_m - self._closed_at_m

    def estimate(self) -> LocalisationEstimate:
        """The pose as a localiser gives it."""
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
        options, frozen = self._options, self._frozen(scan)
        before, self._scan = self._scan, scan
        step = Pose2D(0.0, 0.0, 0.0)
        X_OF, self._X_OF = self._X_OF, Pose2D.from_transform(scan.X_OB)
        if before is not None:
            step = relative(X_OF, self._X_OF)
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
        if not self._active or self._keyframe_is_due():
            self._keep(Keyframe.of(scan, points_F, self._filter, robot))

    def _recognised(self, points_F: FloatArray) -> bool:
        """Find the robot on the map that it goes on from, about where that began; its keyframe then joins the graph."""
        options, first = self._options, self.graph.poses[0]
        for submap in sorted(self.submaps, key=lambda each: self._off_m(each, first))[: options.recognised_in]:
            guess = relative(self.graph.poses[submap.anchor], first)
            found = self.find_in(submap, points_F, guess, options.recognised_window)
            if found is not None:
                self._joint = Edge(submap.anchor, len(self.keyframes), found.pose, self._at_least(found.covariance))
                self._start = compose(self.graph.poses[submap.anchor], found.pose)
                return True
        return False

    @property
    def _current(self) -> Submap:
        return self._active[0]

    def _frozen(self, scan: Scan) -> bool:
        """Returns whether a scan repeats the last one, noise and all, although the robot has moved."""
        last = self._scan
        return last is not None and scan.repeats(last) and has_moved(last, scan)

    def _predict(self, step: Pose2D) -> None:
        """Moves along with odometry, and lets the spread grow."""
        options = self._options
        way, turn = math.hypot(step.x_m, step.y_m), abs(step.yaw_rad)
        old, self._X_AF = self._X_AF, compose(self._X_AF, step)
        along = 5e-4 + options.drift_per_m * way
        yaw = 1e-3 + options.yaw_drift_rad_per_m * way + options.yaw_drift_per_rad * turn
        self._covariance = moved_covariance(self._covariance, old, self._X_AF, along, yaw)
        self.way_m += way
        self._since_keyframe = (self._since_keyframe[0] + way, self._since_keyframe[1] + turn)

    def _matched(self, points_F: FloatArray) -> bool:
        """Matches a scan to the current submap; False when it explains too little."""
        if not self._active:
            return not self._returning or self._recognised(points_F)
        distributions = self._current.distributions
        assert distributions is not None
        found = match(distributions, points_F, self._X_AF, self._covariance, self._options.matching)
        if found.inlier_share < self._options.least_share:
            return False
        self._X_AF, self._covariance = found.pose, found.covariance
        return True

    def _keyframe_is_due(self) -> bool:
        way, turn = self._since_keyframe
        return way > self._options.keyframe_m or turn > self._options.keyframe_rad

    def _keep(self, frame: Keyframe) -> None:
        """A new keyframe: into the submaps and the graph; then look for a loop."""
        index = len(self.keyframes)
        self.keyframes.append(frame)
        way, self._since_keyframe = self._since_keyframe[0], (0.0, 0.0)
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
        current.way_m += way
        for follower in self._active[1:]:
            follower.members[index] = relative(current.members[follower.anchor], self._X_AF)
            self._add_to(follower, index)
            follower.way_m += way
        self._change_submaps(index)
        if self.way_m - self._tried_at_m > self._options.closure_m:
            self._tried_at_m = self.way_m
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
        """Begins the next submap when the current one is half full; go over to it when it is full."""
        current, options = self._current, self._options
        full = max(current.way_m / options.submap_m, len(current.members) / options.submap_keyframes)
        if len(self._active) == 1 and full > 0.5:
            self._begin_submap(index)
        elif len(self._active) > 1 and full > 1.0:
            follower = self._active[1]
            X_AB = current.members[follower.anchor]
            self._X_AF = relative(X_AB, self._X_AF)
            self._covariance = np.diag([1e-5, 1e-5, 1e-6])
            current.distributions = None
            self._active.pop(0)
            self._begin_submap(index)

    def _at_least(self, covariance: FloatArray) -> FloatArray:
        """A covariance that is no smaller than what systematic errors allow."""
        place, yaw = self._options.least_sigma_m, self._options.least_sigma_rad
        return np.asarray(covariance + np.diag([place**2, place**2, yaw**2]))

    # ---- loop closures

    def _close_loops(self, index: int) -> None:
        """Looks for a keyframe in the nearest old submap; take in what another one confirms."""
        found = self._found_in_old(index)
        if found is None:
            return
        self._pending = [
            edge for edge in self._pending if self._way_between(edge.second, index) < self._options.agree_within_m
        ]
        agreeing = [edge for edge in self._pending if self._agree(edge, found)]
        if not agreeing:
            self._pending.append(found)
            return
        self._pending = [edge for edge in self._pending if edge not in agreeing]
        self._take_in([*agreeing, found])

    def _take_in(self, edges: list[Edge]) -> None:
        """Optimise with new closures; what the rest then contradicts goes out again."""
        self.graph.edges.extend(edges)
        self.graph.optimise()
        self.dropped += len(self.graph.drop_outliers(self._options.most_sigmas))
        self.revision += 1
        self._closed_at_m = self.way_m

    def _way_between(self, first: int, second: int) -> float:
        return sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in pairwise(self.graph.poses[first : second + 1]))

    def _agree(self, edge: Edge, other: Edge) -> bool:
        """Returns whether two closures give the same loop: once around both, and the way between them, leads back."""
        if edge.second == other.second:
            return False
        poses = self.graph.poses
        through = compose(edge.measured, relative(poses[edge.second], poses[other.second]))
        across = compose(relative(poses[edge.first], poses[other.first]), other.measured)
        off = relative(through, across)
        options = self._options
        return math.hypot(off.x_m, off.y_m) < options.agree_m and abs(off.yaw_rad) < options.agree_rad

    def _found_in_old(self, index: int) -> Edge | None:
        """The keyframe's pose in the nearest submap that is neither current nor just left."""
        submap = self._nearest_old(index)
        if submap is None:
            return None
        options = self._options
        way = self.way_since_closure_m
        window = Window(
            min(options.widest.place_m, options.closure_window.place_m + options.window_per_m.place_m * way),
            min(options.widest.yaw_rad, options.closure_window.yaw_rad + options.window_per_m.yaw_rad * way),
        )
        guess = relative(self.graph.poses[submap.anchor], self.graph.poses[index])
        found = self.find_in(submap, self.keyframes[index].points_F, guess, window)
        if found is None:
            return None
        return Edge(submap.anchor, index, found.pose, self._at_least(found.covariance), closure=True)

    def _nearest_old(self, index: int) -> Submap | None:
        """The submap with the keyframe nearest to a keyframe, within reach."""
        here = self.graph.poses[index]
        old = [submap for submap in self.submaps if max(submap.members) < self._current.anchor]
        near = min(old, key=lambda each: self._off_m(each, here), default=None)
        return near if near is not None and self._off_m(near, here) < self._options.closure_reach_m else None

    def _off_m(self, submap: Submap, here: Pose2D) -> float:
        """How far a pose is from the nearest keyframe of a submap."""
        places = (self.graph.poses[member] for member in submap.members)
        return min(math.hypot(place.x_m - here.x_m, place.y_m - here.y_m) for place in places)

    def find_in(self, submap: Submap, points_F: FloatArray, guess: Pose2D, window: Window) -> Match | None:
        """Where a scan's points fit into a submap, clearly and nowhere else in the window."""
        options = self._options
        distributions = self.rebuilt(submap)
        points_A = np.vstack([_placed(self.keyframes[i].points_F, pose) for i, pose in submap.members.items()])
        grid = _hit_grid(points_A)
        few = np.ascontiguousarray(points_F[:: max(1, len(points_F) // 150)])
        coarse = find_pose(grid, few, guess, window, least=options.closure_score)
        if coarse is None or coarse.rival_score > options.rival_share * coarse.score:
            return None
        wide = np.diag([0.2**2, 0.2**2, 0.05**2])
        found = match(distributions, points_F, coarse.pose, wide, options.matching)
        return found if found.inlier_share >= options.closure_share else None

    def rebuilt(self, submap: Submap) -> Distributions:
        """The distributions of a submap; a full one does not keep them."""
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
    """The cells that points hit."""
    low = points.min(axis=0) - 1.0
    columns, rows = np.ceil((points.max(axis=0) + 1.0 - low) / _FIELD_CELL_M).astype(int)
    occupied = np.zeros((rows, columns), dtype=np.bool_)
    cells = ((points - low) / _FIELD_CELL_M).astype(int)
    occupied[cells[:, 1], cells[:, 0]] = True
    return GridMap(occupied, _FIELD_CELL_M, (float(low[0]), float(low[1])))
