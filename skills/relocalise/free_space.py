"""How far the body can go straight in a direction, by what LiDAR and cameras see now; no map is needed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skills.quantities import Height, Margin
from skills.robot import Capabilities, FloatArray, Scan

_BEYOND_M = 5.0


@dataclass(frozen=True)
class FreeSpaceOptions:
    """Points between `heights_m` above the floor are in the way; what the body keeps off them (m)."""

    heights_m: tuple[Height, Height] = (0.1, 1.2)
    side_m: Margin = 0.15
    ahead_m: Margin = 0.3
    turning_m: Margin = 0.04


def obstacles_B(scan: Scan, capabilities: Capabilities, options: FreeSpaceOptions) -> FloatArray:
    """Points (N, 2) of a scan in the body frame that the body would hit; what is within its outline is itself."""
    points = scan.points_B()
    heights = points[:, 2] + scan.X_OB.translation()[2]
    x, y = points[:, 0], points[:, 1]
    corners = np.asarray(capabilities.footprint_m)
    own = np.all((points[:, :2] > corners.min(axis=0)) & (points[:, :2] < corners.max(axis=0)), axis=1)
    low, high = options.heights_m
    kept = ~own & (heights > low) & (heights < high) & (np.hypot(x, y) < _BEYOND_M)
    return np.ascontiguousarray(points[kept, :2])


def free_m(obstacles: FloatArray, heading_rad: float, capabilities: Capabilities, options: FreeSpaceOptions) -> float:
    """How far (m) the body can go straight once it has turned to a heading in the body frame."""
    corners = np.asarray(capabilities.footprint_m)
    front, half = corners[:, 0].max(), np.abs(corners[:, 1]).max() + options.side_m
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    along, across = c * obstacles[:, 0] + s * obstacles[:, 1], c * obstacles[:, 1] - s * obstacles[:, 0]
    ahead = along[(np.abs(across) < half) & (along > 0.0)]
    return float(max(0.0, ahead.min() - front - options.ahead_m)) if len(ahead) else _BEYOND_M


def can_turn(obstacles: FloatArray, capabilities: Capabilities, options: FreeSpaceOptions) -> bool:
    """Whether the body can turn on the spot."""
    radius = max(math.hypot(x, y) for x, y in capabilities.footprint_m) + options.turning_m
    return not len(obstacles) or float(np.hypot(obstacles[:, 0], obstacles[:, 1]).min()) > radius
