"""Costmaps with added obstacles: discs about people, outlines of other robots, closed doors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from skills.api import FreeSpace
from skills.navigate.footprint import disc_centres
from skills.robot import FloatArray

_ROUND_UP_M = 0.02
_FAR_M = 1.5
"""Outlines farther than this from their disc are not looked up."""


@dataclass(frozen=True)
class WithObstacles:
    """A costmap with more obstacles; `distance_m` returns the distance of points (N, 2) from the nearest of them."""

    costmap: FreeSpace
    distance_m: Callable[[FloatArray], FloatArray]

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Distance (m) from each (x, y) row to the nearest obstacle."""
        points = np.asarray(points_W, dtype=np.float64)[:, :2]
        return np.minimum(self.costmap.clearance_m(points), self.distance_m(points))


@dataclass(frozen=True)
class NoObstacles:
    """A costmap without obstacles."""

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Infinity for each row."""
        return np.full(len(points_W), np.inf)


def with_discs(costmap: FreeSpace, discs_W: FloatArray) -> FreeSpace:
    """The costmap with discs, rows of x, y and radius in metres."""

    def distance_m(points: FloatArray) -> FloatArray:
        offsets = points[:, None, :] - discs_W[None, :, :2]
        return np.asarray(np.min(np.linalg.norm(offsets, axis=2) - discs_W[None, :, 2], axis=1))

    return WithObstacles(costmap, distance_m)


def with_segments(
    costmap: FreeSpace, segments_W: Sequence[tuple[FloatArray, FloatArray, float]], radius_m: float
) -> FreeSpace:
    """The costmap with segments, radius_m thick to all sides: middle (2,), unit direction (2,) and length in metres."""

    def distance_m(points: FloatArray) -> FloatArray:
        nearest_m = np.full(len(points), np.inf)
        for middle, along, length_m in segments_W:
            at_m = np.clip((points - middle) @ along, -0.5 * length_m, 0.5 * length_m)
            nearest = middle + at_m[:, None] * along
            nearest_m = np.minimum(nearest_m, np.linalg.norm(points - nearest, axis=1))
        return nearest_m - radius_m

    return WithObstacles(costmap, distance_m)


def with_outlines(
    costmap: FreeSpace, outlines: Sequence[tuple[FloatArray, FloatArray]], larger_m: float = 0.0
) -> FreeSpace:
    """The costmap with outlines (discs, as in `Footprint`) at poses (N, 3), each grown by larger_m.

    Radii are rounded up to 2 cm. An outline farther than 1.5 m does not count.
    """
    for discs, poses in outlines:
        steps = np.ceil(discs[:, 2] / _ROUND_UP_M - 1e-6)
        for step in np.unique(steps):
            same = discs[steps == step]
            costmap = WithObstacles(costmap, _distance_from(same, poses, float(same[:, 2].max()) + larger_m))
    return costmap


def _distance_from(discs: FloatArray, poses: FloatArray, radius_m: float) -> Callable[[FloatArray], FloatArray]:
    """The distance of points from discs of one radius at poses, infinite beyond _FAR_M."""
    from scipy.spatial import cKDTree

    tree, most_m = cKDTree(disc_centres(discs, poses).reshape(-1, 2)), radius_m + _FAR_M

    def distance_m(points: FloatArray) -> FloatArray:
        near = np.all((points > tree.mins - most_m) & (points < tree.maxes + most_m), axis=1)
        distances = np.full(len(points), np.inf)
        distances[near] = tree.query(points[near], distance_upper_bound=most_m)[0] - radius_m
        return distances

    return distance_m
