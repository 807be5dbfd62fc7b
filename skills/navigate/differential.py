"""Paths of a differential base: straights forward or backward, turns on the spot, and arcs that round corners."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skills.geometry import wrap
from skills.motion_cost import Space, clearance_needed, drive_cost, segment_cost, zone_factor
from skills.navigate.lattice import Lattice
from skills.path import clearances
from skills.robot import FloatArray

CELL_SHARE = 0.5
"""Cell size as a fraction of the usual one; cells are small because the base cannot shift to a door's centre."""
_LONG_STEPS = 4
"""Cells of a long move for each of a short one."""
_LEGS_M = np.arange(0.2, 2.1, 0.2)
_RADII_M = (0.8, 0.6, 0.4, 0.25)
_SHARPEST_RAD = 2.0
_ARC_STEP_M = 0.05


def courses() -> tuple[FloatArray, NDArray[np.int64]]:
    """Headings (headings,) at which straights lead from cell to cell of a lattice, and moves (headings, M, 3).

    The moves are short and long steps forward and backward, and turns to the next heading (see `lattice_moves`).
    """
    quarter = [(1, 0), (2, 1), (1, 1), (1, 2)]
    steps = quarter + [(-dy, dx) for dx, dy in quarter]
    steps += [(-dx, -dy) for dx, dy in steps]
    yaws = np.array([math.atan2(dy, dx) % math.tau for dx, dy in steps])
    moves = [
        [(sign * n * dx, sign * n * dy, 0) for n in (1, _LONG_STEPS) for sign in (1, -1)] + [(0, 0, -1), (0, 0, 1)]
        for dx, dy in steps
    ]
    return yaws, np.array(moves, dtype=np.int64)


Links = dict[int, tuple[float, tuple[FloatArray, ...]]]
"""Cost between each lattice state, by index, and a pose off the lattice, and the poses between them."""


def links(space: Space, lattice: Lattice, pose: FloatArray, *, to_pose: bool) -> Links:
    """The links from a pose to lattice states, or with `to_pose` from lattice states to the pose.

    From the pose the robot may go straight over any distance, since it may lack the clearance to turn on the spot.
    """
    found: Links = {}
    for cost, via in _straights(space, pose):
        for state, place in _around(lattice, via):
            pair = (place, via) if to_pose else (via, place)
            total = cost + drive_cost(space, *pair, clearance_needed(space, place[0], place[1]))[0]
            if total < found.get(state, (math.inf,))[0]:
                found[state] = (total, () if via is pose else (via,))
    return found


def _straights(space: Space, pose: FloatArray) -> Iterator[tuple[float, FloatArray]]:
    """Yields the pose itself, then free poses straight ahead and behind, each with the cost of the straight."""
    yield 0.0, pose
    ahead = np.array([math.cos(pose[2]), math.sin(pose[2]), 0.0])
    for sign in (1.0, -1.0):
        cost, before = 0.0, pose
        for leg_m in sign * _LEGS_M:
            via = pose + leg_m * ahead
            cost += segment_cost(space, before, via, clearance_needed(space, via[0], via[1]))
            if not math.isfinite(cost):
                break
            yield cost, via
            before = via


