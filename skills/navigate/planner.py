"""Planning of a way for the whole footprint, over place and heading."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from skills.api import NO_WORK_COUNTER, FreeSpace, PlanningError, WorkCounter
from skills.geometry import wrap
from skills.navigate.differential import CELL_SHARE, Links, courses, drives, links
from skills.navigate.footprint import SAFE_MARGIN_M, Footprint, clearance_at
from skills.navigate.lattice import Lattice, Needs, Space, cost_to_go, lattice_moves, search
from skills.navigate.motion_cost import TURNING_RADIUS_M, Weights, segment_cost
from skills.navigate.path import Path
from skills.navigate.smoothing import clearances, densify, relax, shortcut
from skills.quantities import Count, Factor, Length, Margin, Speed, TurnRate
from skills.robot import BaseKind, FloatArray, Pose2D

FIELD_CELL_M = 0.05
STEP_M = 0.06


class NoWayError(PlanningError):
    """Start and goal are free, but nothing that the robot fits through joins them."""


@dataclass(frozen=True)
class LatticePlanner:
    """A lattice over place and heading, searched for the whole footprint, then smoothed.

    Speeds (m/s, rad/s) say how dear each way of moving is. Poses keep `margin_m`, or `least_margin_m` where there is no
    way with more; nearer than `soft_m` to an obstacle the cost grows up to (1 + soft_weight) fold. A start that is
    blocked by noise may be left through poses that are no worse, within `escape_m`. The search covers the box about
    start and goal, `around_m` wider to all sides.
    A base that cannot go sideways gets a path of straights, arcs and turns on the spot, whatever `lateral_m_s` and
    `headings` say, on places half of `cell_m` apart.
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
        """The numbers that a motion's cost depends on, for the compiled loops."""
        return (
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
    ) -> Callable[[], Path]:
        """Samples the costmap now; the call that comes back plans on that sample, and raises PlanningError."""
        options = replace(self, forward_m_s=min(self.forward_m_s, max_speed_m_s))
        return partial(solve, problem_of(costmap, footprint, start, goal, options, self.around_m, work))


@dataclass(frozen=True)
class Problem:
    """A costmap sampled around start and goal, with all that a plan needs: a snapshot, safe to plan in a thread."""

    space: Space
    footprint: Footprint
    start: Pose2D
    goal: Pose2D
    options: LatticePlanner
    work: WorkCounter = NO_WORK_COUNTER

    @property
    def sideways(self) -> bool:
        """Returns whether the base can go sideways."""
        return self.footprint.base_kind is not BaseKind.DIFFERENTIAL


def plan_path(
    costmap: FreeSpace, footprint: Footprint, start: Pose2D, goal: Pose2D, options: LatticePlanner | None = None
) -> Path:
    """The cheapest way from start to goal that the footprint can go. Raises PlanningError.

    The path begins and ends exactly at start and goal. A start that is a little in collision may be left.
    """
    used = options or LatticePlanner()
    try:
        return solve(problem_of(costmap, footprint, start, goal, used))
    except NoWayError:
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
    """Samples the costmap on the box around start and goal, margin_m wider to all sides."""
    low = np.minimum([start.x_m, start.y_m], [goal.x_m, goal.y_m]) - margin_m
    high = np.maximum([start.x_m, start.y_m], [goal.x_m, goal.y_m]) + margin_m
    xs, ys = (np.arange(low[axis], high[axis] + FIELD_CELL_M, FIELD_CELL_M) for axis in (0, 1))
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    field = costmap.clearance_m(points).reshape(len(ys), len(xs)).astype(np.float32)
    rows, columns = _used(field.max(axis=1)), _used(field.max(axis=0))
    field = field[rows, columns]
    frame = (FIELD_CELL_M, float(xs[columns.start]), float(ys[rows.start]))
    space = Space(np.ascontiguousarray(field), frame, footprint.discs, options.weights(footprint))
    return Problem(space, footprint, start, goal, options, work)


