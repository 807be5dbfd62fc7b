"""Localiser for a robot with its own localisation, such as Spot's GraphNav."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skills.api import LocalisationEstimate
from skills.geometry import compose
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.quantities import Angle, Coordinate, Delay, Length, Turn
from skills.robot import OwnLocalisation, Pose2D, Robot


@dataclass(frozen=True)
class GraphNav:
    """The robot's own localisation: GraphNav of a Spot that has its map and was localised on it before the run.

    `seed_pose` is the pose of the map's seed frame in the world, x, y (m) and yaw (rad). `sigma` are the standard
    deviations of a pose in x, y and yaw. A pose older than `max_age_s` does not count.
    """

    seed_pose: tuple[Coordinate, Coordinate, Angle] = (0.0, 0.0, 0.0)
    sigma: tuple[Length, Length, Turn] = (0.05, 0.05, 0.03)
    max_age_s: Delay = 1.0

    def build(self, grid: GridMap, start: Pose2D | None, *, surely: bool) -> OwnLocaliser:
        """Creates a localiser that needs neither grid nor start."""
        return OwnLocaliser(self)


class OwnLocaliser:
    """Localiser from the robot's reported pose; implements `skills.api.Localiser`."""

    def __init__(self, options: GraphNav) -> None:
        self._options, self._X_WS = options, Pose2D(*options.seed_pose)
        self._covariance = np.diag(np.square(options.sigma))
        self._last = OwnLocalisation(-math.inf, Pose2D(0.0, 0.0, 0.0))
        self._localised = False

    def estimate(self) -> LocalisationEstimate:
        """The latest pose, `localised` unless the robot reports that it is lost, or is silent."""
        X_WO = compose(self._X_WS, self._last.X_SO).transform()
        return LocalisationEstimate(
            self._last.stamp_s, X_WO, self._covariance.copy(), self._localised, float(self._localised)
        )

    def update(self, robot: Robot) -> None:
        """Reads the robot's place. Raises InputError for a robot that does not localise itself."""
        if not robot.capabilities().localises:
            hint = "leave localiser out of the stack file, or run with --robot spot://HOST"
            raise InputError(f"{robot.name} has no GraphNav, which the stack's localiser needs", hint=hint)
        place = robot.own_localisation()
        self._last = place or self._last
        old_s = robot.odometry().stamp_s - self._last.stamp_s
        self._localised = place is not None and old_s <= self._options.max_age_s
