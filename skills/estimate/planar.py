"""Planar poses: composition, inversion and angles."""

from __future__ import annotations

import math

from skills.robot import Pose2D


def wrap(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def compose(X_AB: Pose2D, X_BC: Pose2D) -> Pose2D:
    """X_AC."""
    c, s = math.cos(X_AB.yaw_rad), math.sin(X_AB.yaw_rad)
    x_m = X_AB.x_m + c * X_BC.x_m - s * X_BC.y_m
    y_m = X_AB.y_m + s * X_BC.x_m + c * X_BC.y_m
    return Pose2D(x_m, y_m, wrap(X_AB.yaw_rad + X_BC.yaw_rad))


def inverse(X_AB: Pose2D) -> Pose2D:
    """X_BA."""
    c, s = math.cos(X_AB.yaw_rad), math.sin(X_AB.yaw_rad)
    return Pose2D(-c * X_AB.x_m - s * X_AB.y_m, s * X_AB.x_m - c * X_AB.y_m, -X_AB.yaw_rad)


def relative(X_WA: Pose2D, X_WB: Pose2D) -> Pose2D:
    """X_AB of two poses in one frame."""
    return compose(inverse(X_WA), X_WB)
