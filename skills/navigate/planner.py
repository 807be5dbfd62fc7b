"""Path planning for the whole footprint, over position and heading."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from skills.api import FreeSpace, PlanningError
from skills.footprint import SAFE_MARGIN_M, ClearanceField, Footprint, clearance_at, clearance_on_grid
from skills.geometry import wrap
from skills.motion_cost import NO_ZONES, TURNING_RADIUS_M, Needs, Space, Weights, ZoneCosts, segment_cost
from skills.navigate.differential import CELL_SHARE, Links, courses, driven_poses, links
from skills.navigate.lattice import Lattice, cost_to_go, lattice_moves, search
from skills.path import Path, clearances, densify, relax, shortcut
from skills.quantities import Count, Factor, Length, Margin, Speed, TurnRate
from skills.robot import BaseKind, FloatArray, Pose2D
from skills.world_model import NO_WORK_COUNTER, WorkCounter, ZoneKind, zones_sentence
from skills.zone_map import ZoneMap

FIELD_CELL_M = 0.05
STEP_M = 0.06
"""Distance between the poses of a path."""
_SHORTCUT_POSES = 25
"""Poses that one shortcut may skip."""
_RELAX_ROUNDS = 60
_RELAX_CLEARANCE_M = 0.25
"""Clearance below which the relaxation pushes poses off obstacles."""
_NOISE_M = 0.015
"""Largest loss of clearance on a plan from a blocked start."""


class NoPathError(PlanningError):
    """Error of a plan whose start and goal are free, while no path joins them."""


@dataclass(frozen=True)
class LatticePlanner:
    """Searches a lattice over position and heading for the whole footprint, then smooths the path.

    The speeds (m/s, rad/s) set the cost of each motion. `margin_m`: required clearance; `least_margin_m`: the same for
    a second try when no path has it. `soft_m` and `soft_weight`: nearer than `soft_m` to an obstacle the cost grows up
    to (1 + soft_weight) fold. `escape_m`: distance within which a path may keep the clearance of a start that noise
    blocks. `around_m`: margin of the searched box about start and goal. A base that cannot move sideways gets
    straights, arcs and turns on the spot, on cells half of `cell_m` wide; `lateral_m_s` and `headings` do not affect
    it.
    """

    forward_m_s: Speed = 0.8
    backward_m_s: Speed = 0.25
    lateral_m_s: Speed = 0.25
    turn_rad_s: TurnRate = 0.9
    margin_m: Margin = SAFE_MARGIN_M
    least_margin_m: Margin = SAFE_MARGIN_M
    soft_m: Length = 0.35
    soft_weight: Factor = 3.0
    escape_m: Margin = 0.6
    deepest_start_m: Margin = 0.2
    cell_m: Length = 0.1
    headings: Count = 16
    greed: Factor = 2.0
    around_m: Margin = 8.0

    def weights(self, footprint: Footprint) -> Weights:
        """The weights of the motion cost, for a footprint."""
        return Weights(
            self.forward_m_s,
            self.backward_m_s,
            self.lateral_m_s,
            self.turn_rad_s,
            self.soft_m,
            self.soft_weight,
            max(TURNING_RADIUS_M, footprint.circumscribed_m),
        )

    def problem(
        self,
        costmap: FreeSpace,
        footprint: Footprint,
        start: Pose2D,
        goal: Pose2D,
        *,
        max_speed_m_s: float,
        work: WorkCounter = NO_WORK_COUNTER,
        zones: ZoneMap | None = None,
    ) -> Callable[[], Path]:
        """Samples the costmap now; returns a function that plans on that sample or raises PlanningError."""
        options = replace(self, forward_m_s=min(self.forward_m_s, max_speed_m_s))
        problem = problem_of(costmap, footprint, start, goal, options, self.around_m, work)
        return partial(solve, problem) if zones is None else partial(_solve_with_zones, problem, zones)


@dataclass(frozen=True)
class Problem:
    """Input of one plan: a snapshot of the clearance around start and goal, safe to use in a thread."""

    field: ClearanceField
    footprint: Footprint
    start: Pose2D
    goal: Pose2D
    options: LatticePlanner
    work: WorkCounter = NO_WORK_COUNTER
    zones: ZoneCosts = NO_ZONES

    @property
    def sideways(self) -> bool:
        """Returns whether the base can move sideways."""
        return self.footprint.base_kind is not BaseKind.DIFFERENTIAL


def plan_path(
    costmap: FreeSpace, footprint: Footprint, start: Pose2D, goal: Pose2D, options: LatticePlanner | None = None
) -> Path:
    """Plans the cheapest path from start to goal for the footprint. Raises PlanningError when there is none.

    The path begins exactly at the start and ends exactly at the goal. It may leave a start that is slightly in
    collision.
    """
    used = options or LatticePlanner()
    try:
        return solve(problem_of(costmap, footprint, start, goal, used))
    except NoPathError:
        return solve(problem_of(costmap, footprint, start, goal, used, margin_m=8.0))


def problem_of(
    costmap: FreeSpace,
    footprint: Footprint,
    start: Pose2D,
    goal: Pose2D,
    options: LatticePlanner,
    margin_m: float = 3.0,
    work: WorkCounter = NO_WORK_COUNTER,
) -> Problem:
    """Samples the costmap in the box about start and goal, grown by margin_m."""
    low = np.minimum([start.x_m, start.y_m], [goal.x_m, goal.y_m]) - margin_m
    high = np.maximum([start.x_m, start.y_m], [goal.x_m, goal.y_m]) + margin_m
    xs, ys = (np.arange(low[axis], high[axis] + FIELD_CELL_M, FIELD_CELL_M) for axis in (0, 1))
    values = clearance_on_grid(costmap, xs, ys).astype(np.float32)
    rows, columns = _used(values.max(axis=1)), _used(values.max(axis=0))
    corner = float(xs[columns.start]), float(ys[rows.start])
    field = ClearanceField(np.ascontiguousarray(values[rows, columns]), FIELD_CELL_M, *corner, footprint.discs)
    return Problem(field, footprint, start, goal, options, work)


def _used(best: NDArray[np.float32]) -> slice:
    """Index range from the first to the last free sample, grown by one on both sides."""
    free = np.flatnonzero(best > 0.0)
    return slice(max(0, int(free[0]) - 1), int(free[-1]) + 2) if len(free) else slice(0, 2)


def solve(problem: Problem) -> Path:
    """Plans with `margin_m`, then with `least_margin_m`. Raises PlanningError when both fail."""
    options = problem.options
    try:
        return _solve(problem)
    except PlanningError:
        if options.least_margin_m >= options.margin_m:
            raise
        return _solve(replace(problem, options=replace(options, margin_m=options.least_margin_m)))


def _solve_with_zones(problem: Problem, zones: ZoneMap) -> Path:
    """Plans like `solve`, subject to zone costs and one-way directions; a path may leave the zones at its start."""
    field, start = problem.field, problem.start
    xs, ys = (
        c0 + field.cell_m * np.arange(n)
        for c0, n in zip((field.x0_m, field.y0_m), field.values.shape[::-1], strict=True)
    )
    costs = partial(zones.costs, xs, ys, problem.options.forward_m_s)
    try:
        return solve(replace(problem, zones=costs()))
    except NoPathError as error:
        if zones.names_at(ZoneKind.ONE_WAY, start):
            return solve(replace(problem, zones=costs(leave=start)))
        against = zones.against(solve(problem).poses)
        if not against:
            raise
        raise NoPathError(f"{error} {zones_sentence(against, 'one-way zone')}") from error


def _solve(problem: Problem) -> Path:
    """Plans with the options' `margin_m`."""
    space = Space(problem.field, _needs(problem), problem.options.weights(problem.footprint), problem.zones)
    _check_goal(problem)
    for yaw0_rad in (0.0, problem.goal.yaw_rad) if problem.sideways else (0.0,):
        rough = _search(problem, space, yaw0_rad)
        if rough is not None:
            return _smooth(problem, space, rough)
    places = f"from {xy_text(problem.start)} to {xy_text(problem.goal)}"
    raise NoPathError(f"There is no path {places} that the robot fits through{_because(problem.footprint)}.")


