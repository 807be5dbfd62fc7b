"""Doorways, the open width measured by the LiDAR, and the memory of door states."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from skills.robot import FloatArray, Robot, Scan, unit_rays

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

    from skills.world_model import Localiser

_STRIP_M = 0.05
_HEIGHTS_M = (0.1, 1.9)
_IN_PLANE_M = 0.2
"""Largest distance from the door's plane at which a ray counts as ending in the doorway."""
_IN_PLANE_SHARE = 0.3
"""The same limit along the floor, as a fraction of the door's width: jambs are no farther along a ray."""
_BEYOND_M = 0.5
_FEWEST = 5
_CLEARLY = 0.8
_LEAST_TOWARDS = 0.05
_FEW_RAYS = 50
REACH_M: Final = 4.0
"""Largest distance at which a scan shows whether a door is closed."""
FLATTEST_RAD: Final = 1.25
"""Largest view angle at which it does."""
CLOSED_M: Final = 0.1
"""Width of its widest gap up to which a door counts as closed."""

Bools = NDArray[np.bool_]
Counts = NDArray[np.int64]


class DoorOpener(Protocol):
    """Plug-in that opens a motorised door; a frozen dataclass whose fields are its options."""

    def open(self, door_name: str, between: tuple[str, str]) -> None:
        """Asks the door to open; may block for seconds. Raises an exception whose text says why it stays closed."""


@dataclass(frozen=True)
class Doorway:
    """Doorway: its centre (x, y) in the world (m), its clear width (m), and the direction through it (rad).

    The direction may point either way. `between` names the two rooms that it joins, `opener` the plug-in that opens it.
    """

    middle_W: tuple[float, float]
    width_m: float
    through_rad: float
    between: tuple[str, str] = ("", "")
    opener: DoorOpener | None = field(default=None, compare=False)

    def distance_m(self, place_W: tuple[float, float]) -> float:
        """Distance from the doorway's centre to a point (m)."""
        return math.dist(self.middle_W, place_W)

    def axis(self, far_m: float, every_m: float) -> FloatArray:
        """Points (N, 2) on the line through the doorway, up to `far_m` on both sides."""
        steps = np.arange(-far_m, far_m + every_m, every_m)
        through = np.array([math.cos(self.through_rad), math.sin(self.through_rad)])
        return np.asarray(np.array(self.middle_W) + steps[:, None] * through)

    def ends(self) -> FloatArray:
        """Both ends (2, 2) of the doorway's clear width."""
        along = np.array([-math.sin(self.through_rad), math.cos(self.through_rad)])
        return np.asarray(np.array(self.middle_W) + np.array([[-0.5], [0.5]]) * self.width_m * along)

    def view_angle_rad(self, place_W: tuple[float, float]) -> float:
        """Angle between the direction through the doorway and the view from a point: 0 in front, pi/2 in its wall."""
        bearing = math.atan2(self.middle_W[1] - place_W[1], self.middle_W[0] - place_W[0])
        off = abs(math.remainder(bearing - self.through_rad, math.tau))
        return min(off, math.pi - off)


@dataclass(frozen=True)
class Opening:
    """Widest contiguous open part of a doorway (m): `least_m` as seen, `most_m` with unseen strips counted as open.

    `rays` is the number of rays that crossed the doorway.
    """

    least_m: float
    most_m: float
    rays: int


class DoorState(enum.Enum):
    """State of a door as the robot knows it. A gap too narrow for the robot leaves the state unknown."""

    OPEN = "open"
    CLOSED = "closed"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class SeenDoor:
    """State of a door, and the time (s) on the robot's clock when the robot observed it."""

    state: DoorState = DoorState.UNKNOWN
    seen_s: float = -math.inf


@dataclass
class DoorMemory:
    """Last observed state of each door; one memory lasts for all missions of a run."""

    _seen: dict[tuple[float, float], SeenDoor] = field(default_factory=dict)

    def note(self, door: Doorway, state: DoorState, now_s: float) -> None:
        """Records the state in which the robot sees a door now."""
        self._seen[door.middle_W] = SeenDoor(state, now_s)

    def last_seen(self, door: Doorway) -> SeenDoor:
        """State in which the robot last saw a door."""
        return self._seen.get(door.middle_W, SeenDoor())


