"""Costmap of a site without a map: obstacles that the LiDAR has seen, in a window that moves with the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.api import LocalisationEstimate
from skills.compiled import Triple, bilinear, compiled
from skills.estimate.scan_points import SelfFilter, outside_discs, placed_points, points_in_body_axes, scan_points
from skills.geometry import compose
from skills.grid_map import GridMap
from skills.quantities import Count, Factor, Height, Length, Margin
from skills.robot import FloatArray, Pose2D, Robot, Scan

_MOST = 3.5
"""Greatest log odds of a cell."""
_LEAST = -1.0
"""Least log odds of a cell."""
_NEAR_M = 7.0
"""Half the width of the part about the robot whose distances are computed apart."""
_NEAR_SURE_M = 1.0
"""Greatest clearance by that part."""
_NEW_M = 0.15
"""Returns farther than this from obstacles seen before are unexplained."""
_FACE_M = 0.15
"""Depth of an upright face in the returns of one column."""


@dataclass(frozen=True)
class RollingCostmapOptions:
    """Costmap without a map: LiDAR obstacles between the heights and within max_range_m; unseen ground is free.

    `hit` and `miss`: log odds that a beam adds to the cell in which it ends, and subtracts from cells that it crosses
    at the height of the obstacle seen there (Moravec and Elfes 1985). `window_m`: width of the window, which moves once
    the robot is a quarter of it off its centre. `unknown_clearance_m`: largest clearance of unseen ground.
    """

    heights_m: tuple[Height, Height] = (0.1, 1.0)
    window_m: Length = 30.0
    max_range_m: Length = 14.0
    azimuths: Count = 900
    cell_m: Length = 0.04
    hit: Factor = 0.9
    miss: Factor = 0.35
    unknown_clearance_m: Margin = 0.5
    min_points_per_cell: Count = 3

    def build(self, keepout: GridMap) -> RollingCostmap:
        """Creates a costmap that ignores the surveyed grid."""
        return RollingCostmap(self)


class RollingCostmap:
    """Costmap in a frame that drifts slowly, such as odometry's; implements `skills.api.Costmap`."""

    def __init__(self, options: RollingCostmapOptions | None = None) -> None:
        self._options = options or RollingCostmapOptions()
        count = max(2, round(self._options.window_m / self._options.cell_m))
        self._odds = np.zeros((count, count), dtype=np.float32)
        self._known = np.zeros((count, count), dtype=np.bool_)
        self._height_m = np.zeros((count, count), dtype=np.float32)
        self._corner_m: tuple[float, float] | None = None
        self._all: NDArray[np.float32] | None = None
        self._near: tuple[NDArray[np.float32], float, float] | None = None
        self._returns_W: FloatArray = np.empty((0, 3))
        self._stamp_s = -math.inf
        self._X_WB = Pose2D(0.0, 0.0, 0.0)
        self._filter: SelfFilter | None = None

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Distance (m) from each (x, y) row to the nearest obstacle; off the window the value at its edge."""
        points = np.ascontiguousarray(points_W, dtype=np.float64)
        off_m = np.abs(points[:, :2] - (self._X_WB.x_m, self._X_WB.y_m))
        if len(points) and self._corner_m is not None and float(off_m.max()) < _NEAR_M - _NEAR_SURE_M:
            self._near = self._near or self._near_field()
            field, x0_m, y0_m = self._near
            return np.minimum(_looked_up(field, self._options.cell_m, x0_m, y0_m, points), _NEAR_SURE_M)
        if self._all is None:
            self._all = self._distances(slice(None), slice(None))
        return _looked_up(self._all, self._options.cell_m, *(self._corner_m or (0.0, 0.0)), points)

    def unexplained_returns(self) -> tuple[float, FloatArray]:
        """The last scan's stamp, and its returns (N, 3) away from all obstacles seen before."""
        return self._stamp_s, self._returns_W

    def clear_obstacles(self, within_W: FloatArray | None = None) -> int:
        """Clears all cells, or those within discs; returns the number of blocked cells that it cleared."""
        forgotten = np.ones(self._odds.shape, dtype=np.bool_)
        if within_W is not None:
            rows, columns = np.indices(self._odds.shape).reshape(2, -1)
            cell_m = np.float64(self._options.cell_m)
            centres = (np.column_stack([columns, rows]) + 0.5) * cell_m + np.array(self._corner_m or (0.0, 0.0))
            forgotten = ~outside_discs(centres, within_W).reshape(self._odds.shape)
        blocked = int(np.count_nonzero(self._odds[forgotten] > 0.0))
        self._odds[forgotten] = 0.0
        self._known[forgotten] = False
        self._changed()
        return blocked

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Moves the window and updates with the newest scan, when it is new."""
        X_WO = Pose2D.from_transform(localisation.X_WO)
        self._X_WB = compose(X_WO, robot.odometry().pose)
        self._filter = self._filter or SelfFilter.of(robot.capabilities())
        scan = robot.scan()
        if scan is None or scan.stamp_s <= self._stamp_s or not localisation.localised:
            return
        self._stamp_s = scan.stamp_s
        X_WF = compose(X_WO, scan.pose)
        self._follow(X_WF)
        self._take(robot, scan, X_WF)
        self._changed()

    def add_points(self, points_W: FloatArray, stamp_s: float) -> None:
        """Adds points (N, 3) from a depth camera, except those on the floor."""
        if self._corner_m is None or self._filter is None or len(points_W) == 0:
            return
        points = points_W[self._filter.foreign(points_in_body_axes(points_W, self._X_WB), np.empty((0, 3)))]
        cells, first, counts = np.unique(self._cells(points), axis=0, return_index=True, return_counts=True)
        inside = np.all((cells >= 0) & (cells < self._odds.shape), axis=1)
        enough = (counts >= self._options.min_points_per_cell) & inside
        rows, columns = cells[enough].T
        self._odds[rows, columns] = _MOST
        self._height_m[rows, columns] = points[first[enough], 2]
        self._changed()

    def _changed(self) -> None:
        self._all = self._near = None

    def _cells(self, points_W: FloatArray) -> NDArray[np.int64]:
        """The (row, column) of each point."""
        scaled = (points_W[:, :2] - (self._corner_m or (0.0, 0.0))) / self._options.cell_m
        return np.asarray(np.floor(scaled[:, ::-1]).astype(np.int64))

    def _follow(self, X_WF: Pose2D) -> None:
        """Keeps the robot in the central half of the window; cells shared by the old and the new window stay."""
        cell, count = self._options.cell_m, self._odds.shape[0]
        place = np.array([X_WF.x_m, X_WF.y_m])
        corner = np.round(place / cell - 0.5 * count)
        before = corner if self._corner_m is None else np.round(np.array(self._corner_m) / cell)
        if self._corner_m is not None and np.max(np.abs(corner - before)) < 0.25 * count:
            return
        columns, rows = (int(value) for value in corner - before)
        self._odds = _shifted(self._odds, rows, columns)
        self._known = _shifted(self._known, rows, columns)
        self._height_m = _shifted(self._height_m, rows, columns)
        self._corner_m = (float(corner[0] * cell), float(corner[1] * cell))

    def _take(self, robot: Robot, scan: Scan, X_WF: Pose2D) -> None:
        """Traces each column of beams to its nearest obstacle.

        Beams pass beyond a column only when all downward beams returned: none is lost, or too near to be measured.
        """
        assert self._corner_m is not None and self._filter is not None
        options = self._options
        points = scan_points(
            scan, azimuths=options.azimuths, heights_m=options.heights_m, max_range_m=options.max_range_m
        )
        foreign = self._filter.foreign(points, self._filter.arm_F(robot, scan))
        stride = max(1, len(scan.azimuths_rad) // options.azimuths)
        seen_past = np.asarray(np.all(np.isfinite(scan.ranges_m[scan.elevations_rad < 0.0, ::stride]), axis=0))
        seen_past[points[~foreign, 4].astype(np.int64) // stride] = False
        points = np.ascontiguousarray(points[foreign])
        placed = placed_points(points, X_WF)
        self._returns_W = placed[self.clearance_m(placed) > _NEW_M]
        _, origin_F = scan.sensor_pose
        nearest = _nearest(points, origin_F, np.zeros(len(seen_past)), stride)
        directions = np.ascontiguousarray(scan.azimuths_rad[::stride])
        slope = math.tan(float(np.min(scan.elevations_rad)))
        gains = _Gains(options.hit, options.miss, options.max_range_m)
        frames = (options.cell_m, *self._corner_m), (X_WF.x_m, X_WF.y_m, X_WF.yaw_rad)
        grids, own = (self._odds, self._known, self._height_m), self._filter.outline_m
        _trace(*grids, *frames, origin_F, nearest, seen_past, directions, slope, gains, own)

    def _near_field(self) -> tuple[NDArray[np.float32], float, float]:
        """The distance field around the robot, and the x and y of its corner (m)."""
        assert self._corner_m is not None
        cell, (x0_m, y0_m) = self._options.cell_m, self._corner_m
        half, most = round(_NEAR_M / cell), self._odds.shape[0]
        (row, column), *_ = self._cells(np.array([[self._X_WB.x_m, self._X_WB.y_m]])).tolist()
        rows, columns = (slice(max(0, middle - half), min(most, middle + half)) for middle in (row, column))
        return self._distances(rows, columns), x0_m + columns.start * cell, y0_m + rows.start * cell

    def _distances(self, rows: slice, columns: slice) -> NDArray[np.float32]:
        """Distance (m) from each cell in a part of the window to the nearest blocked cell in that part."""
        blocked, known = self._odds[rows, columns] > 0.0, self._known[rows, columns]
        field = np.full(blocked.shape, self._options.window_m, dtype=np.float32)
        if blocked.any():
            cells = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
            field = (cells - np.float32(0.5)) * np.float32(self._options.cell_m)
        if self._corner_m is not None:
            np.minimum(field, np.float32(self._options.unknown_clearance_m), out=field, where=~known)
        return field


def _shifted(values: NDArray[Any], rows: int, columns: int) -> NDArray[Any]:
    """The values of a grid after the window has shifted by `rows` and `columns`."""
    moved = np.zeros_like(values)
    height, width = values.shape
    if abs(rows) < height and abs(columns) < width:
        target = moved[max(0, -rows) : height - max(0, rows), max(0, -columns) : width - max(0, columns)]
        target[...] = values[max(0, rows) : height + min(0, rows), max(0, columns) : width + min(0, columns)]
    return moved


@compiled
def _looked_up(
    field: NDArray[np.float32], cell_m: float, x0_m: float, y0_m: float, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The values of a field at points (N, 2); clamped to its edge outside."""
    values = np.empty(points.shape[0])
    for n in range(points.shape[0]):
        values[n] = bilinear(field, (points[n, 0] - x0_m) / cell_m - 0.5, (points[n, 1] - y0_m) / cell_m - 0.5)
    return values