def _because(footprint: Footprint) -> str:
    """Clause that names what overhangs the robot's body; empty when nothing does."""
    length, width = footprint.extent_m
    return f": {footprint.beyond} makes it {length:.2f} m long and {width:.2f} m wide" if footprint.beyond else ""


def xy_text(pose: Pose2D) -> str:
    """Position (x, y) of a pose, for a message: "(1.20, 5.50)"."""
    return f"({pose.x_m:.2f}, {pose.y_m:.2f})"


def _needs(problem: Problem) -> Needs:
    """Required clearance; near a blocked start, the clearance of that start."""
    options, clearance = problem.options, clearance_at(problem.field, *_row(problem.start))
    if clearance < -options.deepest_start_m:
        raise PlanningError(f"The robot stands in an obstacle at {xy_text(problem.start)}, so no path can begin there.")
    escape = min(options.margin_m, clearance - _NOISE_M)
    return Needs(options.margin_m, escape, options.escape_m, problem.start.x_m, problem.start.y_m)


def _check_goal(problem: Problem) -> None:
    clearance = clearance_at(problem.field, *_row(problem.goal))
    if clearance >= problem.options.margin_m:
        return
    needed = f"would have {clearance:.2f} m to the nearest obstacle there and needs {problem.options.margin_m:.2f} m"
    why = "would stand in an obstacle there, or off the map" if clearance < 0.0 else needed
    raise PlanningError(f"The goal {xy_text(problem.goal)} is blocked: the robot {why}{_because(problem.footprint)}.")


