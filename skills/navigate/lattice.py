"""A* over a lattice of cells and headings, deterministic and compiled."""

import heapq
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skills.compiled import compiled
from skills.footprint import clearance_at
from skills.motion_cost import Space, Weights, clearance_needed, mean_zone_factor, motion_seconds, nearness
from skills.robot import FloatArray

IntArray = NDArray[np.int64]


_CHECK_M = 0.12
"""Distance between the clearance checks along a move."""


class Lattice(NamedTuple):
    """Lattice of points (x0_m + column * cell_m, y0_m + row * cell_m) and headings yaws_rad (headings,), increasing."""

    x0_m: float
    y0_m: float
    cell_m: float
    yaws_rad: FloatArray
    rows: int
    columns: int
    headings: int


def lattice_moves(headings: int) -> IntArray:
    """Moves (headings, M, 3) from each heading, as changes of column, row and heading.

    The moves are sixteen directions, each with no turn or a turn to either side, and turns on the spot.
    """
    flat = [(1, 0), (1, 1), (2, 1), (1, 2)]
    steps = {(sx * a, sy * b) for dx, dy in flat for a, b in ((dx, dy), (dy, dx)) for sx in (1, -1) for sy in (1, -1)}
    moves = [(dx, dy, turn) for dx, dy in sorted(steps) for turn in (0, -1, 1)]
    return np.array([[*moves, (0, 0, -1), (0, 0, 1)]] * headings, dtype=np.int64)


@compiled
def cost_to_go(space: Space, lattice: Lattice, goal_row: int, goal_column: int, inscribed_m: float) -> FloatArray:
    """Minimum time (s) from each cell to the goal for a disc of the inscribed radius; infinite where no path exists."""
    field, weights = space.field, space.weights
    values, least_m = field.values, inscribed_m - field.cell_m
    rows, columns = lattice.rows, lattice.columns
    factor = np.full((rows, columns), np.inf)
    for i in range(rows):
        for j in range(columns):
            u = round((lattice.x0_m + j * lattice.cell_m - field.x0_m) / field.cell_m)
            v = round((lattice.y0_m + i * lattice.cell_m - field.y0_m) / field.cell_m)
            if 0 <= v < values.shape[0] and 0 <= u < values.shape[1] and values[v, u] > least_m:
                factor[i, j] = nearness(values[v, u] - inscribed_m + field.cell_m, weights)
                if space.zones.factor.shape[0] > 0:
                    factor[i, j] *= space.zones.least[v, u]
    cost = np.full((rows, columns), np.inf)
    cost[goal_row, goal_column] = 0.0
    heap = [(0.0, goal_row * columns + goal_column)]
    while len(heap) > 0:
        here, index = heapq.heappop(heap)
        i, j = index // columns, index % columns
        if here > cost[i, j]:
            continue
        for a in range(max(0, i - 1), min(rows, i + 2)):
            for b in range(max(0, j - 1), min(columns, j + 2)):
                seconds = math.hypot(a - i, b - j) * lattice.cell_m / weights.forward_m_s
                new = here + seconds * factor[a, b]
                if new < cost[a, b]:
                    cost[a, b] = new
                    heapq.heappush(heap, (new, a * columns + b))
    return cost


@compiled
def search(
    space: Space,
    lattice: Lattice,
    moves: IntArray,
    to_go: FloatArray,
    seeds: FloatArray,
    ends: FloatArray,
    greed: float,
    expansions: IntArray,
) -> IntArray:
    """Indices of the states on the best path from a seed to an end; empty when no path exists.

    A state's index is (row * columns + column) * headings + heading. `seeds` are rows of state index and cost so far.
    `ends` are rows of state index, increasing, and cost from there to the goal. Adds to the count `expansions` (1,).
    """
    states = lattice.rows * lattice.columns * lattice.headings
    cost = np.full(states + 1, np.inf)
    parent = np.full(states + 1, -1, dtype=np.int64)
    closed = np.zeros(states + 1, dtype=np.bool_)
    clear = np.full(states, np.nan, dtype=np.float32)
    heap = [(0.0, np.int64(0)) for _ in range(0)]
    for n in range(seeds.shape[0]):
        index = np.int64(seeds[n, 0])
        cost[index] = seeds[n, 1]
        heapq.heappush(heap, (seeds[n, 1] + greed * _ahead(to_go, lattice, index), index))
    seconds = _seconds(lattice, moves, space.weights)
    reached_totals, reached_states = np.empty(moves.shape[1]), np.empty(moves.shape[1], dtype=np.int64)
    while len(heap) > 0:
        _, index = heapq.heappop(heap)
        if index == states:
            break
        if closed[index]:
            continue
        closed[index] = True
        expansions[0] += 1
        end = np.searchsorted(ends[:, 0], index)
        if end < len(ends) and ends[end, 0] == index and cost[index] + ends[end, 1] < cost[states]:
            cost[states], parent[states] = cost[index] + ends[end, 1], index
            heapq.heappush(heap, (cost[states], np.int64(states)))
        count = _expand(
            space, lattice, moves, seconds, to_go, int(index), cost, closed, clear, reached_states, reached_totals
        )
        for n in range(count):
            new, total = reached_states[n], reached_totals[n]
            if total < cost[new]:
                cost[new], parent[new] = total, index
                heapq.heappush(heap, (total + greed * _ahead(to_go, lattice, new), new))
    return _trace(parent, states)


