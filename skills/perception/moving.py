"""What moves about the robot, people above all: clusters of LiDAR returns that the map does not explain, over time.

A cluster moves when it has left places where it was and has come to others: one that only shows another side of itself,
as the robot passes, does not.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.quantities import Count, Delay, Duration, Length, Margin, Share, Speed
from skills.robot import FloatArray

_PARTLY = 0.7
"""What shows fewer of its cells than this share is hidden in part."""
_SETS_OFF = 1.5
"""Who is so many times as fast over a short time as over a long one has just set off."""


@dataclass(frozen=True)
class MovingOptions:
    """Returns within `join_m` are one cluster, of at least `least_cells` cells of 5 cm and at most `most_size_m` wide.

    In the next scan it is the one within `match_m` of where it was bound. It moves when, against a scan `short_s` or
    `long_s` ago, a share `changed` of its cells is new by more than `apart_m`, as many are left, and its speed is
    between the two limits (m/s). What moved and is not seen any more, since something hides it or it is too close, is
    taken to go on for `hidden_s`.
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
    """Something that moves: its middle (x, y), velocity (2,) in m/s and radius (m), in the world at `stamp_s`."""

    place_W: tuple[float, float]
    velocity_W: tuple[float, float]
    radius_m: float
    stamp_s: float

    def places_W(self, times_s: FloatArray, now_s: float) -> FloatArray:
        """Where it will be (N, 2) at so many seconds from now, when it goes on as it does."""
        ahead_s = (now_s - self.stamp_s + times_s)[:, None]
        return np.asarray(np.array(self.place_W) + ahead_s * np.array(self.velocity_W))


@dataclass
class _Track:
    """One cluster from scan to scan: stamps, and its cells (N, 2) in the world; how it moved when last seen."""

    seen: deque[tuple[float, FloatArray]] = field(default_factory=deque)
    moving: Moving | None = None

    def expected_W(self, stamp_s: float) -> FloatArray:
        """Where its middle should be at a time."""
        if self.moving is not None:
            return np.asarray(self.moving.places_W(np.zeros(1), stamp_s)[0])
        return np.asarray(self.seen[-1][1].mean(axis=0))


class MovingWatch:
    """Follows clusters from scan to scan; call `take` with the unexplained returns of each new scan."""

    def __init__(self, options: MovingOptions | None = None) -> None:
        self._options = options or MovingOptions()
        self._tracks: list[_Track] = []
        self._stamp_s = -math.inf
        self._moving: tuple[Moving, ...] = ()

    def take(self, stamp_s: float, points_W: FloatArray) -> tuple[Moving, ...]:
        """What moves, by the returns (N, 2 or more) of a scan; those of a scan that is known change nothing."""
        if stamp_s > self._stamp_s:
            self._stamp_s = stamp_s
            self._match(stamp_s, clusters(points_W[:, :2], self._options))
            for track in self._tracks:
                track.moving = self._motion(track) or self._hidden(track)
            self._moving = tuple(track.moving for track in self._tracks if track.moving is not None)
        return self._moving

    def _match(self, stamp_s: float, found: Sequence[FloatArray]) -> None:
        """Lets each track go on with the cluster nearest to where it was bound; what is left begins a new one."""
        left = list(found)
        for track in self._tracks:
            expected = track.expected_W(stamp_s)
            off_m = [float(np.linalg.norm(cells.mean(axis=0) - expected)) for cells in left]
            if off_m and min(off_m) <= self._options.match_m:
                track.seen.append((stamp_s, left.pop(int(np.argmin(off_m)))))
            while len(track.seen) > 1 and track.seen[1][0] <= stamp_s - self._options.long_s:
                track.seen.popleft()
        kept = [track for track in self._tracks if stamp_s - track.seen[-1][0] <= self._options.hidden_s]
        self._tracks = kept + [_Track(deque([(stamp_s, cells)])) for cells in left]

    def _hidden(self, track: _Track) -> Moving | None:
        """How a track moved before it was hidden, wholly or in part; None when it was not, or long ago."""
        if track.moving is None or self._stamp_s - track.moving.stamp_s > self._options.hidden_s:
            return None
        most = max(len(cells) for _, cells in track.seen)
        unseen = track.seen[-1][0] < self._stamp_s
        return track.moving if unseen or len(track.seen[-1][1]) < _PARTLY * most else None

    def _motion(self, track: _Track) -> Moving | None:
        """How a track moves; None when it does not, or has not just been seen."""
        options, (stamp_s, cells) = self._options, track.seen[-1]
        if stamp_s < self._stamp_s:
            return None
        short, long = (self._velocity(track, since_s) for since_s in (options.short_s, options.long_s))
        went = long if long is not None else short
        if went is None:
            return None
        if short is not None and np.linalg.norm(short) > _SETS_OFF * np.linalg.norm(went):
            went = short
        elif track.moving is not None:
            went = 0.5 * (went + np.array(track.moving.velocity_W))
        vx, vy = (float(value) for value in went)
        x, y = (float(value) for value in cells.mean(axis=0))
        radius_m = float(np.linalg.norm(cells - (x, y), axis=1).max())
        return Moving((x, y), (vx, vy), min(radius_m, options.most_radius_m), stamp_s)

    def _velocity(self, track: _Track, since_s: float) -> FloatArray | None:
        """The velocity (2,) against a scan that long ago; None without one, or when it has not moved since."""
        stamp_s, cells = track.seen[-1]
        before = [each for each in track.seen if each[0] <= stamp_s - since_s + 1e-6]
        if not before:
            return None
        then_s, old = before[-1]
        went = np.asarray((cells.mean(axis=0) - old.mean(axis=0)) / (stamp_s - then_s))
        fast = self._options.least_m_s <= float(np.linalg.norm(went)) <= self._options.most_m_s
        changed = fast and min(self._share_away(cells, old), self._share_away(old, cells)) >= self._options.changed
        return went if changed else None

    def _share_away(self, cells: FloatArray, others: FloatArray) -> float:
        """The share of some cells that are away from all others."""
        apart_m = np.linalg.norm(cells[:, None] - others[None], axis=2).min(axis=1)
        return float(np.mean(apart_m > self._options.apart_m))


def clusters(points_W: FloatArray, options: MovingOptions, cell_m: float = 0.05) -> list[FloatArray]:
    """The cells' centres (N, 2) of each cluster of points (N, 2) that is neither too small nor too wide."""
    if len(points_W) == 0:
        return []
    cells = np.unique(np.floor(points_W / cell_m).astype(np.int64), axis=0)
    reach = max(1, math.ceil(options.join_m / cell_m / 2.0))
    low = cells.min(axis=0) - reach
    mask = np.zeros(cells.max(axis=0) - low + reach + 1, np.uint8)
    mask[tuple((cells - low).T)] = 1
    grown = cv2.dilate(mask, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    _, labels = cv2.connectedComponents(grown)
    of_cell: NDArray[np.int32] = labels[tuple((cells - low).T)]
    found = [(cells[of_cell == label] + 0.5) * cell_m for label in np.unique(of_cell)]
    return [
        each for each in found if len(each) >= options.least_cells and np.ptp(each, axis=0).max() < options.most_size_m
    ]
