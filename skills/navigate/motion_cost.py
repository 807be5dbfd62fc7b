"""What a short motion costs: seconds at usual speeds, more near obstacles. Shared by search and shortcutting."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.navigate.footprint import clearance_at
from skills.robot import FloatArray

TURNING_RADIUS_M = 0.6
"""How far (m) the outline moves with a turn of one radian, at least."""
Weights = tuple[float, float, float, float, float, float, float]
"""Speeds ahead, back, sideways (m/s) and turning (rad/s), then `soft_m` and `soft_weight` of the planner, and how far
(m) the outline moves with a turn of one radian, at most."""


@compiled
def motion_seconds(dx: float, dy: float, dyaw: float, yaw: float, weights: Weights) -> float:
    """Seconds for a short motion (world dx, dy, dyaw) of a body that heads to yaw midway."""
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, aside = c * dx + s * dy, -s * dx + c * dy
    speed = weights[0] if ahead >= 0.0 else weights[1]
    shift, turn = math.hypot(ahead / speed, aside / weights[2]), abs(dyaw) / weights[3]
    return max(shift, turn) + 0.3 * min(shift, turn)


@compiled
def nearness(clearance: float, weights: Weights) -> float:
    """The factor by which a clearance makes a motion dearer."""
    short = min(max(0.0, (weights[4] - clearance) / weights[4]), 1.0)
    return 1.0 + weights[5] * short * short


@compiled
def segment_cost(
    field: NDArray[np.float32],
    frame: tuple[float, float, float],
    discs: FloatArray,
    a: FloatArray,
    b: FloatArray,
    need: float,
    weights: Weights,
) -> float:
    """Cost of going straight from pose a to pose b while turning evenly; infinite where clearance falls below need.

    The yaws must differ by the turn that is meant (no wrapping here). Steps are as long as the clearance to spare,
    since no point of the outline moves farther than that; at least 6 cm.
    """
    dx, dy, dyaw = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    way = max(1e-9, math.hypot(dx, dy) + weights[6] * abs(dyaw))
    cost, gone, spare = 0.0, 0.0, 0.0
    while gone < 1.0:
        part = min(1.0 - gone, max(0.06, min(0.3, spare)) / way)
        gone = 1.0 if part >= 1.0 - gone else gone + part
        least = clearance_at(field, frame, discs, a[0] + gone * dx, a[1] + gone * dy, a[2] + gone * dyaw)
        if least < need:
            return math.inf
        spare = least - need
        seconds = motion_seconds(part * dx, part * dy, part * dyaw, a[2] + (gone - 0.5 * part) * dyaw, weights)
        cost += seconds * nearness(least, weights)
    return cost


@compiled
def drive_cost(
    field: NDArray[np.float32],
    frame: tuple[float, float, float],
    discs: FloatArray,
    a: FloatArray,
    b: FloatArray,
    need: float,
    weights: Weights,
) -> tuple[float, float]:
    """Cost of a turn on the spot, a straight and a turn from pose a to pose b, and the yaw on the straight.

    Ahead or back, whichever is cheaper; infinite, with the nearer yaw, where neither is free. The yaw differs from a's
    by the turn that is meant.
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
        cost = segment_cost(field, frame, discs, corner, end, need, weights)
        if cost < best:
            cost += segment_cost(field, frame, discs, a, corner, need, weights)
        if cost < best:
            cost += segment_cost(field, frame, discs, end, last, need, weights)
        if cost < best:
            best, heading = cost, corner[2]
    return best, heading


@compiled
def _half_turn(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
