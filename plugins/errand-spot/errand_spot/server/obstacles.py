"""Obstacles around the robot: points of the last scan, and the no-go regions of clients."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from scipy.spatial import KDTree

from errand_spot.messages import InvalidRequestError, transform
from errand_spot.server.computer import Computer, Snapshot
from errand_spot.server.scan_points import Region
from skills.robot import FloatArray, Pose2D

_PADDING_M, _NEAR_M, _CARRIED_M = 0.05, 2.0, 0.35
_LARGEST_M, _FAR_M = 100.0, 5.0
_BRAKING_S, _WAITS_S = 0.5, 0.04
"""Time to a collision from which on the robot slows down, and at which it waits."""
_SLIP_M, _ALONG, _LEVEL = 0.005, 0.3, 0.5
"""Tolerance of a walk beside a region, the share of its speed that may point inwards, least share of level ground."""
_AHEAD_S: Final = np.linspace(0.05, _BRAKING_S, 14)


class Clearance:
    """Slows a walk down in front of obstacles, by the obstacle parameters of its command."""

    def __init__(self, params: Any) -> None:
        self._padding_m = params.obstacle_avoidance_padding or _PADDING_M
        self._sees = not params.disable_vision_body_obstacle_avoidance

    def limit(self, computer: Computer, velocity: FloatArray) -> FloatArray:
        """Returns a velocity (3,) of the body that stops before it touches an obstacle or enters a region."""
        snapshot, corners = computer.snapshot, np.array(computer.capabilities.footprint_m)
        low, high = corners.min(axis=0), corners.max(axis=0)
        outline_B = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        for region in computer.regions:
            if region.until_s > snapshot.time_s:
                velocity = self._outside(outline_B, seen_from(snapshot.odometry.pose, region.corners_O), velocity)
        points_B = self._points_B(computer)
        if not len(points_B) or not np.any(velocity):
            return velocity
        away_m = np.maximum(low - points_B, points_B - high).max(axis=1)
        points_B, away_m = points_B[away_m > 0.0], away_m[away_m > 0.0]  # the others are the robot's own
        margin = np.minimum(away_m, self._padding_m)[:, None]
        c, s = np.cos(velocity[2] * _AHEAD_S)[:, None], np.sin(velocity[2] * _AHEAD_S)[:, None]
        x, y = (points_B[:, k] - (velocity[k] * _AHEAD_S)[:, None] for k in (0, 1))
        ahead = np.stack([c * x + s * y, c * y - s * x], axis=2)
        touched = ((ahead > low - margin) & (ahead < high + margin)).all(axis=2).any(axis=1)
        return _slowed(velocity, touched)

    def _outside(self, outline_B: FloatArray, region_B: FloatArray, velocity: FloatArray) -> FloatArray:
        """Returns a velocity (3,) with which the body enters a region no deeper, and walks along its side."""
        gaps_m, directions = _gaps_m(outline_B[None], region_B)
        now_m, towards = float(gaps_m[0]), directions[0]
        if now_m > _NEAR_M:
            return velocity
        inwards = float(velocity[:2] @ towards)
        if now_m < self._padding_m + _SLIP_M and 0.0 < inwards < _ALONG * float(np.hypot(*velocity[:2])):
            velocity = velocity - np.array([*(inwards * towards), 0.0])
        moved = np.outer(_AHEAD_S, velocity)
        c, s = np.cos(moved[:, 2]), np.sin(moved[:, 2])
        turns = np.stack([c, s, -s, c], axis=1).reshape(-1, 2, 2)
        ahead_m = _gaps_m(outline_B @ turns + moved[:, None, :2], region_B)[0]
        return _slowed(velocity, np.less(ahead_m, min(now_m, self._padding_m) - _SLIP_M))

    def _points_B(self, computer: Computer) -> FloatArray:
        """Points (N, 2) near the body, without those at what the hand carries."""
        snapshot = computer.snapshot
        points_B = seen_from(snapshot.odometry.pose, computer.scan_points.points_O[: None if self._sees else 0])
        points_B = points_B[(np.abs(points_B) < _NEAR_M).all(axis=1)]
        if snapshot.gripper.holding and "hand" in snapshot.frames:
            hand_B = snapshot.X_AB("body", "hand").translation()[:2]
            points_B = points_B[np.linalg.norm(points_B - hand_B, axis=1) > _CARRIED_M]
        return points_B


class SeenSpace:
    """Free space, for planners: away from what the LiDAR has shown, and outside of no-go regions."""

    def __init__(self, computer: Computer) -> None:
        snapshot, corners = computer.snapshot, np.array(computer.capabilities.footprint_m)
        points_O, low, high = computer.scan_points.points_O, corners.min(axis=0), corners.max(axis=0)
        points_B = seen_from(snapshot.odometry.pose, points_O)
        self._tree = KDTree(points_O[((points_B < low) | (points_B > high)).any(axis=1)])  # the others are its own
        self._regions = [each for each in computer.regions if each.until_s > snapshot.time_s]

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Distance (N,) of points (N, 2) of `odom` from the nearest obstacle."""
        away_m = np.minimum(self._tree.query(points_W)[0], _FAR_M)
        for region in self._regions:
            normals, starts = _sides(region.corners_O)
            away_m = np.minimum(away_m, (points_W @ normals.T - starts).max(axis=1))
        return np.asarray(away_m)


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
        corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    else:
        angles, middle = np.linspace(0.0, math.tau, 37)[1:], placed.circle.center_pt
        around = _size(placed.circle.radius, field) * np.column_stack([np.cos(angles), np.sin(angles)])
        corners = around + [middle.x, middle.y]
    corners_O = (X_OR @ np.column_stack([corners, np.zeros(len(corners))]).T).T[:, :2]
    if abs(level := float(X_OR.rotation().matrix()[2, 2])) < _LEVEL:
        raise InvalidRequestError(f"{field}: the region must lie level on the floor")
    return Region(corners_O if level > 0.0 else corners_O[::-1], until_s)


