"""The subtree of each kind of command: take hold of, look whether, carry, go."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from executive.tree.board import FromBoard
from executive.tree.node import NodeSpec
from executive.tree.nodes.fallen import unless_fallen
from executive.tree.nodes.guard import Holds, HoldsNothingElse
from executive.tree.nodes.interrupts import dock_plan
from executive.tree.nodes.pick_up import go_near_plan, held_plan, known_held_plan, pick_up_plan, tidied
from executive.tree.nodes.search import (
    look_plans,
    people_looks,
    required_surfaces,
    search_plan,
    surfaces_elsewhere,
    tally_of,
    where,
)
from executive.tree.plan import PlanBuilder, pose_2d
from executive.words.command import START, TIME_UNITS_S, Task
from executive.words.geometry import inside
from executive.words.knowledge import ANYBODY, ANYTHING
from skills.api import Thing
from skills.detect.words import numbered, plural
from skills.robot import Pose2D

LONGEST_WAIT_S: Final = 3600.0


def step_plan(builder: PlanBuilder) -> NodeSpec:
    """The subtree of the builder's command.

    Raises InputError: an unknown place or object, or a command that cannot be carried out.
    """
    return _BY_TASK[builder.command.task](builder)


def grasp_plan(builder: PlanBuilder, *, anywhere: bool = True) -> NodeSpec:
    """Find it, stand before it, take it, tuck the arm in.

    When standing or taking fails, what fits the failure is done and the robot looks again and tries anew; when nothing
    is to be found that is final. With `anywhere`, it is looked for elsewhere, too, when it is not in its place. What an
    earlier step grasped, be it that this step failed, is not looked for, unless the gripper is empty. While it holds
    another object, nothing is looked for: PRECONDITION.
    """
    thing = _required(builder, builder.command.object)
    if builder.command.item is not None:
        raise builder.error("the one gripper cannot take hold of a second object", "put the first one down before")
    place = None if builder.command.goal is None else builder.place(builder.command.goal)
    surfaces = set(required_surfaces(builder, thing, place))
    if anywhere and builder.anywhere:
        name = builder.knowledge.thing(thing.name) or thing.name
        surfaces |= set(surfaces_elsewhere(builder.knowledge, name, place, builder.avoided))
    around = tuple(builder.surface(name) for name in builder.knowledge.surfaces if name in surfaces)
    key = builder.key("detection")
    search = search_plan(builder.at("find"), thing, place, key, anywhere=anywhere)
    get = pick_up_plan(builder, thing, search, key, around)
    if not builder.in_gripper:
        held = known_held_plan(builder.at("have"), thing)
        alone = HoldsNothingElse(str(thing), builder.sought(thing.name), thing.attributes)
        get = builder.node("guard", f"get {thing} with an empty gripper", get, part="empty-handed", condition=alone)
        have = builder.node("selector", f"have {thing}, or get it", held, get, part="have")
        return builder.sequence(f"get {thing} {where(builder.knowledge, place)}", have)
    return builder.node(
        "selector", f"have {thing}", held_plan(builder, thing), builder.at("get").sequence("get it", get)
    )


def find_plan(builder: PlanBuilder, answer_key: str | None = None) -> NodeSpec:
    """Look at the surfaces of the place and answer yes or no; where it is asked where or how many, tell that, too.

    The answer goes to `answer_key`, which is a key of this subtree unless one is given.

    The first object that is seen ends the search, unless they are to be counted: then all surfaces are looked at.
    People are looked for in rooms.
    """
    command, knowledge = builder.command, builder.knowledge
    place = None if command.goal is None else builder.place(command.goal)
    counting, key = command.object_count != 1, builder.key("detection")
    person = None if command.object is None else knowledge.somebody(command.object.name)
    if person is not None:
        what = "somebody" if person == ANYBODY else person
        asked = what if command.object_count == 1 else _asked_for(person, command.object_count)
        looks = people_looks(builder.at("search"), person, place, key, tallied=counting)
    else:
        thing = _required(builder, command.object)
        what, asked = str(thing), _asked_for(str(thing), command.object_count)
        whole_room = place is None or place in knowledge.places
        extra = {"floor": whole_room, "count": 0 if counting else 1}
        surfaces = required_surfaces(builder, thing, place)
        looks = look_plans(builder.at("search"), thing, surfaces, key, extra, tallied=counting)
    below = builder.at("search")
    search = below.node("round" if counting else "selector", f"look for {what}", *(look for _, look in looks))
    leaves = {s: tuple(look.children[-1].path_id for name, look in looks if name == s) for s, _ in looks}
    tallies = {look.children[-1].path_id: tally_of(look.children[-1]) for _, look in looks if counting}
    spot = where(knowledge, place)
    denied = f"{'not' if command.object_count > 1 or person in knowledge.people else 'no'} {asked} {spot}"
    if what == ANYTHING:
        asked, denied = "something", f"nothing {spot}"
    elif person == ANYBODY and not counting:
        denied = f"nobody {spot}"
    named = "is" if person in knowledge.people else "are there" if counting and what != ANYTHING else "is there"
    answer = builder.node(
        "answer",
        f"{named} {asked} {spot}?",
        search,
        question=asked if place is None else f"{asked} {spot}",
        denied=denied,
        looks=MappingProxyType(leaves),
        key=answer_key or builder.key("answer"),
        tells=place is None,
        tallies=MappingProxyType(tallies),
        needed=max(1, command.object_count),
        yes_or_no=what != ANYTHING,
    )
    return tidied(builder.at("tidy"), answer)


def _asked_for(thing: str, count: int) -> str:
    """What a question is about: "beer", "two beers", or "beers" for any number."""
    if count == 1:
        return thing
    return numbered(count, thing) if count else plural(thing)


def carry_plan(builder: PlanBuilder) -> NodeSpec:
    """Carry the item to a person, to the start, or to a surface of a place."""
    command = builder.command
    item = _required(builder, command.item or command.object)
    goal = command.goal
    if goal is None:
        raise builder.error(f"it is not said where to take the {item}", "name a place or a person")
    if goal == START:
        return _hand_over_plan(builder, item, FromBoard(builder.start_key), _person_at_start(builder))
    person = builder.knowledge.person(goal)
    if person is not None:
        return _hand_over_plan(builder, item, person_pose(builder, person, command.goal_at), person)
    return _put_down_plan(builder, item, builder.place(goal))


def go_plan(builder: PlanBuilder) -> NodeSpec:
    """Go to a place, a person or the start; with an item in the gripper, carry it."""
    command = builder.command
    if command.item is not None:
        return carry_plan(builder)
    if command.goal is None:
        raise builder.error("the command asks for nothing", "name a place to go to, or an object")
    to = _called(builder, command.goal)
    way = go_near_plan(builder, _goal_pose(builder, command.goal), to)
    return builder.sequence(f"go to {to}", _carried_along(builder, way, f"to {to}"))


def _carried_along(builder: PlanBuilder, way: NodeSpec, to: str) -> NodeSpec:
    """A way on which what an earlier step has grasped stays in the gripper; it is picked up again where it falls.

    An earlier step that failed and was passed over has grasped nothing: then there is nothing to watch.
    """
    if builder.carried is None:
        return way
    guard = _holding(builder.at("carried"), builder.carried, to, way, until_put_down=True)
    return unless_fallen(builder.at("carry-on"), builder.carried, to, guard, (guard,))


def _called(builder: PlanBuilder, goal: str) -> str:
    """A goal as it is called in a sentence."""
    return goal if builder.knowledge.person(goal) else f"the {goal}"


def wait_plan(builder: PlanBuilder) -> NodeSpec:
    """Go to the place, where one is named, and wait there for a time.

    Raises InputError: it is no time, or too long a one.
    """
    command = builder.command
    if command.item is not None:
        raise builder.error(f"the {command.item} cannot be carried by waiting", "take it there in a step of its own")
    unit = TIME_UNITS_S.get("" if command.object is None else command.object.name)
    duration_s = 0.0 if unit is None else unit * command.object_count
    if not 0.0 < duration_s <= LONGEST_WAIT_S:
        raise builder.error("it is not said for how long to wait", 'name a time up to an hour, such as "10 seconds"')
    pause = builder.pause("wait", f"wait {duration_s:g} s", duration_s)
    if command.goal is None:
        return builder.sequence("wait here", pause)
    goal, to = _goal_pose(builder, command.goal), _called(builder, command.goal)
    way = _carried_along(builder, go_near_plan(builder, goal, to), f"to {to}")
    return builder.sequence(f"wait at {to}", way, pause)


def charge_plan(builder: PlanBuilder) -> NodeSpec:
    """Go to the dock and charge there. Raises InputError: anything else is said with it."""
    command, facts = builder.command, builder.knowledge
    if any(part is not None for part in (command.item, command.goal, command.object)):
        raise builder.error("the robot charges itself, at its dock", "say 'do: charge' alone")
    if facts.dock is None:
        raise builder.error("this world has no dock to charge at", "add 'dock' to its knowledge")
    return dock_plan(builder, pose_2d(facts.dock), facts.battery.charged)


def person_pose(builder: PlanBuilder, person: str, at: str | None) -> Pose2D:
    """Where to stand to meet a person: the pose of the place where they are, turned to them when that is known."""
    facts = builder.knowledge.people[person]
    place = builder.place(at or facts.at)
    stand = builder.knowledge.place_pose(place)
    if facts.pose is None or builder.knowledge.room(place) != builder.knowledge.room(builder.place(facts.at)):
        return pose_2d(stand)
    return Pose2D(stand.x, stand.y, math.atan2(facts.pose.y - stand.y, facts.pose.x - stand.x))


def _goal_pose(builder: PlanBuilder, goal: str) -> Pose2D | FromBoard:
    if goal == START:
        return FromBoard(builder.start_key)
    person = builder.knowledge.person(goal)
    if person is not None:
        return person_pose(builder, person, builder.command.goal_at)
    return pose_2d(builder.knowledge.place_pose(builder.place(goal)))


def _hand_over_plan(builder: PlanBuilder, item: Thing, pose: Pose2D | FromBoard, person: str) -> NodeSpec:
    """Carry it there and hold it out; the gripper opens when the person takes it."""
    to = "the start" if isinstance(pose, FromBoard) else person
    ports = {"person": person, **({"thing": str(item)} if builder.has_ports("hand_over", ("thing",)) else {})}
    way = _holding(builder, item, f"to {to}", go_near_plan(builder, pose, to))
    hand_over = builder.skill("hand_over", ports)
    give = _holding(builder.at("give"), item, f"to {to}", hand_over, until_put_down=True)
    bring = builder.at("bring").sequence(f"bring it to {person}", way, give)
    return unless_fallen(builder.at("carry-on"), item, f"to {to}", bring, (way, give), (hand_over,))


def _put_down_plan(builder: PlanBuilder, item: Thing, place: str) -> NodeSpec:
    """Put down in a place; what is dropped on the way is picked up again."""
    put, guards = put_down_plan(builder, item, place)
    skills = tuple(guard.children[0] for guard in guards if guard.children[0].kind == "skill")
    return unless_fallen(builder.at("carry-on"), item, f"to the {place}", put, guards, skills)


def put_down_plan(builder: PlanBuilder, item: Thing, place: str) -> tuple[NodeSpec, tuple[NodeSpec, ...]]:
    """Any surface of the place will do: the next one is tried when one does not work. With it, the guards of the ways.

    Raises InputError: the place has no surfaces.
    """
    surfaces = builder.knowledge.surfaces_in(place)
    if not surfaces:
        raise builder.error(
            f"'{place}' has no surface to put the {item} on", "add one under 'surfaces' in the knowledge"
        )
    to = f"to the {place}"
    ways = tuple(_put_on_plan(builder.at(name), item, name, to) for name in surfaces)
    put = builder.node("selector", f"put {item} down {where(builder.knowledge, place)}", *ways)
    return put, tuple(guard for way in ways for guard in way.children)


def _put_on_plan(builder: PlanBuilder, item: Thing, surface: str, to: str) -> NodeSpec:
    """Carry it there and put it down; both under guards."""
    view, carry = pose_2d(builder.knowledge.surfaces[surface].viewpoints[0]), builder.at("carry")
    place = builder.skill("place", {"surface": builder.surface(surface)})
    return builder.sequence(
        f"put it on {surface}",
        _holding(carry, item, to, go_near_plan(carry, view, f"the {surface}")),
        _holding(builder.at("put"), item, to, place, until_put_down=True),
    )


def _holding(builder: PlanBuilder, item: Thing, to: str, below: NodeSpec, *, until_put_down: bool = False) -> NodeSpec:
    """A guard: what is carried stays in the gripper, perhaps until it is put down."""
    condition = Holds(str(item), to, until_put_down, builder.sought(item.name), item.attributes)
    return builder.node("guard", f"holding {item}", below, condition=condition)


def _person_at_start(builder: PlanBuilder) -> str:
    """The one person who is known to be in the room of the start; else whoever stands there."""
    knowledge = builder.knowledge
    start = (knowledge.start.x, knowledge.start.y)
    rooms = [name for name, place in knowledge.places.items() if inside(place.polygon, start)]
    there = [name for name, facts in knowledge.people.items() if knowledge.room(builder.place(facts.at)) in rooms]
    return there[0] if len(there) == 1 else "person"


def _required(builder: PlanBuilder, thing: Thing | None) -> Thing:
    if thing is None:
        raise builder.error("the command names no object", "say what it is about")
    builder.classes(thing.name)
    return thing


_BY_TASK: Final[Mapping[Task | None, Callable[[PlanBuilder], NodeSpec]]] = {
    Task.GRASP: grasp_plan,
    Task.FIND: find_plan,
    Task.PLACE: carry_plan,
    Task.WAIT: wait_plan,
    Task.CHARGE: charge_plan,
    None: go_plan,
}
