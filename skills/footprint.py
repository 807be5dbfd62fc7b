"""The robot's outline as discs, and its clearance from the obstacles in a costmap.

A wrapped costmap adds obstacles: discs about people, outlines of other robots, closed doors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skills.compiled import compiled
from skills.robot import BaseKind, Capabilities, FloatArray, Pose2D
from skills.world_model import FreeSpace

SAFE_MARGIN_M = 0.06
"""Clearance (m) of a standing or driven pose that covers map and tracking errors."""


@dataclass(frozen=True)
class Footprint:
    """Outline of the robot in the body frame, as discs: rows of x, y, radius (m), with the kind of base.

    The discs lie inside the outline, with radius 0 at the corners, so their common clearance equals that of the
    rectangle within about a centimetre. Further discs cover what overhangs the rectangle; `beyond` names it in
    messages.
    """

    discs: FloatArray
    length_m: float
    width_m: float
    base_kind: BaseKind = BaseKind.OMNIDIRECTIONAL
    beyond: str = ""

    @staticmethod
    def of(capabilities: Capabilities) -> Footprint:
        """Creates the footprint of a robot without its arm (see `skills.navigate.arm_footprint`)."""
        outline = Footprint.round(capabilities.footprint_m) or Footprint.rectangle(capabilities.footprint_m)
        return replace(outline, base_kind=capabilities.base_kind)

    @staticmethod
    def round(corners: Sequence[tuple[float, float]]) -> Footprint | None:
        """Creates one disc about the body's origin if at least eight corners (x, y) lie on a circle; else None."""
        distances = np.hypot(*np.transpose(corners))
        radius = float(distances.max())
        if len(corners) < 8 or float(distances.min()) < 0.97 * radius:
            return None
        return Footprint(np.array([[0.0, 0.0, radius]]), 2.0 * radius, 2.0 * radius)

    def with_discs(self, discs: FloatArray, beyond: str) -> Footprint:
        """This footprint with further discs; `beyond` names what they cover."""
        return replace(self, discs=np.vstack([self.discs, discs]), beyond=beyond)

    @staticmethod
    def rectangle(corners: Sequence[tuple[float, float]]) -> Footprint:
        """Creates the bounding rectangle of the outline's corners (x, y)."""
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        length, width = (float(v) for v in high - low)
        middle, long_axis = (low + high) / 2.0, 0 if length >= width else 1
        radius = min(length, width) / 2.0
        small = 0.3 * radius
        reach = max(length, width) / 2.0 - radius
        row = np.linspace(-reach, reach, max(2, math.ceil(2.0 * reach / (0.6 * radius)) + 1))
        discs = [(t, 0.0, radius) if long_axis == 0 else (0.0, t, radius) for t in row]
        signs = [(sx, sy) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)]
        discs += [(sx * (length / 2.0 - small), sy * (width / 2.0 - small), small) for sx, sy in signs]
        discs += [(sx * length / 2.0, sy * width / 2.0, 0.0) for sx, sy in signs]
        return Footprint(np.array(discs) + np.array([*middle, 0.0]), length, width)

    @property
    def inscribed_m(self) -> float:
        """Radius (m) of the largest inscribed disc."""
        return min(self.length_m, self.width_m) / 2.0

    @cached_property
    def circumscribed_m(self) -> float:
        """Distance (m) from the body's origin to the farthest corner."""
        return float(np.max(np.hypot(self.discs[:, 0], self.discs[:, 1]) + self.discs[:, 2]))

    @property
    def extent_m(self) -> tuple[float, float]:
        """Length and width (m) over all discs."""
        low = np.min(self.discs[:, :2] - self.discs[:, 2:], axis=0)
        length, width = np.max(self.discs[:, :2] + self.discs[:, 2:], axis=0) - low
        return float(length), float(width)


def pose_array(poses: Sequence[Pose2D]) -> FloatArray:
    """Poses as rows x, y, yaw."""
    return np.array([(p.x_m, p.y_m, p.yaw_rad) for p in poses], dtype=np.float64).reshape(-1, 3)


@compiled
def disc_centres(discs: FloatArray, poses: FloatArray) -> FloatArray:
    """World (x, y) of all discs (N, discs, 2) at poses (N, 3)."""
    centres = np.empty((poses.shape[0], discs.shape[0], 2))
    for n in range(poses.shape[0]):
        c, s = math.cos(poses[n, 2]), math.sin(poses[n, 2])
        for k in range(discs.shape[0]):
            centres[n, k, 0] = poses[n, 0] + c * discs[k, 0] - s * discs[k, 1]
            centres[n, k, 1] = poses[n, 1] + s * discs[k, 0] + c * discs[k, 1]
    return centres


@compiled
def outline_distances_m(discs: FloatArray, poses: FloatArray, points_W: FloatArray) -> FloatArray:
    """Distances (N, M) in metres from the outline at poses (N, 3) to points (M, 2)."""
    centres, least = disc_centres(discs, poses), np.full((poses.shape[0], points_W.shape[0]), np.inf)
    for n in range(poses.shape[0]):
        for k in range(discs.shape[0]):
            for m in range(points_W.shape[0]):
                x, y = centres[n, k, 0] - points_W[m, 0], centres[n, k, 1] - points_W[m, 1]
                least[n, m] = min(least[n, m], math.sqrt(x * x + y * y) - discs[k, 2])
    return least