def _used(best: NDArray[np.float32]) -> slice:
    """The stretch between the first and the last free place, and one more to either side."""
    free = np.flatnonzero(best > 0.0)
    return slice(max(0, int(free[0]) - 1), int(free[-1]) + 2) if len(free) else slice(0, 2)


def solve(problem: Problem) -> Path:
    """The cheapest way, smoothed, with less margin where there is none with more. Raises PlanningError."""
    options = problem.options
    try:
        return _solve(problem)
    except PlanningError:
        if options.least_margin_m >= options.margin_m:
            raise
        return _solve(replace(problem, options=replace(options, margin_m=options.least_margin_m)))


def _solve(problem: Problem) -> Path:
    """The cheapest way with the margin that is wanted."""
    needs = _needs(problem)
    _check_goal(problem)
    for yaw0_rad in (0.0, problem.goal.yaw_rad) if problem.sideways else (0.0,):
        rough = _search(problem, needs, yaw0_rad)
        if rough is not None:
            return _smooth(problem, rough, needs)
    places = f"from {_place(problem.start)} to {_place(problem.goal)}"
    raise NoWayError(f"There is no way {places} that the robot fits through{_because(problem.footprint)}.")


def _because(footprint: Footprint) -> str:
    """What makes the robot larger than its body; empty when nothing does."""
    length, width = footprint.extent_m
    return f": {footprint.beyond} makes it {length:.2f} m long and {width:.2f} m wide" if footprint.beyond else ""


def _place(pose: Pose2D) -> str:
    return f"({pose.x_m:.2f}, {pose.y_m:.2f})"


def _clearance(problem: Problem, pose: Pose2D) -> float:
    space = problem.space
    return clearance_at(space.field, space.frame, space.discs, pose.x_m, pose.y_m, pose.yaw_rad)


def _needs(problem: Problem) -> Needs:
    """The clearance wanted; around a blocked start, what the start itself has."""
    options, clearance = problem.options, _clearance(problem, problem.start)
    if clearance < -options.deepest_start_m:
        raise PlanningError(f"The robot stands in something at {_place(problem.start)}, so no way can begin there.")
    escape = min(options.margin_m, clearance - 0.015)
    return Needs(options.margin_m, escape, options.escape_m, problem.start.x_m, problem.start.y_m)


def _check_goal(problem: Problem) -> None:
    clearance = _clearance(problem, problem.goal)
    if clearance >= problem.options.margin_m:
        return
    needed = f"would have {clearance:.2f} m to the nearest thing there and needs {problem.options.margin_m:.2f} m"
    why = "would stand in something there, or off the map" if clearance < 0.0 else needed
    raise PlanningError(f"The goal {_place(problem.goal)} is blocked: the robot {why}{_because(problem.footprint)}.")


def _lattice(problem: Problem, yaw0_rad: float) -> tuple[Lattice, int, int]:
    """The lattice with the goal on one of its places, over the whole field; the goal's row and column."""
    cell, (resolution, x0, y0) = problem.options.cell_m, problem.space.frame
    cell *= 1.0 if problem.sideways else CELL_SHARE
    rows, columns = problem.space.field.shape
    row, column = int((problem.goal.y_m - y0) / cell), int((problem.goal.x_m - x0) / cell)
    above = int((y0 + (rows - 1) * resolution - problem.goal.y_m) / cell)
    beside = int((x0 + (columns - 1) * resolution - problem.goal.x_m) / cell)
    corner = (problem.goal.x_m - column * cell, problem.goal.y_m - row * cell)
    shape = (row + above + 1, column + beside + 1)
    yaws, _ = _courses(problem.options.headings if problem.sideways else None)
    return Lattice(*corner, cell, yaw0_rad + yaws, *shape, len(yaws)), row, column


def _segment(problem: Problem, a: FloatArray, b: FloatArray, need: float) -> float:
    space = problem.space
    return segment_cost(space.field, space.frame, space.discs, a, b, need, space.weights)


