"""Where the body can go: the surveyed keep-out grid and, above it, a layer of what the sensors see now."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.api import LocalisationEstimate
from skills.estimate.compiled import distances
from skills.estimate.grid_map import GridMap
from skills.estimate.obstacle_layer import clear_cells, mark_cells
from skills.estimate.scan_points import SelfFilter, in_body_axes, outside_discs, placed_points, scan_points, sensor_pose
from skills.geometry import compose
from skills.quantities import Count, Delay, Height, Length, Margin
from skills.robot import FloatArray, Pose2D, Robot, Scan


@dataclass(frozen=True)
class CostmapOptions:
    """The surveyed keep-out grid and a layer of obstacles that the sensors see.

    A point between the heights counts when it is nearer than max_range_m and farther than `explained_m` from all
    that the keep-out grid knows. LiDAR cells count once two scans agree; a cell is remembered for `memory_s` unless
    a beam sees past it. A depth picture must put `min_points_per_cell` points into a cell.
    """

    heights_m: tuple[Height, Height] = (0.1, 1.0)
    max_range_m: Length = 4.0
    azimuths: Count = 450
    explained_m: Margin = 0.15
    confirm_s: Delay = 0.6
    memory_s: Delay = 12.0
    cell_m: Length = 0.05
    min_points_per_cell: Count = 3

    def build(self, keepout: GridMap) -> LayeredCostmap:
        """A costmap on a surveyed keep-out grid."""
        return LayeredCostmap(keepout, self)


class LayeredCostmap:
    """Implements `skills.api.Costmap`. `keepout` is the surveyed grid; its unknown cells count as blocked."""

    def __init__(self, keepout: GridMap, options: CostmapOptions | None = None) -> None:
        self._keepout = keepout.with_unknown_blocked()
        self._options = options or CostmapOptions()
        self._layer = _empty_like(keepout, self._options.cell_m)
        self._until_s = np.full(self._layer.occupied.shape, -math.inf)
        self._candidate_s = np.full(self._layer.occupied.shape, -math.inf)
        self._height_m = np.zeros(self._layer.occupied.shape)
        self._field: NDArray[np.float32] | None = None
        self._changed = False
        self._next_expiry_s = math.inf
        self._now_s = -math.inf
        self._scan_stamp_s = -math.inf
        self._returns_W: FloatArray = np.empty((0, 3))
        self._X_WB: Pose2D | None = None
        self._filter: SelfFilter | None = None
        self._left_out_W: FloatArray = np.empty((0, 3))

    @property
    def keepout(self) -> GridMap:
        """The surveyed grid."""
        return self._keepout

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Distance (m) from each (x, y) row to the nearest obstacle, negative inside one and off the grid."""
        points = np.ascontiguousarray(points_W, dtype=np.float64)
        clearance = self._keepout.distance_m(points)
        field = self._seen_field()
        if field is None:
            return clearance
        x0_m, y0_m = self._layer.origin_m
        return np.minimum(clearance, distances(field, self._layer.resolution_m, x0_m, y0_m, points))

    def seen_m(self) -> FloatArray:
        """Centres (x, y) of the cells that are blocked by something seen and not surveyed."""
        return self._layer.centres(np.argwhere(self._until_s > self._now_s))

    def unexplained(self) -> tuple[float, FloatArray]:
        """The last scan's stamp and those of its returns (N, 3) that the surveyed grid does not explain."""
        return self._scan_stamp_s, self._returns_W

    def forget_seen(self, within_W: FloatArray | None = None) -> int:
        """Forgets what was seen and not surveyed, perhaps only within discs; how many cells were blocked by it."""
        cells = self._active()
        if within_W is None:
            self._candidate_s.fill(-math.inf)
        else:
            cells = cells[~outside_discs(self._layer.centres(cells), within_W)]
        self._until_s[cells[:, 0], cells[:, 1]] = -math.inf
        self._candidate_s[cells[:, 0], cells[:, 1]] = -math.inf
        self._note_change()
        return len(cells)

    def leave_out(self, discs_W: FloatArray) -> None:
        """From now on take in nothing that is seen within these discs, rows of x, y and radius (m, world).

        `unexplained` still has it.
        """
        self._left_out_W = discs_W

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Takes in the newest scan, if it is new and the robot knows where it is."""
        odometry = robot.odometry()
        X_WO = Pose2D.from_transform(localisation.X_WO)
        self._pass_time(odometry.stamp_s)
        self._X_WB = compose(X_WO, odometry.pose)
        self._filter = self._filter or SelfFilter.of(robot.capabilities())
        scan = robot.scan()
        if scan is not None and scan.stamp_s > self._scan_stamp_s and localisation.localised:
            self._scan_stamp_s = scan.stamp_s
            self._take_scan(scan, X_WO, partial(self._foreign, self._filter, robot, scan))

    def add_points(self, points_W: FloatArray, stamp_s: float) -> None:
        """Takes in (N, 3) points of a depth camera that lie on things in the way; leave out the floor before."""
        if self._X_WB is None or self._filter is None or len(points_W) == 0:
            return
        own = self._filter.foreign(in_body_axes(points_W, self._X_WB), np.empty((0, 3)))
        points = self._others_left_out(self._unexplained(points_W[own]))
        if len(points) == 0:
            return
        cells, first, counts = np.unique(self._layer.cells(points), axis=0, return_index=True, return_counts=True)
        kept = counts >= self._options.min_points_per_cell
        rows, columns = cells[kept].T
        self._until_s[rows, columns] = np.maximum(self._until_s[rows, columns], stamp_s + self._options.memory_s)
        self._height_m[rows, columns] = points[first[kept], 2]
        self._note_change()

    def _pass_time(self, now_s: float) -> None:
        """Forgets what is too old."""
        self._now_s = now_s
        if now_s >= self._next_expiry_s:
            self._note_change()

    def _note_change(self) -> None:
        """The set of blocked cells is another than before."""
        blocked = self._until_s[self._until_s > self._now_s]
        self._next_expiry_s = float(blocked.min()) if len(blocked) else math.inf
        self._changed = True

    def _active(self) -> NDArray[np.int64]:
        """The (row, column) of the blocked cells."""
        if math.isinf(self._next_expiry_s):
            return np.empty((0, 2), dtype=np.int64)
        return np.argwhere(self._until_s > self._now_s)

    def _foreign(self, own: SelfFilter, robot: Robot, scan: Scan, points_F: FloatArray) -> NDArray[np.bool_]:
        """Which points (N, 3) in the levelled body frame are none of the robot's."""
        return own.foreign(points_F, self._arm_F(robot, scan), holding=robot.gripper().holding)

    def _arm_F(self, robot: Robot, scan: Scan) -> FloatArray:
        """The arm's segments in the levelled body frame."""
        if self._filter is None or self._filter.arm is None:
            return np.empty((0, 3))
        rotation, translation = sensor_pose(scan)
        points_B = self._filter.arm.points_B(robot.joints())
        points_L = scan.X_BL.inverse().multiply(points_B.T)
        return np.asarray((rotation @ points_L).T + translation)

    def _take_scan(self, scan: Scan, X_WO: Pose2D, foreign: Callable[[FloatArray], NDArray[np.bool_]]) -> None:
        """Clears the cells that beams see past, then mark those that are hit, not explained and not the robot's own."""
        options = self._options
        X_WF = compose(X_WO, Pose2D.from_transform(scan.X_OB))
        changed = self._clear(scan, X_WF)
        points_F = scan_points(
            scan, azimuths=options.azimuths, heights_m=options.heights_m, max_range_m=options.max_range_m
        )
        points = self._unexplained(placed_points(points_F, X_WF))
        if len(points):
            points = points[foreign(in_body_axes(points, X_WF))]
        self._returns_W = points
        points = self._others_left_out(points)
        times = (scan.stamp_s, options.confirm_s, options.memory_s)
        cells = self._layer.cells(points)
        changed |= mark_cells(cells, points[:, 2].copy(), times, self._candidate_s, self._until_s, self._height_m)
        if changed:
            self._note_change()

    def _clear(self, scan: Scan, X_WF: Pose2D) -> bool:
        """Forgets the cells that the scan's beams see past; True when there were any."""
        active = self._active()
        if len(active) == 0:
            return False
        heights = self._height_m[active[:, 0], active[:, 1]]
        centres_F = in_body_axes(np.column_stack([self._layer.centres(active), heights]), X_WF)
        gone = active[clear_cells(scan, centres_F, self._layer.resolution_m)]
        self._until_s[gone[:, 0], gone[:, 1]] = -math.inf
        return len(gone) > 0

    def _unexplained(self, points_W: FloatArray) -> FloatArray:
        """Those (x, y, z) rows that lie on the grid and away from all that was surveyed."""
        return np.ascontiguousarray(points_W[self._keepout.distance_m(points_W) > self._options.explained_m])

    def _others_left_out(self, points_W: FloatArray) -> FloatArray:
        """Those (x, y, z) rows that do not lie where another robot says that it is."""
        if not len(self._left_out_W) or not len(points_W):
            return points_W
        return np.ascontiguousarray(points_W[outside_discs(points_W, self._left_out_W)])

    def _seen_field(self) -> NDArray[np.float32] | None:
        """Distance (m) from each cell of the layer to what is seen, None when nothing is."""
        if self._changed:
            seen = self._until_s > self._now_s
            self._field, self._changed = None, False
            if seen.any():
                cells = cv2.distanceTransform((~seen).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
                self._field = ((cells - np.float32(0.5)) * np.float32(self._layer.resolution_m)).astype(np.float32)
        return self._field


def _empty_like(grid: GridMap, cell_m: float) -> GridMap:
    """An empty grid over the same ground with cells of another size."""
    columns, rows = (max(2, math.ceil(size / cell_m)) for size in grid.size_m)
    return GridMap(np.zeros((rows, columns), dtype=np.bool_), cell_m, grid.origin_m)
