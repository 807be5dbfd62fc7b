"""Plans to carry an object to a person, to the start or to a surface, and to pick it up again if it falls.

| event | detection | recovery |
|---|---|---|
| the object slips | the gripper closes on it, or its force falls | the robot grips it more firmly, and carries it on |
| it slips once more | the same | the robot sets it down, grasps it again, and carries it on |
| it falls | the gripper is empty and has not opened | the robot looks where it fell, picks it up, carries it on |
| it is not at its goal or with the person | the camera, the gripper | the same |
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, ClassVar, Final

import numpy as np
from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf
from executive.tree.board import BesideBoard, FromBoard, Sign
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.aside import floor_square
from executive.tree.nodes.guard import Holds
from executive.tree.nodes.pick_up import go_near_plan, held_plan, pick_up_plan
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.nodes.search import BACK_M, HALF_M, detect_plan, place_phrase
from executive.tree.plan import PlanBuilder
from executive.words.command import START
from executive.words.outlines import Point, distance_m, inside
from skills.api import FLOOR, Cause, Failed, ObjectKind, Surface
from skills.geometry import compose
from skills.quantities import Coordinate, Height
from skills.robot import Pose2D


def carry_plan(builder: PlanBuilder, meet: NodeSpec | None = None) -> NodeSpec:
    """Carries the item to a person, to the start, or to a surface of a place; `meet` finds the person at a place."""
    command = builder.command
    item = builder.required_object(command.item or command.object).plain
    goal = command.goal
    if goal is None:
        raise builder.error(f"it is not said where to take the {item}", "name a place or a person")
    if goal == START:
        return hand_over_plan(builder, item, FromBoard(builder.start_key), _person_at_start(builder))
    person = builder.knowledge.person(goal)
    if person is not None:
        met = person in builder.met and command.goal_at is None
        pose = FromBoard(builder.met_key(person, "-beside")) if met else person_pose(builder, person, command.goal_at)
        return hand_over_plan(builder, item, pose, person, meet)
    place = builder.place(goal)
    put, guards = put_down_plan(builder, item, place)
    skills = tuple(guard.children[0] for guard in guards if guard.children[0].skill is not None)
    return recover_fallen_plan(builder.at("carry-on"), item, f"to the {place}", put, guards, skills)


def hand_over_plan(
    builder: PlanBuilder, item: ObjectKind, pose: Pose2D | FromBoard, person: str, meet: NodeSpec | None = None
) -> NodeSpec:
    """Carries the item to a person and holds it out; the gripper opens when the person takes it."""
    to = "the start" if builder.command.goal == START else person
    met = meet is not None or (person in builder.met and builder.command.goal_at is None)
    own = {"thing": str(item), **({"met": True} if met else {})}
    ports = {"person": person, **builder.optional_ports("hand_over", own)}
    way = _holding(builder, item, f"to {to}", meet or go_near_plan(builder, pose, to))
    hand_over = builder.skill("hand_over", ports, _released(builder, "hand_over"))
    give = _holding(builder.at("give"), item, f"to {to}", hand_over, until_put_down=True)
    bring = builder.at("bring").sequence(f"bring it to {person}", way, give)
    return recover_fallen_plan(builder.at("carry-on"), item, f"to {to}", bring, (way, give), (hand_over,))


def put_down_plan(builder: PlanBuilder, item: ObjectKind, place: str) -> tuple[NodeSpec, tuple[NodeSpec, ...]]:
    """Carries the item to a surface at the place, or to the next surface if that fails; returns node and guards.

    Raises InputError when the place has no surfaces.
    """
    surfaces = builder.knowledge.surfaces_in(place)
    if not surfaces:
        raise builder.error(f"'{place}' has no surface to put the {item} on", "add one to its 'surfaces'")
    to = f"to the {place}"
    each = tuple(_put_on_plan(builder.at(name), item, name, to) for name in surfaces)
    put = builder.first_of(f"put the {item} down {place_phrase(builder.knowledge, place)}", *each)
    return put, tuple(guard for plan in each for guard in plan.children)


def _put_on_plan(builder: PlanBuilder, item: ObjectKind, surface: str, to: str) -> NodeSpec:
    """Carries the item to a surface and puts it down, with guards around both."""
    view, carry = builder.knowledge.surfaces[surface].viewpoints[0].pose_2d(), builder.at("carry")
    inputs = {"surface": builder.surface(surface), **builder.relations(builder.command.goal_relations)}
    place = builder.skill("place", inputs, _released(builder, "place"))
    return builder.sequence(
        f"put it {place_phrase(builder.knowledge, surface)}",
        _holding(carry, item, to, go_near_plan(carry, view, f"the {surface}")),
        _holding(builder.at("put"), item, to, place, until_put_down=True),
    )


def _released(builder: PlanBuilder, skill: str) -> dict[str, str]:
    """Output that a skill writes when it releases an object: the point of release, where a later search can begin."""
    return {"released_W": builder.key("released")} if builder.has_ports(skill, (), ("released_W",)) else {}


def carried_along_plan(builder: PlanBuilder, drive: NodeSpec, to: str) -> NodeSpec:
    """Guards a drive with an object that an earlier step has grasped; the robot picks up the object if it falls.

    If the earlier step failed and was skipped, the gripper is empty and the guard lets the drive begin.
    """
    if builder.carried is None:
        return drive
    guard = _holding(builder.at("carried"), builder.carried, to, drive, until_put_down=True)
    return recover_fallen_plan(builder.at("carry-on"), builder.carried, to, guard, (guard,))


def _holding(
    builder: PlanBuilder, item: ObjectKind, to: str, below: NodeSpec, *, until_put_down: bool = False
) -> NodeSpec:
    """Builds a guard that requires the item in the gripper, or only until the robot puts it down."""
    condition = Holds(str(item), to, until_put_down, builder.search_classes(item.name), item.attributes)
    return builder.guarded(f"holding the {item}", below, condition)


def goal_in_words(builder: PlanBuilder, goal: str) -> str:
    """Text for a goal within a sentence."""
    return goal if builder.knowledge.person(goal) else f"the {goal}"


def goal_pose(builder: PlanBuilder, goal: str) -> Pose2D | FromBoard:
    """Pose that the robot takes at a goal: a place, a person, or the start."""
    if goal == START:
        return FromBoard(builder.start_key)
    person = builder.knowledge.person(goal)
    if person is not None:
        return person_pose(builder, person, builder.command.goal_at)
    return builder.knowledge.place_pose(builder.place(goal)).pose_2d()


def person_pose(builder: PlanBuilder, person: str, at: str | None) -> Pose2D:
    """Pose at which the robot meets a person: at the person's place, and facing them if their pose is known."""
    facts = builder.knowledge.people[person]
    place = builder.place(at or facts.at)
    stand = builder.knowledge.place_pose(place)
    if facts.pose is None or builder.knowledge.room(place) != builder.knowledge.room(builder.place(facts.at)):
        return stand.pose_2d()
    return Pose2D(stand.x, stand.y, math.atan2(facts.pose.y - stand.y, facts.pose.x - stand.x))


