"""Moves an object that blocks every grasp of the wanted object aside, on the surface where it stands."""

import math
from collections.abc import Sequence
from typing import ClassVar, Final

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

_STEP_M: Final = 0.2
_FLOOR_HALF_M: Final = 1.2
_CORNERS: Final = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
Circle = tuple[Coordinate, Coordinate, Length]


class InTheWay(ExplainedLeaf):
    """Leaf that writes which object blocks a grasp, and where the robot must not put it.

    Reads the blocking objects (`blocking_key`), and the wanted object (`wanted_key`). Writes the first blocking object
    (`obstacle_key`), its surface (`surface_key`), the robot's pose (`pose_key`), and circles with radius `clear_m`
    along the path from the robot to the wanted object (`clear_key`).

    | case | status |
    |---|---|
    | the surface is known | SUCCESS in its first tick |
    | the surface is unknown | FAILURE with PRECONDITION |
    """

    kind = "in the way"
    output_types: ClassVar = {
        "obstacle_key": ObjectObservation,
        "surface_key": Surface,
        "clear_key": tuple[Circle, ...],
        "pose_key": Pose2D,
    }
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

    def update(self) -> Status:
        """Writes the object, its surface, and the circles to keep clear."""
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
        board.put(self.clear_key, _path_circles(wanted, self.context.pose(), self.clear_m))
        return self.say(f"the {obstacle.kind} is in the way of the {self.item}; it is moved aside")


def floor_square(pose: Pose2D, ahead_m: float, half_m: float) -> Surface:
    """Square on the floor around the point `ahead_m` in front of a pose, `half_m` to each side."""
    corners = (compose(pose, Pose2D(ahead_m + x * half_m, y * half_m, 0.0)) for x, y in _CORNERS)
    return Surface(FLOOR, tuple((corner.x_m, corner.y_m) for corner in corners), 0.0)


def _path_circles(wanted: ObjectObservation, pose: Pose2D, radius_m: float) -> tuple[Circle, ...]:
    """Circles from an object to the robot, with centres at most 0.2 m apart."""
    x, y, _ = wanted.position_W
    off_x, off_y = pose.x_m - x, pose.y_m - y
    steps = max(1, round(math.hypot(off_x, off_y) / _STEP_M))
    return tuple((x + k / steps * off_x, y + k / steps * off_y, radius_m) for k in range(steps + 1))


def can_move_aside(builder: PlanBuilder) -> bool:
    """Returns whether the mission allows moving objects, and the skills have the ports `in_the_way` and `clear_of`."""
    has_ports = builder.has_ports("grasp", (), ("in_the_way",)) and builder.has_ports("place", ("clear_of",))
    return builder.move_aside > 0 and has_ports


def move_aside_plan(
    below: PlanBuilder,
    item: ObjectKind,
    wanted: str,
    blocking: str,
    surfaces: tuple[Surface, ...] | FromBoard,
    tuck: NodeSpec,
) -> NodeSpec:
    """Takes the first object under the key `blocking`, and puts it where it does not block the object under `wanted`.

    `tuck` draws the arm in between grasp and placement. If there is no such place, the robot sets the object down
    anywhere on its surface, to free the gripper. Finally the robot returns to its earlier pose, from which it can now
    grasp.
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
        surfaces=tuple(map(below.surface, below.knowledge.tops)),
    )
    seen = {"observation": FromBoard(obstacle), "surfaces": surfaces}
    before = below.skill("approach", seen, {"observation": obstacle})
    put = below.skill("place", {"surface": FromBoard(surface), "clear_of": FromBoard(clear)})
    back = below.at("back").skill("place", {"surface": FromBoard(surface)})
    near = below.or_stay("stand before it, or stay", before, "take it from here", part="near")
    grasp = below.skill("grasp", {"observation": FromBoard(obstacle)})
    take = below.sequence("take it", near, grasp, part="take")
    causes = frozenset({Cause.EXECUTION, Cause.POSTCONDITION})
    twice = below.retried("take it, twice if need be", take, 2, causes, part="twice")
    there = below.navigate(FromBoard(pose), "where it stood", exactly=True)
    return below.sequence(
        "move it aside",
        what,
        twice,
        tuck,
        below.tidied("set it down elsewhere", put, back, only_after_failure=True, part="put"),
        below.or_stay(
            "go back to where it stood, or go on from here", there, "go on from here", pause="here", part="there"
        ),
    )