def _slowed(velocity: FloatArray, touched: FloatArray) -> FloatArray:
    """Velocity (3,) slowed down by the first of the times ahead at which the body touches something."""
    if not touched.any():
        return velocity
    free_s = float(_AHEAD_S[touched][0]) - float(_AHEAD_S[0])
    return velocity * (free_s / _BRAKING_S if free_s > _WAITS_S else 0.0)


def _gaps_m(outlines: FloatArray, region: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gaps (T,) of convex outlines (T, N, 2) to a region, negative by the overlap's depth, and directions (T, 2) to it.

    The axis of separation is normal to an edge of either outline.
    """
    (ours, our_starts), (theirs, their_starts) = _sides(outlines), _sides(region)
    to_region = (region @ ours.swapaxes(1, 2)).min(axis=1) - our_starts
    gaps_m = np.concatenate([to_region, (outlines @ theirs.T).min(axis=1) - their_starts], axis=1)
    towards = np.concatenate([ours, np.broadcast_to(-theirs, (len(ours), *theirs.shape))], axis=1)
    best = np.arange(len(gaps_m)), gaps_m.argmax(axis=1)
    return gaps_m[best], towards[best]


def _size(value: float, field: str) -> float:
    if not 0.0 < value <= _LARGEST_M:
        raise InvalidRequestError(f"{field}: a size is {value} m; it must be positive and at most {_LARGEST_M:.0f} m")
    return value


def seen_from(pose: Pose2D, points_O: FloatArray) -> FloatArray:
    """Points (N, 2) of `odom` in the frame of a body at a pose."""
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.asarray((points_O - [pose.x_m, pose.y_m]) @ np.array([[c, -s], [s, c]]))


def _sides(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Outer normals (..., N, 2) of a convex outline's sides, and how far along them each side lies (..., N)."""
    along = np.roll(corners, -1, axis=-2) - corners
    normals = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1)[..., None]
    return normals, (corners * normals).sum(axis=-1)
