"""Localiser for a robot of ROS 2 that localises itself, as by AMCL or SLAM Toolbox on a map of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skills.api import LocalisationEstimate
from skills.geometry import compose
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.quantities import Angle, Coordinate, Length, Turn
from skills.robot import OwnLocalisation, Pose2D, Robot


@dataclass(frozen=True)
class Ros2Pose:
    """The robot's own localisation, from the topic `pose` of its description.

    `map_pose` is the pose of the robot's frame `map` in the world, x, y (m) and yaw (rad). `sigma` are the standard
    deviations in x, y and yaw. AMCL tells a pose only after a motion: one counts until the robot has moved `max_moved`
    (m) since.
    """

    map_pose: tuple[Coordinate, Coordinate, Angle] = (0.0, 0.0, 0.0)
    sigma: tuple[Length, Length, Turn] = (0.05, 0.05, 0.03)
    max_moved: Length = 2.0

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> OwnPose:
        """Creates a localiser that needs neither grid nor start."""
        return OwnPose(self)


class OwnPose:
    """Localiser from the robot's reported pose; implements `skills.api.Localiser`."""

    def __init__(self, options: Ros2Pose) -> None:
        self._options, self._X_WM = options, Pose2D(*options.map_pose)
        self._last: OwnLocalisation | None = None
        self._heard_at = Pose2D(0.0, 0.0, 0.0)
        self._stamp_s, self._localised = -math.inf, False

    def estimate(self) -> LocalisationEstimate:
        """The latest pose; `localised` while it counts."""
        X_WO = self._X_WM if self._last is None else compose(self._X_WM, self._last.X_SO)
        shape, localised = np.diag(np.square(self._options.sigma)), self._localised
        return LocalisationEstimate(self._stamp_s, X_WO.transform(), shape, localised, float(localised))

    def update(self, robot: Robot) -> None:
        """Reads the robot's pose. Raises InputError for a robot that does not localise itself."""
        if not robot.capabilities().localises:
            hint = "name its topic as pose in the robot's description, or leave localiser out of the stack file"
            raise InputError(f"{robot.name} does not localise itself, which the stack's localiser needs", hint=hint)
        odometry, place = robot.odometry(), robot.own_localisation()
        if place is not None and place is not self._last:
            self._last, self._heard_at = place, odometry.pose
        moved_m = math.hypot(odometry.pose.x_m - self._heard_at.x_m, odometry.pose.y_m - self._heard_at.y_m)
        self._localised = self._last is not None and moved_m <= self._options.max_moved
        self._stamp_s = odometry.stamp_s
