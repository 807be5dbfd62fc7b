"""Obstacles around the robot: points of the last scan, and the no-go regions of clients."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from errand_spot.messages import InvalidRequestError, finite, transform
from skills.robot import FloatArray, Pose2D, Scan

if TYPE_CHECKING:
    from errand_spot.server.computer import Computer, Snapshot

HEIGHTS_M: Final = (0.15, 1.0)
_PADDING_M: Final = 0.05
_NEAR_M, _CARRIED_M = 2.0, 0.35
_SPACING_M, _LARGEST_M = 0.05, 100.0
_BRAKING_S, _WAITS_S = 0.7, 0.04
"""Time to a collision from which on the robot slows down, and at which it waits."""
_AHEAD_S: Final = np.linspace(0.05, _BRAKING_S, 14)


@dataclass(frozen=True)
class Region:
    """No-go region of a client: points on its outline (N, 2) in `odom`, until a robot time."""

    outline_O: FloatArray
    until_s: float


class ScanPoints:
    """Points of the last scan at the height of the body, in `odom`."""

    def __init__(self) -> None:
        self._scan: Scan | None = None
        self._points_O = np.empty((0, 2))

    def points_O(self, scan: Scan | None) -> FloatArray:
        """Points (N, 2) of a scan; the last ones again without a new scan."""
        if scan is not None and scan is not self._scan:
            points_O = (scan.X_OB @ scan.points_B().T).T
            high = (points_O[:, 2] > HEIGHTS_M[0]) & (points_O[:, 2] < HEIGHTS_M[1])
            self._scan, self._points_O = scan, points_O[high, :2]
        return self._points_O


class Clearance:
    """Slows a walk down in front of obstacles, by the obstacle parameters of its command."""

    def __init__(self, params: Any) -> None:
        """Raises InvalidRequestError for a padding that is negative or not finite."""
        given_m = finite(params.obstacle_avoidance_padding, "obstacle_params.obstacle_avoidance_padding")
        if given_m < 0.0:
            raise InvalidRequestError(f"obstacle_params.obstacle_avoidance_padding is {given_m}; it must be >= 0")
        self._padding_m = given_m or _PADDING_M
        self._scans = None if params.disable_vision_body_obstacle_avoidance else ScanPoints()

    def limit(self, computer: Computer, velocity: FloatArray) -> FloatArray:
        """Returns a velocity (3,) of the body that stops before it touches an obstacle."""
        points_B = self._points_B(computer)
        if not len(points_B) or not np.any(velocity):
            return velocity
        corners = np.array(computer.capabilities.footprint_m)
        low, high = corners.min(axis=0), corners.max(axis=0)
        away_m = np.maximum(low - points_B, points_B - high).max(axis=1)
        points_B, away_m = points_B[away_m > 0.0], away_m[away_m > 0.0]  # the others are the robot's own
        margin = np.minimum(away_m, self._padding_m)[:, None]
        vx, vy, wz = velocity
        turned = wz * _AHEAD_S
        c, s = np.cos(turned)[:, None], np.sin(turned)[:, None]
        x, y = points_B[:, 0] - (vx * _AHEAD_S)[:, None], points_B[:, 1] - (vy * _AHEAD_S)[:, None]
        ahead = np.stack([c * x + s * y, c * y - s * x], axis=2)
        touched = ((ahead > low - margin) & (ahead < high + margin)).all(axis=2).any(axis=1)
        if not touched.any():
            return velocity
        free_s = float(_AHEAD_S[touched][0]) - float(_AHEAD_S[0])
        return velocity * (free_s / _BRAKING_S if free_s > _WAITS_S else 0.0)

    def _points_B(self, computer: Computer) -> FloatArray:
        """Points (N, 2) near the body, without those at what the hand carries."""
        snapshot = computer.snapshot
        points_O = [] if self._scans is None else [self._scans.points_O(snapshot.scan)]
        points_O += [region.outline_O for region in computer.regions if region.until_s > snapshot.time_s]
        if not points_O:
            return np.empty((0, 2))
        pose = snapshot.odometry.pose
        away = np.concatenate(points_O) - [pose.x_m, pose.y_m]
        away = away[(np.abs(away) < _NEAR_M).all(axis=1)]
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        points_B = away @ np.array([[c, -s], [s, c]])
        if snapshot.gripper.holding and "hand" in snapshot.frames:
            hand_B = snapshot.X_AB("body", "hand").translation()[:2]
            points_B = points_B[np.linalg.norm(points_B - hand_B, axis=1) > _CARRIED_M]
        return np.asarray(points_B)


def region_of(message: Any, until_s: float, snapshot: Snapshot) -> Region | None:
    """Region of a client's object; None for one without an obstacle. Raises InvalidRequestError."""
    given = message.nogo_region_properties
    kind = given.WhichOneof("region")
    if kind is None or (given.disable_body_obstacle_generation and given.disable_foot_obstacle_generation):
        return None
    placed = getattr(given, kind)
    if placed.frame_name not in ("odom", "vision"):
        raise InvalidRequestError(f"nogo_region_properties.{kind}.frame_name must be odom or vision")
    field = f"nogo_region_properties.{kind}"
    X_OR = snapshot.X_AB("odom", placed.frame_name) @ transform(getattr(placed, f"frame_name_tform_{kind}"), field)
    outline = _box(placed.box.size, field) if kind == "box" else _circle(placed.circle, field)
    pose = Pose2D.from_transform(X_OR)
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return Region(outline @ np.array([[c, s], [-s, c]]) + [pose.x_m, pose.y_m], until_s)


def _box(size: Any, field: str) -> FloatArray:
    x, y = 0.5 * _size(size.x, field), 0.5 * _size(size.y, field)
    corners = [(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
    return np.concatenate([np.linspace(a, b, _count(math.dist(a, b))) for a, b in pairwise(corners)])


def _circle(circle: Any, field: str) -> FloatArray:
    radius_m = _size(circle.radius, field)
    angles = np.linspace(0.0, math.tau, _count(math.tau * radius_m))
    middle = [circle.center_pt.x, circle.center_pt.y]
    return np.asarray(radius_m * np.column_stack([np.cos(angles), np.sin(angles)]) + middle)


def _size(value: float, field: str) -> float:
    if not 0.0 < finite(value, field) <= _LARGEST_M:
        raise InvalidRequestError(f"{field}: a size is {value} m; it must be positive and at most {_LARGEST_M:.0f} m")
    return value


def _count(length_m: float) -> int:
    return 2 + math.ceil(length_m / _SPACING_M)