def _poses(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Starts and goal as rows x, y, yaw."""
    start, goal = (np.array([p.x_m, p.y_m, p.yaw_rad]) for p in (problem.start, problem.goal))
    return start, goal


def _seeds(problem: Problem, lattice: Lattice, needs: Needs) -> Links:
    """Lattice states next to the start that it can be left to."""
    start, turn = _poses(problem)[0], 2.0 * math.pi / lattice.headings
    column, row = (start[0] - lattice.x0_m) / lattice.cell_m, (start[1] - lattice.y0_m) / lattice.cell_m
    k = math.floor((start[2] - lattice.yaws_rad[0]) / turn)
    seeds: Links = {}
    for i in (math.floor(row), math.floor(row) + 1):
        for j in (math.floor(column), math.floor(column) + 1):
            for heading in (k, k + 1):
                yaw = lattice.yaws_rad[0] + heading * turn
                pose = np.array([lattice.x0_m + j * lattice.cell_m, lattice.y0_m + i * lattice.cell_m, yaw])
                cost = _segment(problem, start, pose, needs.escape_margin_m)
                if math.isfinite(cost):
                    seeds[(i * lattice.columns + j) * lattice.headings + heading % lattice.headings] = (cost, ())
    return seeds


def _final_turns(problem: Problem, lattice: Lattice, goal_cell: int) -> Links:
    """Turns at the goal from each heading to the goal's, by one heading's width at most."""
    goal, turn = _poses(problem)[1], 2.0 * math.pi / lattice.headings
    turns: Links = {}
    for k in range(lattice.headings):
        off = wrap(float(lattice.yaws_rad[k]) - problem.goal.yaw_rad)
        if abs(off) < turn:
            cost = _segment(problem, goal + np.array([0.0, 0.0, off]), goal, problem.options.margin_m)
            turns[goal_cell * lattice.headings + k] = (cost, ())
    return turns


@lru_cache(maxsize=4)
def _courses(headings: int | None) -> tuple[FloatArray, NDArray[np.int64]]:
    """Yaws and moves of a lattice with so many headings, or of one for a base that cannot go sideways (None)."""
    if headings is None:
        return courses()
    return np.asarray(np.arange(headings) * (2.0 * math.pi / headings)), lattice_moves(headings)


def _rows(found: Links) -> FloatArray:
    """State index and cost, by index."""
    return np.array(sorted((float(state), cost) for state, (cost, _) in found.items()), dtype=np.float64).reshape(-1, 2)


def _search(problem: Problem, needs: Needs, yaw0_rad: float) -> FloatArray | None:
    """Lattice poses from start to goal with continuous yaw, None when there is no way."""
    lattice, row, column = _lattice(problem, yaw0_rad)
    start, goal = _poses(problem)
    if problem.sideways:
        seeds, ends = _seeds(problem, lattice, needs), _final_turns(problem, lattice, row * lattice.columns + column)
    else:
        seeds = links(problem.space, lattice, start, needs, to_pose=False)
        ends = links(problem.space, lattice, goal, needs, to_pose=True)
    to_go = cost_to_go(problem.space, lattice, row, column, problem.footprint.inscribed_m)
    expansions = np.zeros(1, dtype=np.int64)
    _, moves = _courses(problem.options.headings if problem.sideways else None)
    states = search(
        problem.space,
        lattice,
        moves,
        to_go,
        _rows(seeds),
        _rows(ends),
        needs,
        problem.options.greed,
        expansions,
    )
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


def _smooth(problem: Problem, rough: FloatArray, needs: Needs) -> Path:
    """Shortcut, fill in and relax."""
    knots = shortcut(problem.space, rough, needs, 25, problem.sideways)
    if not problem.sideways:
        poses = densify(drives(problem.space, knots, needs), STEP_M)
        return Path(poses, clearances(problem.space, poses))
    band = relax(problem.space, densify(knots, STEP_M), 60, problem.options.margin_m, 0.25)
    poses = densify(band, STEP_M)
    return Path(poses, clearances(problem.space, poses))
