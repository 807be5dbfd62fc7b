"""Obstacles around the robot: points of the last scan, and the no-go regions of clients."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from errand_spot.messages import InvalidRequestError, transform
from skills.robot import FloatArray, Pose2D, Scan

if TYPE_CHECKING:
    from errand_spot.server.computer import Computer, Snapshot

HEIGHTS_M: Final = (0.15, 1.0)
_PADDING_M, _NEAR_M, _CARRIED_M = 0.05, 2.0, 0.35
_REMEMBERED_S, _CELL_M, _SEEN_M, _THIN_M, _AROUND_M = 15.0, 0.05, 0.01, 0.12, 0.2
_SPACING_M, _LARGEST_M, _FAR_M, _ENOUGH_M, _PER_LEG = 0.05, 100.0, 5.0, 0.15, 12
_BRAKING_S, _WAITS_S = 0.5, 0.04
"""Time to a collision from which on the robot slows down, and at which it waits."""
_AHEAD_S: Final = np.linspace(0.05, _BRAKING_S, 14)


@dataclass(frozen=True)
class Region:
    """No-go region of a client: points on its outline (N, 2) in `odom`, until a robot time."""

    outline_O: FloatArray
    until_s: float


class ScanPoints:
    """Highest points of the last scan up to the body's height; earlier ones below or, if thin, between its beams."""

    def __init__(self) -> None:
        self._scan: Scan | None = None
        self._points = np.empty((0, 5))  # x, y, z in `odom`, their time, and whether they are of something thin
        self.points_O: FloatArray = self._points[:, :2]

    def take(self, scan: Scan | None) -> None:
        """Takes in a scan; nothing without a new one."""
        if scan is None or scan is self._scan:
            return
        points_O = (scan.X_OB @ scan.points_B().T).T
        points_O = points_O[(points_O[:, 2] > HEIGHTS_M[0]) & (points_O[:, 2] < HEIGHTS_M[1])]
        away = self._points[:, :3] - (scan.X_OB @ scan.X_BL).translation()
        far_m = np.hypot(away[:, 0], away[:, 1])
        low = away[:, 2] < far_m * math.tan(float(scan.elevations_rad.min())) - _CELL_M
        missed_m = np.abs(away[:, 2:] - far_m[:, None] * np.tan(scan.elevations_rad)).min(axis=1)
        unseen = (far_m < _NEAR_M) & (low | ((missed_m > _SEEN_M) & (self._points[:, 4] > 0.0)))
        kept = self._points[unseen & (self._points[:, 3] > scan.stamp_s - _REMEMBERED_S)]
        highest = points_O[np.argsort(-points_O[:, 2], kind="stable")]
        first = np.unique(np.round(highest[:, :2] / _CELL_M), axis=0, return_index=True)[1]
        around = np.round(highest[:, :2] / _AROUND_M)
        _, top, inverse = np.unique(around, axis=0, return_index=True, return_inverse=True)
        bottom = len(around) - 1 - np.unique(around[::-1], axis=0, return_index=True)[1]
        thin = (highest[top, 2] - highest[bottom, 2] < _THIN_M)[inverse.ravel()][first]
        new = np.column_stack([highest[first], np.full(len(first), scan.stamp_s), thin])
        self._scan, self._points = scan, np.concatenate([kept, new])
        self.points_O = self._points[:, :2]


class Clearance:
    """Slows a walk down in front of obstacles, by the obstacle parameters of its command."""

    def __init__(self, params: Any) -> None:
        self._padding_m = params.obstacle_avoidance_padding or _PADDING_M
        self._sees = not params.disable_vision_body_obstacle_avoidance

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
        turned = velocity[2] * _AHEAD_S
        c, s = np.cos(turned)[:, None], np.sin(turned)[:, None]
        x, y = (points_B[:, k] - (velocity[k] * _AHEAD_S)[:, None] for k in (0, 1))
        ahead = np.stack([c * x + s * y, c * y - s * x], axis=2)
        touched = ((ahead > low - margin) & (ahead < high + margin)).all(axis=2).any(axis=1)
        if not touched.any():
            return velocity
        free_s = float(_AHEAD_S[touched][0]) - float(_AHEAD_S[0])
        return velocity * (free_s / _BRAKING_S if free_s > _WAITS_S else 0.0)

    def _points_B(self, computer: Computer) -> FloatArray:
        """Points (N, 2) near the body, without those at what the hand carries."""
        snapshot = computer.snapshot
        points_O = [computer.scan_points.points_O[: None if self._sees else 0]]
        points_O += [region.outline_O for region in computer.regions if region.until_s > snapshot.time_s]
        points_B = seen_from(snapshot.odometry.pose, np.concatenate(points_O))
        points_B = points_B[(np.abs(points_B) < _NEAR_M).all(axis=1)]
        if snapshot.gripper.holding and "hand" in snapshot.frames:
            hand_B = snapshot.X_AB("body", "hand").translation()[:2]
            points_B = points_B[np.linalg.norm(points_B - hand_B, axis=1) > _CARRIED_M]
        return points_B


def room_m(computer: Computer, poses: Sequence[Pose2D]) -> float:
    """Least distance of the body from what the LiDAR shows on a way through poses in `odom`, at most 0.15 m."""
    points_O = computer.scan_points.points_O
    points_O = points_O[(np.abs(points_O - [poses[0].x_m, poses[0].y_m]) < _FAR_M).all(axis=1)]
    corners, least_m = np.array(computer.capabilities.footprint_m), _ENOUGH_M
    for a, b in pairwise(poses):
        turn = math.remainder(b.yaw_rad - a.yaw_rad, math.tau)
        for share in np.linspace(0.0, 1.0, _PER_LEG).tolist() if len(points_O) else ():
            x, y = a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m)
            points_B = seen_from(Pose2D(x, y, a.yaw_rad + share * turn), points_O)
            off_m = np.maximum(corners.min(axis=0) - points_B, points_B - corners.max(axis=0)).max(axis=1)
            least_m = min(least_m, float(off_m.min()))
    return least_m


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
    if kind == "box":
        x, y = 0.5 * _size(placed.box.size.x, field), 0.5 * _size(placed.box.size.y, field)
        corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)])
    else:
        angles, middle = np.linspace(0.0, math.tau, 37), placed.circle.center_pt
        around = _size(placed.circle.radius, field) * np.column_stack([np.cos(angles), np.sin(angles)])
        corners = around + [middle.x, middle.y]
    sides = [np.linspace(a, b, 2 + math.ceil(math.dist(a, b) / _SPACING_M)) for a, b in pairwise(corners)]
    outline = np.concatenate(sides)
    return Region((X_OR @ np.column_stack([outline, np.zeros(len(outline))]).T).T[:, :2], until_s)


def _size(value: float, field: str) -> float:
    if not 0.0 < value <= _LARGEST_M:
        raise InvalidRequestError(f"{field}: a size is {value} m; it must be positive and at most {_LARGEST_M:.0f} m")
    return value


def seen_from(pose: Pose2D, points_O: FloatArray) -> FloatArray:
    """Points (N, 2) of `odom` in the frame of a body at a pose."""
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.asarray((points_O - [pose.x_m, pose.y_m]) @ np.array([[c, -s], [s, c]]))
