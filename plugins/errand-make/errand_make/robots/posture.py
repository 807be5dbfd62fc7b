"""Postures in which the chains that no part drives are held: inside the base's outline, clear of the robot."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from errand_make.robots.tree import KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfJoint
from skills.robot import FloatArray

_TRIES: Final = 5000
_STARTS, _NEAR = 8, 40
"""Postures that are made better, and changed postures tried around each at a time."""
_MOST: Final = 400
"""Postures that are returned."""
_WIDTHS: Final = (0.3, 0.2, 0.15, 0.1, 0.1, 0.07, 0.05, 0.05, 0.03, 0.03, 0.02, 0.02)
"""Standard deviations of these changes, as parts of the joints' ranges."""
_STICKS_OUT_M: Final = 0.02
_CLEAR_M: Final = 0.05
"""Least height of a held chain over the floor."""
_INSIDE_M: Final = 0.005
SIDE_WEIGHTS: Final = np.array([1.0, 4.0])
"""Costs of a metre beyond the outline, ahead or behind, and to a side, which decides what doors the robot passes."""
_HIT: Final = 3.0
"""Cost of a chain whose points are all inside the robot, in metres beyond the outline."""
_UP: Final = 0.05
_BENT: Final = 0.01
_FREE_JOINTS: Final = 2
"""Joints at a chain's root whose bodies overlap the robot's by their design."""