def _lattice(problem: Problem, yaw0_rad: float) -> tuple[Lattice, int, int]:
    """The lattice over the whole field, aligned to the goal, and the goal's row and column."""
    field, goal = problem.field, problem.goal
    cell = problem.options.cell_m * (1.0 if problem.sideways else CELL_SHARE)
    rows, columns = field.values.shape
    row, column = int((goal.y_m - field.y0_m) / cell), int((goal.x_m - field.x0_m) / cell)
    above = int((field.y0_m + (rows - 1) * field.cell_m - goal.y_m) / cell)
    beside = int((field.x0_m + (columns - 1) * field.cell_m - goal.x_m) / cell)
    corner = (goal.x_m - column * cell, goal.y_m - row * cell)
    shape = (row + above + 1, column + beside + 1)
    yaws, _ = _courses(problem.options.headings if problem.sideways else None)
    return Lattice(*corner, cell, yaw0_rad + yaws, *shape, len(yaws)), row, column


def _row(pose: Pose2D) -> FloatArray:
    """The pose as x, y (m), yaw (rad)."""
    return np.array([pose.x_m, pose.y_m, pose.yaw_rad])


def _seeds(space: Space, lattice: Lattice, start: FloatArray) -> Links:
    """Lattice states next to the start that a free segment reaches, with the segment's cost."""
    turn = 2.0 * math.pi / lattice.headings
    column, row = (start[0] - lattice.x0_m) / lattice.cell_m, (start[1] - lattice.y0_m) / lattice.cell_m
    k = math.floor((start[2] - lattice.yaws_rad[0]) / turn)
    seeds: Links = {}
    for i in (math.floor(row), math.floor(row) + 1):
        for j in (math.floor(column), math.floor(column) + 1):
            for heading in (k, k + 1):
                yaw = lattice.yaws_rad[0] + heading * turn
                pose = np.array([lattice.x0_m + j * lattice.cell_m, lattice.y0_m + i * lattice.cell_m, yaw])
                cost = segment_cost(space, start, pose, space.needs.escape_margin_m)
                if math.isfinite(cost):
                    seeds[(i * lattice.columns + j) * lattice.headings + heading % lattice.headings] = (cost, ())
    return seeds


def _final_turns(space: Space, lattice: Lattice, goal: FloatArray, goal_cell: int) -> Links:
    """Turns at the goal from neighbouring headings to the goal's yaw, with their cost."""
    turn = 2.0 * math.pi / lattice.headings
    turns: Links = {}
    for k in range(lattice.headings):
        off = wrap(float(lattice.yaws_rad[k]) - float(goal[2]))
        if abs(off) < turn:
            cost = segment_cost(space, goal + np.array([0.0, 0.0, off]), goal, space.needs.margin_m)
            turns[goal_cell * lattice.headings + k] = (cost, ())
    return turns


@lru_cache(maxsize=4)
def _courses(headings: int | None) -> tuple[FloatArray, NDArray[np.int64]]:
    """Yaws and moves for a lattice with `headings` headings; None stands for a base that cannot move sideways."""
    if headings is None:
        return courses()
    return np.asarray(np.arange(headings) * (2.0 * math.pi / headings)), lattice_moves(headings)


def _rows(found: Links) -> FloatArray:
    """Rows of state index and cost, sorted by index."""
    return np.array(sorted((float(state), cost) for state, (cost, _) in found.items()), dtype=np.float64).reshape(-1, 2)


def _search(problem: Problem, space: Space, yaw0_rad: float) -> FloatArray | None:
    """Lattice poses from start to goal with continuous yaw; None when no path exists."""
    lattice, row, column = _lattice(problem, yaw0_rad)
    start, goal = _row(problem.start), _row(problem.goal)
    if problem.sideways:
        seeds = _seeds(space, lattice, start)
        ends = _final_turns(space, lattice, goal, row * lattice.columns + column)
    else:
        seeds, ends = links(space, lattice, start, to_pose=False), links(space, lattice, goal, to_pose=True)
    to_go = cost_to_go(space, lattice, row, column, problem.footprint.inscribed_m)
    expansions = np.zeros(1, dtype=np.int64)
    _, moves = _courses(problem.options.headings if problem.sideways else None)
    states = search(space, lattice, moves, to_go, _rows(seeds), _rows(ends), problem.options.greed, expansions)
    problem.work.count("planner_expansions", int(expansions[0]))
    if len(states) == 0:
        return None
    cells, k = np.divmod(states, lattice.headings)
    i, j = np.divmod(cells, lattice.columns)
    x, y = lattice.x0_m + j * lattice.cell_m, lattice.y0_m + i * lattice.cell_m
    between = np.column_stack([x, y, lattice.yaws_rad[k]])
    first, last = seeds[int(states[0])][1], ends[int(states[-1])][1]
    poses = np.vstack([start, *first, between, *last, goal])
    poses[:, 2] = np.unwrap(poses[:, 2])
    return np.ascontiguousarray(poses)


def _smooth(problem: Problem, space: Space, rough: FloatArray) -> Path:
    """The rough path after shortcuts and relaxation, or, for a differential base, with rounded corners."""
    knots = shortcut(space, rough, _SHORTCUT_POSES, problem.sideways)
    if problem.sideways:
        knots = relax(space, densify(knots, STEP_M), _RELAX_ROUNDS, problem.options.margin_m, _RELAX_CLEARANCE_M)
    else:
        knots = driven_poses(space, knots)
    poses = densify(knots, STEP_M)
    return Path(poses, clearances(space, poses))
