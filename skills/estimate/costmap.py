"""Costmap of a mapped site: the surveyed keep-out grid and a layer of obstacles that the sensors see."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.api import LocalisationEstimate
from skills.compiled import Triple, compiled, distance_at, distances
from skills.estimate.scan_points import SelfFilter, outside_discs, points_in_body_axes, scan_points
from skills.geometry import compose
from skills.grid_map import GridMap
from skills.quantities import Count, Delay, Height, Length, Margin
from skills.robot import FloatArray, Pose2D, Robot, Scan


@dataclass(frozen=True)
class CostmapOptions:
    """The surveyed keep-out grid and a layer of obstacles that the sensors see.

    `heights_m`, `max_range_m` and `explained_m`: a point counts between these heights, within this range, and farther
    than this from all occupied cells of the grid. `confirm_s`: LiDAR cells count once two scans agree within this time.
    `memory_s`: a cell is remembered this long unless a beam passes beyond it. `min_points_per_cell`: points that a
    depth image must have in a cell.
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
        """Creates a costmap on a surveyed keep-out grid."""
        return LayeredCostmap(keepout, self)


class LayeredCostmap:
    """Costmap on a surveyed grid `keepout`, whose unknown cells count as blocked; implements `skills.api.Costmap`."""

    def __init__(self, keepout: GridMap, options: CostmapOptions | None = None) -> None:
        self.keepout = keepout.with_unknown_blocked()
        self._options = options or CostmapOptions()
        rows_columns = [max(2, math.ceil(size / self._options.cell_m)) for size in reversed(keepout.size_m)]
        self._layer = GridMap(np.zeros(rows_columns, dtype=np.bool_), self._options.cell_m, keepout.origin_m)
        self._until_s = np.full(self._layer.occupied.shape, -math.inf)
        self._candidate_s = np.full(self._layer.occupied.shape, -math.inf)
        self._height_m = np.zeros(self._layer.occupied.shape)
        self._cells: NDArray[np.int64] = np.empty((0, 2), dtype=np.int64)
        self._field: NDArray[np.float32] | None = None
        self._changed = False
        self._next_expiry_s = math.inf
        self._now_s = -math.inf
        self._scan_stamp_s = -math.inf
        self._returns_W: FloatArray = np.empty((0, 3))
        self._X_WB: Pose2D | None = None
        self._filter: SelfFilter | None = None
        self._left_out_W: FloatArray = np.empty((0, 3))

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """Distance (m) from each (x, y) row to the nearest obstacle; negative inside an obstacle and off the grid."""
        points = np.ascontiguousarray(points_W, dtype=np.float64)
        clearance = self.keepout.distance_m(points)
        field = self._layer_field()
        if field is None:
            return clearance
        return np.minimum(clearance, distances(field, *self._layer.frame, points))

    def obstacle_cells(self, within_s: float = math.inf) -> FloatArray:
        """Centres (x, y) of the blocked cells of the obstacle layer, or of those hit within a time."""
        expires_s = self._now_s + max(0.0, self._options.memory_s - within_s)
        rows, columns = self._cells.T
        return self._layer.centres(self._cells[self._until_s[rows, columns] > expires_s])

    def unexplained_returns(self) -> tuple[float, FloatArray]:
        """The last scan's stamp, and its returns (N, 3) that the surveyed grid does not explain."""
        return self._scan_stamp_s, self._returns_W

    def clear_obstacles(self, within_W: FloatArray | None = None) -> int:
        """Clears the obstacle layer, or only its cells within discs; returns the number of blocked cells cleared."""
        cells = self._cells
        if within_W is None:
            self._candidate_s.fill(-math.inf)
        else:
            cells = cells[~outside_discs(self._layer.centres(cells), within_W)]
        self._until_s[cells[:, 0], cells[:, 1]] = -math.inf
        self._candidate_s[cells[:, 0], cells[:, 1]] = -math.inf
        self._note_change()
        return len(cells)

    def exclude_robots(self, discs_W: FloatArray) -> None:
        """Ignores points within these discs, rows of x, y and radius (m, world), in the obstacle layer.

        `unexplained_returns` still includes them.
        """
        self._left_out_W = discs_W

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Updates with the newest scan, when the scan is new and the robot is localised."""
        odometry = robot.odometry()
        X_WO = Pose2D.from_transform(localisation.X_WO)
        self._now_s = odometry.stamp_s
        if self._now_s >= self._next_expiry_s:
            self._note_change()
        self._X_WB = compose(X_WO, odometry.pose)
        self._filter = self._filter or SelfFilter.of(robot.capabilities())
        scan = robot.scan()
        if scan is not None and scan.stamp_s > self._scan_stamp_s and localisation.localised:
            self._scan_stamp_s = scan.stamp_s
            self._take_scan(scan, X_WO, self._filter, robot)

    def add_points(self, points_W: FloatArray, stamp_s: float) -> None:
        """Adds points (N, 3) from a depth camera, except those on the floor."""
        if self._X_WB is None or self._filter is None or len(points_W) == 0:
            return
        own = self._filter.foreign(points_in_body_axes(points_W, self._X_WB), np.empty((0, 3)))
        points = points_W[own & self.is_unexplained(points_W) & outside_discs(points_W, self._left_out_W)]
        if len(points) == 0:
            return
        hit = np.ravel_multi_index(tuple(self._layer.cells(points).T), self._until_s.shape)
        cells, first, counts = np.unique(hit, return_index=True, return_counts=True)
        enough = counts >= self._options.min_points_per_cell
        rows, columns = np.unravel_index(cells[enough], self._until_s.shape)
        self._until_s[rows, columns] = np.maximum(self._until_s[rows, columns], stamp_s + self._options.memory_s)
        self._height_m[rows, columns] = points[first[enough], 2]
        self._note_change()

    def _note_change(self) -> None:
        """Notes that the set of blocked cells, by (row, column), has changed."""
        blocked = np.flatnonzero(self._until_s > self._now_s)
        self._cells = np.column_stack(np.unravel_index(blocked, self._until_s.shape))
        self._next_expiry_s = float(self._until_s.flat[blocked].min(initial=math.inf))
        self._changed = True

    def _take_scan(self, scan: Scan, X_WO: Pose2D, own: SelfFilter, robot: Robot) -> None:
        """Clears cells beyond which beams pass, then marks cells with returns that neither map nor robot explains."""
        options, X_WF = self._options, compose(X_WO, scan.pose)
        pose = (X_WF.x_m, X_WF.y_m, X_WF.yaw_rad)
        layer, heights_m = self._layer.frame, self._height_m
        beams = np.ascontiguousarray(scan.ranges_m), scan.elevations_rad, scan.azimuths_rad
        changed = clear_cells(beams, scan.sensor_pose, pose, layer, self._cells, self._until_s, heights_m)
        seen_F = scan_points(
            scan, azimuths=options.azimuths, heights_m=options.heights_m, max_range_m=options.max_range_m
        )
        points_F, points = _unexplained(seen_F, pose, self.keepout.distance, self.keepout.frame, options.explained_m)
        if len(points):
            points = points[own.foreign(points_F, own.arm_F(robot, scan), holding=robot.gripper().holding)]
        self._returns_W = points
        times = (scan.stamp_s, options.confirm_s, options.memory_s)
        points = points[outside_discs(points, self._left_out_W)]
        if mark_cells(points, layer, times, self._candidate_s, self._until_s, heights_m) or changed:
            self._note_change()

    def is_unexplained(self, points_W: FloatArray) -> NDArray[np.bool_]:
        """Returns whether each (x, y, z) row lies on the grid and away from its occupied cells."""
        return np.asarray(self.keepout.distance_m(points_W) > self._options.explained_m)

    def _layer_field(self) -> NDArray[np.float32] | None:
        """Distance (m) from each cell of the obstacle layer to the nearest blocked cell; None when none is blocked."""
        if self._changed:
            seen = self._until_s > self._now_s
            self._field, self._changed = None, False
            if seen.any():
                cells = cv2.distanceTransform((~seen).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
                self._field = ((cells - np.float32(0.5)) * np.float32(self._layer.resolution_m)).astype(np.float32)
        return self._field


@compiled
def _unexplained(
    points_F: FloatArray, X_WF: Triple, distance: NDArray[np.float32], frame: Triple, explained_m: float
) -> tuple[FloatArray, FloatArray]:
    """The points farther than explained_m from the occupied cells of a grid, (N, 3) in frame F and in the world."""
    kept_F, kept_W, count = np.empty((points_F.shape[0], 3)), np.empty((points_F.shape[0], 3)), 0
    c, s = math.cos(X_WF[2]), math.sin(X_WF[2])
    for n in range(points_F.shape[0]):
        x, y = points_F[n, 0], points_F[n, 1]
        x, y = X_WF[0] + c * x - s * y, X_WF[1] + s * x + c * y
        if distance_at(distance, frame[0], frame[1], frame[2], x, y) > explained_m:
            kept_F[count] = points_F[n, :3]
            kept_W[count, 0], kept_W[count, 1], kept_W[count, 2] = x, y, points_F[n, 2]
            count += 1
    return kept_F[:count], kept_W[:count]


Beams = tuple[NDArray[np.float32], FloatArray, FloatArray]
"""Ranges (rings, azimuths), elevations and azimuths of a whole revolution."""


@compiled
def clear_cells(
    beams: Beams,
    sensor_pose: tuple[FloatArray, FloatArray],
    X_WF: Triple,
    frame: Triple,
    cells: NDArray[np.int64],
    until_s: FloatArray,
    height_m: FloatArray,
) -> bool:
    """Clears, in place, those of the blocked `cells` that beams pass beyond; returns whether there were any.

    A cell is free when all beams that could have hit it continue for 0.3 m at least. A cell that no beam can hit (too
    low, too near) is free when a free one lies beside it, since both were seen on one object.
    """
    rotation, translation = sensor_pose
    c, s = math.cos(X_WF[2]), math.sin(X_WF[2])
    places = np.empty((cells.shape[0], 3))
    for n in range(cells.shape[0]):
        dx = (cells[n, 1] + 0.5) * frame[0] + frame[1] - X_WF[0]
        dy = (cells[n, 0] + 0.5) * frame[0] + frame[2] - X_WF[1]
        x, y = c * dx + s * dy - translation[0], -s * dx + c * dy - translation[1]
        z = height_m[cells[n, 0], cells[n, 1]] - translation[2]
        for axis in range(3):
            places[n, axis] = x * rotation[0, axis] + y * rotation[1, axis] + z * rotation[2, axis]
    gone = _passed(beams, places, frame[0])
    for k in np.flatnonzero(gone):
        until_s[cells[k, 0], cells[k, 1]] = -math.inf
    return bool(gone.any())


@compiled
def _passed(beams: Beams, places: FloatArray, cell_m: float) -> NDArray[np.bool_]:
    """Returns whether each position (N, 3), in the LiDAR's frame, is free as in `clear_cells`."""
    ranges, elevations, azimuths = beams
    count = azimuths.shape[0]
    spacing = azimuths[1] - azimuths[0]
    ring_gap = abs(elevations[1] - elevations[0]) if elevations.shape[0] > 1 else abs(spacing)
    lowest, highest = elevations.min() + 0.5 * ring_gap, elevations.max()
    if elevations.shape[0] == 1:
        lowest, highest = highest - ring_gap, highest + ring_gap
    free = np.zeros(places.shape[0], dtype=np.bool_)
    hidden = np.zeros(places.shape[0], dtype=np.bool_)
    for n in range(places.shape[0]):
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        flat = math.hypot(x, y)
        reach = math.hypot(flat, z)
        elevation = math.atan2(z, flat)
        if not lowest <= elevation <= highest:
            hidden[n] = True
            continue
        middle = round((math.atan2(y, x) - azimuths[0]) / spacing)
        half = math.ceil(cell_m / max(flat, 0.3) / abs(spacing))
        looked, blocked = 0, False
        for i in range(elevations.shape[0]):
            if abs(elevations[i] - elevation) > ring_gap:
                continue
            for j in range(middle - half, middle + half + 1):
                r = ranges[i, j % count]
                if not r > reach + 0.3:
                    blocked = True
                looked += 1
        free[n] = looked > 0 and not blocked
    return _spread(free, hidden, places, 3.0 * cell_m)


