"""Estimators that know the scripted robot's world exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skills.api import LocalisationEstimate
from skills.robot import Pose2D, Robot, Scan
from skills.testing.blocks import Block

OPEN_M = 9.0


class KnownPlace:
    """A localiser that knows where odometry starts and trusts it. Implements `skills.api.SearchingLocaliser` too.

    Set `localised` to False to be lost. Its stamp is that of the odometry it last took in.
    """

    def __init__(self, start: Pose2D | None = None) -> None:
        self.localised = True
        self._X_WO, self._stamp_s = (start or Pose2D(0.0, 0.0, 0.0)).transform(), 0.0

    def estimate(self) -> LocalisationEstimate:
        """The latest estimate."""
        return LocalisationEstimate(self._stamp_s, self._X_WO, np.eye(3) * 1e-4, self.localised)

    def update(self, robot: Robot) -> None:
        """Takes in the odometry's stamp."""
        self._stamp_s = robot.odometry().stamp_s

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> LocalisationEstimate | None:
        """Where the robot is; what a search of the map would find."""
        return LocalisationEstimate(scan.stamp_s, self._X_WO, np.eye(3) * 1e-4, True)

    def accept(self, estimate: LocalisationEstimate) -> None:
        """No longer lost."""
        self._X_WO, self.localised = estimate.X_WO, True


class BlockCostmap:
    """Clearance from the blocks that the body would touch (0.05 to 1.0 m), and from nothing else.

    Implements `skills.api.Costmap`.
    """

    def __init__(self, blocks: Sequence[Block] = ()) -> None:
        rows = [(b.x0, b.y0, b.x1, b.y1) for b in blocks if b.z0 < 1.0 and b.z1 > 0.05]
        self._boxes = np.array(rows, dtype=np.float64).reshape(-1, 4)

    def clearance_m(self, points_W: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance from each (x, y) row to the nearest block, negative within one."""
        if not len(self._boxes):
            return np.full(len(points_W), OPEN_M)
        x, y = np.asarray(points_W)[:, 0:1], np.asarray(points_W)[:, 1:2]
        dx = np.maximum(self._boxes[:, 0] - x, x - self._boxes[:, 2])
        dy = np.maximum(self._boxes[:, 1] - y, y - self._boxes[:, 3])
        outside = np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0))
        return np.asarray(np.min(np.where(outside > 0.0, outside, np.maximum(dx, dy)), axis=1))

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Nothing changes."""

    def add_points(self, points_W: NDArray[np.float64], stamp_s: float) -> None:
        """Nothing changes."""

    def forget_seen(self, within_W: NDArray[np.float64] | None = None) -> int:
        """Nothing was seen that is not there."""
        return 0
