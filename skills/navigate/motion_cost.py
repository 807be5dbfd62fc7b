"""What a short motion costs: seconds at usual speeds, more near obstacles. Shared by search and shortcutting."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skills.estimate.compiled import compiled
from skills.navigate.footprint import SAFE_MARGIN_M, clearance_at
from skills.robot import FloatArray

Weights = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class PlannerOptions:
    """Numbers of the planner.

    Speeds (m/s, rad/s) say how dear each way of moving is. Poses keep `margin_m`; nearer than `soft_m` to an obstacle
    the cost grows up to (1 + soft_weight) fold. A start that is blocked by noise may be left through poses that are no
    worse, within `escape_m`.
    """

    forward_m_s: float = 0.8
    backward_m_s: float = 0.25
    lateral_m_s: float = 0.25
    turn_rad_s: float = 0.9
    margin_m: float = SAFE_MARGIN_M
    soft_m: float = 0.35
    soft_weight: float = 3.0
    escape_m: float = 0.6
    deepest_start_m: float = 0.2
    cell_m: float = 0.1
    headings: int = 16
    greed: float = 1.3

    def weights(self) -> Weights:
        """The numbers that a motion's cost depends on, for the compiled loops."""
        return (
            self.forward_m_s,
            self.backward_m_s,
            self.lateral_m_s,
            self.turn_rad_s,
            self.soft_m,
            self.soft_weight,
        )


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
