"""Plans to pick up an object: approach it, grasp it, draw the arm in, with recoveries for each failure.

Other recoveries are defined beside the work that fails: drives in `executive.tree.plan`, searches in
`executive.tree.nodes.search`, a dropped object in `executive.tree.nodes.carry`, charging in
`executive.tree.nodes.dock`.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Final

import numpy as np
from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf
from executive.tree.board import BesideBoard, FromBoard, FromBoardOr
from executive.tree.context import RunContext
from executive.tree.estimate import CannotError, Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.aside import can_move_aside, move_aside_plan
from executive.tree.nodes.guard import Holds
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.plan import PlanBuilder
from executive.words.outlines import Point, inside
from skills.api import Cause, Failed, ObjectKind, Surface
from skills.geometry import compose, grid_inside
from skills.robot import Pose2D

ATTEMPTS: Final = 4
NEARBY_M: Final = ((-0.5, 0.0), (0.0, 0.6), (0.0, -0.6))
"""Alternative poses near a goal, forward and left of it (m)."""
GRID_M: Final = 0.2
"""Distance between the places of a room that are tried (m)."""
_ANY: Final = frozenset(Cause) - {Cause.ERROR}
_PLANNING: Final = frozenset({Cause.PLANNING})
_OTHERS: Final = frozenset({Cause.PRECONDITION, Cause.EXECUTION, Cause.POSTCONDITION})
_LOST: Final = Trigger(frozenset({Cause.PRECONDITION, Cause.EXECUTION}), "tuck", own=True)
RECOVERIES: Final[Mapping[str, Recovery]] = {
    "have it": Recovery((Trigger(_ANY, "grasp"),), uses=ATTEMPTS, completes=True),
    "move aside": Recovery((Trigger(_PLANNING, "grasp"),), final=True),
    "search": Recovery(
        (Trigger(_OTHERS, "grasp"), Trigger(_OTHERS, "approach"), _LOST, Trigger(_PLANNING, "grasp")), 3
    ),
    "look again": Recovery((Trigger(_OTHERS, "grasp"), Trigger(_OTHERS, "approach"), _LOST), uses=2),
    "plan again": Recovery((Trigger(_PLANNING, "grasp"),)),
    "see what is around": Recovery((Trigger(_PLANNING, "approach"),)),
    "back off": Recovery((Trigger(_PLANNING, "grasp"), Trigger(_PLANNING, "approach"))),
}
"""Recoveries before the next attempt, in their order: the first that fits the failure of a step runs."""


def go_near_plan(builder: PlanBuilder, pose: Pose2D | FromBoard, to: str) -> NodeSpec:
    """Drives to a pose, called `to`, or to one nearby in the same room if there is no path.

    selector
    ├── navigate to the pose
    ├── navigate 0.5 m behind it
    └── navigate 0.6 m to its left, then to its right
    """
    nearby = _nearby(builder, pose)
    direct = builder.navigate(pose, to, nearby_m=tuple(nearby))
    numbered = enumerate(nearby.values(), start=1)
    others = [builder.at(f"nearby-{n}").navigate(other, f"a place near {to}") for n, other in numbered]
    if not others:
        return direct
    return builder.first_of(f"go to {to}, or near it", direct, *others, part="or-near", one_goal=True)


class FreePlace(ExplainedLeaf):
    """Leaf that writes a pose in a room with space to turn, near the room's own pose and the robot.

    SUCCESS if the costmap has such a pose, else FAILURE with PLANNING.
    """

    kind = "free place"
    output_types: ClassVar = {"key": Pose2D}
    room: str
    pose: Pose2D
    area_W: tuple[Point, ...]
    key: str
    context: RunContext

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Raises CannotError: a room whose pose no path reaches is out of reach."""
        raise CannotError(None)

    def update(self) -> Status:
        """Chooses the pose by the present costmap."""
        points, here = grid_inside(self.area_W, GRID_M, first_m=GRID_M / 2), self.context.pose()
        reach_m = max(math.hypot(*corner) for corner in self.context.robot.capabilities().footprint_m)
        free = points[self.context.free_space().clearance_m(points) > reach_m]
        if not len(free):
            return self.fail(Failed(Cause.PLANNING, f"there is no free place in the {self.room}"))
        # the robot's way counts, too, for a place on its side of what blocks the pose
        far_m = 2.0 * np.hypot(*(free - [self.pose.x_m, self.pose.y_m]).T) + np.hypot(*(free - [here.x_m, here.y_m]).T)
        x, y = free[int(np.argmin(far_m))].tolist()
        self.context.board.put(self.key, Pose2D(x, y, self.pose.yaw_rad))
        return self.say(f"goes to ({x:.2f}, {y:.2f}) in the {self.room}")


def go_into_plan(builder: PlanBuilder, room: str) -> NodeSpec:
    """Drives to the pose of a room, or, if it is blocked, to a free place in the room.

    selector
    ├── navigate to the pose
    └── sequence: choose a free place, navigate there
    """
    pose, below = builder.knowledge.place_pose(room).pose_2d(), builder.at("elsewhere")
    to, key, area_W = f"a free place in the {room}", below.key("pose"), builder.knowledge.rooms[room]
    choose = below.node("free place", to, part="choose", room=room, pose=pose, area_W=area_W, key=key)
    drive = below.navigate(FromBoard(key), to)
    other = below.sequence(f"go into the {room}", choose, drive)
    direct = builder.navigate(pose, f"the {room}", nearby_m=tuple(_nearby(builder, pose)))
    return builder.first_of(f"go to the {room}, or into it", direct, other, part="into", one_goal=True)