def held_postures(
    tree: KinematicTree,
    chain: Sequence[UrdfJoint],
    others: FloatArray,
    ground_m: float,
    *,
    leave: Collection[str] = (),
) -> FloatArray:
    """Positions (K, J) of a chain, the best first, that stick out of `others` (N, 3) and hit things as little as found.

    They are the zero posture alone unless that sticks out. The links `leave` will be elsewhere.
    """
    zero = np.array([each.clipped(0.0) for each in chain])
    low, high = outline(others)
    search = _Search(tree, chain, (low, high), ground_m, leave)
    if search.overhang(zero[None])[0] <= _STICKS_OUT_M:
        return zero[None]
    lower, upper = (np.array([getattr(each, side) for each in chain]) for side in ("lower", "upper"))
    lower, upper = np.maximum(lower, -np.pi), np.maximum(np.minimum(upper, np.pi), np.maximum(lower, -np.pi))
    rng = np.random.default_rng(0)
    tries = lower + rng.random((_TRIES, len(chain))) * (upper - lower)
    tries[0] = zero
    near = tries[np.argsort(search.cost(tries, zero))[:_STARTS]]
    found = list[FloatArray]()
    for width in _WIDTHS:
        steps = rng.normal(size=(_NEAR, *near.shape)) * width * (upper - lower)
        groups = np.concatenate([near[None], np.clip(near + steps, lower, upper)])
        costs = search.cost(groups.reshape(-1, len(chain)), zero).reshape(groups.shape[:2])
        near = groups[np.argmin(costs, axis=0), np.arange(len(near))]
        found.append(groups)
    best = [
        each[np.argsort(search.cost(each, zero))[: _MOST // _STARTS]] for each in np.concatenate(found).swapaxes(0, 1)
    ]
    every = np.concatenate(best)
    return np.asarray(every[np.argsort(search.cost(every, zero))])


def outline(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest x and y of points."""
    return points[:, :2].min(axis=0), points[:, :2].max(axis=0)


class Obstacle:
    """Box from `low` to `high` (3,) in the frame of a link L."""

    def __init__(self, X_BL: RigidTransform, low: FloatArray, high: FloatArray) -> None:
        self._X_LB, self._low, self._high = X_BL.inverse(), low, high
        corners = X_BL @ np.stack(np.meshgrid(*np.stack([low, high], axis=1)), axis=-1).reshape(-1, 3).T
        self._bounds = list(zip(corners.min(axis=1), corners.max(axis=1), strict=True))
        self._is_empty = bool((low >= high).any())

    def contained(self, columns: FloatArray) -> NDArray[np.intp]:
        """Indices of the points (3, N) in B that are in the box: first those in its bounds, then exactly."""
        near = np.arange(0 if self._is_empty else columns.shape[1])
        for column, (low, high) in zip(columns, self._bounds, strict=True):
            values = column[near]
            near = near[(values > low) & (values < high)]
        points_L = (self._X_LB @ columns[:, near]).T
        return np.asarray(near[((points_L > self._low) & (points_L < self._high)).all(axis=1)])


class _Search:
    """Costs of the postures of a chain."""

    def __init__(
        self,
        tree: KinematicTree,
        chain: Sequence[UrdfJoint],
        within: tuple[FloatArray, FloatArray],
        ground_m: float,
        leave: Collection[str],
    ) -> None:
        self._tree, self._chain, self._ground_m = tree, chain, ground_m
        self._low, self._high = within
        bodies = [{each.child for each in tree.below(joint)} for joint in chain] + [set[str]()]
        links = [[link for body in one - two for link in tree.links_of[body]] for one, two in pairwise(bodies)]
        self._points = [
            _box_of((tree.X_BL[joint.child].inverse() @ tree.points(each).T).T)
            for joint, each in zip(chain, links, strict=True)
        ]
        carried = {*leave, *(link for each in links for link in each)}
        self._obstacles = [
            Obstacle(tree.X_BL[link], points.min(axis=0) + _INSIDE_M, points.max(axis=0) - _INSIDE_M)
            for link in tree.urdf.links
            if link not in carried and len(points := tree.local_points(link))
        ]

    def _bodies(self, q: FloatArray) -> list[FloatArray]:
        """Points (Q, N, 3) of each body of the chain in B, at Q postures."""
        found = list[FloatArray]()
        R, p = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
        X_BL, before = self._tree.X_BL, None
        for k, joint in enumerate(self._chain):
            X = self._tree.frame(joint) if before is None else X_BL[before].inverse() @ self._tree.frame(joint)
            p, R = p + R @ X.translation(), R @ X.rotation().matrix()
            if joint.kind == "prismatic":
                p = p + np.einsum("qij,qj->qi", R, q[:, k, None] * joint.axis)
            else:
                R = R @ _turns(joint.axis, q[:, k])
            turned = (R.reshape(-1, 3) @ self._points[k].T).reshape(len(q), 3, -1)
            found.append(p[:, None] + turned.transpose(0, 2, 1))
            before = joint.child
        return found

    def overhang(self, q: FloatArray) -> FloatArray:
        """Distances (Q,) by which postures stick out of the outline, or come too near to the floor."""
        points = np.concatenate(self._bodies(q), axis=1)
        return self._overhang(points)

    def _overhang(self, points: FloatArray) -> FloatArray:
        if not points.shape[1]:
            return np.zeros(len(points))
        sides = np.maximum(points[..., :2] - self._high, self._low - points[..., :2]).max(axis=1)
        beyond = np.maximum(sides, 0.0) @ SIDE_WEIGHTS
        below = self._ground_m + _CLEAR_M - points[..., 2].min(axis=1)
        return np.asarray(np.maximum(0.0, np.maximum(beyond, 2.0 * below)))

    def cost(self, q: FloatArray, zero: FloatArray) -> FloatArray:
        """Costs (Q,) of postures: overhang, contacts, height and distance from zero."""
        bodies = self._bodies(q)
        points = np.concatenate(bodies, axis=1)
        outer = np.concatenate([points[:, :0], *bodies[_FREE_JOINTS:]], axis=1)
        hits, many = np.zeros(len(q)), outer.shape[1]
        columns = np.ascontiguousarray(outer.reshape(-1, 3).T)
        for obstacle in self._obstacles if many else ():
            inside = obstacle.contained(columns)
            hits += np.bincount(inside // many, minlength=len(q)) / many
        top = points[..., 2].max(axis=1) if points.shape[1] else hits
        return np.asarray(self._overhang(points) + _HIT * hits + _UP * top + _BENT * np.abs(q - zero).sum(axis=1))


def _box_of(points: FloatArray) -> FloatArray:
    """Corners and middle of the box about points, and the middles of its sides; none for no points."""
    if not len(points):
        return points
    low, high = points.min(axis=0), points.max(axis=0)
    shares = np.stack(np.meshgrid(*[[0.0, 0.5, 1.0]] * 3), axis=-1).reshape(-1, 3)
    return np.asarray(low + (high - low) * shares)


def _turns(axis: FloatArray, angles: FloatArray) -> FloatArray:
    """Rotations (Q, 3, 3) about an axis."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sin * K + (1.0 - cos) * (K @ K))


def positions(joints: Sequence[UrdfJoint], posture: Mapping[str, float]) -> dict[str, float]:
    """Positions by name at which joints are held: those of a posture, else 0 or the nearest limit."""
    return {each.name: round(float(posture.get(each.name, each.clipped(0.0))), 4) for each in joints}
