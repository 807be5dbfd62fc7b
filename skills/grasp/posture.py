"""How high the body stands for what lies where."""

from __future__ import annotations

from skills.robot import Capabilities

_HIGH_SURFACE_M = 0.72
_BELOW_LIMIT_M = 0.005


def body_height_m(base_m: float, capabilities: Capabilities) -> float:
    """Height of the body's origin over the floor to take an object that stands base_m over the floor."""
    if base_m < _HIGH_SURFACE_M:
        return capabilities.standing_height_m
    return max(capabilities.standing_height_m, capabilities.height_range_m[1] - _BELOW_LIMIT_M)
