"""World model of skills: observed objects, pose estimate, free space, zones, and the traffic among a run's robots.

Skills of others import these names from `skills.api`. The traffic contains estimates only, never ground truth. A robot
that has reported nothing for some seconds is removed from it, and remains only an obstacle that others perceive.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from skills.quantities import Angle, Coordinate, Delay, Height, Margin, Share, Speed, TagNumber, TagSize
from skills.relations import Relation
from skills.robot import FloatArray, Pose2D, Robot, Scan

if TYPE_CHECKING:
    from pydrake.math import RigidTransform


PERSON: Final = "person"
"""Class name of people."""


class PlanningError(Exception):
    """Error of a planner that found no plan: one plain sentence, and `outputs` for the next attempt (see `Failed`)."""

    def __init__(self, message: str, outputs: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.outputs: Mapping[str, Any] = outputs or {}


@dataclass(frozen=True)
class ObjectKind:
    """Kind of object, optionally with attributes: "red wrench" is ObjectKind("wrench", ("red",)).

    The `relations` say which object of the kind is meant: "red wrench next to the hammer".
    """

    name: str
    attributes: tuple[str, ...] = ()
    relations: tuple[Relation, ...] = ()

    def __str__(self) -> str:
        return " ".join((*self.attributes, self.name.replace("_", " "), *map(str, self.relations)))

    @property
    def plain(self) -> ObjectKind:
        """Kind without its relations, which no longer hold once the robot has taken the object."""
        return replace(self, relations=()) if self.relations else self


@dataclass(frozen=True)
class Surface:
    """Flat top on which objects lie: outline in the world frame as (x, y) corners, height above the floor.

    Left and right on it are as seen from the pose `viewer` (None: from the robot). A bin is open at this height.
    """

    name: str
    polygon_W: tuple[tuple[Coordinate, Coordinate], ...]
    height_m: Height
    viewer: Pose2D | None = None
    is_bin: bool = False


@dataclass(frozen=True)
class Tag:
    """AprilTag that the robot knows: its number, the side of its black square, and what carries it.

    For a tag on an object, `on` is the object's class. Any other tag is upright with its centre at `p_W` and faces the
    direction `yaw_rad`, at the dock named by `on` or on a wall.
    """

    id: TagNumber
    size_m: TagSize
    on: str | None = None
    p_W: tuple[Coordinate, Coordinate, Height] | None = None
    yaw_rad: Angle = 0.0

    def X_WT(self) -> RigidTransform:
        """Pose of a tag that has a position: x to the right and y up on its face, z out of the face."""
        from pydrake.math import RigidTransform, RotationMatrix

        assert self.p_W is not None
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return RigidTransform(RotationMatrix(np.array([[-s, 0.0, c], [c, 0.0, s], [0.0, 1.0, 0.0]])), self.p_W)


FLOOR: Final = "floor"
"""Surface name for an object that lies on the floor."""


@dataclass(frozen=True)
class ObjectObservation:
    """Observed object: kind, position, size and score.

    `position_W` is the centre of its observed points in the world frame (m). `size_m` are the extents of those points
    along the axes of a box that is rotated by `yaw_rad` about the vertical. `surface` is the name of the surface on
    which it rests.
    """

    stamp_s: Delay
    kind: ObjectKind
    position_W: tuple[Coordinate, Coordinate, Height]
    size_m: tuple[Margin, Margin, Margin]
    yaw_rad: Angle
    score: Share
    surface: str | None = None


@dataclass(frozen=True)
class LocalisationEstimate:
    """Estimated pose of the robot: X_WO corrects odometry, so that X_WB = X_WO @ X_OB.

    The covariance is over x, y (m), yaw (rad). `health` is the confidence in the estimate, from 0 to 1: the fraction of
    the scan that the map explains at this pose, minus the support for competing poses.
    """

    stamp_s: float
    X_WO: RigidTransform
    covariance: NDArray[np.float64]
    localised: bool
    health: float = 1.0


class Localiser(Protocol):
    """Estimates the robot's pose in the world."""

    def estimate(self) -> LocalisationEstimate:
        """Returns the latest estimate."""

    def update(self, robot: Robot) -> None:
        """Updates from the robot's newest sensor readings; the runner calls this before each tick."""