def _around(lattice: Lattice, pose: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Yields the lattice states about a pose: four cells with two headings each."""
    row, column = (pose[1] - lattice.y0_m) / lattice.cell_m, (pose[0] - lattice.x0_m) / lattice.cell_m
    k = int(np.searchsorted(lattice.yaws_rad, pose[2] % math.tau, side="right")) - 1
    for i in {math.floor(row + 1e-6), math.ceil(row - 1e-6)}:
        for j in {math.floor(column + 1e-6), math.ceil(column - 1e-6)}:
            if not (0 <= i < lattice.rows and 0 <= j < lattice.columns):
                continue
            for heading in (k, (k + 1) % lattice.headings):
                yaw = pose[2] + wrap(float(lattice.yaws_rad[heading]) - pose[2])
                place = np.array([lattice.x0_m + j * lattice.cell_m, lattice.y0_m + i * lattice.cell_m, yaw])
                yield (i * lattice.columns + j) * lattice.headings + heading, place


def driven_poses(space: Space, knots: FloatArray) -> FloatArray:
    """Poses (N, 3) on the path through knots: turn, straight, turn; rounds corners where the arc is free."""
    legs = _legs(space, knots)
    places = [legs[0][0], *(end for _, end, _ in legs)]
    poses = [knots[0]]
    trimmed_m = 0.0
    for n, (begin, end, yaw) in enumerate(legs):
        if trimmed_m == 0.0:
            poses.append(np.array([*(poses[-1][:2]), yaw]))
        arc = None
        if n + 1 < len(legs):
            free_m = min(
                float(np.linalg.norm(end - begin)) - trimmed_m, 0.5 * float(np.linalg.norm(places[n + 2] - end))
            )
            arc = _rounded(space, legs[n], legs[n + 1], free_m)
        trimmed_m = 0.0
        if arc is None:
            poses.append(np.array([*end, yaw]))
        else:
            poses.extend(arc)
            trimmed_m = float(np.linalg.norm(arc[-1][:2] - end))
    last = knots[-1].copy()
    last[2] = poses[-1][2] + wrap(last[2] - poses[-1][2])
    return np.array([*poses, last])


_Leg = tuple[FloatArray, FloatArray, float]


def _legs(space: Space, knots: FloatArray) -> list[_Leg]:
    """The straights between knots, each with its two ends and the yaw along it; yaws are continuous."""
    legs: list[_Leg] = []
    yaw = float(knots[0, 2])
    for a, b in pairwise(knots):
        if np.hypot(*(b - a)[:2]) < 1e-6:
            continue
        begin = np.array([a[0], a[1], yaw + wrap(a[2] - yaw)])
        _, on_it = drive_cost(space, begin, b, clearance_needed(space, a[0], a[1]))
        yaw += wrap(on_it - yaw)
        legs.append((a[:2], b[:2], yaw))
    return legs or [(knots[0, :2], knots[0, :2], yaw)]


def _rounded(space: Space, first: _Leg, second: _Leg, free_m: float) -> list[FloatArray] | None:
    """The widest free arc between two straights; None when the base reverses between them or no arc is free."""
    (_, corner, yaw), (_, _, yaw_after) = first, second
    turn = yaw_after - yaw
    towards = [np.subtract(leg[1], leg[0]) @ (math.cos(leg[2]), math.sin(leg[2])) for leg in (first, second)]
    if towards[0] * towards[1] <= 0.0 or not 1e-3 < abs(turn) < _SHARPEST_RAD:
        return None
    course = yaw if towards[0] > 0.0 else yaw + math.pi
    widest = free_m / math.tan(0.5 * abs(turn))
    for radius in (radius for radius in (min(_RADII_M[0], widest), *_RADII_M) if 0.1 <= radius <= widest):
        count = 1 + math.ceil(radius * abs(turn) / _ARC_STEP_M)
        yaws = yaw + np.linspace(0.0, turn, count + 1)
        angles, side = course + np.linspace(0.0, turn, count + 1), math.copysign(radius, turn)
        begin = corner - radius * math.tan(0.5 * abs(turn)) * np.array([math.cos(course), math.sin(course)])
        x = begin[0] + side * (np.sin(angles) - math.sin(course))
        y = begin[1] - side * (np.cos(angles) - math.cos(course))
        arc = np.column_stack([x, y, yaws])
        clear = float(np.min(clearances(space, arc))) >= max(clearance_needed(space, x[0], y[0]), space.needs.margin_m)
        if clear and all(math.isfinite(zone_factor(space, *a[:2], *(b - a)[:2])) for a, b in pairwise(arc)):
            return list(arc)
    return None
