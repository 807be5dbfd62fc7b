"""Small leaves that need no skill."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf
from executive.tree.context import RunContext
from executive.tree.node import NodeKind
from executive.words.geometry import Point, distance_m, inside
from skills.api import Cause, Surface
from skills.robot import Clock, Pose2D


@dataclass(kw_only=True, eq=False, repr=False)
class RememberPose(ExplainedLeaf):
    """Writes the robot's present pose in the world to the blackboard. Always SUCCESS once the robot is localised.

    FAILURE with PRECONDITION when the robot does not know where it is for longer than `patience_s`. With `keep`, a pose
    that is there already stays: the mission was asked for where another one began.
    """

    key: str
    context: RunContext
    patience_s: float = 5.0
    keep: bool = False

    def initialise(self) -> None:
        """Start the patience."""
        self.clear_explanation()
        self._started_s = self.context.clock.now()

    def update(self) -> Status:
        """Write the pose, or wait for one."""
        if self.keep and self.key in self.context.board:
            self.message = "began before"
            return Status.SUCCESS
        if self.context.localiser.estimate().localised:
            self.context.board.put(self.key, self.context.pose())
            self.message = "knows where it stands"
            return Status.SUCCESS
        if self.context.clock.now() - self._started_s <= self.patience_s:
            self.message = "waits until it knows where it is"
            return Status.RUNNING
        self.cause, self.message = Cause.PRECONDITION, "the robot does not know where it is"
        return Status.FAILURE


@dataclass(kw_only=True, eq=False, repr=False)
class Pause(ExplainedLeaf):
    """RUNNING for `duration_s` on the robot's clock, then SUCCESS: objects may come to rest, readings may come in."""

    duration_s: float
    clock: Clock

    def initialise(self) -> None:
        """Start the time."""
        self.clear_explanation()
        self._end_s = self.clock.now() + self.duration_s

    def update(self) -> Status:
        """Wait until the time is over."""
        done = self.clock.now() >= self._end_s
        self.message = f"waited {self.duration_s:g} s" if done else "waits a moment"
        return Status.SUCCESS if done else Status.RUNNING


@dataclass(kw_only=True, eq=False, repr=False)
class SurfacesNear(ExplainedLeaf):
    """Writes those of some surfaces to the blackboard that lie within `within_m` of the robot, the nearest first.

    `rooms` has the outline of each surface's room by the surface's name. Where surfaces of the robot's own room are
    near, others do not count: a wall hides them.
    SUCCESS when there are some. FAILURE with POSTCONDITION when there are none: `otherwise` says what that means.
    """

    surfaces: Sequence[Surface]
    within_m: float
    key: str
    otherwise: str
    context: RunContext
    rooms: Mapping[str, Sequence[Point]] = field(default_factory=dict)

    def update(self) -> Status:
        """Look which surfaces are near."""
        pose = self.context.pose()
        here = (pose.x_m, pose.y_m)
        near = sorted((distance_m(surface.polygon_W, here), k) for k, surface in enumerate(self.surfaces))
        close = tuple(self.surfaces[k] for distance, k in near if distance <= self.within_m)
        found = tuple(surface for surface in close if inside(self.rooms.get(surface.name, ()), here)) or close
        if found:
            self.context.board.put(self.key, found)
            self.cause, self.message = None, f"near here: {', '.join(surface.name for surface in found)}"
            return Status.SUCCESS
        self.cause = Cause.POSTCONDITION
        self.message = f"there is no surface within {self.within_m:g} m of {_xy(here)}; {self.otherwise}"
        return Status.FAILURE


def _xy(point: tuple[float, float]) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f}) m"


KINDS: Final[Mapping[str, NodeKind]] = {
    "remember": NodeKind(RememberPose, ("context",), writes=lambda options: {options["key"]: Pose2D}),
    "pause": NodeKind(Pause, ("clock",)),
    "surfaces near": NodeKind(SurfacesNear, ("context",), writes=lambda options: {options["key"]: tuple[Surface, ...]}),
}
