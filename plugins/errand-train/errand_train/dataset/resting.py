"""Stable poses of an object on a plane, by the faces of its convex hull."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial import ConvexHull

from errand_train.dataset.objects import ObjectModel
from errand_train.dataset.objects.model import read_model
from skills.robot import FloatArray

LEAST_MARGIN = 0.05
_UPRIGHT = {"person": 1.0, "extinguisher": 0.9, "beer": 0.7, "coke": 0.72, "cylinder": 0.6}
TOPPLED_SHARE: Final = 0.75
"""Factor by which objects stand less often in training pictures than usual."""


@dataclass(frozen=True)
class Resting:
    """Rotation that lays an object on a plane, height of its origin over the plane, and stability (0..1).

    `upright` says whether the model's own z axis points up.
    """

    R: FloatArray
    height_m: float
    margin: float
    upright: bool


def resting_poses(model: ObjectModel) -> tuple[Resting, ...]:
    """Finds all stable poses; the upright one comes first if it is stable."""
    return _poses_of(model.folder)


@lru_cache(maxsize=2048)
def _poses_of(folder: Path) -> tuple[Resting, ...]:
    """Caches poses by the folder, so that no triangles stay in memory."""
    model = read_model(folder)
    points, com = model.surface.points, np.array(model.com_m)
    if model.category == "person":
        return (Resting(np.eye(3), -float(points[:, 2].min()), 1.0, True),)
    hull = ConvexHull(points)
    poses = []
    for normal, offset in _faces_below(hull, com):
        margin = _margin(points, hull, normal, offset, com)
        if margin > LEAST_MARGIN:
            poses.append(Resting(_to_down(normal), float((points @ normal).max()), margin, bool(normal[2] < -0.99)))
    if not poses:
        poses = [Resting(np.eye(3), -float(points[:, 2].min()), 0.0, True)]
    return tuple(sorted(poses, key=lambda pose: (not pose.upright, -pose.margin)))


def _faces_below(hull: ConvexHull, com: FloatArray) -> list[tuple[FloatArray, float]]:
    """The distinct planes (outward normal, distance from the origin) under which the centre of mass lies."""
    planes = np.unique(np.round(hull.equations, 4), axis=0)
    heights = -(planes[:, :3] @ com + planes[:, 3])
    feet = com + planes[:, :3] * heights[:, None]
    inside = np.all(feet @ planes[:, :3].T + planes[:, 3] < 1e-4, axis=1)
    return [(plane[:3] / np.linalg.norm(plane[:3]), -float(plane[3])) for plane in planes[inside]]


def _margin(points: FloatArray, hull: ConvexHull, normal: FloatArray, offset: float, com: FloatArray) -> float:
    """Tangent of the least tilt that topples the object off a face; negative when it falls by itself."""
    corners = points[hull.vertices]
    touching = corners[corners @ normal > offset - 4e-4]
    height = offset - float(com @ normal)
    flat = (_to_down(normal) @ touching.T).T[:, :2]
    if len(flat) < 3 or height <= 0 or np.linalg.matrix_rank(flat - flat[0], tol=1e-5) < 2:
        return -1.0
    edge = ConvexHull(flat)
    middle = (_to_down(normal) @ com)[:2]
    inside = -float((edge.equations[:, :2] @ middle + edge.equations[:, 2]).max())
    return inside / height


def _to_down(normal: FloatArray) -> FloatArray:
    """The shortest turn that makes a direction point down."""
    down = np.array([0.0, 0.0, -1.0])
    axis, cosine = np.cross(normal, down), float(normal @ down)
    if np.linalg.norm(axis) < 1e-9:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + K + K @ K / (1 + cosine))


def choose_pose(
    rng: np.random.Generator, model: ObjectModel, poses: Sequence[Resting], *, toppled: bool = False
) -> Resting:
    """Chooses a pose: upright as often as usual for such objects, else by stability.

    With `toppled`, objects except people lie more often than usual, so that training covers it.
    """
    standing = [pose for pose in poses if pose.upright]
    lying = [pose for pose in poses if not pose.upright]
    share = _UPRIGHT.get(model.category, 0.75 if model.class_id == 0 else 0.5)
    share *= TOPPLED_SHARE if toppled and model.category != "person" else 1.0
    group = standing if standing and (not lying or rng.random() < share) else lying or standing
    weights = np.array([pose.margin + 1e-3 for pose in group])
    return group[int(rng.choice(len(group), p=weights / weights.sum()))]
