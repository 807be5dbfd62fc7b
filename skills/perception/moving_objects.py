"""Tracking of moving objects, such as people: clusters of LiDAR returns that the map does not explain, over time.

A cluster moves when it has left cells and entered others. A cluster that only shows another side, as the robot passes,
does neither.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from skills.perception.point_cloud import cell_labels
from skills.quantities import Count, Delay, Duration, Length, Margin, Share, Speed
from skills.robot import FloatArray

_PARTLY = 0.7
"""Fraction of its cells below which a cluster counts as hidden in part."""
_SETS_OFF = 1.5
"""Ratio of the short-term to the long-term speed above which an object has just set off."""


@dataclass(frozen=True)
class MovingOptions:
    """Clustering and tracking of moving objects.

    `join_m`: returns this near to each other form a cluster. `least_cells` and `most_size_m`: least number of cells of
    5 cm, and largest width, of a cluster. `match_m`: distance from its prediction within which a cluster continues a
    track. `short_s`, `long_s`, `changed` and `apart_m`: a cluster moves when, against a scan `short_s` or `long_s` ago,
    a fraction `changed` of its cells is new by more than `apart_m` and as many cells are left, at a speed between the
    limits (m/s). `hidden_s`: how long an occluded moving object is predicted.
    """

    join_m: Margin = 0.15
    least_cells: Count = 4
    most_size_m: Length = 1.2
    match_m: Length = 0.35
    short_s: Duration = 0.15
    long_s: Duration = 0.35
    apart_m: Margin = 0.08
    changed: Share = 0.2
    least_m_s: Speed = 0.35
    most_m_s: Speed = 2.5
    most_radius_m: Length = 0.3
    hidden_s: Delay = 1.0


@dataclass(frozen=True)
class Moving:
    """A moving object: its centre (x, y), velocity (2,) in m/s and radius (m), in the world at `stamp_s`."""

    place_W: tuple[float, float]
    velocity_W: tuple[float, float]
    radius_m: float
    stamp_s: float

    def places_W(self, times_s: FloatArray, now_s: float) -> FloatArray:
        """Predicts positions (N, 2) at times (s) from now at constant velocity."""
        ahead_s = (now_s - self.stamp_s + times_s)[:, None]
        return np.asarray(np.array(self.place_W) + ahead_s * np.array(self.velocity_W))


@dataclass
class _Track:
    """One cluster over several scans: stamps, its cells (N, 2) in the world, and its last motion."""

    seen: deque[tuple[float, FloatArray]] = field(default_factory=deque)
    moving: Moving | None = None

    def expected_W(self, stamp_s: float) -> FloatArray:
        """Predicts the centre of the cluster at a time."""
        if self.moving is not None:
            return np.asarray(self.moving.places_W(np.zeros(1), stamp_s)[0])
        return np.asarray(self.seen[-1][1].mean(axis=0))


class MovingWatch:
    """Tracks clusters; call `update` with the unexplained returns in each new scan."""

    def __init__(self, options: MovingOptions | None = None) -> None:
        self._options = options or MovingOptions()
        self._tracks: list[_Track] = []
        self._stamp_s = -math.inf
        self._moving: tuple[Moving, ...] = ()

    def update(self, stamp_s: float, points_W: FloatArray) -> tuple[Moving, ...]:
        """Returns the moving objects after adding a scan's returns (N, 2 or more); a repeated scan changes nothing."""
        if stamp_s > self._stamp_s:
            self._stamp_s = stamp_s
            self._match(stamp_s, clusters(points_W[:, :2], self._options))
            for track in self._tracks:
                track.moving = self._motion(track) or self._motion_before_hidden(track)
            self._moving = tuple(track.moving for track in self._tracks if track.moving is not None)
        return self._moving

    def _match(self, stamp_s: float, found: Sequence[FloatArray]) -> None:
        """Continues each track with the cluster nearest to its prediction; other clusters begin new tracks."""
        left = list(found)
        for track in self._tracks:
            expected = track.expected_W(stamp_s)
            off_m = [float(np.linalg.norm(cells.mean(axis=0) - expected)) for cells in left]
            if off_m and min(off_m) <= self._options.match_m:
                track.seen.append((stamp_s, left.pop(int(np.argmin(off_m)))))
            while len(track.seen) > 1 and track.seen[1][0] <= stamp_s - self._options.long_s:
                track.seen.popleft()
        alive = [track for track in self._tracks if stamp_s - track.seen[-1][0] <= self._options.hidden_s]
        self._tracks = alive + [_Track(deque([(stamp_s, cells)])) for cells in left]

    def _motion_before_hidden(self, track: _Track) -> Moving | None:
        """Motion of a track before it was occluded, at least in part; None when visible, or occluded for too long."""
        if track.moving is None or self._stamp_s - track.moving.stamp_s > self._options.hidden_s:
            return None
        most = max(len(cells) for _, cells in track.seen)
        unseen = track.seen[-1][0] < self._stamp_s
        return track.moving if unseen or len(track.seen[-1][1]) < _PARTLY * most else None

    def _motion(self, track: _Track) -> Moving | None:
        """Motion of a track; None when it stands still, or is not in the last scan."""
        options, (stamp_s, cells) = self._options, track.seen[-1]
        if stamp_s < self._stamp_s:
            return None
        short, long = (self._velocity(track, since_s) for since_s in (options.short_s, options.long_s))
        velocity = long if long is not None else short
        if velocity is None:
            return None
        if short is not None and np.linalg.norm(short) > _SETS_OFF * np.linalg.norm(velocity):
            velocity = short
        elif track.moving is not None:
            velocity = 0.5 * (velocity + np.array(track.moving.velocity_W))
        vx, vy = (float(value) for value in velocity)
        x, y = (float(value) for value in cells.mean(axis=0))
        radius_m = float(np.linalg.norm(cells - (x, y), axis=1).max())
        return Moving((x, y), (vx, vy), min(radius_m, options.most_radius_m), stamp_s)

    def _velocity(self, track: _Track, since_s: float) -> FloatArray | None:
        """Velocity (2,) against a scan since_s ago; None without such a scan, or when the cluster has not moved."""
        stamp_s, cells = track.seen[-1]
        before = [each for each in track.seen if each[0] <= stamp_s - since_s + 1e-6]
        if not before:
            return None
        then_s, old = before[-1]
        velocity = np.asarray((cells.mean(axis=0) - old.mean(axis=0)) / (stamp_s - then_s))
        fast = self._options.least_m_s <= float(np.linalg.norm(velocity)) <= self._options.most_m_s
        changed = fast and min(self._share_away(cells, old), self._share_away(old, cells)) >= self._options.changed
        return velocity if changed else None

    def _share_away(self, cells: FloatArray, others: FloatArray) -> float:
        """Fraction of `cells` that are away from all `others`."""
        apart_m = np.linalg.norm(cells[:, None] - others[None], axis=2).min(axis=1)
        return float(np.mean(apart_m > self._options.apart_m))


def clusters(points_W: FloatArray, options: MovingOptions, cell_m: float = 0.05) -> list[FloatArray]:
    """Clusters points (N, 2): cell centres (N, 2) of each cluster that is neither too small nor too wide."""
    if len(points_W) == 0:
        return []
    cells = np.array(sorted(set(map(tuple, np.floor(points_W / cell_m).astype(np.int64).tolist()))))
    reach = max(1, math.ceil(options.join_m / cell_m / 2.0))
    labels, count = cell_labels(cells, reach=reach)
    found = [(cells[labels == label] + 0.5) * cell_m for label in range(1, count)]
    return [
        each for each in found if len(each) >= options.least_cells and np.ptp(each, axis=0).max() < options.most_size_m
    ]
