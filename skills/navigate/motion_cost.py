"""What a short motion costs: seconds at usual speeds, more near obstacles. Shared by search and shortcutting."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.navigate.footprint import clearance_at
from skills.robot import FloatArray

Weights = tuple[float, float, float, float, float, float]
"""Speeds ahead, back, sideways (m/s) and turning (rad/s), then `soft_m` and `soft_weight` of the planner."""


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

    The yaws must differ by the turn that is meant (no wrapping here).
    """
    dx, dy, dyaw = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    steps = max(1, math.ceil((math.hypot(dx, dy) + 0.6 * abs(dyaw)) / 0.06))
    cost = 0.0
    for n in range(steps):
        t = (n + 1.0) / steps
        least = clearance_at(field, frame, discs, a[0] + t * dx, a[1] + t * dy, a[2] + t * dyaw)
        if least < need:
            return math.inf
        yaw = a[2] + (n + 0.5) / steps * dyaw
        cost += motion_seconds(dx / steps, dy / steps, dyaw / steps, yaw, weights) * nearness(least, weights)
    return cost
