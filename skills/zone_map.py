"""Zones drawn on a grid of the ground: keep-out, speed limits, costs and directions of motion, silence.

A robot that starts in a keep-out zone may leave it; cells deeper inside the zone remain obstacles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.compiled import distances
from skills.footprint import SAFE_MARGIN_M, Footprint, WithObstacles, clearance_on_grid, disc_centres
from skills.grid_map import BoolGrid, load_filter_mask, signed_distance
from skills.motion_cost import ZoneCosts
from skills.robot import FloatArray, Pose2D
from skills.world_model import FilterType, FreeSpace, Zone, ZoneKind

_CELL_M = 0.05
_MOST_CELLS = 4_000_000
"""Where the zones would fill more cells, the cells are larger."""
_AROUND_M = 1.0
"""Ground about the zones that belongs to the grid."""
_SUBPIXEL_BITS: Final = 6
_PREFERENCE = 3.0
"""Factor on the cost of a motion outside all preferred zones, and through a mask's most expensive cell."""
_LEAVING = 10.0
"""Factor on the cost of a motion in a zone that the robot has to leave."""
_BACK_M = 0.01
_SAMPLE_M = 0.08
"""Distance between the points of the body at which zones are looked up."""
_UNSURE_M = 0.08
"""Growth of the body at which speed limits are looked up, for the errors of pose and map."""
_NEVER: Final = 2**30
_BESIDE: Final = 4
"""Radius about the body's origin within which a path out of a zone may begin, in cells."""
_EARLY_M = 0.25
"""Distance before a limit at which the robot is as slow."""
_BRAKING_M_S2 = 0.4
_MOST_PERCENT: Final = 100

Floats = NDArray[np.float32]


@lru_cache(maxsize=16)
def zone_map(zones: tuple[Zone, ...], full_m_s: float) -> ZoneMap:
    """The zone map for a robot with this full speed. Raises InputError when a mask cannot be read."""
    return ZoneMap(zones, full_m_s)


