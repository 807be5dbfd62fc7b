"""Reads poses and velocities from messages of ROS 2; refuses numbers that are not finite."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform

from errand_ros2.messages import MAP_FRAME
from skills.estimate.grid_map import GridMap
from skills.geometry import compose
from skills.inputs.errors import InputError
from skills.robot import Capabilities, Pose2D

FRAMES: Final = frozenset({MAP_FRAME, "world"})
"""Names of the map's frame."""
TOPIC: Final = "cmd_vel"
LIFE_S: Final = 0.2
"""Time after which a velocity no longer counts; then the robot stands."""
STILL: Final = ((0.0, 0.0, 0.0), -math.inf)
_SHORTEST_QUATERNION: Final = 0.1


def transform_of(at: Any, turn: Any) -> RigidTransform:
    """Reads a position and a quaternion. Raises InputError for numbers that are not finite, and for no rotation."""
    values = np.array([at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z], float)
    if not np.isfinite(values).all():
        raise InputError("the pose has a number that is not finite", hint="send finite numbers")
    if (length := float(np.linalg.norm(values[3:]))) < _SHORTEST_QUATERNION:
        raise InputError("the pose's quaternion is zero", hint="send w = 1 for no rotation")
    return RigidTransform(Quaternion(values[3:] / length), values[:3])


def planar_pose(pose: Any) -> Pose2D:
    """Reads geometry_msgs/Pose, as `transform_of`."""
    return Pose2D.from_transform(transform_of(pose.position, pose.orientation))


def pose_on_map(stamped: Any, grid: GridMap, frames: Mapping[str, Pose2D]) -> Pose2D:
    """Reads geometry_msgs/PoseStamped as a pose on the map; `frames` are the poses of other frames on it.

    Raises InputError for an unknown frame, a pose off the map, and what `planar_pose` refuses.
    """
    frame, pose = stamped.header.frame_id.strip("/"), planar_pose(stamped.pose)
    if frame not in FRAMES and frame not in frames:
        raise InputError(f"there is no frame '{frame[:60]}'", hint=f"known: {', '.join(sorted({*FRAMES, *frames}))}")
    placed = pose if frame in FRAMES else compose(frames[frame], pose)
    least = np.array(grid.origin_m)
    if not (np.all(least <= (placed.x_m, placed.y_m)) and np.all((placed.x_m, placed.y_m) <= least + grid.size_m)):
        raise InputError(f"({placed.x_m:.6g}, {placed.y_m:.6g}) is not on the map", hint="name a pose on it")
    return placed


def velocity(twist: Any) -> tuple[float, float, float]:
    """Reads geometry_msgs/Twist as vx, vy (m/s), wz (rad/s). Raises InputError for numbers that are not finite."""
    values = (twist.linear.x, twist.linear.y, twist.angular.z)
    if not all(math.isfinite(value) for value in values):
        raise InputError("the velocity has a number that is not finite", hint="send finite numbers")
    return values


def within_limits(velocity: tuple[float, float, float], can: Capabilities) -> tuple[float, float, float]:
    """Returns a velocity of the base within its limits."""
    vx, vy, wz = velocity
    share, most = min(1.0, can.max_speed_m_s / max(math.hypot(vx, vy), 1e-9)), can.max_turn_rate_rad_s
    return share * vx, share * vy, max(-most, min(wz, most))


class HeardVelocity:
    """Last velocity of a topic, and when it came on the clock `now` (s). Any thread may call `hear`."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.last = STILL

    def hear(self, twist: Any) -> None:
        """Takes a velocity; one that is not finite stops the robot."""
        try:
            self.last = velocity(twist), self._now()
        except InputError:
            self.last = STILL
