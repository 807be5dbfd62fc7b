"""Checks whether a door is open, from one side or else from the other, and opens doors.

A closed door may block the path to its viewpoint, so the robot also looks from where its drive ended.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import product
from typing import ClassVar, Final

from py_trees.common import Status

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import ExplainedLeaf, MemoryComposite
from executive.tree.context import RunContext
from executive.tree.goals import door_goal
from executive.tree.node import NodeSpec
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words.goal import GoalKind
from executive.words.knowledge import Door, Knowledge
from executive.words.leaf_steps import OpenDoor
from executive.words.outlines import Point, distance_m, fits, nearest_side
from skills.api import Cause
from skills.doorway import DoorState, Doorway
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from skills.stack import StackError, door_opener

CHECK_DOOR: Final = "check_door"
_FROM_EITHER: Final = "look from one side, or else from the other"
_CANNOT_TELL: Final = frozenset({Cause.PRECONDITION, Cause.PLANNING, Cause.EXECUTION, Cause.POSTCONDITION})
_LOOKS: Final = 1000
"""Limit of inconclusive looks at a door, as while people walk through; the time limit comes first."""
_HERE_M: Final = 2.0
_HERE_RAD: Final = 0.9
"""Largest distance and angle from which a robot looks at a door without driving to a better viewpoint."""
_BEFORE_M: Final = ((1.5, 1.2, 1.8), (0.9, 0.7))
"""Distances before a door, the better ones first."""
_ASIDE_RAD: Final = tuple(map(math.radians, (0.0, 20.0, -20.0, 40.0, -40.0)))
_TURNED_RAD: Final = (0.0, math.pi / 2)
_BODY_M: Final = (1.3, 0.7)
"""Length and width of the body, with a margin."""


class KnownDoor(ExplainedLeaf):
    """Leaf that applies if the robot saw a door at most `max_age_s` ago; writes under `key` whether it is open."""

    kind = "known door"
    output_types: ClassVar = {"key": bool}
    door: Doorway
    max_age_s: float
    key: str
    context: RunContext

    def applies(self) -> bool:
        """Returns whether the robot has seen the door within `max_age_s`."""
        seen = self.context.door_memory.last_seen(self.door)
        return seen.state is not DoorState.UNKNOWN and self.context.clock.now() - seen.seen_s <= self.max_age_s

    def update(self) -> Status:
        """Writes the answer."""
        seen = self.context.door_memory.last_seen(self.door)
        self.context.board.put(self.key, seen.state is DoorState.OPEN)
        return self.say(f"{seen.state.value} when it was seen, {self.context.clock.now() - seen.seen_s:.0f} s ago")


class BeforeDoor(MemoryComposite):
    """Composite that applies while the robot sees through a door from its pose; has the status of its only child."""

    kind = "before door"
    door: Doorway
    context: RunContext

    def applies(self) -> bool:
        """Returns whether the robot stands in front of the door and sees through it."""
        pose = self.context.known_pose()
        here = None if pose is None else (pose.x_m, pose.y_m)
        if here is None or self.door.distance_m(here) > _HERE_M:
            return False
        return self.door.view_angle_rad(here) < _HERE_RAD


def door_plan(
    builder: PlanBuilder, between: tuple[str, str], key: str, max_age_s: float = 0.0, *, negated: bool = False
) -> NodeSpec:
    """Looks whether a door is open, or closed if `negated`; answers to `key`. Knowledge `max_age_s` old spares a look.

    Raises InputError when the world has no such door.
    """
    door = _door(builder, between)
    below = builder.at("look") if max_age_s else builder
    look = below.first_of(_FROM_EITHER, *_looks(below, door, key), part="look")
    question = f"is the {_name(door)} {'closed' if negated else 'open'}?"
    check = below.node("check", question, look, key=key, negated=negated)
    return _known_or(builder, door, check, key, max_age_s) if max_age_s else check


def _known_or(builder: PlanBuilder, door: Door, look: NodeSpec, key: str, max_age_s: float) -> NodeSpec:
    """Uses recent knowledge of a door, or else looks."""
    options = {"door": doorway(builder.knowledge, door), "max_age_s": max_age_s, "key": key}
    known = builder.node("known door", "what is known of it", part="known", **options)
    return builder.first_of(f"is the {_name(door)} open?", known, look)


def _looks(builder: PlanBuilder, door: Door, key: str) -> Iterator[NodeSpec]:
    """Looks from the robot's pose if it is before the door, else from the room on one side, else from the other side.

    The room with more doors comes first, because the robot can reach it more easily when this door is closed.
    """
    knowledge, name = builder.knowledge, _name(door)
    ports = _ports(knowledge, door)
    sides = sorted(door.between, key=lambda room: -sum(room in other.between for other in knowledge.doors))
    views = [(room, view) for room in sides if (view := view_of(knowledge, door, room)) is not None]
    views = views or [(room, knowledge.places[room].pose.pose_2d()) for room in sides]
    here = builder.at("here")
    look = here.skill(CHECK_DOOR, ports, {"open": key})
    yield here.node("before door", "look from here", look, door=doorway(knowledge, door))
    for room, view in views:
        below = builder.at(f"from-{room}")
        drive = below.navigate(view, f"the {name}")
        near = below.or_stay("stand before it, or stay", drive, "look from here", part="near")
        yield below.sequence(f"look from the {room}", near, below.skill(CHECK_DOOR, ports, {"open": key}))


def _open_plan(_: Assembler, block: OpenDoor, builder: PlanBuilder) -> Assembled:
    """Looks at a door; if it is closed, calls the door's plug-in, or asks the people there and waits."""
    door, key, wanted = _door(builder, block.door.between), builder.key("open"), block.door
    look = builder.at("look")
    first = look.first_of(_FROM_EITHER, *_looks(look, door, key), part="look")
    first = _known_or(look, door, first, key, wanted.max_age_s)
    if door.opens is None:
        work = _asks(builder, door, key, str(wanted))
    else:
        work = builder.at("open").skill("open_door", _ports(builder.knowledge, door))
    opened = builder.chosen(f"{wanted}?", first, {False: work}, key, part="choose")
    late = f"the {_name(door)} was not opened"
    node = builder.node("timeout", wanted.words, opened, limit_s=wanted.within_s, late=late)
    goal = door_goal(builder.knowledge, door.between, GoalKind.DOOR_OPENED)
    return Assembled((node,), (StepPart(node.path_id, goal=goal),))


