"""Looking whether a door is open: go where it can be seen through, and look."""

from __future__ import annotations

from executive.mission.errors import InputError
from executive.mission.knowledge import Door
from executive.tree.compiling.builder import PlanBuilder, pose_2d
from executive.tree.node import NodeSpec

CHECK_DOOR = "check_door"


def door_plan(builder: PlanBuilder, between: tuple[str, str], key: str) -> NodeSpec:
    """Go near the door from the room on its first side, and look; whether it is open goes to `key`.

    Raises InputError: the world has no such door.
    """
    door = _door(builder, between)
    view = pose_2d(builder.knowledge.places[between[0]].pose)
    look = builder.skill(CHECK_DOOR, {"middle_W": door.at, "width_m": door.width}, {"open": key})
    name = f"is the door between {between[0]} and {between[1]} open?"
    return builder.sequence(name, builder.navigate(view, f"the door to the {between[1]}"), look)


def _door(builder: PlanBuilder, between: tuple[str, str]) -> Door:
    found = next((door for door in builder.knowledge.doors if set(door.between) == set(between)), None)
    if found is None:
        what = f"there is no door between {between[0]} and {between[1]}"
        raise InputError.at(builder.source, what, hint="add it under 'doors' in the knowledge file")
    return found
