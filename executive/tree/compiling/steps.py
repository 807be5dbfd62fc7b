"""The subtree of each kind of command: take hold of, look whether, carry, go."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from executive.mission.command import Task, Thing
from executive.tree.behaviours.board import FromBoard
from executive.tree.compiling.geometry import inside
from executive.tree.compiling.handling import go_near_plan, pick_up_plan, tidied, tuck_plan, unless_dropped
from executive.tree.compiling.plans import AnswerPlan, HoldingPlan, NodePlan, RoundPlan, SelectorPlan
from executive.tree.compiling.search import (
    look_plans,
    required_surfaces,
    search_plan,
    surfaces_elsewhere,
    tally_key,
    where,
)
from executive.tree.compiling.workshop import Workshop, pose_2d
from skills.detect.words import numbered, plural
from skills.robot import Pose2D

START: Final = "start"


def step_plan(shop: Workshop) -> NodePlan:
    """The subtree of the workshop's command.

    Raises:
        InputError: an unknown place or thing, or a command that cannot be carried out.
    """
    return _BY_TASK[shop.command.task](shop)


def grasp_plan(shop: Workshop, *, anywhere: bool = True) -> NodePlan:
    """Find it, stand before it, take it, tuck the arm in.

    When standing or taking fails, what fits the failure is done and the robot looks again and tries anew; when nothing
    is to be found that is final. With `anywhere`, it is looked for elsewhere, too, when it is not in its place.
    """
    thing = _required(shop, shop.command.object)
    if shop.command.item is not None:
        raise shop.error("the one gripper cannot take hold of a second thing", "put the first one down before")
    place = None if shop.command.goal is None else shop.place(shop.command.goal)
    surfaces = set(required_surfaces(shop, thing, place))
    if anywhere and shop.anywhere:
        name = shop.knowledge.thing(thing.name) or thing.name
        surfaces |= set(surfaces_elsewhere(shop.knowledge, name, place, shop.avoided))
    around = tuple(shop.surface(name) for name in shop.knowledge.surfaces if name in surfaces)
    key = f"{shop.path_id}/sighting"
    search = search_plan(shop.at("find"), thing, place, key, anywhere=anywhere)
    return shop.sequence(
        f"get {thing} {where(place)}",
        pick_up_plan(shop, thing, search, key, around),
        tuck_plan(shop),
    )


def find_plan(shop: Workshop) -> NodePlan:
    """Look at the surfaces of the place and answer yes or no; where it is asked where or how many, tell that, too.

    The first thing that is seen ends the search, unless they are to be counted: then all surfaces are looked at.
    """
    thing, count = _required(shop, shop.command.object), shop.command.object_count
    place = None if shop.command.goal is None else shop.place(shop.command.goal)
    surfaces = required_surfaces(shop, thing, place)
    below, counting = shop.at("search"), count != 1
    whole_room = place is None or place in shop.knowledge.places
    extra = {"floor": whole_room, "count": 0 if counting else 1}
    looks = look_plans(below, thing, surfaces, f"{shop.path_id}/sighting", extra, tallied=counting)
    kind = RoundPlan if counting else SelectorPlan
    search = kind(
        path_id=below.path_id, name=f"look for {thing}", source=shop.source, steps=tuple(look for _, look in looks)
    )
    leaves = {s: tuple(f"{look.path_id}/detect" for name, look in looks if name == s) for s in surfaces}
    asked = _asked_for(str(thing), count)
    answer = AnswerPlan(
        path_id=shop.path_id,
        name=f"{'are' if counting else 'is'} there {asked} {where(place)}?",
        source=shop.source,
        child=search,
        question=f"{asked} {where(place)}",
        looks=tuple(leaves.items()),
        key=f"{shop.path_id}/answer",
        tells=place is None,
        tallies=tuple((leaf, tally_key(leaf)) for own in leaves.values() for leaf in own) if counting else (),
        needed=max(1, count),
    )
    return tidied(shop.at("tidy"), answer)


def _asked_for(thing: str, count: int) -> str:
    """What a question is about: "beer", "two beers", or "beers" for any number."""
    if count == 1:
        return thing
    return numbered(count, thing) if count else plural(thing)


def carry_plan(shop: Workshop) -> NodePlan:
    """Carry the item to a person, to the start, or to a surface of a place."""
    command = shop.command
    item = _required(shop, command.item or command.object)
    goal = command.goal
    if goal is None:
        raise shop.error(f"it is not said where to take the {item}", "name a place or a person")
    if goal == START:
        return _hand_over_plan(shop, item, FromBoard(shop.start_key), _person_at_start(shop))
    person = shop.knowledge.person(goal)
    if person is not None:
        return _hand_over_plan(shop, item, person_pose(shop, person, command.goal_at), person)
    return _put_down_plan(shop, item, shop.place(goal))


def go_plan(shop: Workshop) -> NodePlan:
    """Go to a place, a person or the start; with an item in the gripper, carry it."""
    command = shop.command
    if command.item is not None:
        return carry_plan(shop)
    if command.goal is None:
        raise shop.error("the command asks for nothing", "name a place to go to, or a thing")
    return shop.sequence(f"go to {command.goal}", go_near_plan(shop, _goal_pose(shop, command.goal)))


def person_pose(shop: Workshop, person: str, at: str | None) -> Pose2D:
    """Where to stand to meet a person: the pose of the place where they are, turned to them when that is known."""
    facts = shop.knowledge.people[person]
    place = shop.place(at or facts.at)
    stand = shop.knowledge.place_pose(place)
    if facts.pose is None or shop.knowledge.room(place) != shop.knowledge.room(shop.place(facts.at)):
        return pose_2d(stand)
    return Pose2D(stand.x, stand.y, math.atan2(facts.pose.y - stand.y, facts.pose.x - stand.x))


def _goal_pose(shop: Workshop, goal: str) -> Pose2D | FromBoard:
    if goal == START:
        return FromBoard(shop.start_key)
    person = shop.knowledge.person(goal)
    if person is not None:
        return person_pose(shop, person, shop.command.goal_at)
    return pose_2d(shop.knowledge.place_pose(shop.place(goal)))


def _hand_over_plan(shop: Workshop, item: Thing, pose: Pose2D | FromBoard, person: str) -> NodePlan:
    way = shop.at("bring").sequence(
        f"bring it to {person}", go_near_plan(shop, pose), shop.skill("hand_over", {"person": person})
    )
    guard = _holding(shop, item, way)
    return unless_dropped(shop.at("carry-on"), item, guard, (guard,))


def _put_down_plan(shop: Workshop, item: Thing, place: str) -> NodePlan:
    """Any surface of the place will do: the next one is tried when one does not work."""
    surfaces = shop.knowledge.surfaces_in(place)
    if not surfaces:
        raise shop.error(f"'{place}' has no surface to put the {item} on", "add one under 'surfaces' in the knowledge")
    guards = tuple(_carry_to_plan(shop.at(name, "carry"), item, name) for name in surfaces)
    ways = tuple(_put_on_plan(shop.at(name), name, guard) for name, guard in zip(surfaces, guards, strict=True))
    put = SelectorPlan(path_id=shop.path_id, name=f"put {item} down {where(place)}", source=shop.source, steps=ways)
    return unless_dropped(shop.at("carry-on"), item, put, guards)


def _carry_to_plan(shop: Workshop, item: Thing, surface: str) -> HoldingPlan:
    view = pose_2d(shop.knowledge.surfaces[surface].viewpoints[0])
    return _holding(shop, item, shop.navigate(view))


def _put_on_plan(shop: Workshop, surface: str, carry: HoldingPlan) -> NodePlan:
    return shop.sequence(f"put it on {surface}", carry, shop.skill("place", {"surface": shop.surface(surface)}))


def _holding(shop: Workshop, item: Thing, below: NodePlan) -> HoldingPlan:
    """A guard: what is carried stays in the gripper."""
    return HoldingPlan(path_id=shop.path_id, name=f"holding {item}", source=shop.source, child=below, thing=str(item))


def _person_at_start(shop: Workshop) -> str:
    """The one person who is known to be in the room of the start; else whoever stands there."""
    knowledge = shop.knowledge
    start = (knowledge.start.x, knowledge.start.y)
    rooms = [name for name, place in knowledge.places.items() if inside(place.polygon, start)]
    there = [name for name, facts in knowledge.people.items() if knowledge.room(shop.place(facts.at)) in rooms]
    return there[0] if len(there) == 1 else "person"


def _required(shop: Workshop, thing: Thing | None) -> Thing:
    if thing is None:
        raise shop.error("the command names no thing", "say what it is about")
    shop.classes(thing.name)
    return thing


_BY_TASK: Final[Mapping[Task | None, Callable[[Workshop], NodePlan]]] = MappingProxyType(
    {Task.GRASP: grasp_plan, Task.FIND: find_plan, Task.PLACE: carry_plan, None: go_plan}
)