def _person_at_start(builder: PlanBuilder) -> str:
    """Name of the only person whose place is in the start's room; "somebody" if there are none or several."""
    knowledge = builder.knowledge
    rooms = {name: knowledge.room(builder.place(facts.at)) for name, facts in knowledge.people.items()}
    there = [name for name, room in rooms.items() if room == knowledge.room(START)]
    return there[0] if len(there) == 1 else "somebody"


DROPPED: Final = Trigger(frozenset({Cause.EXECUTION}), own=True)
MISSED: Final = Trigger(frozenset({Cause.POSTCONDITION}))
"""Failures before a new pick-up: of a guard on holding the object, and of a skill that puts it down."""
_TURNS_RAD: Final = tuple(math.radians(turn) for turn in (0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180))
LOST_WITHIN_M: Final = 2.0
AHEAD_M: Final = 0.6
"""Distance before the middle of the body at which a carried object falls."""
ASIDE_M: Final = ((-0.4, 0.9), (-0.4, -0.9))
"""Further viewpoints of the floor: forward and left of the pose at which the object was lost (m)."""


class Fallen(ExplainedLeaf):
    """Leaf that writes where an object was lost: RUNNING for `settle_s`, then SUCCESS.

    Writes the robot's pose (`pose_key`); the point on the floor `ahead_m` in front of the body (`spot_key`); the square
    of floor around this point, `half_m` to each side (`floor_key`); this square and the `surfaces` within `within_m` of
    the robot, onto which the object may have fallen (`around_key`). An object still in the gripper has slipped: the
    leaf writes a smaller square of free floor to set it down (`set_down_key`), and the other keys for the grasp from
    there.
    """

    kind = "fallen"
    logged = True
    output_types: ClassVar = {
        "pose_key": Pose2D,
        "spot_key": tuple[Coordinate, Coordinate, Height],
        "floor_key": tuple[Surface, ...],
        "around_key": tuple[Surface, ...],
        "set_down_key": Surface,
    }
    item: str
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

    @classmethod
    def signs(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the key of the place where the object fell."""
        return {options["spot_key"]: Sign.DROPPED}

    def initialise(self) -> None:
        """Writes where to search for the object, from the robot's present pose."""
        self._end_s = self.context.clock.now() + self.settle_s
        pose = self.context.pose()
        here = (pose.x_m, pose.y_m)
        self._near = [surface for surface in self.surfaces if distance_m(surface.polygon_W, here) <= self.within_m]
        self._write(pose, self.ahead_m)

    def update(self) -> Status:
        """Waits for the gripper to settle, and checks whether it still holds the object."""
        if self.context.clock.now() < self._end_s:
            return self.say(f"feels whether the {self.item} is still held", Status.RUNNING)
        towards = self._towards_free_floor()
        self.context.board.put(self.set_down_key, floor_square(towards, self.set_down_ahead_m, self.set_down_half_m))
        slipped = self.context.robot.gripper().holding
        if slipped:
            self._write(towards, self.set_down_ahead_m)
        happened = "slips in the gripper" if slipped else "has left the gripper"
        then = "is set down and gripped again" if slipped else "is looked for"
        return self.say(f"the {self.item} {happened} on the way {self.to}; it {then}")

    def _write(self, pose: Pose2D, ahead_m: float) -> None:
        """Writes the places for a search around the point `ahead_m` in front of a pose."""
        board, spot = self.context.board, compose(pose, Pose2D(ahead_m, 0.0, 0.0))
        floor = floor_square(pose, ahead_m, self.half_m)
        board.put(self.pose_key, pose)
        board.put(self.spot_key, (spot.x_m, spot.y_m, 0.0))
        board.put(self.floor_key, (floor,))
        board.put(self.around_key, (floor, *self._near))

    def _towards_free_floor(self) -> Pose2D:
        """Robot's pose, turned by the least angle towards free floor; ahead of a robot at a table is the table."""
        pose, costmap = self.context.pose(), self.context.free_space()
        turned = [compose(pose, Pose2D(0.0, 0.0, turn)) for turn in _TURNS_RAD]
        middles = [compose(each, Pose2D(self.set_down_ahead_m, 0.0, 0.0)) for each in turned]
        clear_m = costmap.clearance_m(np.array([[middle.x_m, middle.y_m] for middle in middles]))
        return turned[int(np.argmax(clear_m >= self.set_down_half_m))]


class SurfacesNear(ExplainedLeaf):
    """Leaf that writes the surfaces within `within_m` of the robot, the nearest first.

    `rooms` has the outline of each surface's room by the surface's name. If surfaces in the robot's own room are near,
    those in other rooms do not count, because a wall hides them. SUCCESS if any surface is near, else FAILURE with
    POSTCONDITION and the message `otherwise`.
    """

    kind = "surfaces near"
    output_types: ClassVar = {"key": tuple[Surface, ...]}
    surfaces: Sequence[Surface]
    within_m: float
    key: str
    otherwise: str
    context: RunContext
    rooms: Mapping[str, Sequence[Point]] = field(default_factory=dict)

    def update(self) -> Status:
        """Writes the near surfaces."""
        pose = self.context.pose()
        here = (pose.x_m, pose.y_m)
        near = sorted((distance_m(surface.polygon_W, here), k) for k, surface in enumerate(self.surfaces))
        close = tuple(self.surfaces[k] for distance, k in near if distance <= self.within_m)
        found = tuple(surface for surface in close if inside(self.rooms.get(surface.name, ()), here)) or close
        if found:
            self.context.board.put(self.key, found)
            return self.say(f"near here: {', '.join(surface.name for surface in found)}")
        spot = f"({pose.x_m:.2f}, {pose.y_m:.2f}) m"
        what = f"there is no surface within {self.within_m:g} m of {spot}; {self.otherwise}"
        return self.fail(Failed(Cause.POSTCONDITION, what))


def recover_fallen_plan(
    builder: PlanBuilder,
    item: ObjectKind,
    to: str,
    carry: NodeSpec,
    guards: tuple[NodeSpec, ...],
    hands_on: tuple[NodeSpec, ...] = (),
) -> NodeSpec:
    """Wraps carrying `to` a goal in a recovery: when a guard fails, the robot picks the object up where it fell.

    It does the same if a skill in `hands_on` has released the object and it is not at its goal. The carrying begins
    again at most `pick_ups` times, by the builder.

        recover
        ├── carry
        └── sequence, after a broken guard or a missed goal
            ├── fallen: where is it?
            ├── selector: set it down if it is still held, or stow the arm
            └── selector: it is in the gripper, or stand back, look and pick it up
    """
    if not builder.pick_ups:
        return carry
    dropped = (replace(DROPPED, node=guard.path_id) for guard in guards)
    missed = (replace(MISSED, node=skill.path_id) for skill in hands_on)
    lost = Recovery((*dropped, *missed), uses=builder.pick_ups)
    recovery = _pick_up_again_plan(builder.at("again"), item, to)
    return builder.recover(f"carry the {item}", carry, (recovery, lost), attempts=builder.pick_ups + 1)


def _pick_up_again_plan(builder: PlanBuilder, item: ObjectKind, to: str) -> NodeSpec:
    keys = {name: builder.key(name) for name in ("pose", "spot", "floor", "around", "set-down", "detection")}
    fell = builder.node(
        "fallen",
        f"where is the {item}?",
        part="fell",
        item=str(item),
        to=to,
        pose_key=keys["pose"],
        spot_key=keys["spot"],
        floor_key=keys["floor"],
        around_key=keys["around"],
        set_down_key=keys["set-down"],
        surfaces=tuple(map(builder.surface, builder.knowledge.tops)),
        within_m=LOST_WITHIN_M,
        ahead_m=AHEAD_M,
        half_m=HALF_M,
    )
    first, below, back = builder.at("first"), builder.at("first").at("set-down"), builder.at("back")
    set_down = below.skill("place", {"surface": FromBoard(keys["set-down"])})
    still_held = below.if_holding(f"set the {item} down", set_down)
    free = first.first_of("free the gripper", still_held, first.skill("stow"))
    ports = builder.optional_ports("back_off", {"distance_m": BACK_M})
    stand_back = back.or_stay("stand back", back.skill("back_off", ports), "look from here")
    look = _look_plan(builder, item, keys)
    pick_up = pick_up_plan(builder, item, look, keys["detection"], FromBoard(keys["around"]))
    take = builder.at("take").sequence(f"take the {item} from where it lies", stand_back, pick_up)
    have = builder.first_of(f"have the {item} again", held_plan(builder, item), take, part="have")
    return builder.sequence(f"pick the {item} up again", fell, free, have)


def _look_plan(builder: PlanBuilder, item: ObjectKind, keys: dict[str, str]) -> NodeSpec:
    """Looks at the spot where the object fell, at the floor around it, at near surfaces, then from either side."""
    floor, detection = FromBoard(keys["floor"]), keys["detection"]
    aside = [
        below.look_from(
            f"look at the {FLOOR} from aside",
            BesideBoard(keys["pose"], *offset),
            f"the side of where the {item} fell",
            detect_plan(below, item, floor, detection),
        )
        for below, offset in zip((builder.at("left"), builder.at("right")), ASIDE_M, strict=True)
    ]
    knows_spot = builder.has_ports("detect", ("expected_W",))
    spot = [detect_plan(builder.at("spot"), item, floor, detection, {"expected_W": FromBoard(keys["spot"])})]
    return builder.first_of(
        f"find the {item} where it was lost",
        *(spot if knows_spot else []),
        detect_plan(builder, item, floor, detection),
        _near_plan(builder.at("near"), item, detection),
        *aside,
        part="find",
        exhausted_cause=Cause.POSTCONDITION,
        exhausted_message=f"the {item} is not found again where it was lost",
    )


def _near_plan(builder: PlanBuilder, item: ObjectKind, detection: str) -> NodeSpec:
    """Looks at the surfaces that are near the place where the object was lost."""
    facts, near = builder.knowledge, builder.key("surfaces")
    surfaces = builder.node(
        "surfaces near",
        "which surfaces are near?",
        part="surfaces-near",
        surfaces=tuple(map(builder.surface, facts.tops)),
        rooms={name: facts.rooms[surface.place] for name, surface in facts.surfaces.items()},
        within_m=LOST_WITHIN_M,
        key=near,
        otherwise="there is only the floor",
    )
    look = detect_plan(builder, item, FromBoard(near), detection)
    return builder.sequence(f"look for the {item} on the surfaces near", surfaces, look)
