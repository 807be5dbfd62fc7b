"""Persons in a LiDAR scan: upright, about as wide as shoulders, standing alone."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.robot import FloatArray, Scan

_CELL_M = 0.05
_LOWEST_M = 0.8
_HIGHEST_M = 1.8
_WIDTH_M = (0.15, 0.75)
_ALONE_M = 0.2
_FEWEST_POINTS = 12
_FRONT_TO_AXIS_M = 0.1


@dataclass(frozen=True)
class SeenPerson:
    """The axis (x, y) of a person in the body frame, m."""

    x_m: float
    y_m: float

    @property
    def distance_m(self) -> float:
        """Distance from the body's origin."""
        return float(np.hypot(self.x_m, self.y_m))


def people_in_scan(scan: Scan, furthest_m: float = 3.5) -> list[SeenPerson]:
    """Persons seen, the nearest first."""
    points_B = scan.points_B()
    level = points_B @ scan.X_OB.rotation().matrix().T
    height = level[:, 2] + scan.X_OB.translation()[2]
    distance = np.hypot(points_B[:, 0], points_B[:, 1])
    near = (height > _LOWEST_M) & (height < _HIGHEST_M) & (distance < furthest_m + 0.5) & ~_own(points_B)
    clusters = _clusters(points_B[near])
    people = [
        _axis(cluster)
        for k, cluster in enumerate(clusters)
        if _person_sized(cluster) and _alone(cluster, [other for j, other in enumerate(clusters) if j != k])
    ]
    return sorted((p for p in people if p.distance_m < furthest_m), key=lambda person: person.distance_m)


def _own(points_B: FloatArray) -> NDArray[np.bool_]:
    """Points of the robot's own arm and what it holds."""
    return np.asarray((np.abs(points_B[:, 1]) < 0.3) & (points_B[:, 0] > -0.6) & (points_B[:, 0] < 0.75))


def _clusters(points_B: FloatArray) -> list[FloatArray]:
    """Points (N, 3) joined where they are neighbours on a grid seen from above."""
    if len(points_B) == 0:
        return []
    cells = np.floor((points_B[:, :2] - points_B[:, :2].min(axis=0)) / _CELL_M).astype(np.int64) + 2
    occupied = np.zeros(cells.max(axis=0) + 3, dtype=np.uint8)
    occupied[cells[:, 0], cells[:, 1]] = 1
    count, labels = cv2.connectedComponents(cv2.dilate(occupied, np.ones((3, 3), np.uint8)), connectivity=8)
    label = labels[cells[:, 0], cells[:, 1]]
    groups = [points_B[label == k] for k in range(1, count)]
    return [group for group in groups if len(group) >= 3]


def _person_sized(points_B: FloatArray) -> bool:
    spans = np.ptp(points_B[:, :2] - points_B[:, :2].mean(axis=0), axis=0)
    width = float(np.hypot(*spans))
    tall = float(np.ptp(points_B[:, 2])) > 0.1
    return len(points_B) >= _FEWEST_POINTS and _WIDTH_M[0] < width < _WIDTH_M[1] and tall


def _alone(points_B: FloatArray, others: list[FloatArray]) -> bool:
    """Whether no other cluster is close; walls and cupboards seldom stand alone."""
    centre = points_B[:, :2].mean(axis=0)
    reach = float(np.max(np.linalg.norm(points_B[:, :2] - centre, axis=1))) + _ALONE_M
    return all(float(np.min(np.linalg.norm(other[:, :2] - centre, axis=1))) > reach for other in others)


def _axis(points_B: FloatArray) -> SeenPerson:
    """The axis: a little behind the middle of the front that is seen."""
    centre = points_B[:, :2].mean(axis=0)
    behind = centre + _FRONT_TO_AXIS_M * centre / max(float(np.linalg.norm(centre)), 1e-6)
    return SeenPerson(float(behind[0]), float(behind[1]))


def person_in_world(person: SeenPerson, X_WB: RigidTransform) -> tuple[float, float]:
    """The person's axis in the world frame."""
    p_W = X_WB @ np.array([person.x_m, person.y_m, 0.0])
    return float(p_W[0]), float(p_W[1])
