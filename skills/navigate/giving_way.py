"""Right of way among robots: reserved paths as obstacles, where to stop before them, and waiting poses off them.

Prioritised planning (Erdmann and Lozano-Perez, "On Multiple Moving Objects", 1987) with the inherited priority of PIBT
(Okumura, Machida, Defago and Tamura, "Priority Inheritance with Backtracking for Iterative Multi-Agent Path Finding",
2022): a robot with priority reserves its path even through a robot with lower priority, which then has to clear it.
Where that robot cannot, the two swap priorities. Waiting poses lie off all reserved paths.
"""

import enum
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.api import FreeSpace, SkillContext
from skills.footprint import (
    SAFE_MARGIN_M,
    Footprint,
    NoObstacles,
    clearance_on_grid,
    footprint_clearance_m,
    pose_array,
    with_outlines,
)
from skills.path import LocalController, progress_m
from skills.quantities import Count, Delay, Length, Margin
from skills.robot import FloatArray, Pose2D
from skills.world_model import Neighbour

_PATH_STEP_M = 0.12
"""Distance between the poses by which a reserved path is avoided."""
_CELL_M = 0.1
_YAWS = 8
"""Headings that are tried at each waiting position."""
_SLACK_M = 0.03
_UNSURE_M = 0.04
"""Growth of another robot's outline, for the errors of both poses."""
_AT_ONCE = 200
"""Positions that are checked in one call of the costmap."""
_BESIDE_TRIED_M = 0.6
_ABOUT_M = 1.2
_BODY_M = 0.3


@dataclass(frozen=True)
class GivingWayOptions:
    """Right of way: distances between outlines (m), times on the robot's clock (s).

    `apart_m` and `short_m`: the robot stops `short_m` before its path comes within `apart_m` of a reserved path.
    `room_m`, `room_look_m` and `patience_s`: a robot with priority waits, for `patience_s` at most, for a robot that
    must make way and stands within `room_m` of the next `room_look_m` of its path; then the two swap priorities.
    `aside_m`, `reach_m` and `places`: a waiting pose lies `aside_m` off reserved paths within `reach_m`; at most
    `places` are tried. `again_s`: time between plans. `blocked_patience_s`: the skill fails after waiting this long for
    other robots.
    """

    apart_m: Margin = 0.15
    short_m: Length = 0.25
    look_m: Length = 3.0
    room_m: Margin = 0.12
    room_look_m: Length = 0.9
    patience_s: Delay = 20.0
    blocked_patience_s: Delay = 60.0
    aside_m: Margin = 0.25
    reach_m: Length = 9.0
    places: Count = 3
    again_s: Delay = 1.5


class Avoided(enum.Enum):
    """Parts of the other robots that a plan avoids, besides the obstacles in the costmap."""

    PATHS = "paths"  # their bodies, and their reserved paths with priority over this robot
    BODIES = "bodies"  # their bodies: the robot stops before a reserved path
    WORKING = "working"  # only the bodies of robots that do not clear a reserved path


