"""World model of skills: seen objects, the estimated pose, and free space.

Skills of others import these names from `skills.api`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from skills.quantities import Angle, Coordinate, Delay, Height, Margin, Share
from skills.robot import Robot, Scan

if TYPE_CHECKING:
    from pydrake.math import RigidTransform


class PlanningError(Exception):
    """No plan was found; the message is one plain sentence, `outputs` is what was learnt (see `Failed`)."""

    def __init__(self, message: str, outputs: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.outputs: Mapping[str, Any] = outputs or {}


@dataclass(frozen=True)
class ObjectKind:
    """A kind of object, perhaps with attributes: "red wrench" is ObjectKind("wrench", ("red",))."""

    name: str
    attributes: tuple[str, ...] = ()

    def __str__(self) -> str:
        return " ".join((*self.attributes, self.name))


@dataclass(frozen=True)
class Surface:
    """A flat top where objects lie: outline in the world frame as (x, y) corners, height above the floor."""

    name: str
    polygon_W: tuple[tuple[Coordinate, Coordinate], ...]
    height_m: Height


FLOOR: Final = "floor"
"""The name of the surface on which an object rests that lies on the floor."""


@dataclass(frozen=True)
class ObjectObservation:
    """An object that was seen: position, size and score.

    `position_W` is the centre of what was seen, in the world frame (m); `size_m` the extents of its points along the
    axes of a box that is turned by `yaw_rad` about the vertical; `surface` the name of the surface that it rests on.
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
    """The robot's pose: X_WO corrects odometry, so that X_WB = X_WO @ X_OB. Covariance over x, y (m), yaw (rad).

    `health` is how far it can be trusted, from 0 to 1: the share of what the robot sees that the map explains at this
    pose, less what speaks for other poses.
    """

    stamp_s: float
    X_WO: RigidTransform
    covariance: NDArray[np.float64]
    localised: bool
    health: float = 1.0


class Localiser(Protocol):
    """Estimates the robot's pose in the world."""

    def estimate(self) -> LocalisationEstimate:
        """The latest estimate."""

    def update(self, robot: Robot) -> None:
        """Updates from the robot's newest sensor readings; the runner calls this before each tick."""


@runtime_checkable
class SearchingLocaliser(Protocol):
    """A localiser that can search a whole map for the robot's pose, as the recovery from lost localisation does."""

    def search(self, scan: Scan, belief: LocalisationEstimate, radius_m: float | None) -> LocalisationEstimate | None:
        """The pose where the scan fits, within radius_m of the belief or anywhere (None); None when it fits nowhere.

        Changes nothing, reads nothing that `update` changes, and may take long: call it inside a Worker job.
        """

    def accept(self, estimate: LocalisationEstimate) -> None:
        """Uses this estimate from now on."""


@runtime_checkable
class ParticleView(Protocol):
    """A localiser that says where the robot may be, by sample poses."""

    def particles_W(self, most: int) -> NDArray[np.float64]:
        """Poses (N, 3) of x, y (m) and yaw (rad), `most` at most, evenly chosen by weight."""


class FreeSpace(Protocol):
    """Free space for the body, as planners and controllers ask for it."""

    def clearance_m(self, points_W: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance from each (x, y) row to the nearest obstacle."""


class Costmap(FreeSpace, Protocol):
    """Free space by the surveyed keep-out grid, and by obstacles that the sensors see."""

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Takes in the robot's newest sensor readings; called by the runner before each tick."""

    def add_points(self, points_W: NDArray[np.float64], stamp_s: float) -> None:
        """Takes in (N, 3) points that a camera saw on objects in the way, the floor left out."""


@runtime_checkable
class ForgettingCostmap(Protocol):
    """A costmap whose layer of seen objects can be cleared; what the survey knows stays."""

    def forget_seen(self, within_W: NDArray[np.float64] | None = None) -> int:
        """Forgets what was seen and not surveyed; the number of cells that were blocked by it.

        With discs, rows of x, y and radius (m, world), only what lies within them.
        """


@runtime_checkable
class LeavesOthersOut(Protocol):
    """A costmap or localiser that leaves other robots to those who know where they are."""

    def leave_out(self, discs_W: NDArray[np.float64]) -> None:
        """From now on take in nothing that is seen within these discs, rows of x, y and radius (m, world)."""


@runtime_checkable
class LayeredView(Protocol):
    """A costmap that says what is seen and not surveyed."""

    def seen_m(self) -> NDArray[np.float64]:
        """Centres (N, 2) of the cells that are blocked by something seen that the map does not explain."""


@runtime_checkable
class ReturnsView(Protocol):
    """A costmap that gives the LiDAR returns of the last scan that nothing surveyed explains."""

    def unexplained(self) -> tuple[float, NDArray[np.float64]]:
        """The scan's stamp and the returns (N, 3) in the world; of one scan alone, so not confirmed."""


class WorkCounter(Protocol):
    """Counts what a run computes, so that a slower path is seen without a clock. Jobs may call it."""

    def count(self, name: str, amount: int = 1) -> None:
        """Adds to the counter of this name: "planner_expansions"."""


class NoWorkCounter:
    """A `WorkCounter` where nobody counts."""

    def count(self, name: str, amount: int = 1) -> None:
        """Nothing."""


NO_WORK_COUNTER: Final = NoWorkCounter()


IN_THE_WAY: Final = "in_the_way"
"""Output port with the objects that block every grasp."""
