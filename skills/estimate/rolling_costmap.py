"""Where the body can go in a place without a map: what the LiDAR has seen, on a window that moves with the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skills.api import LocalisationEstimate
from skills.estimate.costmap import CostmapOptions, LayeredCostmap
from skills.estimate.grid_map import GridMap
from skills.quantities import Count, Delay, Height, Length
from skills.robot import FloatArray, Pose2D, Robot


@dataclass(frozen=True)
class RollingCostmapOptions:
    """No map: obstacles are what the LiDAR sees between the heights and nearer than max_range_m; the rest is free.

    The window is `window_m` wide and moves once the robot is farther than a quarter of it off its middle. Cells count
    once two scans within `confirm_s` agree and are remembered for `memory_s`, unless a beam sees past them.
    """

    heights_m: tuple[Height, Height] = (0.1, 1.0)
    window_m: Length = 40.0
    max_range_m: Length = 15.0
    azimuths: Count = 900
    confirm_s: Delay = 0.6
    memory_s: Delay = 600.0
    cell_m: Length = 0.05
    min_points_per_cell: Count = 3

    def build(self, keepout: GridMap) -> RollingCostmap:
        """A costmap that ignores the surveyed grid."""
        return RollingCostmap(self)


class RollingCostmap(LayeredCostmap):
    """Implements `skills.api.Costmap` in any frame that drifts slowly, such as odometry's."""

    def __init__(self, options: RollingCostmapOptions | None = None) -> None:
        self._rolling = options or RollingCostmapOptions()
        self._centred = False
        used = self._rolling
        layered = CostmapOptions(
            heights_m=used.heights_m,
            max_range_m=used.max_range_m,
            azimuths=used.azimuths,
            explained_m=0.0,
            confirm_s=used.confirm_s,
            memory_s=used.memory_s,
            cell_m=used.cell_m,
            min_points_per_cell=used.min_points_per_cell,
        )
        super().__init__(self._window((0.0, 0.0)), layered)

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Distance (m) from each (x, y) row to the nearest obstacle seen; off the window as at its edge."""
        low = np.array(self._layer.origin_m) + 1e-6
        high = low + self._layer.size_m - 2e-6
        return super().clearance_m(np.clip(np.asarray(points_W, dtype=np.float64)[:, :2], low, high))

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Move the window along, then take in the newest scan."""
        here = Pose2D.from_transform(localisation.X_WO @ robot.odometry().X_OB)
        middle = np.array(self._layer.origin_m) + 0.5 * np.array(self._layer.size_m)
        off_m = float(np.max(np.abs(middle - [here.x_m, here.y_m])))
        if not self._centred or off_m > 0.25 * self._rolling.window_m:
            self._centre((here.x_m, here.y_m))
        super().update(robot, localisation)

    def _window(self, centre: tuple[float, float]) -> GridMap:
        """An empty window about a place, its cells on one raster over the whole world."""
        cell, count = self._rolling.cell_m, max(2, round(self._rolling.window_m / self._rolling.cell_m))
        x, y = (cell * math.floor(value / cell - 0.5 * count) for value in centre)
        return GridMap(np.zeros((count, count), dtype=np.bool_), cell, (x, y))

    def _centre(self, place: tuple[float, float]) -> None:
        """Move the window's middle to a place; what lies in both windows is kept."""
        before, self._layer = self._layer, self._window(place)
        self._keepout, self._centred = self._layer, True
        shift = (np.array(self._layer.origin_m) - before.origin_m) / self._rolling.cell_m
        columns, rows = (int(round(value)) for value in shift)
        self._until_s = _shifted(self._until_s, rows, columns, -math.inf)
        self._candidate_s = _shifted(self._candidate_s, rows, columns, -math.inf)
        self._height_m = _shifted(self._height_m, rows, columns, 0.0)
        self._note_change()


def _shifted(values: FloatArray, rows: int, columns: int, fill: float) -> FloatArray:
    """A grid's values in a window that lies so many cells on."""
    moved = np.full_like(values, fill)
    height, width = values.shape
    if abs(rows) < height and abs(columns) < width:
        target = moved[max(0, -rows) : height - max(0, rows), max(0, -columns) : width - max(0, columns)]
        target[...] = values[max(0, rows) : height + min(0, rows), max(0, columns) : width + min(0, columns)]
    return moved