class ZoneMap:
    """Zones on a grid; outside the grid there are none. It is immutable, so that a plan may use it in a thread."""

    def __init__(self, zones: Sequence[Zone], full_m_s: float) -> None:
        self._zones, self._full_m_s = tuple(zones), full_m_s
        corners = [load_filter_mask(Path(z.mask.file)).corners_W if z.mask else np.array(z.corners_W) for z in zones]
        points = np.vstack([np.empty((0, 2)), *corners])
        low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.zeros(2))
        self.origin_m, size_m = low - _AROUND_M, high - low + 2.0 * _AROUND_M
        self.cell_m = max(_CELL_M, math.sqrt(float(size_m.prod()) / _MOST_CELLS))
        columns, rows = np.ceil(size_m / self.cell_m).astype(int).tolist()
        self._shape = rows, columns

    def _of(self, *kinds: ZoneKind) -> tuple[Zone, ...]:
        return tuple(zone for zone in self._zones if zone.kind in kinds)

    @property
    def axes(self) -> tuple[FloatArray, FloatArray]:
        """The x and y of the cell centres."""
        x, y = ((self.origin_m[n] + (np.arange(self._shape[1 - n]) + 0.5) * self.cell_m) for n in (0, 1))
        return x, y

    def cells(self, points_W: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64], BoolGrid]:
        """Row and column of the cell that contains each point (N, 2), and whether the point is on the grid."""
        column, row = np.floor((points_W[:, :2] - self.origin_m) / self.cell_m).astype(np.int64).T
        on = (row >= 0) & (row < self._shape[0]) & (column >= 0) & (column < self._shape[1])
        return row[on], column[on], on

    def _values(self, zone: Zone) -> NDArray[np.float64]:
        """Values of a zone's mask in all cells, base + multiplier * percent; NaN in unknown cells."""
        assert zone.mask is not None
        x, y = np.meshgrid(*self.axes)
        mask = load_filter_mask(Path(zone.mask.file))
        percent = mask.at(np.column_stack([x.ravel(), y.ravel()])).reshape(self._shape)
        return np.where(percent < 0, np.nan, zone.mask.base + zone.mask.multiplier * percent)

    def ground(self, zone: Zone) -> BoolGrid:
        """The cells inside a zone, edge included."""
        if zone.mask is not None:
            values = self._values(zone)
            return values >= _MOST_PERCENT if zone.kind is ZoneKind.KEEP_OUT else np.isfinite(values)
        cells = np.zeros(self._shape, dtype=np.uint8)
        corners = ((np.array(zone.corners_W) - self.origin_m) / self.cell_m - 0.5) * 2**_SUBPIXEL_BITS
        cv2.fillPoly(cells, [np.round(corners).astype(np.int32)], 1, shift=_SUBPIXEL_BITS)
        return cells.astype(np.bool_)

    @cached_property
    def keep_out(self) -> BoolGrid:
        """The cells that the body may not enter."""
        grounds = (self.ground(zone) for zone in self._of(ZoneKind.KEEP_OUT))
        return np.asarray(np.logical_or.reduce([np.zeros(self._shape, dtype=np.bool_), *grounds]))

    @cached_property
    def _limits_m_s(self) -> Floats:
        limits = np.full(self._shape, np.inf, dtype=np.float32)
        for zone in self._of(ZoneKind.SPEED_LIMIT):
            if zone.mask is None:
                limit = zone.speed_m_s if zone.speed_m_s is not None else (zone.share or 1.0) * self._full_m_s
                each = np.where(self.ground(zone), limit, np.inf)
            else:
                values = self._values(zone)
                share = zone.mask.type is FilterType.SPEED_SHARE
                valid = (values > 0.0) & (values <= _MOST_PERCENT if share else np.isfinite(values))
                each = np.where(valid, values * (self._full_m_s / _MOST_PERCENT if share else 1.0), np.inf)
            limits = np.minimum(limits, each.astype(np.float32))
        return limits

    @cached_property
    def slowdown(self) -> float:
        """Factor, 1 or more, by which speed limits may prolong a drive."""
        return max(1.0, self._full_m_s / float(self._limits_m_s.min()))

    def speed_m_s(self, footprint: Footprint, poses: FloatArray, ahead_m: FloatArray) -> float:
        """Speed limit for a robot that reaches `poses` (N, 3) after `ahead_m` (N,), so that it brakes in time."""
        if not self._of(ZoneKind.SPEED_LIMIT):
            return math.inf
        limits = np.full(len(poses), np.inf)
        row, column, on = self.cells(disc_centres(_body_points(footprint, _UNSURE_M), poses).reshape(-1, 2))
        pose = np.repeat(np.arange(len(poses)), len(on) // max(1, len(poses)))[on]
        np.minimum.at(limits, pose, self._limits_m_s[row, column])
        return float(np.min(np.sqrt(limits**2 + 2.0 * _BRAKING_M_S2 * np.maximum(0.0, ahead_m - _EARLY_M))))

    def braking_m(self, speed_m_s: float) -> float:
        """Distance (m) ahead within which speed limits count at this speed."""
        return _EARLY_M + speed_m_s**2 / (2.0 * _BRAKING_M_S2)

    def names_at(self, kind: ZoneKind, pose: Pose2D, footprint: Footprint | None = None) -> tuple[str, ...]:
        """Names of the zones of one kind at the body's origin, or near a footprint when one is given."""
        points = np.zeros((1, 2)) if footprint is None else _body_points(footprint, SAFE_MARGIN_M)
        row, column, _ = self.cells(disc_centres(points, _row(pose))[0])
        return tuple(zone.name for zone in self._of(kind) if self.ground(zone)[row, column].any())

    @cached_property
    def _factors(self) -> Floats:
        """Cost factors of all zones, without the effect of speed limits."""
        preferred = self._of(ZoneKind.PREFERRED)
        factor = np.full(self._shape, _PREFERENCE if preferred else 1.0)
        for zone in preferred:
            factor[self.ground(zone)] = 1.0
        for zone in self._of(ZoneKind.KEEP_OUT):
            if zone.mask is not None:
                values = np.nan_to_num(self._values(zone)).clip(0.0, _MOST_PERCENT)
                factor = np.maximum(factor, 1.0 + (_PREFERENCE - 1.0) * values / _MOST_PERCENT)
        factor[self.keep_out] = _LEAVING
        return factor.astype(np.float32)

    def has_costs(self, start: Pose2D) -> bool:
        """Returns whether zones make some motions from a start more expensive than others."""
        costly = (ZoneKind.PREFERRED, ZoneKind.ONE_WAY, ZoneKind.SPEED_LIMIT)
        masked = any(zone.mask is not None for zone in self._zones)
        return masked or bool(self._of(*costly)) or bool(self.names_at(ZoneKind.KEEP_OUT, start))

    def costs(self, xs: FloatArray, ys: FloatArray, forward_m_s: float, leave: Pose2D | None = None) -> ZoneCosts:
        """Zone costs at the points of a grid with these x and y; `forward_m_s` is the speed without a limit.

        With `leave`, motions may take any direction in the one-way zones that contain this start.
        """
        factor = np.full((len(ys), len(xs)), _PREFERENCE if self._of(ZoneKind.PREFERRED) else 1.0, dtype=np.float32)
        course = np.full(factor.shape, np.nan, dtype=np.float32)
        row, column, on = self.cells(np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2))
        slower = forward_m_s / np.minimum(self._limits_m_s[row, column], forward_m_s)
        factor.reshape(-1)[on] = self._factors[row, column] * slower
        left = () if leave is None else self.names_at(ZoneKind.ONE_WAY, leave)
        for zone in self._of(ZoneKind.ONE_WAY):
            cells = np.zeros(factor.shape, dtype=np.bool_)
            cells.reshape(-1)[on] = self.ground(zone)[row, column]
            if zone.name in left:
                factor[cells] *= _LEAVING
            else:
                course[cells] = zone.direction_rad
        return ZoneCosts(factor, course, cv2.erode(factor, np.ones((13, 13), np.uint8)).astype(np.float32))

    def against(self, poses: FloatArray) -> tuple[str, ...]:
        """Names of the one-way zones in which a path (N, 3) opposes the direction."""
        names, steps = [], np.diff(poses[:, :2], axis=0)
        row, column, on = self.cells(poses[:-1])
        for zone in self._of(ZoneKind.ONE_WAY):
            along = steps[on] @ (math.cos(zone.direction_rad), math.sin(zone.direction_rad))
            if np.any(self.ground(zone)[row, column] & (along < -_BACK_M)):
                names.append(zone.name)
        return tuple(names)


