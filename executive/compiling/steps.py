"""The subtree of each kind of command: take hold of, look whether, carry, go."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from executive.behaviours.board import FromBoard
from executive.command import Task, Thing
from executive.compiling.plans import AnswerPlan, HoldingPlan, NodePlan, RetryPlan, SelectorPlan
from executive.compiling.search import look_plans, required_surfaces, search_plan, sighting, where
from executive.compiling.workshop import Workshop, pose_2d
from skills.api import Cause
from skills.robot import Pose2D

START: Final = "start"
ATTEMPTS: Final = 3
WORTH_RETRYING: Final = frozenset({Cause.EXECUTION, Cause.POSTCONDITION, Cause.PRECONDITION, Cause.PLANNING})


def step_plan(shop: Workshop) -> NodePlan:
    """The subtree of the workshop's command.

    Raises:
        InputError: an unknown place or thing, or a command that cannot be carried out.
    """
    return _BY_TASK[shop.command.task](shop)


def needs_start(shop: Workshop) -> bool:
    """True when the command refers to where the robot stood at the start."""
    return shop.command.goal == START


def grasp_plan(shop: Workshop) -> NodePlan:
    """Find it, stand before it, take it, tuck the arm in.

    When standing or taking fails the robot looks again and tries anew; when nothing is to be found that is final.
    """
    thing = _required(shop, shop.command.object)
    if shop.command.item is not None:
        raise shop.error("the one gripper cannot take hold of a second thing", "put the first one down before")
    place = None if shop.command.goal is None else shop.place(shop.command.goal)
    key = f"{shop.path_id}/sighting"
    near = f"{shop.path_id}/near-sighting"
    surfaces = tuple(map(shop.surface, required_surfaces(shop, thing, place)))
    attempt = shop.at("pick-up").sequence(
        f"pick up {thing}",
        search_plan(shop.at("find"), thing, place, key),
        shop.skill("approach", {"observation": sighting(key), "surfaces": surfaces}, {"observation": near}),
        shop.skill("grasp", {"observation": FromBoard(near)}),
    )
    attempts = RetryPlan(
        path_id=f"{shop.path_id}/attempts",
        name=f"up to {ATTEMPTS} attempts",
        source=shop.source,
        child=attempt,
        attempts=ATTEMPTS,
        causes=WORTH_RETRYING,
        final=f"{shop.path_id}/find",
    )
    return shop.sequence(f"get {thing} {where(place)}", attempts, shop.skill("stow"))


def find_plan(shop: Workshop) -> NodePlan:
    """Look at every surface of the place and answer yes or no."""
    thing = _required(shop, shop.command.object)
    place = None if shop.command.goal is None else shop.place(shop.command.goal)
    surfaces = required_surfaces(shop, thing, place)
    below = shop.at("search")
    looks = look_plans(below, thing, surfaces, f"{shop.path_id}/sighting")
    search = SelectorPlan(
        path_id=below.path_id, name=f"look for {thing}", source=shop.source, steps=tuple(look for _, look in looks)
    )
    leaves = {s: tuple(f"{look.path_id}/detect" for name, look in looks if name == s) for s in surfaces}
    return AnswerPlan(
        path_id=shop.path_id,
        name=f"is there {thing} {where(place)}?",
        source=shop.source,
        child=search,
        question=f"{thing} {where(place)}",
        looks=tuple(leaves.items()),
        key=f"{shop.path_id}/answer",
    )


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
    return shop.sequence(f"go to {command.goal}", shop.navigate(_goal_pose(shop, command.goal)))


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
        f"bring it to {person}", shop.navigate(pose), shop.skill("hand_over", {"person": person})
    )
    return _holding(shop, item, way)


def _put_down_plan(shop: Workshop, item: Thing, place: str) -> NodePlan:
    """Any surface of the place will do: the next one is tried when one does not work."""
    surfaces = shop.knowledge.surfaces_in(place)
    if not surfaces:
        raise shop.error(f"'{place}' has no surface to put the {item} on", "add one under 'surfaces' in the knowledge")
    ways = tuple(_put_on_plan(shop.at(name), item, name) for name in surfaces)
    return SelectorPlan(path_id=shop.path_id, name=f"put {item} down {where(place)}", source=shop.source, steps=ways)


def _put_on_plan(shop: Workshop, item: Thing, surface: str) -> NodePlan:
    view = pose_2d(shop.knowledge.surfaces[surface].viewpoints[0])
    carry = _holding(shop.at("carry"), item, shop.at("carry").navigate(view))
    return shop.sequence(f"put it on {surface}", carry, shop.skill("place", {"surface": shop.surface(surface)}))


def _holding(shop: Workshop, item: Thing, below: NodePlan) -> NodePlan:
    """A guard: what is carried stays in the gripper."""
    return HoldingPlan(path_id=shop.path_id, name=f"holding {item}", source=shop.source, child=below, thing=str(item))


def _person_at_start(shop: Workshop) -> str:
    """The one person who is known to be in the room of the start; else whoever stands there."""
    knowledge = shop.knowledge
    start = (knowledge.start.x, knowledge.start.y)
    rooms = [name for name, place in knowledge.places.items() if inside(place.polygon, start)]
    there = [name for name, facts in knowledge.people.items() if knowledge.room(shop.place(facts.at)) in rooms]
    return there[0] if len(there) == 1 else "person"


def inside(polygon: Sequence[tuple[float, float]], point: tuple[float, float]) -> bool:
    """True when (x, y) lies within the outline."""
    x, y = point
    crossings = 0
    for (x1, y1), (x2, y2) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if (y1 > y) != (y2 > y):
            crossings += x < x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return crossings % 2 == 1


def _required(shop: Workshop, thing: Thing | None) -> Thing:
    if thing is None:
        raise shop.error("the command names no thing", "say what it is about")
    shop.classes(thing.name)
    return thing


_BY_TASK: Final[Mapping[Task | None, Callable[[Workshop], NodePlan]]] = MappingProxyType(
    {Task.GRASP: grasp_plan, Task.FIND: find_plan, Task.PLACE: carry_plan, None: go_plan}
)
