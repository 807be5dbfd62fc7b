"""Moving an object aside that blocks every grasp of the wanted one, on the surface where it stands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf
from executive.tree.board import FromBoard
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.plan import PlanBuilder
from skills.api import FLOOR, Cause, Failed, ObjectKind, ObjectObservation, Surface
from skills.geometry import compose
from skills.quantities import Coordinate, Length
from skills.robot import Pose2D

_STEP_M, _FLOOR_HALF_M = 0.2, 1.2
_CORNERS: Final = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
Circle = tuple[Coordinate, Coordinate, Length]
SETTLE_S: Final = 0.5


class InTheWay(ExplainedLeaf):
    """Says what stands in the way of an object, and notes where to put it. SUCCESS at once.

    Reads from the blackboard: the objects that are in the way (`blocking_key`), of which the first is meant, and the
    wanted one (`wanted_key`). Writes: that first one (`obstacle_key`), the surface on which it stands (`surface_key`),
    the robot's pose (`pose_key`), and the circles of `clear_m` about the wanted object and the way from the robot to it
    (`clear_key`), where it would be in the way again. FAILURE with PRECONDITION: nobody knows what it stands on.
    """

    kind = "in the way"
    item: str
    blocking_key: str
    wanted_key: str
    obstacle_key: str
    surface_key: str
    clear_key: str
    pose_key: str
    surfaces: Sequence[Surface]
    context: RunContext
    clear_m: float = 0.25

    @staticmethod
    def writes(options: Mapping[str, Any]) -> Mapping[str, Any]:
        """The keys of the object, its surface, the pose and the circles."""
        types = {"obstacle_key": ObjectObservation, "surface_key": Surface, "pose_key": Pose2D}
        return {options[name]: kind for name, kind in types.items()} | {options["clear_key"]: tuple[Circle, ...]}

    def update(self) -> Status:
        """Writes where it is, and where it must not be put."""
        board = self.context.board
        obstacle: ObjectObservation = board.get(self.blocking_key)[0]
        wanted: ObjectObservation = board.get(self.wanted_key)
        x, y, _ = obstacle.position_W
        floor = floor_square(Pose2D(x, y, 0.0), 0.0, _FLOOR_HALF_M)
        surface = next((each for each in (*self.surfaces, floor) if each.name == obstacle.surface), None)
        if surface is None:
            return self.fail(Failed(Cause.PRECONDITION, f"it is not known what the {obstacle.kind} stands on"))
        board.put(self.obstacle_key, obstacle)
        board.put(self.surface_key, surface)
        board.put(self.pose_key, self.context.pose())
        board.put(self.clear_key, _way_circles(wanted, self.context.pose(), self.clear_m))
        return self.say(f"the {obstacle.kind} is in the way of the {self.item}; it is moved aside")


def floor_square(pose: Pose2D, ahead_m: float, half_m: float) -> Surface:
    """A square of floor about a point before the body."""
    corners = (compose(pose, Pose2D(ahead_m + x * half_m, y * half_m, 0.0)) for x, y in _CORNERS)
    return Surface(FLOOR, tuple((corner.x_m, corner.y_m) for corner in corners), 0.0)


def _way_circles(wanted: ObjectObservation, pose: Pose2D, radius_m: float) -> tuple[Circle, ...]:
    """Circles in a row from an object to the robot."""
    x, y, _ = wanted.position_W
    off_x, off_y = pose.x_m - x, pose.y_m - y
    steps = max(1, round(math.hypot(off_x, off_y) / _STEP_M))
    return tuple((x + k / steps * off_x, y + k / steps * off_y, radius_m) for k in range(steps + 1))


def can_move_aside(builder: PlanBuilder) -> bool:
    """Whether the mission allows it, and the skills tell what is in the way and can be told where not to put it."""
    told = builder.has_ports("grasp", (), ("in_the_way",)) and builder.has_ports("place", ("clear_of",))
    return builder.move_aside > 0 and told


def move_aside_plan(
    below: PlanBuilder,
    item: ObjectKind,
    wanted: str,
    blocking: str,
    surfaces: tuple[Surface, ...] | FromBoard,
    tuck: NodeSpec,
) -> NodeSpec:
    """Takes the first object under the key `blocking`, and put it where it is not in the way of the one under `wanted`.

    `tuck` draws the arm in between. What finds no room there is set down again anywhere on its surface, so that the
    gripper is free. In the end the robot goes back to where it stood, since from there a grasp was found without it.
    """
    obstacle, surface, clear, pose = map(below.key, ("obstacle", "surface", "clear", "pose"))
    what = below.node(
        "in the way",
        f"what is in the way of the {item}?",
        part="what",
        item=str(item),
        blocking_key=blocking,
        wanted_key=wanted,
        obstacle_key=obstacle,
        surface_key=surface,
        clear_key=clear,
        pose_key=pose,
        surfaces=tuple(map(below.surface, below.knowledge.surfaces)),
    )
    before = below.skill(
        "approach", {"observation": FromBoard(obstacle), "surfaces": surfaces}, {"observation": obstacle}
    )
    stay = below.pause("stay", "take it from here", SETTLE_S)
    put = below.skill("place", {"surface": FromBoard(surface), "clear_of": FromBoard(clear)})
    back = below.at("back").skill("place", {"surface": FromBoard(surface)})
    near = below.node("selector", "stand before it, or stay", before, stay, part="near")
    grasp = below.skill("grasp", {"observation": FromBoard(obstacle)})
    take = below.node("sequence", "take it", near, grasp, part="take")
    causes = frozenset({Cause.EXECUTION, Cause.POSTCONDITION})
    twice = below.node("retry", "take it, twice if need be", take, part="twice", attempts=2, causes=causes)
    there = below.navigate(FromBoard(pose), "where it stood", exactly=True)
    here = below.pause("here", "go on from here", SETTLE_S)
    return below.sequence(
        "move it aside",
        what,
        twice,
        tuck,
        below.node(
            "afterwards", "set it down again if there is no room", put, back, part="put", only_after_failure=True
        ),
        below.node("selector", "go back to where it stood, or go on from here", there, here, part="there"),
    )
