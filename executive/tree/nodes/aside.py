"""What stands in the way of an object that is to be taken, and where it may be put aside."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from py_trees.common import Status

from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.explained import ExplainedLeaf
from executive.tree.node import NodeKind
from executive.tree.nodes.fallen import floor_square
from skills.api import Cause, ObjectObservation, Surface
from skills.quantities import Coordinate, Length
from skills.robot import Pose2D

_STEP_M, _FLOOR_HALF_M = 0.2, 1.2
Circle = tuple[Coordinate, Coordinate, Length]


@dataclass(kw_only=True, eq=False, repr=False)
class InTheWay(ExplainedLeaf):
    """Says what stands in the way of an object, and notes where to put it. SUCCESS at once.

    Reads from the blackboard: the objects that are in the way (`blocking_key`), of which the first is meant, and the
    wanted one (`wanted_key`). Writes: that first one (`obstacle_key`), the surface on which it stands (`surface_key`),
    the robot's pose (`pose_key`), and the circles of `clear_m` about the wanted object and the way from the robot to it
    (`clear_key`), where it would be in the way again. FAILURE with PRECONDITION: nobody knows what it stands on.
    """

    thing: str
    blocking_key: str
    wanted_key: str
    obstacle_key: str
    surface_key: str
    clear_key: str
    pose_key: str
    surfaces: Sequence[Surface]
    context: RunContext
    clear_m: float = 0.25

    def update(self) -> Status:
        """Write where it is, and where it must not be put."""
        board = self.context.board
        obstacle: ObjectObservation = board.get(self.blocking_key)[0]
        wanted: ObjectObservation = board.get(self.wanted_key)
        x, y, _ = obstacle.position_W
        floor = floor_square(Pose2D(x, y, 0.0), 0.0, _FLOOR_HALF_M)
        surface = next((each for each in (*self.surfaces, floor) if each.name == obstacle.surface), None)
        if surface is None:
            self.cause, self.message = Cause.PRECONDITION, f"it is not known what the {obstacle.thing} stands on"
            return Status.FAILURE
        board.put(self.obstacle_key, obstacle)
        board.put(self.surface_key, surface)
        board.put(self.pose_key, self.context.pose())
        board.put(self.clear_key, _way_circles(wanted, self.context.pose(), self.clear_m))
        self.cause = None
        self.message = f"the {obstacle.thing} is in the way of the {self.thing}; it is moved aside"
        return Status.SUCCESS


def _way_circles(wanted: ObjectObservation, pose: Pose2D, radius_m: float) -> tuple[Circle, ...]:
    """Circles in a row from an object to the robot."""
    x, y, _ = wanted.position_W
    off_x, off_y = pose.x_m - x, pose.y_m - y
    steps = max(1, round(math.hypot(off_x, off_y) / _STEP_M))
    return tuple((x + k / steps * off_x, y + k / steps * off_y, radius_m) for k in range(steps + 1))


def _written(options: Mapping[str, Any]) -> Mapping[str, Any]:
    """The keys of the object, its surface, the pose and the circles."""
    circles = tuple[Circle, ...]
    return {
        options["obstacle_key"]: ObjectObservation,
        options["surface_key"]: Surface,
        options["pose_key"]: Pose2D,
        options["clear_key"]: circles,
    }


KINDS: Final[Mapping[str, NodeKind]] = {"in the way": NodeKind(InTheWay, ("context",), writes=_written)}