class KeepOut:
    """Keep-out zones as obstacles, for one robot.

    While the body is partly in a zone, cells no deeper than the body are free, so that the robot may leave.
    """

    def __init__(self, zones: ZoneMap) -> None:
        self._zones = zones
        self._whole = signed_distance(zones.keep_out, zones.cell_m)
        self.reset()

    def reset(self) -> None:
        """Forgets the path out of a zone, so that the next call searches it again."""
        self._steps: NDArray[np.int32] | None = None
        self._deeper: tuple[int, Floats] | None = None

    def space(self, costmap: FreeSpace, footprint: Footprint, pose: Pose2D) -> FreeSpace:
        """The costmap with the zones as obstacles, for a robot at a pose."""
        keep_out = self._zones.keep_out
        if not keep_out.any():
            return costmap
        row, column, _ = self._zones.cells(disc_centres(_body_points(footprint), _row(pose))[0])
        if not keep_out[row, column].any():
            self.reset()
            return WithObstacles(costmap, self._distance_m(self._whole))
        self._steps = _steps_out(self._zones, costmap, footprint) if self._steps is None else self._steps
        (i,), (j,) = self._zones.cells(_row(pose))[:2]
        around = self._steps[max(0, i - _BESIDE) : i + _BESIDE + 1, max(0, j - _BESIDE) : j + _BESIDE + 1]
        level = int(around.min()) if keep_out[i, j] else 0
        if level == _NEVER:
            return WithObstacles(costmap, self._distance_m(self._whole))
        body = self._steps[row, column]
        turning = math.ceil(footprint.circumscribed_m / self._zones.cell_m) if level > 0 else 0
        most = max(int(body[body < _NEVER].max(initial=0)), level + turning) + 1
        if self._deeper is None or self._deeper[0] != most:
            self._deeper = most, signed_distance(keep_out & (self._steps > most), self._zones.cell_m)
        return WithObstacles(costmap, self._distance_m(self._deeper[1]))

    def _distance_m(self, field: Floats) -> Callable[[FloatArray], FloatArray]:
        """Distance from points to the cells of a field; infinite off the grid, which is larger than the zones."""
        x0_m, y0_m = self._zones.origin_m.tolist()

        def distance_m(points_W: FloatArray) -> FloatArray:
            points = np.ascontiguousarray(points_W)
            found = distances(field, self._zones.cell_m, x0_m, y0_m, points)
            return np.where(self._zones.cells(points)[2], found, np.inf)

        return distance_m


