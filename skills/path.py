"""Planned paths: closely spaced poses, their planners and controllers, and the smoothing of a lattice path.

Smoothing takes shortcuts, then relaxes the path like an elastic band; every step checks the clearance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from skills.compiled import compiled
from skills.footprint import clearance_at
from skills.motion_cost import TURNING_RADIUS_M, Space, clearance_needed, drive_cost, segment_cost, zone_factor
from skills.robot import FloatArray, Pose2D

if TYPE_CHECKING:
    from skills.footprint import Footprint
    from skills.world_model import FreeSpace, WorkCounter
    from skills.zone_map import ZoneMap

TURN_M_PER_RAD = 0.4
"""Metres of progress along a path for a turn of one radian."""


@dataclass(frozen=True)
class Path:
    """Poses (N, 3) x, y (m), yaw (rad, continuous, not wrapped) in the world frame, spaced by a few centimetres.

    `clearance_m` (N,) is the footprint's clearance at each pose at planning time.
    """

    poses: FloatArray
    clearance_m: FloatArray

    def __post_init__(self) -> None:
        if self.poses.ndim != 2 or self.poses.shape[1] != 3 or len(self.poses) < 1:
            raise ValueError("Path: poses must be (N, 3) with at least one row")

    @property
    def start(self) -> Pose2D:
        """The first pose."""
        return Pose2D(*self.poses[0].tolist())

    @property
    def goal(self) -> Pose2D:
        """The last pose."""
        return Pose2D(*self.poses[-1].tolist())

    def progress_m(self) -> FloatArray:
        """Distance (m) along the path up to each pose (N,); a radian counts as TURN_M_PER_RAD."""
        return progress_m(self.poses)


def progress_m(poses: FloatArray) -> FloatArray:
    """Distance (m) along poses (N, 3) with continuous yaw, up to each pose (N,); a radian counts as TURN_M_PER_RAD."""
    steps = np.diff(poses, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1]) + TURN_M_PER_RAD * np.abs(steps[:, 2])
    return np.concatenate([[0.0], np.cumsum(lengths)])[: len(poses)]


def path_length(path: Path) -> float:
    """Length (m) of a path without its turns."""
    steps = np.diff(path.poses[:, :2], axis=0)
    return float(np.sum(np.hypot(steps[:, 0], steps[:, 1])))


@compiled
def shortcut(space: Space, poses: FloatArray, window: int, sideways: bool) -> FloatArray:
    """The cheapest subset of poses (N, 3) that straight lines can join; each line skips at most `window` poses.

    The first and the last pose stay; yaws must be continuous. A base that cannot move sideways turns to each line
    first.
    """
    count = poses.shape[0]
    best = np.full(count, np.inf)
    came = np.full(count, -1, dtype=np.int64)
    best[0] = 0.0
    for j in range(1, count):
        for i in range(max(0, j - window), j):
            need = clearance_needed(space, poses[i, 0], poses[i, 1])
            if sideways:
                cost = segment_cost(space, poses[i], poses[j], need)
            else:
                cost = drive_cost(space, poses[i], poses[j], need)[0]
            if j - i == 1:
                cost = min(cost, 1e6)
            if best[i] + cost < best[j]:
                best[j], came[j] = best[i] + cost, i
    chosen = np.zeros(count, dtype=np.bool_)
    j = count - 1
    while j >= 0:
        chosen[j] = True
        j = came[j]
    return poses[chosen]


@compiled
def densify(poses: FloatArray, step_m: float) -> FloatArray:
    """The same path with poses at most step_m apart (a radian counting 0.6 m)."""
    counts = np.empty(len(poses) - 1, dtype=np.int64)
    for n in range(len(counts)):
        length = math.hypot(poses[n + 1, 0] - poses[n, 0], poses[n + 1, 1] - poses[n, 1])
        counts[n] = max(1, math.ceil((length + TURNING_RADIUS_M * abs(poses[n + 1, 2] - poses[n, 2])) / step_m))
    dense = np.empty((counts.sum() + 1, 3))
    dense[0], row = poses[0], 1
    for n in range(len(counts)):
        for k in range(1, counts[n] + 1):
            dense[row] = poses[n] + (k / counts[n]) * (poses[n + 1] - poses[n])
            row += 1
    return dense


@compiled
def relax(space: Space, poses: FloatArray, rounds: int, margin_m: float, wide_m: float) -> FloatArray:
    """Pulls poses between their neighbours, turns them along the path, pushes them off obstacles nearer than wide_m.

    Both ends stay. A pose moves only where its clearance stays above margin_m or does not decrease.
    """
    poses = poses.copy()
    count, clearance = poses.shape[0], clearances(space, poses)
    for _ in range(rounds):
        for n in range(1, count - 1):
            x = 0.5 * poses[n, 0] + 0.25 * (poses[n - 1, 0] + poses[n + 1, 0])
            y = 0.5 * poses[n, 1] + 0.25 * (poses[n - 1, 1] + poses[n + 1, 1])
            yaw = 0.5 * poses[n, 2] + 0.25 * (poses[n - 1, 2] + poses[n + 1, 2])
            yaw += 0.1 * _off_course(poses, n, yaw)
            if clearance[n] < wide_m:
                gx, gy = _uphill(space, x, y, yaw)
                push = 0.02 * (wide_m - clearance[n]) / wide_m
                x, y = x + push * gx, y + push * gy
            new = clearance_at(space.field, x, y, yaw)
            if new >= min(margin_m, clearance[n]) and not _dearer(space, poses, n, x, y):
                poses[n, 0], poses[n, 1], poses[n, 2], clearance[n] = x, y, yaw, new
    return poses


@compiled
def _dearer(space: Space, poses: FloatArray, n: int, x: float, y: float) -> bool:
    """Returns whether zones raise the cost of the motions to and from a pose once that pose moves to (x, y)."""
    if space.zones.factor.shape[0] == 0:
        return False
    before, after = 0.0, 0.0
    for k, sign in ((n - 1, 1.0), (n + 1, -1.0)):
        px, py = poses[k, 0], poses[k, 1]
        before += zone_factor(space, poses[n, 0], poses[n, 1], sign * (poses[n, 0] - px), sign * (poses[n, 1] - py))
        after += zone_factor(space, x, y, sign * (x - px), sign * (y - py))
        after += zone_factor(space, px, py, sign * (x - px), sign * (y - py))
        before += zone_factor(space, px, py, sign * (poses[n, 0] - px), sign * (poses[n, 1] - py))
    return after > before


@compiled
def _off_course(poses: FloatArray, n: int, yaw: float) -> float:
    """Heading error of `yaw` against the path's direction at a pose; 0 where the path does not lead roughly forward."""
    first, last = max(0, n - 2), min(poses.shape[0] - 1, n + 2)
    dx, dy = poses[last, 0] - poses[first, 0], poses[last, 1] - poses[first, 1]
    if math.hypot(dx, dy) < 0.1:
        return 0.0
    off = (math.atan2(dy, dx) - yaw + math.pi) % (2.0 * math.pi) - math.pi
    return off if abs(off) < 0.8 else 0.0


