"""Cost of short motions: time at the usual speeds, more near obstacles. Search, smoothing and shortcuts share it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skills.compiled import compiled
from skills.footprint import ClearanceField, clearance_at
from skills.geometry import wrap
from skills.robot import FloatArray

TURNING_RADIUS_M = 0.6
"""Least distance (m) that the outline moves in a turn of one radian."""
_PLAIN_STEP_M = 0.06
_LONGEST_STEP_M = 0.3
_ZONE_STEP_M = 0.1
"""Longest distance between the points of a motion at which zones are looked up."""
_BACK_SHARE = -0.02
"""Cosine between a motion and a one-way direction below which the motion goes against it."""
_SLOWER_SHARE = 0.3
"""Extra time of a combined shift and turn, as a fraction of the shorter of the two."""


class Weights(NamedTuple):
    """Speeds and weights in the cost: see `LatticePlanner`. `turning_radius_m` is the outline's reach in a rotation."""

    forward_m_s: float
    backward_m_s: float
    lateral_m_s: float
    turn_rad_s: float
    soft_m: float
    soft_weight: float
    turning_radius_m: float


class Needs(NamedTuple):
    """Required clearance: margin_m, but escape_margin_m within escape_m of the start (x, y)."""

    margin_m: float
    escape_margin_m: float
    escape_m: float
    x_m: float
    y_m: float


class ZoneCosts(NamedTuple):
    """Zone costs at the points of a clearance field; empty arrays when no zone affects the cost.

    `factor`, 1 or more, multiplies the cost of a motion. `course` is the direction (rad) that motions must not oppose;
    NaN allows any direction. `least` is the smallest factor near each point.
    """

    factor: NDArray[np.float32]
    course: NDArray[np.float32]
    least: NDArray[np.float32]


NO_ZONES = ZoneCosts(*3 * [np.empty((0, 0), dtype=np.float32)])


class Space(NamedTuple):
    """Input of a plan: the sampled clearance, the required clearance, the cost weights, and the zones."""

    field: ClearanceField
    needs: Needs
    weights: Weights
    zones: ZoneCosts = NO_ZONES


@compiled
def clearance_needed(space: Space, x: float, y: float) -> float:
    """Clearance (m) that a pose at (x, y) requires."""
    needs = space.needs
    near = math.hypot(x - needs.x_m, y - needs.y_m) < needs.escape_m
    return needs.escape_margin_m if near else needs.margin_m


@compiled
def motion_seconds(dx: float, dy: float, dyaw: float, yaw: float, weights: Weights) -> float:
    """Time (s) of a short motion (world dx, dy, dyaw) of a body whose heading midway is `yaw`."""
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, aside = c * dx + s * dy, -s * dx + c * dy
    speed = weights.forward_m_s if ahead >= 0.0 else weights.backward_m_s
    shift, turn = math.hypot(ahead / speed, aside / weights.lateral_m_s), abs(dyaw) / weights.turn_rad_s
    return max(shift, turn) + _SLOWER_SHARE * min(shift, turn)


@compiled
def nearness(clearance: float, weights: Weights) -> float:
    """Factor, 1 or more, by which a small clearance multiplies the cost of a motion."""
    short = min(max(0.0, (weights.soft_m - clearance) / weights.soft_m), 1.0)
    return 1.0 + weights.soft_weight * short * short


@compiled
def zone_factor(space: Space, x: float, y: float, dx: float, dy: float) -> float:
    """Factor, 1 or more, by which the zones at (x, y) multiply a motion's cost; infinite against a one-way zone."""
    if space.zones.factor.shape[0] == 0:
        return 1.0
    field, factor = space.field, space.zones.factor
    i, j = round((y - field.y0_m) / field.cell_m), round((x - field.x0_m) / field.cell_m)
    if not (0 <= i < factor.shape[0] and 0 <= j < factor.shape[1]):
        return 1.0
    course = space.zones.course[i, j]
    if not math.isnan(course) and math.cos(course) * dx + math.sin(course) * dy < _BACK_SHARE * math.hypot(dx, dy):
        return math.inf
    return float(factor[i, j])


@compiled
def mean_zone_factor(space: Space, x: float, y: float, dx: float, dy: float) -> float:
    """Mean of `zone_factor` along a motion (dx, dy) from (x, y)."""
    if space.zones.factor.shape[0] == 0:
        return 1.0
    count, total = max(1, math.ceil(math.hypot(dx, dy) / _ZONE_STEP_M)), 0.0
    for n in range(count):
        t = (n + 0.5) / count
        total += zone_factor(space, x + t * dx, y + t * dy, dx, dy)
    return total / count


@compiled
def segment_cost(space: Space, a: FloatArray, b: FloatArray, need: float) -> float:
    """Cost of a straight motion from pose a to pose b with a uniform turn; infinite where clearance is below `need`.

    The yaws must differ by the intended turn (no wrapping here). A step is as long as the spare clearance, at least 6
    cm, since no point of the outline moves farther than a step.
    """
    dx, dy, dyaw = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = max(1e-9, math.hypot(dx, dy) + space.weights.turning_radius_m * abs(dyaw))
    cost, gone, spare = 0.0, 0.0, 0.0
    while gone < 1.0:
        part = min(1.0 - gone, max(_PLAIN_STEP_M, min(_LONGEST_STEP_M, spare)) / length)
        gone = 1.0 if part >= 1.0 - gone else gone + part
        least = clearance_at(space.field, a[0] + gone * dx, a[1] + gone * dy, a[2] + gone * dyaw)
        if least < need:
            return math.inf
        spare = least - need
        begun = gone - part
        zones = mean_zone_factor(space, a[0] + begun * dx, a[1] + begun * dy, part * dx, part * dy)
        midway = a[2] + (gone - 0.5 * part) * dyaw
        seconds = motion_seconds(part * dx, part * dy, part * dyaw, midway, space.weights)
        cost += seconds * nearness(least, space.weights) * zones
    return cost


@compiled
def drive_cost(space: Space, a: FloatArray, b: FloatArray, need: float) -> tuple[float, float]:
    """Cost of a turn on the spot, a straight and a turn from pose a to pose b, and the yaw on the straight.

    The base drives forward or backward, whichever costs less; when neither is free the cost is infinite, with the
    nearer yaw. The yaw differs from a's yaw by the intended turn.
    """
    dx, dy = b[0] - a[0], b[1] - a[1]
    moved = math.hypot(dx, dy) > 1e-6
    course = math.atan2(dy, dx) if moved else a[2]
    best, heading = math.inf, a[2] + _half_turn(course - a[2])
    if moved and abs(heading - a[2]) > 0.5 * math.pi:
        heading = a[2] + _half_turn(course + math.pi - a[2])
    corner, end, last = a.copy(), b.copy(), b.copy()
    for back in range(2 if moved else 1):
        corner[2] = end[2] = a[2] + _half_turn(course + back * math.pi - a[2])
        last[2] = end[2] + _half_turn(b[2] - end[2])
        cost = segment_cost(space, corner, end, need)
        if cost < best:
            cost += segment_cost(space, a, corner, need)
        if cost < best:
            cost += segment_cost(space, end, last, need)
        if cost < best:
            best, heading = cost, corner[2]
    return best, heading


_half_turn = compiled(wrap)