class GivingWay:
    """Right of way during one navigation; without other robots, nothing restricts it."""

    def __init__(self, context: SkillContext, options: GivingWayOptions) -> None:
        self._traffic, self._options = context.traffic, options
        self._clock = context.clock
        self._waiting_since_s: float | None = None

    def begin(self) -> None:
        """Claims a rank in the order of the robots."""
        self._traffic.release()
        self._traffic.claim()

    def reserve_path(self, follower: LocalController, footprint: Footprint) -> None:
        """Reserves the rest of the path."""
        self._traffic.announce(follower.ahead(math.inf), footprint.discs)

    def reserve_poses(self, footprint: Footprint, *poses: Pose2D) -> None:
        """Reserves only the pose where the robot stands, and the goal while no path leads to it.

        Then a robot with lower priority steps aside.
        """
        self._traffic.announce(pose_array(poses), footprint.discs)

    def others(self) -> Sequence[Neighbour]:
        """All other robots that have reported recently."""
        return self._traffic.others()

    def robots_with_priority(self) -> Sequence[Neighbour]:
        """The other robots that have a path and priority over this one."""
        return [one for one in self._traffic.others() if one.first and one.path is not None]

    def costmap(self, costmap: FreeSpace, avoided: Avoided) -> FreeSpace:
        """The costmap with the bodies, and where `avoided` says so the reserved paths, of other robots as obstacles."""
        others = [one for one in self._traffic.others() if avoided is not Avoided.WORKING or not _will_move(one)]
        with_others = with_outlines(costmap, [(one.discs, one.pose[None, :]) for one in others], _UNSURE_M)
        if avoided is not Avoided.PATHS:
            return with_others
        return with_outlines(with_others, [(one.discs, _thinned(one)) for one in self.robots_with_priority()])

    def less_avoided(self, avoided: Avoided) -> Avoided | None:
        """The next smaller set to avoid after no path was found; None when avoiding less would not help."""
        if avoided is Avoided.PATHS and self.robots_with_priority():
            return Avoided.BODIES
        if avoided is not Avoided.WORKING and any(_will_move(one) for one in self._traffic.others()):
            return Avoided.WORKING
        return None

    def let_pass(self, names: Sequence[str]) -> None:
        """Swaps priorities with robots for which this one cannot make way."""
        for name in names:
            self._traffic.let_pass(name)

    def conflict_m(self, follower: LocalController, footprint: Footprint) -> tuple[float, str] | None:
        """Distance (m) along the path to the first reserved path, and its robot's name; None when there is none."""
        ahead = follower.ahead(self._options.look_m)
        found: tuple[float, str] | None = None
        for one in self.robots_with_priority():
            paths = with_outlines(NoObstacles(), [(one.discs, _thinned(one))])
            met = np.flatnonzero(footprint_clearance_m(paths, footprint, ahead) < self._options.apart_m)
            if len(met):
                met_m = float(progress_m(ahead)[met[0]])
                found = (met_m, one.name) if found is None or met_m < found[0] else found
        return found

    def robot_to_wait_for(self, follower: LocalController, footprint: Footprint) -> str | None:
        """Name of the robot ahead that must make way and for which this one waits; None when there is none.

        Swaps priorities with a robot that takes longer than `patience_s`.
        """
        ahead = follower.ahead(self._options.room_look_m)
        for one in (one for one in self._traffic.others() if one.yields):
            body = with_outlines(NoObstacles(), [(one.discs, one.pose[None, :])])
            clearance = footprint_clearance_m(body, footprint, ahead)
            if clearance.min() < min(self._options.room_m, float(clearance[0]) - 0.02):
                now_s = self._clock.now()
                since_s = self._waiting_since_s = self._waiting_since_s or now_s
                if now_s - since_s < self._options.patience_s:
                    return one.name
                self.let_pass([one.name])
                return None
        self._waiting_since_s = None
        return None

    def another_drives(self) -> bool:
        """Returns whether another robot has a path."""
        return any(one.path is not None for one in self._traffic.others())

    def is_robot(self, place_W: tuple[float, float]) -> bool:
        """Returns whether a point (x, y) lies on another robot's body or just outside it."""
        bodies = self.costmap(NoObstacles(), Avoided.BODIES)
        return bool(bodies.clearance_m(np.array([place_W]))[0] < _BODY_M)

    def name_at(self, place_W: tuple[float, float] | None) -> str | None:
        """Name of the robot near a point (x, y); None when no robot is near the point."""
        about = (one for one in self.others() if place_W and math.dist(place_W, one.pose[:2].tolist()) < _ABOUT_M)
        return next((one.name for one in about), None)

    def blocked_robots(self, here: Pose2D, footprint: Footprint) -> Sequence[str]:
        """Names of the robots whose reserved path this robot blocks."""
        names, pose = [], pose_array([here])
        for one in self.robots_with_priority():
            path = with_outlines(NoObstacles(), [(one.discs, _thinned(one)[1:])])
            if footprint_clearance_m(path, footprint, pose)[0] < self._options.apart_m:
                names.append(one.name)
        return names

    def waiting_pose(
        self, costmap: FreeSpace, footprint: Footprint, here: Pose2D, tried: Sequence[Pose2D] = ()
    ) -> Pose2D | None:
        """The nearest reachable pose off all reserved paths and away from the `tried` poses; None without any."""
        paths = with_outlines(NoObstacles(), [(one.discs, _thinned(one)) for one in self.robots_with_priority()])
        return pose_aside(self.costmap(costmap, Avoided.BODIES), paths, footprint, here, self._options, tried)


