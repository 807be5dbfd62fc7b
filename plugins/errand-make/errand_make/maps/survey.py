"""Survey: the robot maps while it drives to frontiers or along a route."""

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_make.maps.mapper import Mapper
from errand_make.maps.occupancy import Frontier, Ground, LayeredOccupancy
from skills.api import Costmap, PlanningError
from skills.footprint import Footprint, footprint_clearance_m, pose_array
from skills.geometry import relative_pose
from skills.grid_map import GridMap
from skills.path import LocalController
from skills.robot import CommandState, FloatArray, Lease, Pose2D, Robot
from skills.stack import RobotStack, stack_of

_ROUNDS = 1
"""Rounds, once back at the start, in which abandoned frontiers are tried again."""
_FRONTIER_M = 0.3
_FRONTIER_CELLS = 8
"""A frontier counts as explored once fewer cells than this within _FRONTIER_M are unseen near the floor."""
_FAR_STAND_M = 2.5
"""Greatest distance from which a frontier is viewed."""

STACK: Final[Mapping[str, Any]] = {
    "costmap": {"use": "layered", "explained_m": 0.3},
    "planner": {"use": "lattice", "least_margin_m": 0.02},
    "controller": {"use": "path_follower"},
}
"""Components that drive the robot, in the form of a stack file."""


@dataclass(frozen=True)
class SurveyOptions:
    """Options of a survey, in metres, m/s and seconds of the robot's clock.

    Ground counts as explored within `explored_m`. The robot returns to a known place when the standard deviation of its
    position passes `unsure_m`, once `back_after_m` were driven since the last loop. Before a loop is closed, a known
    wall may appear beside its place; `explained_m` of the costmap in STACK allows for that.
    """

    resolution_m: float = 0.05
    explored_m: float = 5.0
    max_speed_m_s: float = 0.7
    margin_m: float = 0.05
    clear_m: float = 0.3
    frontier_m: float = 0.5
    frontier_within_m: float = 1.5
    tried_m: float = 0.6
    route_tolerance_m: float = 0.3
    unsure_m: float = 0.3
    back_after_m: float = 25.0
    refresh_m: float = 0.5
    moved_m: float = 0.04
    around_m: float = 5.0
    low_m: float = 0.3
    refresh_s: float = 1.5
    look_s: float = 0.09
    stuck_s: float = 3.0
    blind_stop_s: float = 1.0
    blind_patience_s: float = 10.0
    stack: RobotStack = field(default_factory=lambda: stack_of(STACK))


_NO_PATH = "no free path leads on or back to the start"


class Purpose(enum.Enum):
    """Purpose of a drive."""

    FRONTIER = "a frontier"
    ROUTE = "the route"
    LOOP = "a known place, to close a loop"
    HOME = "the start"


@dataclass(frozen=True)
class _Goal:
    purpose: Purpose
    pose: Pose2D
    about: tuple[float, float]