@compiled
def _spread(
    free: NDArray[np.bool_], hidden: NDArray[np.bool_], places: FloatArray, radius_m: float
) -> NDArray[np.bool_]:
    """Returns whether each position is free, or hidden and within radius_m of a free one."""
    gone = free.copy()
    for n in np.flatnonzero(hidden):
        for m in np.flatnonzero(free):
            if math.hypot(places[n, 0] - places[m, 0], places[n, 1] - places[m, 1]) <= radius_m:
                gone[n] = True
    return gone


@compiled
def mark_cells(
    points: FloatArray, frame: Triple, times: Triple, candidate_s: FloatArray, until_s: FloatArray, height_m: FloatArray
) -> bool:
    """Marks the cells of points (N, 3) in place; returns whether a cell became blocked.

    `times` (s) are the scan's stamp, the time within which another scan must have hit the cell or a neighbour, and the
    time for which a blocked cell is remembered.
    """
    stamp, confirm, memory = times
    rows, columns = until_s.shape
    cells = np.empty((points.shape[0], 2), dtype=np.int64)
    changed = False
    for n in range(cells.shape[0]):
        i, j = math.floor((points[n, 1] - frame[2]) / frame[0]), math.floor((points[n, 0] - frame[1]) / frame[0])
        cells[n, 0], cells[n, 1] = i, j
        for a in range(max(0, i - 1), min(rows, i + 2)):
            for b in range(max(0, j - 1), min(columns, j + 2)):
                if stamp - confirm <= candidate_s[a, b] < stamp:
                    fresh = until_s[i, j] <= stamp
                    changed |= fresh
                    until_s[i, j] = stamp + memory
                    height_m[i, j] = points[n, 2] if fresh else max(height_m[i, j], points[n, 2])
    for n in range(cells.shape[0]):
        candidate_s[cells[n, 0], cells[n, 1]] = stamp
    return changed