@compiled
def _uphill(space: Space, x: float, y: float, yaw: float) -> tuple[float, float]:
    """Direction in which the clearance grows: a vector of length up to 1."""
    h = 0.03
    gx = clearance_at(space.field, x + h, y, yaw)
    gx -= clearance_at(space.field, x - h, y, yaw)
    gy = clearance_at(space.field, x, y + h, yaw)
    gy -= clearance_at(space.field, x, y - h, yaw)
    size = max(math.hypot(gx, gy), 2.0 * h)
    return gx / size, gy / size


@compiled
def clearances(space: Space, poses: FloatArray) -> FloatArray:
    """Clearance (m) of the footprint at each pose (N, 3)."""
    values = np.empty(poses.shape[0])
    for n in range(poses.shape[0]):
        values[n] = clearance_at(space.field, poses[n, 0], poses[n, 1], poses[n, 2])
    return values


@dataclass(frozen=True)
class Drive:
    """Command for one tick: body-frame velocity, remaining path (m, turns included), and distance from it (m).

    `blocked_at` is the world (x, y) of the obstacle that blocks the path ahead; None when the path is clear. With
    `halt`, another program moves the base in place of the velocity, until `halt` is called.
    """

    velocity: tuple[float, float, float]
    remaining_m: float
    off_path_m: float
    blocked_at: tuple[float, float] | None
    halt: Callable[[], None] | None = None


class GlobalPlanner(Protocol):
    """Plans paths for the base."""

    def problem(
        self,
        costmap: FreeSpace,
        footprint: Footprint,
        start: Pose2D,
        goal: Pose2D,
        *,
        max_speed_m_s: float,
        work: WorkCounter = ...,
        zones: ZoneMap | None = ...,
    ) -> Callable[[], Path]:
        """Samples the costmap now; returns a function that plans on that sample, in any thread.

        That function raises PlanningError when there is no path, and counts its computations in `work`. `zones` adds
        costs and allowed directions of motion; the costmap already contains the keep-out zones as obstacles.
        """


class LocalController(Protocol):
    """Follows one path."""

    length_m: float

    def command(
        self,
        pose: Pose2D,
        velocity: tuple[float, float, float],
        last: FloatArray,
        costmap: FreeSpace,
        most_m_s: float = np.inf,
    ) -> Drive:
        """Returns the velocity to command at a world pose and body velocity; `last` (3,) is the previous command."""

    def ahead(self, way_m: float) -> FloatArray:
        """Returns the path's poses (N, 3) over the next `way_m`, from the robot's last position on the path."""

    def pose_after(self, way_m: float) -> Pose2D:
        """Returns the path's pose `way_m` beyond the robot's last position on the path."""


class ControllerComponent(Protocol):
    """Builds a controller for each path; a robot farther than `lost_path_m` from the path abandons it.

    `max_speed_m_s` is the controller's own speed limit; infinite when it has none.
    """

    lost_path_m: float
    max_speed_m_s: float = np.inf

    def build(self, path: Path, footprint: Footprint, *, max_speed_m_s: float) -> LocalController:
        """Builds a controller that follows a path."""