def _asks(builder: PlanBuilder, door: Door, key: str, words: str) -> NodeSpec:
    """Asks the people there to open a door, and looks every two seconds until `key` says that it is open."""
    ask, again = builder.at("ask").skill("speak", {"text": f"Please open the {_name(door)}."}), builder.at("again")
    looks = again.first_of(_FROM_EITHER, *_looks(again, door, key), part="look")
    patient = again.retried("look until it can tell", looks, _LOOKS, _CANNOT_TELL)
    wait = builder.node("wait for", f"wait until {words}", patient, part="wait", key=key, words=words, every_s=2.0)
    return builder.sequence("ask, and wait", ask, wait, part="ask-and-wait")


PLANS: Final[StepPlans] = {OpenDoor: _open_plan}


def _door(builder: PlanBuilder, between: tuple[str, str]) -> Door:
    door = next((each for each in builder.knowledge.doors if set(each.between) == set(between)), None)
    if door is None:
        what = f"there is no door between {between[0]} and {between[1]}"
        raise InputError.at(builder.source, what, hint="add it under 'doors' in the knowledge file")
    return door


def _ports(knowledge: Knowledge, door: Door) -> Mapping[str, object]:
    """Inputs for the skills that look at a door or open it."""
    return {
        "middle_W": door.at,
        "width_m": door.width,
        "through_rad": _through_rad(knowledge, door),
        "door": _name(door),
    }


def _name(door: Door) -> str:
    return f"door between {door.between[0]} and {door.between[1]}"


def view_of(knowledge: Knowledge, door: Door, room: str) -> Pose2D | None:
    """Viewpoint in a room to see through a door: before it, or to the side; None if the room has no free pose.

    The robot faces the door, or stands along the wall in a narrow space, because its LiDAR sees all around.
    """
    across = _through_rad(knowledge, door)
    outline = knowledge.rooms[room]
    into = min((across, across + math.pi), key=lambda each_rad: distance_m(outline, _from(door.at, each_rad, 0.5)))
    taken = [knowledge.surfaces[name].polygon for name in knowledge.surfaces_in(room)]
    return next((pose for pose in _before(door, into) if fits(_outline(pose), outline, taken)), None)


def _before(door: Door, into_rad: float) -> Iterator[Pose2D]:
    """Yields poses in front of a door, the best viewpoint first."""
    for far_m in _BEFORE_M:
        for aside_rad, turned_rad, before_m in product(_ASIDE_RAD, _TURNED_RAD, far_m):
            bearing_rad = into_rad + aside_rad
            x, y = _from(door.at, bearing_rad, before_m)
            yaw_rad = math.remainder(bearing_rad + math.pi + turned_rad, math.tau)
            yield Pose2D(round(x, 3), round(y, 3), round(yaw_rad, 4))


def doorway(knowledge: Knowledge, door: Door) -> Doorway:
    """Converts a door of the knowledge file to the doorway of the skills. Raises InputError for a wrong plug-in."""
    try:
        opener = None if door.opens is None else door_opener(door.opens)
    except StackError as error:
        what = f"'opens' of the {_name(door)} in the knowledge file: {error}"
        raise InputError(what, hint=error.hint) from error
    return Doorway(door.at, door.width, _through_rad(knowledge, door), door.between, opener)


def _through_rad(knowledge: Knowledge, door: Door) -> float:
    """Direction (rad) through a door: perpendicular to the room's side that contains the door."""
    sides = [nearest_side(knowledge.rooms[room], door.at, door.width) for room in door.between]
    (x0, y0), (x1, y1) = min(sides, key=lambda side: side.off_m).ends
    return math.remainder(math.atan2(y1 - y0, x1 - x0) + math.pi / 2, math.tau)


def _from(point: Point, bearing_rad: float, by_m: float) -> Point:
    """Point at a distance (m) from another point, in a direction (rad)."""
    return point[0] + by_m * math.cos(bearing_rad), point[1] + by_m * math.sin(bearing_rad)


def _outline(pose: Pose2D) -> tuple[Point, ...]:
    """Corners of the body at a pose."""
    half_x, half_y = 0.5 * _BODY_M[0], 0.5 * _BODY_M[1]
    corners = ((half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y))
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return tuple((pose.x_m + c * x - s * y, pose.y_m + s * x + c * y) for x, y in corners)
