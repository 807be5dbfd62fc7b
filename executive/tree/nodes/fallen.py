"""Where an object lies that fell out of the gripper on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from py_trees.common import Status

from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.explained import ExplainedLeaf
from executive.tree.node import NodeKind
from executive.words.geometry import distance_m
from skills.api import FLOOR, Surface
from skills.geometry import compose
from skills.quantities import Coordinate, Height
from skills.robot import Pose2D

_TURNS_RAD: Final = tuple(math.radians(turn) for turn in (0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180))
_CORNERS: Final = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))


@dataclass(kw_only=True, eq=False, repr=False)
class Fallen(ExplainedLeaf):
    """Notes where the robot has lost what it carried, and says what happened. SUCCESS after `settle_s`.

    Writes to the blackboard: the robot's pose (`pose_key`); the point of the floor `ahead_m` before the body, where it
    fell (`spot_key`); the square of floor about it, `half_m` to each side (`floor_key`); that square with those of
    `surfaces` that lie within `within_m` of the robot, onto which it may have fallen as well (`around_key`). What the
    gripper still holds by then has slipped, and is not yet lost: a smaller square of free floor says where to
    set it down (`set_down_key`), and all else is written anew for there: it is picked up from where it is set down.
    """

    thing: str
    to: str
    pose_key: str
    spot_key: str
    floor_key: str
    around_key: str
    set_down_key: str
    surfaces: Sequence[Surface]
    context: RunContext
    within_m: float = 2.0
    ahead_m: float = 0.6
    half_m: float = 1.2
    set_down_ahead_m: float = 1.15
    set_down_half_m: float = 0.3
    settle_s: float = 0.3

    def initialise(self) -> None:
        """Write where it is looked for: where the robot stands just now."""
        self.clear_explanation()
        self._end_s = self.context.clock.now() + self.settle_s
        pose = self.context.pose()
        here = (pose.x_m, pose.y_m)
        self._near = [surface for surface in self.surfaces if distance_m(surface.polygon_W, here) <= self.within_m]
        self._write(pose, self.ahead_m)

    def update(self) -> Status:
        """Feel for a moment whether the gripper still holds something."""
        if self.context.clock.now() < self._end_s:
            self.message = f"feels whether the {self.thing} is still held"
            return Status.RUNNING
        towards = self._towards_free_floor()
        self.context.board.put(self.set_down_key, floor_square(towards, self.set_down_ahead_m, self.set_down_half_m))
        slipped = self.context.robot.gripper().holding
        if slipped:
            self._write(towards, self.set_down_ahead_m)
        happened = "slips in the gripper" if slipped else "fell"
        then = "is set down and gripped anew" if slipped else "is picked up again"
        self.cause, self.message = None, f"the {self.thing} {happened} on the way {self.to}; it {then}"
        return Status.SUCCESS

    def _write(self, pose: Pose2D, ahead_m: float) -> None:
        """Write where the object lies: so far (m) before the body at a pose."""
        board, spot = self.context.board, compose(pose, Pose2D(ahead_m, 0.0, 0.0))
        floor = floor_square(pose, ahead_m, self.half_m)
        board.put(self.pose_key, pose)
        board.put(self.spot_key, (spot.x_m, spot.y_m, 0.0))
        board.put(self.floor_key, (floor,))
        board.put(self.around_key, (floor, *self._near))

    def _towards_free_floor(self) -> Pose2D:
        """The robot's pose, turned to floor on which nothing stands, as little as may be.

        A robot at a table has the table ahead.
        """
        pose, costmap = self.context.pose(), self.context.costmap
        turned = [compose(pose, Pose2D(0.0, 0.0, turn)) for turn in _TURNS_RAD]
        middles = [compose(each, Pose2D(self.set_down_ahead_m, 0.0, 0.0)) for each in turned]
        clear_m = costmap.clearance_m(np.array([[middle.x_m, middle.y_m] for middle in middles]))
        return turned[int(np.argmax(clear_m >= self.set_down_half_m))]


def floor_square(pose: Pose2D, ahead_m: float, half_m: float) -> Surface:
    """A square of floor about a point before the body."""
    corners = (compose(pose, Pose2D(ahead_m + x * half_m, y * half_m, 0.0)) for x, y in _CORNERS)
    return Surface(FLOOR, tuple((corner.x_m, corner.y_m) for corner in corners), 0.0)


def _written(options: Mapping[str, Any]) -> Mapping[str, Any]:
    """The keys of the pose, of the point and of the pieces of floor."""
    surfaces = {options[key]: tuple[Surface, ...] for key in ("floor_key", "around_key")}
    spot = tuple[Coordinate, Coordinate, Height]
    return {options["pose_key"]: Pose2D, options["spot_key"]: spot, options["set_down_key"]: Surface, **surfaces}


KINDS: Final[Mapping[str, NodeKind]] = {"fallen": NodeKind(Fallen, ("context",), writes=_written)}