def footprint_clearance_m(costmap: FreeSpace, footprint: Footprint, poses: FloatArray) -> FloatArray:
    """Distance (m) from the outline to the nearest obstacle at (N, 3) poses x, y, yaw; negative in collision."""
    centres = disc_centres(footprint.discs, np.ascontiguousarray(poses))
    clearance = costmap.clearance_m(centres.reshape(-1, 2)).reshape(centres.shape[:2])
    return np.asarray(np.min(clearance - footprint.discs[:, 2], axis=1))


def footprint_clear(costmap: FreeSpace, footprint: Footprint, pose: Pose2D, margin_m: float = SAFE_MARGIN_M) -> bool:
    """Returns whether the robot can stand at a pose with at least margin_m of clearance."""
    return bool(footprint_clearance_m(costmap, footprint, pose_array([pose]))[0] >= margin_m)


class ClearanceField(NamedTuple):
    """Clearance (m) sampled at points (x0_m + column * cell_m, y0_m + row * cell_m), with the footprint's discs."""

    values: NDArray[np.float32]
    cell_m: float
    x0_m: float
    y0_m: float
    discs: FloatArray


def clearance_on_grid(costmap: FreeSpace, xs: FloatArray, ys: FloatArray) -> FloatArray:
    """Clearance (rows, columns) in metres at the points of a grid with these x and y."""
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    return costmap.clearance_m(points).reshape(len(ys), len(xs))


@compiled
def clearance_at(field: ClearanceField, x: float, y: float, yaw: float) -> float:
    """Clearance (m) of the footprint at one pose; -1 outside the sampled field."""
    values, discs = field.values, field.discs
    cells = 1.0 / field.cell_m
    c, s = math.cos(yaw) * cells, math.sin(yaw) * cells
    u0, v0 = (x - field.x0_m) * cells, (y - field.y0_m) * cells
    rows, columns = values.shape
    least = 1e9
    for n in range(discs.shape[0]):
        u = u0 + c * discs[n, 0] - s * discs[n, 1]
        v = v0 + s * discs[n, 0] + c * discs[n, 1]
        if not (0.0 <= u < columns - 1.0 and 0.0 <= v < rows - 1.0):
            return -1.0
        i, j = int(v), int(u)
        a, b = u - j, v - i
        low = values[i, j] + a * (values[i, j + 1] - values[i, j])
        high = values[i + 1, j] + a * (values[i + 1, j + 1] - values[i + 1, j])
        least = min(least, low + b * (high - low) - discs[n, 2])
    return least


_ROUND_UP_M = 0.02
_FAR_M = 1.5
"""Distance beyond which an outline does not count as an obstacle."""


@dataclass(frozen=True)
class WithObstacles:
    """Costmap with further obstacles; `distance_m` maps points (N, 2) to their distance from the nearest of these."""

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
    """The costmap with discs as obstacles: rows of x, y and radius (m)."""

    def distance_m(points: FloatArray) -> FloatArray:
        offsets = points[:, None, :] - discs_W[None, :, :2]
        return np.asarray(np.min(np.linalg.norm(offsets, axis=2) - discs_W[None, :, 2], axis=1))

    return WithObstacles(costmap, distance_m)


def with_segments(
    costmap: FreeSpace, segments_W: Sequence[tuple[FloatArray, FloatArray, float]], radius_m: float
) -> FreeSpace:
    """The costmap with segments grown by radius_m as obstacles: centre (2,), unit direction (2,) and length (m)."""

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
    """The costmap with outlines (discs, as in `Footprint`) as obstacles at poses (N, 3), each grown by larger_m.

    Radii are rounded up to 2 cm. Outlines farther away than 1.5 m are ignored.
    """
    for discs, poses in outlines:
        steps = np.ceil(discs[:, 2] / _ROUND_UP_M - 1e-6)
        for step in np.unique(steps):
            same = discs[steps == step]
            costmap = WithObstacles(costmap, _distance_from(same, poses, float(same[:, 2].max()) + larger_m))
    return costmap


def _distance_from(discs: FloatArray, poses: FloatArray, radius_m: float) -> Callable[[FloatArray], FloatArray]:
    """Distance from points to discs of one radius at poses; infinite beyond _FAR_M."""
    from scipy.spatial import cKDTree

    tree, most_m = cKDTree(disc_centres(discs, poses).reshape(-1, 2)), radius_m + _FAR_M

    def distance_m(points: FloatArray) -> FloatArray:
        near = np.all((points > tree.mins - most_m) & (points < tree.maxes + most_m), axis=1)
        distances = np.full(len(points), np.inf)
        distances[near] = tree.query(points[near], distance_upper_bound=most_m)[0] - radius_m
        return distances

    return distance_m