def look_at_doors(
    doors: Sequence[Doorway],
    memory: DoorMemory,
    robot: Robot,
    localiser: Localiser,
    *,
    reach_m: float = REACH_M,
    flattest_rad: float = FLATTEST_RAD,
    closed_m: float = CLOSED_M,
) -> None:
    """Updates the memory of the doors in view from the newest scan.

    `reach_m` and `flattest_rad`: largest distance and view angle at which a scan is used. `closed_m`: a door counts as
    closed while all its gaps are narrower, and as open when the robot fits through.
    """
    scan, estimate = robot.scan(), localiser.estimate()
    if not doors or scan is None or not estimate.localised:
        return
    X_WL, sides = estimate.X_WO @ scan.X_OB @ scan.X_BL, [y for _, y in robot.capabilities().footprint_m]
    place = float(X_WL.translation()[0]), float(X_WL.translation()[1])
    for door in doors:
        if door.distance_m(place) > reach_m or door.view_angle_rad(place) > flattest_rad:
            continue
        seen = measure_opening(door, [(scan, X_WL)])
        if seen.rays >= _FEW_RAYS and seen.most_m <= closed_m:
            memory.note(door, DoorState.CLOSED, scan.stamp_s)
        elif seen.least_m >= max(sides) - min(sides):
            memory.note(door, DoorState.OPEN, scan.stamp_s)
        elif seen.least_m > closed_m and memory.last_seen(door).state is DoorState.CLOSED:
            memory.note(door, DoorState.UNKNOWN, scan.stamp_s)


def measure_opening(door: Doorway, scans: Iterable[tuple[Scan, RigidTransform]]) -> Opening:
    """Measures how wide a door is open, from scans with the pose X_WL of the LiDAR.

    A strip of the doorway is free when the rays through it end clearly beyond the doorway, and shut when they end in
    the doorway. Shut strips that touch neither side, such as a person who stands in the doorway, count as unseen.
    """
    strips = max(1, round(door.width_m / _STRIP_M))
    counts: Counts = np.array([_counts(door, strips, scan, X_WL) for scan, X_WL in scans]).sum(axis=0)
    free, shut = ((part >= _FEWEST) & (part >= _CLEARLY * counts.sum(axis=0)) for part in counts[:2])
    closed = np.logical_and.accumulate(shut) | np.logical_and.accumulate(shut[::-1])[::-1]
    strip_m = door.width_m / strips
    return Opening(_longest(free) * strip_m, _longest(~closed) * strip_m, int(counts.sum()))


def _counts(door: Doorway, strips: int, scan: Scan, X_WL: RigidTransform) -> Counts:
    """Counts, for each strip, the rays (3, strips) that pass through, end in the doorway, or end elsewhere."""
    origin, middle = X_WL.translation(), np.array(door.middle_W)
    through = np.array([math.cos(door.through_rad), math.sin(door.through_rad)])
    through = through if (middle - origin[:2]) @ through > 0.0 else -through
    along = np.array([-through[1], through[0]])
    rays = unit_rays(scan.elevations_rad, scan.azimuths_rad) @ X_WL.rotation().matrix().T
    towards = np.maximum(rays[..., :2] @ through, _LEAST_TOWARDS)
    crossing = ((middle - origin[:2]) @ through) / towards
    aside = (origin[:2] - middle) @ along + crossing * (rays[..., :2] @ along) + 0.5 * door.width_m
    height = origin[2] + crossing * rays[..., 2]
    crosses = np.isfinite(scan.ranges_m) & (towards > _LEAST_TOWARDS) & (aside >= 0.0) & (aside < door.width_m)
    crosses &= (height > _HEIGHTS_M[0]) & (height < _HEIGHTS_M[1])
    beyond = ((scan.ranges_m - crossing) * towards)[crosses]
    strip = np.minimum((aside[crosses] / door.width_m * strips).astype(np.int64), strips - 1)
    flat = towards[crosses] / np.sqrt(np.maximum(1e-6, 1.0 - towards[crosses] ** 2))
    goes, ends = beyond > _BEYOND_M, np.abs(beyond) <= np.minimum(_IN_PLANE_M, _IN_PLANE_SHARE * door.width_m * flat)
    return np.array([np.bincount(strip[kind], minlength=strips) for kind in (goes, ends, ~goes & ~ends)])


def _longest(flags: Bools) -> int:
    """Length of the longest run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