@compiled
def _nearest(points: FloatArray, origin: FloatArray, weight: FloatArray, stride: int) -> FloatArray:
    """Range and height (columns, 2) of the nearest obstacle in each column of beams; infinite when there is none.

    Both come from the returns within 0.15 m behind the first, which lie on one upright face: mean range, maximum
    height.
    """
    count = weight.shape[0]
    first = np.full(count, np.inf)
    nearest = np.zeros((count, 2))
    for n in range(points.shape[0]):
        column = int(points[n, 4]) // stride
        first[column] = min(first[column], math.hypot(points[n, 0] - origin[0], points[n, 1] - origin[1]))
    for n in range(points.shape[0]):
        column = int(points[n, 4]) // stride
        flat = math.hypot(points[n, 0] - origin[0], points[n, 1] - origin[1])
        if flat < first[column] + _FACE_M:
            nearest[column, 0] += flat
            nearest[column, 1] = max(nearest[column, 1], points[n, 2])
            weight[column] += 1.0
    for column in range(count):
        nearest[column, 0] = nearest[column, 0] / weight[column] if weight[column] > 0.0 else np.inf
    return nearest


class _Gains(NamedTuple):
    """Changes of the log odds where a beam ends and where it passes, and the range of the beams."""

    hit: float
    miss: float
    range_m: float