class Survey:
    """Survey of a place by one robot. Call `tick` after each advance of the clock until `done`.

    `trouble` is the reason of an early end.
    """

    def __init__(
        self,
        robot: Robot,
        lease: Lease,
        mapper: Mapper,
        *,
        home: Pose2D,
        route: Sequence[tuple[float, float]] | None = None,
        options: SurveyOptions | None = None,
    ) -> None:
        """Explores by frontiers unless there is a `route` (points in the map's frame, m); ends at `home`."""
        self._robot, self._lease, self.mapper = robot, lease, mapper
        self._options = options or SurveyOptions()
        self._home = home
        self._route = None if route is None else list(route)
        self._footprint = Footprint.of(robot.capabilities())
        self.done = False
        self.trouble: str | None = None
        self.notes: list[str] = []
        self._grid = LayeredOccupancy(self._options.resolution_m, self._options.explored_m)
        self._inserted: list[Pose2D] = []
        self._revision = 0
        self._costmap: Costmap | None = None
        self._whole: Costmap | None = None
        self._looked_s = -math.inf
        self._begun_s: float | None = None
        self._refreshed = (-math.inf, -math.inf)
        self._goal: _Goal | None = None
        self._follower: LocalController | None = None
        self._last: FloatArray = np.zeros(3)
        self._tried: list[tuple[float, float]] = []
        self._refused: list[tuple[float, float]] = []
        self._best_m, self._best_s = math.inf, -math.inf
        self._failures = 0
        self._rounds_left, self._given_up = _ROUNDS, False
        self._explored_since_loop = True
        self._closed = 0

    @property
    def goal(self) -> tuple[str, Pose2D] | None:
        """Purpose and goal of the present drive, None when there is none."""
        return None if self._goal is None else (self._goal.purpose.value, self._goal.pose)

    def tick(self, now_s: float) -> None:
        """Takes in the robot's sensor readings and drives on."""
        self.mapper.update(self._robot)
        options = self._options
        if self._blind(now_s) or not self.mapper.keyframes:
            return
        corrected = self.mapper.revision != self._revision
        self._refresh(now_s, force=corrected or self._costmap is None)
        assert self._costmap is not None
        if now_s - self._looked_s > options.look_s:
            self._looked_s = now_s
            self._costmap.update(self._robot, self.mapper.estimate())
        if corrected and self._goal is not None:
            self._whole = options.stack.costmap.build(self.known_grid()[0])
            self._begin(self._goal, now_s)
        if self._goal is None or self._is_explored(self._goal, now_s):
            self._choose(now_s)
        if not self.done:
            self._drive(now_s)

    def stop(self) -> None:
        """Stops the robot."""
        self._last = np.zeros(3)
        self._robot.stop(lease=self._lease)

    def _blind(self, now_s: float) -> bool:
        """Stands while the LiDAR gives no usable scan, and ends when that lasts; returns whether the robot stands."""
        scan = self._robot.scan()
        self._begun_s = now_s if self._begun_s is None else self._begun_s
        seen_s = self._begun_s if scan is None else scan.stamp_s
        since_s = seen_s if now_s - seen_s > self._options.blind_stop_s else self.mapper.blind_since_s
        if since_s is None or now_s - since_s < self._options.blind_stop_s:
            return False
        self.stop()
        if now_s - since_s > self._options.blind_patience_s:
            self.trouble = (
                f"the LiDAR has given no usable scan for {now_s - since_s:.0f} s (none, no returns, repeated, or "
                "unlike everything seen before); the robot stands"
            )
            self.done = True
        return True

    # ---- the map so far

    def _refresh(self, now_s: float, *, force: bool) -> None:
        """Updates the grid for driving, and the costmap about the robot."""
        mapper, options = self.mapper, self._options
        due = mapper.driven_m - self._refreshed[0] > options.refresh_m or now_s - self._refreshed[1] > options.refresh_s
        if not force and not (due and len(self._inserted) < len(mapper.keyframes)):
            return
        if self._moved():
            self._grid, self._inserted = LayeredOccupancy(options.resolution_m, options.explored_m), []
        for index in range(len(self._inserted), len(mapper.keyframes)):
            self._grid.insert(mapper.keyframes[index], mapper.graph.poses[index], stride=2)
            self._inserted.append(mapper.graph.poses[index])
        self._refreshed = mapper.driven_m, now_s
        self._costmap = options.stack.costmap.build(self.known_grid(options.around_m)[0])

    def _moved(self) -> bool:
        """Returns whether keyframes were corrected by more than the grid for driving tolerates."""
        if self.mapper.revision == self._revision:
            return False
        self._revision = self.mapper.revision
        pairs = zip(self._inserted, self.mapper.graph.poses, strict=False)
        return any(math.hypot(a.x_m - b.x_m, a.y_m - b.y_m) > self._options.moved_m for a, b in pairs)

    def known_grid(self, around_m: float | None = None) -> tuple[GridMap, NDArray[np.bool_]]:
        """The keep-out grid so far, or its part about the robot, and whether each cell is explored.

        Explored cells were also seen near the floor. Cells where the robot stood are free.
        """
        grid, poses = self._grid, [*self._inserted, self.mapper.pose]
        shape = grid.values.shape[1:]
        rows, columns = slice(0, shape[0]), slice(0, shape[1])
        if around_m is not None:
            rows, columns = grid.window(poses[-1].x_m, poses[-1].y_m, around_m)
        (x_m, y_m), cell_m = grid.origin_m, grid.resolution_m
        origin_m = (x_m + columns.start * cell_m, y_m + rows.start * cell_m)
        occupied, observed, low = grid.ground((rows, columns), self._options.low_m)
        close = np.ones((3, 3), np.uint8)
        observed, low = (
            cv2.morphologyEx(seen.astype(np.uint8), cv2.MORPH_CLOSE, close) > 0 for seen in (observed, low)
        )
        stood = _stood(poses, occupied.shape, origin_m, grid.resolution_m, self._footprint.inscribed_m)
        unknown = ~observed & ~stood & ~occupied
        return GridMap(occupied & ~stood, grid.resolution_m, origin_m, unknown), (low & observed) | stood | occupied

    # ---- goals

    def _is_explored(self, goal: _Goal, now_s: float) -> bool:
        """Returns whether the goal is a frontier that has been explored; checked when the costmap was refreshed."""
        if goal.purpose is not Purpose.FRONTIER or self._refreshed[1] != now_s:
            return False
        window = self._grid.window(*goal.about, _FRONTIER_M)
        _, _, low = self._grid.ground(window, self._options.low_m)
        return int(np.count_nonzero(~low)) < _FRONTIER_CELLS

    def _choose(self, now_s: float) -> None:
        """Chooses the next goal, or ends."""
        self._goal = None
        self._refresh(now_s, force=True)
        pose, (known, explored) = self.mapper.pose, self.known_grid()
        self._whole = self._options.stack.costmap.build(known)
        ground = Ground(known, explored, (pose.x_m, pose.y_m), clear_m=self._options.clear_m)
        if self._unsure() and (goal := self._loop_goal(ground)) is not None:
            self._explored_since_loop = False
            if self._begin(goal, now_s):
                return
        next_goal = self._frontier_goal if self._route is None else self._route_goal
        while (goal := next_goal(ground)) is not None:
            if self._begin(goal, now_s):
                return
            self._refused.append(goal.about)
        home = _Goal(Purpose.HOME, self._home, (self._home.x_m, self._home.y_m))
        if not self._at(home.pose):
            if self._begin(home, now_s):
                return
            self.trouble = _NO_PATH
        self.stop()
        self.done = True

    def _frontier_goal(self, ground: Ground) -> _Goal | None:
        """The nearest frontier that was not tried, None when there is none."""
        options, self._given_up = self._options, False
        for frontier in ground.frontiers(least_m=options.frontier_m, within_m=options.frontier_within_m):
            if any(math.dist(frontier.at, tried) < options.tried_m for tried in (*self._tried, *self._refused)):
                self._given_up = True
                continue
            pose = self._before(frontier, ground)
            if pose is not None:
                return _Goal(Purpose.FRONTIER, pose, frontier.at)
            self._refused.append(frontier.at)
        return None

    def _before(self, frontier: Frontier, ground: Ground) -> Pose2D | None:
        """The pose nearest to a frontier where the body has clearance, on this side of walls."""
        others = ground.stands_near(*frontier.at, most=16, apart_m=0.25)
        for stand in (frontier.stand, *others):
            near = math.dist(stand, frontier.at) < _FAR_STAND_M
            if near and ground.cost_to(*stand) < frontier.cost_m + 1.0:
                pose = self._standing(stand, frontier.at)
                if pose is not None:
                    return pose
        return None

    def _route_goal(self, ground: Ground) -> _Goal | None:
        """The free pose nearest to the next point of the route, None at its end."""
        assert self._route is not None
        here, near_m = (self.mapper.pose.x_m, self.mapper.pose.y_m), self._options.route_tolerance_m
        while self._route:
            point = self._route[0]
            away_m = math.dist(here, point)
            if away_m >= near_m:
                for stand in ground.stands_near(*point, most=60, apart_m=0.25):
                    if math.dist(stand, point) > away_m - 0.5 * near_m:
                        break
                    pose = self._standing(stand, _beyond(here, stand, point))
                    if pose is not None and stand not in self._refused:
                        return _Goal(Purpose.ROUTE, pose, stand)
                self.notes.append(f"the route's point ({point[0]:.1f}, {point[1]:.1f}) cannot be reached")
            self._route.pop(0)
        return None

    def _loop_goal(self, ground: Ground) -> _Goal | None:
        """The nearest pose of an old submap, None when there is none."""
        mapper = self.mapper
        newest = mapper.submaps[-3].anchor if len(mapper.submaps) > 3 else 0
        old = [pose for pose in mapper.graph.poses[:newest] if math.isfinite(ground.cost_to(pose.x_m, pose.y_m))]
        if not old:
            return None
        pose = min(old, key=lambda each: ground.cost_to(each.x_m, each.y_m))
        return _Goal(Purpose.LOOP, pose, (pose.x_m, pose.y_m))

    def _unsure(self) -> bool:
        """Returns whether the robot should close a loop before it goes on."""
        mapper, options = self.mapper, self._options
        if mapper.since_closure_m < options.back_after_m or not self._explored_since_loop:
            return False
        covariance = mapper.graph.covariance(len(mapper.graph.poses) - 1)
        return math.sqrt(float(covariance[0, 0] + covariance[1, 1])) > options.unsure_m

    def _standing(self, stand: tuple[float, float], towards: tuple[float, float]) -> Pose2D | None:
        """A pose at a position where the body has clearance, turned to a point as far as possible."""
        assert self._whole is not None
        facing = math.atan2(towards[1] - stand[1], towards[0] - stand[0])
        turns = np.array([0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2, 1.57, -1.57, 2.2, -2.2, 2.8, -2.8, math.pi])
        poses = np.column_stack([np.full(len(turns), stand[0]), np.full(len(turns), stand[1]), facing + turns])
        clear = footprint_clearance_m(self._whole, self._footprint, poses)
        free = np.flatnonzero(clear > self._options.margin_m + 0.01)
        return Pose2D(stand[0], stand[1], float(poses[free[0], 2])) if len(free) else None

    # ---- driving

    def _begin(self, goal: _Goal, now_s: float) -> bool:
        """Plans a path to a goal; returns whether there is one."""
        assert self._whole is not None
        options = self._options
        problem = options.stack.planner.problem(
            self._whole, self._footprint, self.mapper.pose, goal.pose, max_speed_m_s=options.max_speed_m_s
        )
        try:
            path = problem()
        except PlanningError:
            self._goal, self._follower = None, None
            return False
        if goal is not self._goal:
            self._failures = 0
        self._goal = goal
        self._follower = options.stack.controller.build(path, self._footprint, max_speed_m_s=options.max_speed_m_s)
        self._best_m, self._best_s = math.inf, now_s
        return True

    def _drive(self, now_s: float) -> None:
        """Sends one command along the path; plans again when the robot is stuck or off the path."""
        if self._goal is None or self._follower is None or self._costmap is None:
            self.stop()
            return
        velocity = self._robot.odometry().velocity
        drive = self._follower.command(self.mapper.pose, velocity, self._last, self._costmap)
        if drive.remaining_m < 0.03 or (drive.remaining_m < 0.3 and self._at(self._goal.pose)):
            self._arrived()
            return
        if drive.remaining_m < self._best_m - 0.05:
            self._best_m, self._best_s = drive.remaining_m, now_s
        stuck = now_s - self._best_s > self._options.stuck_s
        if stuck or drive.off_path_m > self._options.stack.controller.lost_path_m:
            self._replan(now_s)
            return
        self._last = np.array(drive.velocity)
        command = self._robot.drive(
            *drive.velocity, until_s=now_s + self._robot.capabilities().drive_expiry_s, lease=self._lease
        )
        status = self._robot.command_status(command)
        if status.state is CommandState.REFUSED:
            self.trouble, self.done = f"the robot refused to drive: {status.reason}", True

    def _arrived(self) -> None:
        """Ends a drive at its goal; goals that could not be reached are tried again, since more is known now."""
        assert self._goal is not None
        self._refused.clear()
        if self._goal.purpose is not Purpose.LOOP:
            self._explored_since_loop = True
        if self._goal.purpose is Purpose.HOME:
            self.done = not self._given_up or self._rounds_left == 0
            self._rounds_left -= 1
            self._tried.clear()
        if self._goal.purpose is Purpose.FRONTIER:
            self._tried.append(self._goal.about)
        self._goal = None
        self._last = np.zeros(3)
        self._robot.stop(lease=self._lease)

    def _replan(self, now_s: float) -> None:
        """Plans again; abandons the goal after three times."""
        goal = self._goal
        assert goal is not None
        self._failures += 1
        self._last = np.zeros(3)
        self._refresh(now_s, force=True)
        self._whole = self._options.stack.costmap.build(self.known_grid()[0])
        if self._failures < 3 and self._begin(goal, now_s):
            return
        self._tried.append(goal.about)
        self._refused.append(goal.about)
        if goal.purpose is Purpose.HOME:
            self.trouble, self.done = _NO_PATH, True
        self._goal = None

    def _at(self, pose: Pose2D) -> bool:
        off = relative_pose(pose, self.mapper.pose)
        return math.hypot(off.x_m, off.y_m) < 0.1 and abs(off.yaw_rad) < 0.15


def _stood(
    poses: Sequence[Pose2D], shape: tuple[int, ...], origin_m: tuple[float, float], cell_m: float, radius_m: float
) -> NDArray[np.bool_]:
    """The cells about the body's middle at some poses."""
    x, y, yaw = pose_array(poses).T
    marked = np.zeros(shape, dtype=np.uint8)
    for reach_m in (-0.25, 0.0, 0.25):
        row = np.floor((y + reach_m * np.sin(yaw) - origin_m[1]) / cell_m).astype(int)
        column = np.floor((x + reach_m * np.cos(yaw) - origin_m[0]) / cell_m).astype(int)
        inside = (row >= 0) & (column >= 0) & (row < shape[0]) & (column < shape[1])
        marked[row[inside], column[inside]] = 1
    size = 2 * math.ceil(radius_m / cell_m) + 1
    return np.asarray(cv2.dilate(marked, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))) > 0)


def _beyond(here: tuple[float, float], stand: tuple[float, float], point: tuple[float, float]) -> tuple[float, float]:
    """The point to face on a route: the route's next point, or ahead where that is the position itself."""
    return point if math.dist(stand, point) > 0.1 else (2.0 * stand[0] - here[0], 2.0 * stand[1] - here[1])
