"""Positions of people, and their detection in LiDAR scans: an upright cluster as wide as shoulders that stands alone.

For a LiDAR of one ring, a person is a pair of legs, or one leg, that stands alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.perception.point_cloud import grid_labels
from skills.robot import FloatArray, Pose2D, Scan

_CELL_M = 0.05
_LOWEST_M = 0.8
_HIGHEST_M = 1.8
_WIDTH_M = (0.15, 0.75)
_ALONE_M = 0.2
_FEWEST_POINTS = 12
_LEGS_LOWEST_M = 0.1
_LEGS_CELL_M = 0.12
_LEGS_WIDTH_M = (0.08, 0.6)
_LEGS_FEWEST_POINTS = 6
_FRONT_TO_AXIS_M = 0.1
_AXIS_SIGMA_M = 0.08
_OWN_M = (0.1, 0.19, 0.05)
"""Reach of the arm and the held object beyond the robot's outline: behind, ahead, to the sides."""


@dataclass(frozen=True)
class SeenPerson:
    """A person: the upright axis (x, y) in the world (m), its covariance (2, 2), and the time of the last view.

    `here_W` is the robot's pose at that time, `looks` the number of views that showed the person, and `missed` the
    number of views since then that should have.
    """

    place_W: tuple[float, float]
    covariance: FloatArray
    score: float
    stamp_s: float
    here_W: Pose2D
    looks: int = 1
    missed: int = 0

    @property
    def distance_m(self) -> float:
        """Distance of the person from the robot at the last view, in metres."""
        return math.dist(self.place_W, (self.here_W.x_m, self.here_W.y_m))


def add_person(known: Sequence[SeenPerson], new: SeenPerson, same_m: float) -> tuple[SeenPerson, ...]:
    """Adds a person to those known: replaces the nearest within same_m, or is one more.

    The newer position counts, since people walk. Two cameras that see a person at once count as one view.
    """
    near = [one for one in known if math.dist(one.place_W, new.place_W) <= same_m]
    if not near:
        return (*known, new)
    old = min(near, key=lambda one: math.dist(one.place_W, new.place_W))
    again = old.looks + (new.stamp_s > old.stamp_s)
    return tuple(replace(new, looks=again) if one is old else one for one in known)


def people_in_scan(
    scan: Scan, X_WB: RigidTransform, footprint_m: Sequence[tuple[float, float]], furthest_m: float = 3.5
) -> list[SeenPerson]:
    """Detects people in a LiDAR scan, nearest first; ignores points in and right around the robot's footprint."""
    points_B = scan.points_B()
    level = points_B @ scan.X_OB.rotation().matrix().T
    height = level[:, 2] + scan.X_OB.translation()[2]
    distance = np.hypot(points_B[:, 0], points_B[:, 1])
    own = _is_own(points_B, np.array(footprint_m))
    planar = len(scan.elevations_rad) == 1
    near = (
        (height > (_LEGS_LOWEST_M if planar else _LOWEST_M))
        & (height < _HIGHEST_M)
        & (distance < furthest_m + 0.5)
        & ~own
    )
    clusters = _clusters(points_B[near], _LEGS_CELL_M if planar else _CELL_M)
    is_sized = _is_leg_sized if planar else _is_person_sized
    people = [
        _person(scan.stamp_s, X_WB, cluster)
        for k, cluster in enumerate(clusters)
        if is_sized(cluster) and _is_alone(cluster, [other for j, other in enumerate(clusters) if j != k])
    ]
    return sorted((p for p in people if p.distance_m < furthest_m), key=lambda person: person.distance_m)


def _is_own(points_B: FloatArray, corners: FloatArray) -> NDArray[np.bool_]:
    """Returns which points belong to the robot's own arm and the held object."""
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    behind, ahead, aside = _OWN_M
    x, y = points_B[:, 0], points_B[:, 1]
    return np.asarray((x > x0 - behind) & (x < x1 + ahead) & (y > y0 - aside) & (y < y1 + aside))


def _clusters(points_B: FloatArray, cell_m: float) -> list[FloatArray]:
    """Clusters points (N, 3) by neighbourhood on a grid seen from above."""
    if len(points_B) == 0:
        return []
    labels, count = grid_labels(points_B[:, :2], cell_m, dilated=True)
    groups = [points_B[labels == k] for k in range(1, count)]
    return [group for group in groups if len(group) >= 3]


def _is_person_sized(points_B: FloatArray) -> bool:
    spans = np.ptp(points_B[:, :2] - points_B[:, :2].mean(axis=0), axis=0)
    width = float(np.hypot(*spans))
    tall = float(np.ptp(points_B[:, 2])) > 0.1
    return len(points_B) >= _FEWEST_POINTS and _WIDTH_M[0] < width < _WIDTH_M[1] and tall


def _is_leg_sized(points_B: FloatArray) -> bool:
    width = float(np.hypot(*np.ptp(points_B[:, :2], axis=0)))
    return len(points_B) >= _LEGS_FEWEST_POINTS and _LEGS_WIDTH_M[0] < width < _LEGS_WIDTH_M[1]


def _is_alone(points_B: FloatArray, others: list[FloatArray]) -> bool:
    """Returns whether no other cluster is close; walls and cupboards seldom stand alone."""
    centre = points_B[:, :2].mean(axis=0)
    reach = float(np.max(np.linalg.norm(points_B[:, :2] - centre, axis=1))) + _ALONE_M
    return all(float(np.min(np.linalg.norm(other[:, :2] - centre, axis=1))) > reach for other in others)


def _person(stamp_s: float, X_WB: RigidTransform, points_B: FloatArray) -> SeenPerson:
    """Person whose front is a cluster: the axis is a little behind its middle."""
    centre = points_B[:, :2].mean(axis=0)
    behind = centre + _FRONT_TO_AXIS_M * centre / max(float(np.linalg.norm(centre)), 1e-6)
    x, y, _ = (float(value) for value in X_WB @ np.array([*behind, 0.0]))
    return SeenPerson((x, y), _AXIS_SIGMA_M**2 * np.eye(2), 1.0, stamp_s, Pose2D.from_transform(X_WB))