@compiled
def _trace(
    odds: NDArray[np.float32],
    known: NDArray[np.bool_],
    heights: NDArray[np.float32],
    frame: Triple,
    pose: Triple,
    origin: FloatArray,
    nearest: FloatArray,
    seen_past: NDArray[np.bool_],
    directions: FloatArray,
    slope: float,
    gains: _Gains,
    own: tuple[float, float, float, float],
) -> None:
    """Lowers the odds along each column of beams and raises them half a cell behind its end, in place.

    `frame` is cell size and corner, `slope` that of the lowest beam. Ground under the robot (outline `own`) becomes
    known.
    """
    cell, x0, y0 = frame
    c, s = math.cos(pose[2]), math.sin(pose[2])
    rows, columns = odds.shape
    ox, oy = pose[0] + c * origin[0] - s * origin[1], pose[1] + s * origin[0] + c * origin[1]
    for n in range(directions.shape[0]):
        reach = nearest[n, 0]
        dx, dy = math.cos(pose[2] + directions[n]), math.sin(pose[2] + directions[n])
        free_m = min(reach - 1.5 * cell, gains.range_m) if seen_past[n] else 0.0
        for k in range(int(free_m / (0.8 * cell))):
            r = (k + 0.5) * 0.8 * cell
            i, j = int((oy + r * dy - y0) / cell), int((ox + r * dx - x0) / cell)
            if not (0 <= i < rows and 0 <= j < columns):
                break
            known[i, j] = True
            if origin[2] + slope * r < heights[i, j] or odds[i, j] <= 0.0:
                odds[i, j] = max(odds[i, j] - gains.miss, _LEAST)
        if not reach < gains.range_m:
            continue
        end = reach + 0.5 * cell
        i, j = int((oy + end * dy - y0) / cell), int((ox + end * dx - x0) / cell)
        if 0 <= i < rows and 0 <= j < columns:
            known[i, j] = True
            odds[i, j] = min(odds[i, j] + gains.hit, _MOST)
            heights[i, j] = max(heights[i, j] if odds[i, j] > gains.hit else 0.0, nearest[n, 1])
    for a in range(int((own[1] - own[0]) / (0.7 * cell)) + 1):
        for b in range(int((own[3] - own[2]) / (0.7 * cell)) + 1):
            x, y = own[0] + 0.7 * cell * a, own[2] + 0.7 * cell * b
            i, j = int((pose[1] + s * x + c * y - y0) / cell), int((pose[0] + c * x - s * y - x0) / cell)
            if 0 <= i < rows and 0 <= j < columns:
                known[i, j] = True
