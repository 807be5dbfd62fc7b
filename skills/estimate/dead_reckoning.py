"""Localisation in a place without a map: the pose is where odometry says that the robot has gone from its start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skills.api import LocalisationEstimate
from skills.estimate.grid_map import GridMap
from skills.geometry import compose, inverse, relative
from skills.quantities import Share
from skills.robot import Pose2D, Robot

_START_VARIANCE = 1e-4


@dataclass(frozen=True)
class DeadReckoning:
    """Trusts odometry and needs no map: goals are relative to the start, and the error grows with the way.

    Odometry is expected to err by `drift_per_m` of the way and by `yaw_drift_rad_per_m`.
    """

    drift_per_m: Share = 0.01
    yaw_drift_rad_per_m: Share = 0.005

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> OdometryLocaliser:
        """A localiser that ignores the grid; a start that is not known becomes the origin."""
        return OdometryLocaliser(start or Pose2D(0.0, 0.0, 0.0), self)


class OdometryLocaliser:
    """Implements `skills.api.Localiser`. `start` is X_WB when it first sees the robot."""

    def __init__(self, start: Pose2D, options: DeadReckoning | None = None) -> None:
        self._start, self._options = start, options or DeadReckoning()
        self._X_WO = start
        self._last: Pose2D | None = None
        self._way_m = 0.0
        self._stamp_s = -math.inf

    def estimate(self) -> LocalisationEstimate:
        """The latest estimate: sure of the start, less so with the way gone."""
        along = self._options.drift_per_m * self._way_m
        yaw = self._options.yaw_drift_rad_per_m * self._way_m
        across = 0.5 * yaw * self._way_m
        variance = np.array([along**2 + across**2, along**2 + across**2, yaw**2]) + _START_VARIANCE
        return LocalisationEstimate(self._stamp_s, self._X_WO.transform(), np.diag(variance), self._last is not None)

    def update(self, robot: Robot) -> None:
        """Takes in the newest odometry."""
        odometry = robot.odometry()
        if self._last is None:
            self._X_WO = compose(self._start, inverse(odometry.pose))
            self._last = odometry.pose
        step = relative(self._last, odometry.pose)
        self._way_m += math.hypot(step.x_m, step.y_m)
        self._last, self._stamp_s = odometry.pose, odometry.stamp_s