def pose_aside(
    costmap: FreeSpace,
    paths: FreeSpace,
    footprint: Footprint,
    here: Pose2D,
    options: GivingWayOptions,
    tried: Sequence[Pose2D] = (),
) -> Pose2D | None:
    """The nearest reachable pose clear of `paths`; None when there is none (see `GivingWay.waiting_pose`)."""
    n = int(2.0 * options.reach_m / _CELL_M) + 1
    axis = np.linspace(-options.reach_m, options.reach_m, n)
    xs, ys = here.x_m + axis, here.y_m + axis
    x, y = np.meshgrid(xs, ys)
    free = clearance_on_grid(costmap, xs, ys) > footprint.inscribed_m + SAFE_MARGIN_M
    aside = clearance_on_grid(paths, xs, ys) > footprint.inscribed_m + options.aside_m
    for other in tried:
        aside &= np.hypot(x - other.x_m, y - other.y_m) > _BESIDE_TRIED_M
    yaws = here.yaw_rad + np.arange(_YAWS) * (2.0 * math.pi / _YAWS)

    def suits(places: FloatArray) -> Pose2D | None:
        poses = np.column_stack([np.repeat(places, _YAWS, axis=0), np.tile(yaws, len(places))])
        clear = footprint_clearance_m(costmap, footprint, poses) > SAFE_MARGIN_M + _SLACK_M
        good = np.flatnonzero(clear & (footprint_clearance_m(paths, footprint, poses) > options.aside_m))
        return Pose2D(*poses[good[0]].tolist()) if len(good) else None

    cells = [cell for cell in reachable_cells(free, (n // 2, n // 2)) if aside[cell] and sum(cell) % 2 == 0]
    rows, columns = np.array(cells, dtype=np.int64).reshape(-1, 2).T
    return first_suitable_pose(np.column_stack([x[rows, columns], y[rows, columns]]), suits)


def reachable_cells(free: NDArray[np.bool_], begin: tuple[int, int]) -> list[tuple[int, int]]:
    """Cells (row, column) that free cells connect to `begin`, nearest first; `begin` itself counts as free."""
    seen, order, queue = {begin}, [begin], deque([begin])
    rows, columns = free.shape
    while queue:
        row, column = queue.popleft()
        for cell in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if cell not in seen and 0 <= cell[0] < rows and 0 <= cell[1] < columns and free[cell]:
                seen.add(cell)
                order.append(cell)
                queue.append(cell)
    return order


def first_suitable_pose(places_W: FloatArray, suits: Callable[[FloatArray], Pose2D | None]) -> Pose2D | None:
    """The first pose that `suits` returns for positions (N, 2), evaluated in batches; None when no position suits."""
    for begin in range(0, len(places_W), _AT_ONCE):
        if (place := suits(places_W[begin : begin + _AT_ONCE])) is not None:
            return place
    return None


def _will_move(one: Neighbour) -> bool:
    """Returns whether a robot drives along a path, or clears a reserved path."""
    return one.yields or (one.first and one.path is not None)


def _thinned(one: Neighbour) -> FloatArray:
    """The robot's pose and the poses of its remaining path, thinned out."""
    path = one.path if one.path is not None else np.empty((0, 3))
    chosen, last_m = [one.pose], -math.inf
    for pose, at_m in zip(path, progress_m(path), strict=True):
        if at_m - last_m >= _PATH_STEP_M:
            chosen.append(pose)
            last_m = float(at_m)
    return np.vstack([*chosen, path[-1:]])
