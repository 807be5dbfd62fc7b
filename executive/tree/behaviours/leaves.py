"""Small leaves that need no skill."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.geometry import distance_m
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.explained import Explained
from executive.tree.node import NodeKind
from skills.api import Cause, Surface
from skills.robot import Clock, Pose2D


class RememberPose(Explained, Behaviour):
    """Writes the robot's present pose in the world to the blackboard. Always SUCCESS once the robot is localised.

    FAILURE with PRECONDITION when the robot does not know where it is for longer than `patience_s`. With `keep`, a pose
    that is there already stays: the mission was asked for where another one began.
    """

    def __init__(
        self,
        *,
        path_id: str,
        name: str,
        key: str,
        context: RunContext,
        patience_s: float = 5.0,
        keep: bool = False,
    ) -> None:
        super().__init__(name)
        self.path_id = path_id
        self._keep = keep
        self._key, self._context, self._patience_s, self._started_s = key, context, patience_s, 0.0
        self.clear_explanation()

    def initialise(self) -> None:
        """Start the patience."""
        self.clear_explanation()
        self._started_s = self._context.clock.now()

    def update(self) -> Status:
        """Write the pose, or wait for one."""
        if self._keep and self._key in self._context.board:
            self.message = "began before"
            return Status.SUCCESS
        if self._context.localiser.estimate().localised:
            pose = self._context.pose()
            self._context.board.put(self._key, pose)
            self.message = f"stands at ({pose.x_m:.2f}, {pose.y_m:.2f}) m"
            return Status.SUCCESS
        if self._context.clock.now() - self._started_s <= self._patience_s:
            self.message = "waits until it knows where it is"
            return Status.RUNNING
        self.cause, self.message = Cause.PRECONDITION, "the robot does not know where it is"
        return Status.FAILURE


class Pause(Explained, Behaviour):
    """RUNNING for `duration_s` on the robot's clock, then SUCCESS: objects may come to rest, readings may come in."""

    def __init__(self, *, path_id: str, name: str, duration_s: float, clock: Clock) -> None:
        super().__init__(name)
        self.path_id = path_id
        self._duration_s, self._clock, self._end_s = duration_s, clock, 0.0
        self.clear_explanation()

    def initialise(self) -> None:
        """Start the time."""
        self.clear_explanation()
        self._end_s = self._clock.now() + self._duration_s

    def update(self) -> Status:
        """Wait until the time is over."""
        done = self._clock.now() >= self._end_s
        self.message = f"waited {self._duration_s:g} s" if done else "waits a moment"
        return Status.SUCCESS if done else Status.RUNNING


class SurfacesNear(Explained, Behaviour):
    """Writes those of some surfaces to the blackboard that lie within `within_m` of the robot, the nearest first.

    SUCCESS when there are some. FAILURE with POSTCONDITION when there are none: `otherwise` says what that means.
    """

    def __init__(
        self,
        *,
        path_id: str,
        name: str,
        surfaces: Sequence[Surface],
        within_m: float,
        key: str,
        otherwise: str,
        context: RunContext,
    ) -> None:
        super().__init__(name)
        self.path_id = path_id
        self._surfaces, self._within_m, self._key = tuple(surfaces), within_m, key
        self._otherwise, self._context = otherwise, context
        self.clear_explanation()

    def update(self) -> Status:
        """Look which surfaces are near."""
        pose = self._context.pose()
        here = (pose.x_m, pose.y_m)
        near = sorted((distance_m(surface.polygon_W, here), k) for k, surface in enumerate(self._surfaces))
        found = tuple(self._surfaces[k] for distance, k in near if distance <= self._within_m)
        if found:
            self._context.board.put(self._key, found)
            self.cause, self.message = None, f"near here: {', '.join(surface.name for surface in found)}"
            return Status.SUCCESS
        self.cause = Cause.POSTCONDITION
        self.message = f"there is no surface within {self._within_m:g} m of {_xy(here)}; {self._otherwise}"
        return Status.FAILURE


def _xy(point: tuple[float, float]) -> str:
    return f"({point[0]:.2f}, {point[1]:.2f}) m"


KINDS: Final[Mapping[str, NodeKind]] = MappingProxyType(
    {
        "remember": NodeKind(RememberPose, ("context",), writes=lambda options: {options["key"]: Pose2D}),
        "pause": NodeKind(Pause, ("clock",)),
        "surfaces near": NodeKind(
            SurfacesNear, ("context",), writes=lambda options: {options["key"]: tuple[Surface, ...]}
        ),
    }
)
