"""Derives goal conditions from commands and skills in the known world."""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Final

from executive.mission.world_names import in_world
from executive.words.command import SPEAKER, START, Command, Task
from executive.words.goal import GoalCondition, GoalKind, Region, When
from executive.words.knowledge import ANYBODY, Knowledge, Pose
from skills.api import ObjectKind
from skills.relations import RelationKind

BELOW_TOP_M: Final = 0.05
ABOVE_TOP_M: Final = 0.30
FLOOR_M: Final = (-0.05, 0.30)
NEAR_M: Final = 0.75
POSE_NEAR_M: Final = 0.25
DOOR_NEAR_M: Final = 0.3
_Goal = Callable[[Command, Knowledge, tuple[str, ...]], GoalCondition | None]


def command_goal(command: Command, knowledge: Knowledge, elsewhere: Iterable[str] = ()) -> GoalCondition | None:
    """Goal condition of a command; the object may also be taken from the surfaces `elsewhere`.

    None for waiting at the present pose.
    """
    return _GOALS[command.task](command, knowledge, tuple(elsewhere))


def clearing_goals(get: Command, bring: Command, knowledge: Knowledge) -> tuple[GoalCondition, GoalCondition]:
    """Goal conditions of two commands that clear a place: the place is empty, and all its objects are at the goal."""
    source = _regions(get, knowledge, ())
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
    inside = [
        name for name in (knowledge.tops if place is None else knowledge.surfaces_in(place)) if name not in left_out
    ]
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


def _classes(item: ObjectKind | None, knowledge: Knowledge) -> tuple[str, ...]:
    assert item is not None
    return knowledge.classes(item.name)


def _regions(command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> tuple[Region, ...]:
    assert command.object is not None
    place = None if command.goal is None else knowledge.place(command.goal)
    surfaces = (*surfaces_to_search(knowledge, command.object, place), *elsewhere)
    return tuple(surface_region(knowledge, name) for name in surfaces)


def _grasped(command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
    classes, regions = _classes(command.object, knowledge), _regions(command, knowledge, elsewhere)
    meant = in_world(() if command.object is None else command.object.relations, knowledge, command.goal)
    count, wanted = command.object_count, str(command.object)
    return GoalCondition(GoalKind.GRASPED, classes, count, regions, wanted=wanted, relations=meant)


def _answered(command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
    assert command.object is not None
    who = knowledge.somebody(command.object.name)
    if who is not None:
        place = None if command.goal is None else knowledge.place(command.goal)
        rooms = tuple(Region(name, knowledge.rooms[name]) for name in knowledge.rooms_to_search(who, place))
        person = None if who == ANYBODY else who
        return GoalCondition(
            GoalKind.ANSWERED, (ANYBODY,), command.object_count, rooms, person=person, wanted=str(command.object)
        )
    classes, regions = _classes(command.object, knowledge), _regions(command, knowledge, elsewhere)
    place = None if command.goal is None else knowledge.place(command.goal)
    around = [name for name in knowledge.rooms if place in (None, name)]
    floors = tuple(Region(f"the floor of the {name}", knowledge.rooms[name], *FLOOR_M) for name in around)
    asked, meant = str(command.object), in_world(command.object.relations, knowledge, command.goal)
    count, floors = command.object_count, () if meant else floors
    return GoalCondition(GoalKind.ANSWERED, classes, count, regions, wanted=asked, maybe=floors, relations=meant)


def _carried(command: Command, knowledge: Knowledge, _: tuple[str, ...]) -> GoalCondition:
    item, goal = command.item or command.object, command.goal
    assert goal is not None
    classes = _classes(item, knowledge)
    person = knowledge.person(goal)
    if goal == START or person is not None:
        return GoalCondition(GoalKind.HANDED_OVER, classes, command.item_count, person=person, wanted=str(item))
    place = knowledge.place(goal)
    assert place is not None
    goals = tuple(surface_region(knowledge, name) for name in knowledge.surfaces_in(place))
    where = in_world(command.goal_relations, knowledge, goal)
    return GoalCondition(GoalKind.PLACED, classes, command.item_count, goal=goals, wanted=str(item), relations=where)


def _went(command: Command, knowledge: Knowledge, elsewhere: tuple[str, ...]) -> GoalCondition:
    if command.item is not None:
        return _carried(command, knowledge, elsewhere)
    assert command.goal is not None
    person = knowledge.person(command.goal)
    if person is not None:
        room = _room_region(command.goal_at, knowledge)
        return GoalCondition(GoalKind.MET, person=person, goal=room, when=When.END_OF_STEP)  # the person may walk on
    return GoalCondition(GoalKind.WENT, goal=(_place_region(knowledge, command.goal),))


def _with_person(kind: GoalKind) -> _Goal:
    """Returns a function from a command to its goal about a person: known or any, in the room that it names."""

    def goal(command: Command, knowledge: Knowledge, _: tuple[str, ...]) -> GoalCondition | None:
        name = "" if command.object is None else command.object.name
        if (kind, name) == (GoalKind.GREETED, SPEAKER):
            return None  # the speaker is unknown, and the speech is judged by itself
        room = _room_region(None if command.goal == START else command.goal, knowledge)
        return GoalCondition(kind, person=knowledge.person(name), goal=room, when=When.END_OF_STEP)

    return goal


def _charged(_: Command, knowledge: Knowledge, __: tuple[str, ...]) -> GoalCondition | None:
    if knowledge.dock is None:
        return None
    return GoalCondition(GoalKind.WENT, goal=(square_region("the dock", knowledge.dock, POSE_NEAR_M),))


def _room_region(place: str | None, knowledge: Knowledge) -> tuple[Region, ...]:
    """Room of a place, as the only region; none without a known place."""
    known = None if place is None else knowledge.place(place)
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


_GOALS: Final[Mapping[Task | None, _Goal]] = MappingProxyType(
    {
        Task.GRASP: _grasped,
        Task.FIND: _answered,
        Task.PLACE: _carried,
        Task.WAIT: lambda command, *known: None if command.goal is None else _went(command, *known),
        Task.CHARGE: _charged,
        Task.FOLLOW: _with_person(GoalKind.FOLLOWED),
        Task.GUIDE: _with_person(GoalKind.GUIDED),
        Task.GREET: _with_person(GoalKind.GREETED),
        None: _went,
    }
)