def _nearby(builder: PlanBuilder, pose: Pose2D | FromBoard) -> dict[tuple[float, float], Pose2D | FromBoard]:
    """Returns poses beside a goal by their offsets (m); if the goal is known now, only poses in the same room."""
    if isinstance(pose, FromBoard):
        return {offset: BesideBoard(pose.key, *offset) for offset in NEARBY_M}
    rooms = [outline for outline in builder.knowledge.rooms.values() if inside(outline, (pose.x_m, pose.y_m))]
    poses = {offset: compose(pose, Pose2D(*offset, 0.0)) for offset in NEARBY_M}
    return {at: pose for at, pose in poses.items() if any(inside(room, (pose.x_m, pose.y_m)) for room in rooms)}


def pick_up_plan(
    builder: PlanBuilder,
    item: ObjectKind,
    search: NodeSpec,
    key: str,
    surfaces: tuple[Surface, ...] | FromBoard,
    *,
    seen: bool = False,
) -> NodeSpec:
    """Finds an object by `search`, which writes `key`, approaches and grasps it, and draws the arm in, with recoveries.

    A failure ends with the arm stowed. With `seen`, an earlier node has just written `key`, and the search runs only
    before further attempts.

        afterwards
        ├── recover, up to 4 attempts
        │   ├── sequence: search, approach, grasp, draw the arm in
        │   └── each of `RECOVERIES`, in this order
        └── stow, after a failure
    """
    near, tried, blocking = map(builder.key, ("near-detection", "tried-grasps", "in-the-way"))
    approach = builder.skill("approach", {"observation": FromBoard(key), "surfaces": surfaces}, {"observation": near})
    aside = not seen and can_move_aside(builder)
    memory = builder.has_ports("grasp", ("avoid",), ("tried",))
    inputs = {"observation": FromBoard(near), **({"avoid": FromBoardOr(tried, ())} if memory else {})}
    outputs = {**({"tried": tried} if memory else {}), **({"in_the_way": blocking} if aside else {})}
    grasp = builder.skill("grasp", inputs, outputs)
    tuck = _tucked(builder, item)
    steps = (approach, grasp, tuck) if seen else (search, approach, grasp, tuck)
    attempt = builder.at("pick-up").sequence(f"pick up the {item}", *steps)
    around, beside = builder.at("around"), builder.at("aside")
    work = {
        "have it": known_held_plan(builder.at("in-hand"), item),
        "see what is around": around.skill("clear_costmap"),
        "back off": around.skill("back_off"),
    }
    if aside:
        work["move aside"] = move_aside_plan(beside, item, near, blocking, surfaces, tuck_plan(beside))
    if seen:
        work["search"] = search
    else:
        work["look again"] = builder.pause("look-again", "look again")
        work["plan again"] = builder.pause("plan-again", "look and plan again")
    paths = {"approach": approach.path_id, "grasp": grasp.path_id, "tuck": tuck.path_id}
    rules = {name: rule.bind(paths) for name, rule in RECOVERIES.items() if name in work}
    if aside:
        rules["move aside"] = replace(rules["move aside"], uses=builder.move_aside, given=blocking)
    most = ATTEMPTS + builder.move_aside if aside else ATTEMPTS
    attempts = builder.recover(
        f"up to {most} attempts",
        attempt,
        *((work[name], rule) for name, rule in rules.items()),
        attempts=most,
        part="attempts",
        forgets=(near, tried) if seen else (key, near, tried, blocking),
    )
    return builder.at("tidy").stow_after(attempts, f"pick up the {item}", only_after_failure=True)


def tuck_plan(builder: PlanBuilder) -> NodeSpec:
    """Draws the arm in, in two attempts; if both fail and the gripper holds the object, the arm stays out.

    selector
    ├── retry, 2 attempts
    │   └── stow
    └── only if holding
        └── pause
    """
    causes = frozenset({Cause.PLANNING, Cause.EXECUTION, Cause.POSTCONDITION})
    twice = builder.retried("draw in the arm, twice if need be", builder.skill("stow"), 2, causes, part="tuck-in")
    below = builder.at("carry-as-it-is")
    as_it_is = below.if_holding("carry it as it is held", below.pause("settle", "hold it still"))
    return builder.first_of("tuck the arm in", twice, as_it_is, part="tucked-in")


def held_plan(builder: PlanBuilder, item: ObjectKind) -> NodeSpec:
    """Builds a branch that succeeds while the gripper holds the object that an earlier step grasped."""
    below = builder.at("in-gripper")
    return below.if_holding(f"the {item} is in the gripper", below.pause("settle", "hold it"))


def known_held_plan(builder: PlanBuilder, item: ObjectKind) -> NodeSpec:
    """Draws the arm in if the gripper holds the object, and no other, after a failed or interrupted grasp."""
    known = {"known_as": builder.search_classes(item.name), "attributes": item.attributes}
    tuck = _tucked(builder, item)
    return builder.if_holding(f"it took hold of the {item}", tuck, part="only-if", **known)


def _tucked(builder: PlanBuilder, item: ObjectKind) -> NodeSpec:
    """Draws the arm in under a guard that the gripper holds the object."""
    return builder.guarded(f"holding the {item}", tuck_plan(builder), Holds(str(item)), part="held")