@compiled
def _seconds(lattice: Lattice, moves: IntArray, weights: Weights) -> FloatArray:
    """Seconds of each move from each heading, (headings, moves)."""
    seconds = np.empty((lattice.headings, moves.shape[1]))
    for k in range(lattice.headings):
        for n in range(moves.shape[1]):
            dx, dy = moves[k, n, 0] * lattice.cell_m, moves[k, n, 1] * lattice.cell_m
            dyaw = _turn(lattice, k, moves[k, n, 2])
            seconds[k, n] = motion_seconds(dx, dy, dyaw, lattice.yaws_rad[k] + 0.5 * dyaw, weights)
    return seconds


@compiled
def _turn(lattice: Lattice, k: int, change: int | np.int64) -> float:
    """Angle (rad) from a heading to the one `change` steps further, at most half a turn."""
    off = lattice.yaws_rad[(k + change) % lattice.headings] - lattice.yaws_rad[k]
    return float((off + math.pi) % (2.0 * math.pi) - math.pi)


@compiled
def _expand(
    space: Space,
    lattice: Lattice,
    moves: IntArray,
    seconds: FloatArray,
    to_go: FloatArray,
    index: int,
    cost: FloatArray,
    closed: NDArray[np.bool_],
    clear: NDArray[np.float32],
    reached_states: IntArray,
    reached_totals: FloatArray,
) -> int:
    """Writes the states that a state reaches at a lower cost than before, and these costs; returns their number."""
    headings, columns = lattice.headings, lattice.columns
    cell, k = index // headings, index % headings
    i, j = cell // columns, cell % columns
    here, there, count = np.empty(3), np.empty(3), 0
    here[0], here[1] = lattice.x0_m + j * lattice.cell_m, lattice.y0_m + i * lattice.cell_m
    here[2] = lattice.yaws_rad[k]
    if math.isnan(clear[index]):
        clear[index] = clearance_at(space.field, here[0], here[1], here[2])
    need = clearance_needed(space, here[0], here[1])
    for n in range(moves.shape[1]):
        a, b = i + moves[k, n, 1], j + moves[k, n, 0]
        if not (0 <= a < lattice.rows and 0 <= b < columns) or not to_go[a, b] < np.inf:
            continue
        new = (a * columns + b) * headings + (k + moves[k, n, 2]) % headings
        if closed[new]:
            continue
        there[0], there[1] = lattice.x0_m + b * lattice.cell_m, lattice.y0_m + a * lattice.cell_m
        there[2] = here[2] + _turn(lattice, k, moves[k, n, 2])
        if cost[index] + seconds[k, n] >= cost[new]:
            continue
        total = cost[index] + _move_cost(space, clear, here, there, clear[index], new, need, seconds[k, n])
        if total < cost[new]:
            reached_states[count], reached_totals[count] = new, total
            count += 1
    return count


@compiled
def _move_cost(
    space: Space,
    clear: NDArray[np.float32],
    here: FloatArray,
    there: FloatArray,
    clear_here: float,
    new: int,
    need: float,
    seconds: float,
) -> float:
    """Cost of one move; checks the clearance at its end (cached in `clear`), and between unless both have plenty."""
    if math.isnan(clear[new]):
        clear[new] = clearance_at(space.field, there[0], there[1], there[2])
    if clear[new] < need:
        return math.inf
    shift, turn = math.hypot(there[0] - here[0], there[1] - here[1]), abs(there[2] - here[2])
    length = shift + space.weights.turning_radius_m * turn
    steps = math.ceil(length / _CHECK_M)
    if clear_here + clear[new] - length < 2.0 * need:
        for n in range(1, steps):
            t = n / steps
            pose = here + t * (there - here)
            if clearance_at(space.field, pose[0], pose[1], pose[2]) < need:
                return math.inf
    zones = mean_zone_factor(space, here[0], here[1], there[0] - here[0], there[1] - here[1])
    return seconds * nearness(clear[new], space.weights) * zones


@compiled
def _ahead(to_go: FloatArray, lattice: Lattice, index: int | np.int64) -> float:
    """Cost to go from the cell of a state."""
    cell = index // lattice.headings
    return float(to_go[cell // lattice.columns, cell % lattice.columns])


@compiled
def _trace(parent: IntArray, last: int) -> IntArray:
    """The states from the seed up to the one before `last`."""
    count, index = 0, parent[last]
    while index >= 0:
        count += 1
        index = parent[index]
    states = np.empty(count, dtype=np.int64)
    index = parent[last]
    for n in range(count):
        states[count - 1 - n] = index
        index = parent[index]
    return states
