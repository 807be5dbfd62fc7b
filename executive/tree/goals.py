"""Derives goal conditions from commands and skills in the known world."""

from collections.abc import Iterable
from dataclasses import replace
from types import NoneType
from typing import Final

from executive.mission.world_names import in_world
from executive.tree.task_page import from_page
from executive.words.command import START, Command
from executive.words.goal import GoalCondition, GoalKind, Region, When
from executive.words.knowledge import Knowledge, Pose
from skills.api import ObjectKind
from skills.relations import RelationKind

BELOW_TOP_M: Final = 0.05
ABOVE_TOP_M: Final = 0.30
FLOOR_M: Final = (-0.05, 0.30)
NEAR_M: Final = 0.75
POSE_NEAR_M: Final = 0.25
DOOR_NEAR_M: Final = 0.3


def command_goal(command: Command, knowledge: Knowledge, elsewhere: Iterable[str] = ()) -> GoalCondition | None:
    """Goal condition of a command; the object may also be taken from the surfaces `elsewhere`.

    None for a task that is not judged there, such as waiting at the present pose.
    """
    if command.task is None:
        return went_goal(command, knowledge)
    task, surfaces = command.task, tuple(elsewhere)
    found = from_page(task, "promise", lambda page: page.promise(command, knowledge, surfaces), GoalCondition, NoneType)
    return replace(found, task=task.word) if found is not None and found.kind is GoalKind.OWN else found


def clearing_goals(get: Command, bring: Command, knowledge: Knowledge) -> tuple[GoalCondition, GoalCondition]:
    """Goal conditions of two commands that clear a place: the place is empty, and all its objects are at the goal."""
    source = regions_of(get, knowledge, ())
    place = None if bring.goal is None else knowledge.place(bring.goal)
    assert place is not None
    goal = tuple(surface_region(knowledge, name) for name in knowledge.surfaces_in(place))
    return GoalCondition(GoalKind.CLEARED, source=source), GoalCondition(GoalKind.CLEARED, source=source, goal=goal)


def door_goal(knowledge: Knowledge, between: tuple[str, str], kind: GoalKind = GoalKind.DOOR_OPEN) -> GoalCondition:
    """Goal condition for a door: a right answer whether it is open, or an open door after a step (DOOR_OPENED).

    Raises StopIteration if the world has no such door.
    """
    (x, y) = next(door.at for door in knowledge.doors if set(door.between) == set(between))
    square = square_region(f"door between {between[0]} and {between[1]}", Pose(x=x, y=y, yaw=0.0), DOOR_NEAR_M)
    when = When.END_OF_STEP if kind is GoalKind.DOOR_OPENED else When.END_OF_MISSION
    return GoalCondition(kind, source=(square,), when=when)


def surfaces_to_search(knowledge: Knowledge, item: ObjectKind, place: str | None) -> tuple[str, ...]:
    """Returns the surfaces to search, those where the object usually is first; without a place, all surfaces.

    The surfaces of a room that is a usual place count as usual. None is at a place where the object is said not to be.
    """
    left_out = surfaces_left_out(knowledge, item)
    inside = [n for n in (knowledge.tops if place is None else knowledge.surfaces_in(place)) if n not in left_out]
    usual = (name for spot in knowledge.usual_surfaces(item.name) for name in knowledge.surfaces_in(spot))
    return tuple(dict.fromkeys((*(name for name in usual if name in inside), *inside)))


def surfaces_left_out(knowledge: Knowledge, item: ObjectKind) -> frozenset[str]:
    """Surfaces at the places where an object is said not to be ("not at the desk")."""
    places = (each.landmarks[0].name for each in item.relations if each.kind is RelationKind.NOT_AT)
    known = (knowledge.place(name) for name in places)
    return frozenset(surface for place in known if place for surface in knowledge.surfaces_in(place))


def surface_region(knowledge: Knowledge, surface: str) -> Region:
    """Region that contains the origin of each object at rest on a surface, or in a bin."""
    facts = knowledge.surfaces[surface]
    heights_m = (0.0, facts.height) if facts.bin else (facts.height - BELOW_TOP_M, facts.height + ABOVE_TOP_M)
    return Region(surface, facts.polygon, *heights_m, facts.viewpoints[0].pose_2d(), facts.bin)


def classes_of(item: ObjectKind | None, knowledge: Knowledge) -> tuple[str, ...]:
    """Classes of a command's object."""
    assert item is not None
    return knowledge.classes(item.name)


def regions_of(command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> tuple[Region, ...]:
    """Regions of the surfaces on which a command's object may be, and of those `elsewhere`."""
    assert command.object is not None
    place = None if command.goal is None else knowledge.place(command.goal)
    surfaces = (*surfaces_to_search(knowledge, command.object, place), *elsewhere)
    return tuple(surface_region(knowledge, name) for name in surfaces)


def carried_goal(command: Command, knowledge: Knowledge) -> GoalCondition:
    """Goal condition of a command that carries an object: it is at the goal, or a person has it."""
    item, goal = command.item or command.object, command.goal
    assert goal is not None
    classes = classes_of(item, knowledge)
    person = knowledge.person(goal)
    if goal == START or person is not None:
        return GoalCondition(GoalKind.HANDED_OVER, classes, command.item_count, person=person, wanted=str(item))
    place = knowledge.place(goal)
    assert place is not None
    goals = tuple(surface_region(knowledge, name) for name in knowledge.surfaces_in(place))
    where = in_world(command.goal_relations, knowledge, goal)
    return GoalCondition(GoalKind.PLACED, classes, command.item_count, goal=goals, wanted=str(item), relations=where)


def went_goal(command: Command, knowledge: Knowledge) -> GoalCondition:
    """Goal condition of going to a place or a person, with the item of the command if it has one."""
    if command.item is not None:
        return carried_goal(command, knowledge)
    assert command.goal is not None
    person = knowledge.person(command.goal)
    if person is not None:
        room = room_region(command.goal_at, knowledge)
        return GoalCondition(GoalKind.MET, person=person, goal=room, when=When.END_OF_STEP)  # the person may walk on
    return GoalCondition(GoalKind.WENT, goal=(_place_region(knowledge, command.goal),))


def room_region(place: str | None, knowledge: Knowledge) -> tuple[Region, ...]:
    """Room of a place or of the start, as the only region; none without a known place."""
    known = place if place in (None, START) else knowledge.place(place)
    return () if known is None else (Region(room := knowledge.room(known), knowledge.rooms[room]),)


def _place_region(knowledge: Knowledge, goal: str) -> Region:
    """Outline of a room; for a surface or the start, a square around the pose there, a small one for a named pose."""
    place = knowledge.place(goal)
    if place in knowledge.rooms:
        return Region(place, knowledge.rooms[place])
    pose = knowledge.start if goal == START or place is None else knowledge.place_pose(place)
    return square_region(goal, pose, POSE_NEAR_M if place in knowledge.poses else NEAR_M)


def square_region(name: str, pose: Pose, near_m: float = NEAR_M) -> Region:
    """Square region around a pose, `near_m` to each side."""
    sides = ((-near_m, -near_m), (near_m, -near_m), (near_m, near_m), (-near_m, near_m))
    return Region(name, tuple((pose.x + dx, pose.y + dy) for dx, dy in sides))