@runtime_checkable
class SearchingLocaliser(Localiser, Protocol):
    """Localiser that can search the whole map for the robot's pose, to recover from lost localisation."""

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> LocalisationEstimate | None:
        """Returns the pose where the scan fits, within `radius_m` of the belief, or anywhere when `radius_m` is None.

        Returns None when the scan fits nowhere. Changes nothing, reads nothing that `update` changes, and may take
        long: call it inside a Worker job.
        """

    def accept(self, estimate: LocalisationEstimate) -> None:
        """Replaces the estimate."""


@runtime_checkable
class ParticleView(Protocol):
    """Localiser that represents its belief by particles."""

    def particles_W(self, most: int) -> NDArray[np.float64]:
        """Returns at most `most` poses (N, 3) of x, y (m) and yaw (rad), resampled evenly by weight."""


class FreeSpace(Protocol):
    """Free space for the body, as planners and controllers query it."""

    def clearance_m(self, points_W: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the distance (m) from each (x, y) row to the nearest obstacle."""


class Costmap(FreeSpace, Protocol):
    """Free space from the surveyed keep-out grid and from the obstacles that the sensors see."""

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Adds the robot's newest sensor readings; the runner calls this before each tick."""

    def add_points(self, points_W: NDArray[np.float64], stamp_s: float) -> None:
        """Adds obstacle points (N, 3) that a camera saw; they must not contain the floor."""


@runtime_checkable
class ClearableCostmap(Protocol):
    """Costmap whose obstacle layer can be cleared; the surveyed grid stays."""

    def clear_obstacles(self, within_W: NDArray[np.float64] | None = None) -> int:
        """Clears the obstacle layer; returns the number of blocked cells that it cleared.

        With discs, rows of x, y and radius (m, world), clears only the cells within them.
        """


@runtime_checkable
class ExcludesRobots(Protocol):
    """Costmap or localiser that ignores sensor returns from other robots, whose poses are known."""

    def exclude_robots(self, discs_W: NDArray[np.float64]) -> None:
        """Ignores, from now on, sensor returns within these discs, rows of x, y and radius (m, world)."""


@runtime_checkable
class ObstacleLayerView(Protocol):
    """Costmap that gives access to its obstacle layer."""

    def obstacle_cells(self, within_s: float = math.inf) -> NDArray[np.float64]:
        """Returns the centres (N, 2) of the cells that a perceived obstacle blocks and the map does not explain.

        With `within_s`, only of the cells in which an obstacle was perceived within this time.
        """


@runtime_checkable
class ReturnsView(Protocol):
    """Costmap that provides those LiDAR returns of the last scan which the survey does not explain."""

    def unexplained_returns(self) -> tuple[float, NDArray[np.float64]]:
        """Returns the scan's stamp and the returns (N, 3) in the world; one scan alone has seen them."""


@runtime_checkable
class SurveyView(Protocol):
    """Costmap on a survey of the site, which explains walls and furniture."""

    def is_unexplained(self, points_W: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Returns whether each (x, y, z) row lies on surveyed ground and away from everything in the survey."""


class WorkCounter(Protocol):
    """Counts the computations of a run, so that a slower algorithm is detected without a clock. Jobs may call it."""

    def count(self, name: str, amount: int = 1) -> None:
        """Adds to the counter with this name, such as "planner_expansions"."""


class NoWorkCounter:
    """`WorkCounter` that counts nothing."""

    def count(self, name: str, amount: int = 1) -> None:
        """Does nothing."""


NO_WORK_COUNTER: Final = NoWorkCounter()


IN_THE_WAY: Final = "in_the_way"
"""Output port with the objects that block every grasp."""


@dataclass(frozen=True)
class Neighbour:
    """Another robot: its name, estimated pose (3,) and remaining path (N, 3), all as x, y, yaw in the world.

    `path` is None while the robot stands. `discs` (x, y, radius) cover its outline in the body frame. `first` is True
    while it has priority over us where the two paths meet. `yields` is True while it must clear a path that is reserved
    against it, because it has lower priority or no task. When both are False it works where it stands, and the others
    wait for it.
    """

    name: str
    pose: FloatArray
    path: FloatArray | None
    discs: FloatArray
    stamp_s: float
    first: bool = False
    yields: bool = False


class Traffic(Protocol):
    """One robot's view of the other robots and of the priorities among them."""

    def claim(self) -> None:
        """Asks for the right of way; the robot that asked first goes first. A robot that has a claim keeps it."""

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Reports the poses (N, 3) that lie ahead, and the robot's outline (discs in the body frame).

        While the robot has a claim, they are reserved against all robots that claimed later.
        """

    def release(self) -> None:
        """Gives up claim and path. Idempotent."""

    def others(self) -> Sequence[Neighbour]:
        """Returns the other robots that have reported recently, by name."""

    def let_pass(self, name: str) -> None:
        """Swaps priority with a robot for which we should have made way and cannot."""


class _Alone:
    """Traffic of a robot without other robots."""

    def claim(self) -> None:
        """Does nothing."""

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Does nothing."""

    def release(self) -> None:
        """Does nothing."""

    def others(self) -> Sequence[Neighbour]:
        """Returns an empty list."""
        return ()

    def let_pass(self, name: str) -> None:
        """Does nothing."""


NO_TRAFFIC: Final[Traffic] = _Alone()


class ZoneKind(enum.StrEnum):
    """Kind of a zone."""

    KEEP_OUT = "keep_out"  # no part of the body enters
    PREFERRED = "preferred"  # paths lead through it where that is not much longer
    SPEED_LIMIT = "speed_limit"  # the base is no faster while a part of the body is in it
    ONE_WAY = "one_way"  # the base moves in its direction, or across, and never against it
    SILENT = "silent"  # the robot shows what it has to say, and does not speak


_WORDS: Final = {
    ZoneKind.KEEP_OUT: "keep out of",
    ZoneKind.PREFERRED: "preferably through",
    ZoneKind.SPEED_LIMIT: "at most {speed} in",
    ZoneKind.ONE_WAY: "one way through",
    ZoneKind.SILENT: "silent in",
}


class FilterType(enum.IntEnum):
    """Type of a Nav2 costmap filter, by its number in `nav2_msgs/CostmapFilterInfo`."""

    KEEP_OUT = 0
    SPEED_SHARE = 1  # percent of the full speed
    SPEED = 2  # m/s


@dataclass(frozen=True)
class ZoneMask:
    """Nav2 filter mask: the YAML file of its picture, and type, base and multiplier from its filter info.

    The limit in a cell is base + multiplier * value, where value is the cell's occupancy in percent; 0 is no limit.
    """

    file: str
    type: FilterType
    base: float
    multiplier: float


@dataclass(frozen=True)
class Zone:
    """Zone of the map: its kind, and its ground as corners (x, y) in the world frame (m) or as a filter mask.

    A speed limit is `speed_m_s`, or a `share` of the robot's full speed; a mask contains its own limits.
    `direction_rad` is the direction of a one-way zone.
    """

    name: str
    kind: ZoneKind
    corners_W: tuple[tuple[Coordinate, Coordinate], ...] = ()
    mask: ZoneMask | None = None
    speed_m_s: Speed | None = None
    share: Share | None = None
    direction_rad: Angle = 0.0

    @property
    def words(self) -> str:
        """Rule of the zone in words, with its name: "keep out of: bathroom"."""
        speed = (
            f"{self.speed_m_s:g} m/s" if self.speed_m_s is not None else f"{100 * (self.share or 1):g} % of full speed"
        )
        return f"{_WORDS[self.kind].format(speed=speed if self.mask is None else 'the speed of its mask')}: {self.name}"


def zones_sentence(names: Sequence[str], what: str) -> str:
    """ "The bathroom is a keep-out zone." or "The hall and the lab are keep-out zones."."""
    *first, last = (f"the {name}" for name in names)
    said = f"{', '.join(first)} and {last} are {what}s" if first else f"{last} is a {what}"
    return f"{said[0].upper()}{said[1:]}."