def _steps_out(zones: ZoneMap, costmap: FreeSpace, footprint: Footprint) -> NDArray[np.int32]:
    """Distance, in cells, from each cell of a keep-out zone to free ground, for a disc as wide as the body.

    It is 0 outside zones, and _NEVER in cells from which no path leads out.
    """
    clear_m = clearance_on_grid(costmap, *zones.axes)
    free = clear_m > footprint.inscribed_m - 2.0 * zones.cell_m
    steps = np.full(free.shape, _NEVER, dtype=np.int32)
    square, front, count = np.ones((3, 3), np.uint8), free & ~zones.keep_out, 0
    while front.any():
        steps[front] = count
        count += 1
        front = cv2.dilate(front.astype(np.uint8), square).astype(np.bool_) & free & (steps == _NEVER)
    for _ in range(math.ceil(footprint.inscribed_m / zones.cell_m)):
        nearest = cv2.erode(steps.astype(np.float32), square)
        beside = (clear_m > 0.0) & (steps == _NEVER) & (nearest < _NEVER)
        steps[beside] = nearest[beside].astype(np.int32) + 1
    return steps


def _row(pose: Pose2D) -> FloatArray:
    return np.array([[pose.x_m, pose.y_m, pose.yaw_rad]])


def _body_points(footprint: Footprint, grown_m: float = 0.0) -> FloatArray:
    """Points (N, 2) that cover the footprint, grown by a margin, in the body frame."""
    return _points_of(footprint.discs.tobytes(), grown_m)


@lru_cache(maxsize=16)
def _points_of(buffer: bytes, grown_m: float) -> FloatArray:
    discs = np.frombuffer(buffer).reshape(-1, 3)
    reach = discs[:, 2:] + grown_m
    low, high = np.min(discs[:, :2] - reach, axis=0), np.max(discs[:, :2] + reach, axis=0)
    axes = (np.linspace(a, b, 1 + math.ceil((b - a) / _SAMPLE_M)) for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(points[:, None] - discs[None, :, :2], axis=2)
    return np.asarray(points[np.any(apart <= reach[:, 0] + 0.5 * _SAMPLE_M, axis=1)])


def zone_messages(zones: Iterable[Zone]) -> list[dict[str, Any]]:
    """Encodes the zones that have an outline: name, kind, rule in words, outlines (world frame, m), one-way direction.

    A mask's outlines surround its keep-out cells or its limits. Raises InputError when a mask cannot be read.
    """
    found = []
    for zone in zones:
        outlines: list[Any] = [zone.corners_W]
        if zone.mask is not None:
            least = 100 if zone.kind is ZoneKind.KEEP_OUT else 1
            outlines = [each.round(3).tolist() for each in load_filter_mask(Path(zone.mask.file)).outlines_W(least)]
        ahead = {"direction_rad": zone.direction_rad} if zone.kind is ZoneKind.ONE_WAY else {}
        message = {"name": zone.name, "kind": zone.kind.value, "rule": zone.words, "outlines": outlines, **ahead}
        found += [message] if outlines else []
    return found
