"""Check whether a door is open: the robot goes to a viewpoint before it and looks, or else on its other side.

A closed door may bar the path to its viewpoint, so the robot also looks from the pose where its drive ended.
"""

import math
from collections.abc import Iterator
from itertools import product
from typing import Final

from executive.tree.node import NodeSpec
from executive.tree.plan import PlanBuilder, pose_2d
from executive.words.knowledge import Door, Knowledge
from executive.words.outlines import Point, distance_m, fits, nearest_side
from skills.files.errors import InputError
from skills.perception.doorway import Doorway
from skills.robot import Pose2D

CHECK_DOOR: Final = "check_door"
_BEFORE_M: Final = ((1.5, 1.2, 1.8), (0.9, 0.7))
"""Distances before a door, the better ones first."""
_ASIDE_RAD: Final = tuple(map(math.radians, (0.0, 20.0, -20.0, 40.0, -40.0)))
_LOOK_S: Final = 0.5
_TURNED_RAD: Final = (0.0, math.pi / 2)
_BODY_M: Final = (1.3, 0.7)
"""Length and width of the body, with a margin."""


def door_plan(builder: PlanBuilder, between: tuple[str, str], key: str) -> NodeSpec:
    """Goes before the door in the room on one side, or else on the other, and looks; the answer goes to `key`.

    The room with more doors comes first, since the robot can reach it more easily when this door is closed.

    Raises InputError when the world has no such door.
    """
    door = next((each for each in builder.knowledge.doors if set(each.between) == set(between)), None)
    if door is None:
        what = f"there is no door between {between[0]} and {between[1]}"
        raise InputError.at(builder.source, what, hint="add it under 'doors' in the knowledge file")
    through_rad = _through_rad(builder.knowledge, door)
    sides = sorted(between, key=lambda room: -sum(room in other.between for other in builder.knowledge.doors))
    views = [(room, view) for room in sides if (view := view_of(builder.knowledge, door, room)) is not None]
    views = views or [(room, pose_2d(builder.knowledge.places[room].pose)) for room in sides]
    name = f"door between {between[0]} and {between[1]}"
    ports = {"middle_W": door.at, "width_m": door.width, "through_rad": through_rad, "door": name}

    def look_from(room: str, view: Pose2D) -> NodeSpec:
        below = builder.at(f"from-{room}")
        stay = below.pause("stay", "look from here", _LOOK_S)
        near = below.node(
            "selector", "stand before it, or stay", below.navigate(view, f"the {name}"), stay, part="near"
        )
        return below.sequence(f"look from the {room}", near, below.skill(CHECK_DOOR, ports, {"open": key}))

    looks = (look_from(room, view) for room, view in views)
    look = builder.node("selector", "look from one side, or else from the other", *looks, part="look")
    return builder.node("check", f"is the {name} open?", look, question=f"is the {name} open", key=key)


def view_of(knowledge: Knowledge, door: Door, room: str) -> Pose2D | None:
    """Viewpoint in a room to see through a door: before it, or to the side; None if the room has no free pose.

    The robot faces the door, or stands along the wall in a narrow space; its LiDAR sees all around.
    """
    across = _through_rad(knowledge, door)
    outline = knowledge.places[room].polygon
    into = min((across, across + math.pi), key=lambda each_rad: distance_m(outline, _from(door.at, each_rad, 0.5)))
    taken = [knowledge.surfaces[name].polygon for name in knowledge.surfaces_in(room)]
    return next((pose for pose in _before(door, into) if fits(_outline(pose), outline, taken)), None)


def _before(door: Door, into_rad: float) -> Iterator[Pose2D]:
    """Iterates over poses before a door, the best viewpoint first."""
    for far_m in _BEFORE_M:
        for aside_rad, turned_rad, before_m in product(_ASIDE_RAD, _TURNED_RAD, far_m):
            bearing_rad = into_rad + aside_rad
            x, y = _from(door.at, bearing_rad, before_m)
            yaw_rad = math.remainder(bearing_rad + math.pi + turned_rad, math.tau)
            yield Pose2D(round(x, 3), round(y, 3), round(yaw_rad, 4))


def doorway(knowledge: Knowledge, door: Door) -> Doorway:
    """Converts a door of the knowledge file to the doorway of the skills."""
    return Doorway(door.at, door.width, _through_rad(knowledge, door), door.between)


def _through_rad(knowledge: Knowledge, door: Door) -> float:
    """Direction (rad) through a door: across the side of the room in which it lies."""
    sides = [nearest_side(knowledge.places[room].polygon, door.at, door.width) for room in door.between]
    (x0, y0), (x1, y1) = min(sides, key=lambda side: side.off_m).ends
    return math.remainder(math.atan2(y1 - y0, x1 - x0) + math.pi / 2, math.tau)


def _from(point: Point, bearing_rad: float, by_m: float) -> Point:
    """Point at a distance in a direction."""
    return point[0] + by_m * math.cos(bearing_rad), point[1] + by_m * math.sin(bearing_rad)


def _outline(pose: Pose2D) -> tuple[Point, ...]:
    """Corners of the body at a pose."""
    half_x, half_y = 0.5 * _BODY_M[0], 0.5 * _BODY_M[1]
    corners = ((half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y))
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return tuple((pose.x_m + c * x - s * y, pose.y_m + s * x + c * y) for x, y in corners)
