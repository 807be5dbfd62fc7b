"""Carrying an object to a person, to the start or to a surface, under the guard that the gripper holds it."""

from __future__ import annotations

import math

from executive.tree.board import FromBoard
from executive.tree.node import NodeSpec
from executive.tree.nodes.fallen import unless_fallen
from executive.tree.nodes.guard import Holds
from executive.tree.nodes.pick_up import go_near_plan
from executive.tree.nodes.search import where
from executive.tree.plan import PlanBuilder, pose_2d
from executive.words.command import START
from executive.words.outlines import inside
from skills.api import Thing
from skills.robot import Pose2D


def carry_plan(builder: PlanBuilder) -> NodeSpec:
    """Carries the item to a person, to the start, or to a surface of a place."""
    command = builder.command
    item = builder.known(command.item or command.object)
    goal = command.goal
    if goal is None:
        raise builder.error(f"it is not said where to take the {item}", "name a place or a person")
    if goal == START:
        return _hand_over_plan(builder, item, FromBoard(builder.start_key), _person_at_start(builder))
    person = builder.knowledge.person(goal)
    if person is not None:
        return _hand_over_plan(builder, item, person_pose(builder, person, command.goal_at), person)
    place = builder.place(goal)
    put, guards = put_down_plan(builder, item, place)
    skills = tuple(guard.children[0] for guard in guards if guard.children[0].kind == "skill")
    return unless_fallen(builder.at("carry-on"), item, f"to the {place}", put, guards, skills)


def _hand_over_plan(builder: PlanBuilder, item: Thing, pose: Pose2D | FromBoard, person: str) -> NodeSpec:
    """Carries it there and holds it out; the gripper opens when the person takes it."""
    to = "the start" if isinstance(pose, FromBoard) else person
    ports = {"person": person, **({"thing": str(item)} if builder.has_ports("hand_over", ("thing",)) else {})}
    way = _holding(builder, item, f"to {to}", go_near_plan(builder, pose, to))
    hand_over = builder.skill("hand_over", ports)
    give = _holding(builder.at("give"), item, f"to {to}", hand_over, until_put_down=True)
    bring = builder.at("bring").sequence(f"bring it to {person}", way, give)
    return unless_fallen(builder.at("carry-on"), item, f"to {to}", bring, (way, give), (hand_over,))


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
    """Carries it there and puts it down; both under guards."""
    view, carry = pose_2d(builder.knowledge.surfaces[surface].viewpoints[0]), builder.at("carry")
    place = builder.skill("place", {"surface": builder.surface(surface)})
    return builder.sequence(
        f"put it on {surface}",
        _holding(carry, item, to, go_near_plan(carry, view, f"the {surface}")),
        _holding(builder.at("put"), item, to, place, until_put_down=True),
    )


def carried_along_plan(builder: PlanBuilder, way: NodeSpec, to: str) -> NodeSpec:
    """A way on which what an earlier step has grasped stays in the gripper; it is picked up again where it falls.

    An earlier step that failed and was passed over has grasped nothing: then there is nothing to watch.
    """
    if builder.carried is None:
        return way
    guard = _holding(builder.at("carried"), builder.carried, to, way, until_put_down=True)
    return unless_fallen(builder.at("carry-on"), builder.carried, to, guard, (guard,))


def _holding(builder: PlanBuilder, item: Thing, to: str, below: NodeSpec, *, until_put_down: bool = False) -> NodeSpec:
    """A guard: what is carried stays in the gripper, perhaps until it is put down."""
    condition = Holds(str(item), to, until_put_down, builder.sought(item.name), item.attributes)
    return builder.node("guard", f"holding {item}", below, condition=condition)


def goal_in_words(builder: PlanBuilder, goal: str) -> str:
    """A goal as it is called in a sentence."""
    return goal if builder.knowledge.person(goal) else f"the {goal}"


def goal_pose(builder: PlanBuilder, goal: str) -> Pose2D | FromBoard:
    """Where to stand at a goal: a place, a person, or the start."""
    if goal == START:
        return FromBoard(builder.start_key)
    person = builder.knowledge.person(goal)
    if person is not None:
        return person_pose(builder, person, builder.command.goal_at)
    return pose_2d(builder.knowledge.place_pose(builder.place(goal)))


def person_pose(builder: PlanBuilder, person: str, at: str | None) -> Pose2D:
    """Where to stand to meet a person: the pose of the place where they are, turned to them when that is known."""
    facts = builder.knowledge.people[person]
    place = builder.place(at or facts.at)
    stand = builder.knowledge.place_pose(place)
    if facts.pose is None or builder.knowledge.room(place) != builder.knowledge.room(builder.place(facts.at)):
        return pose_2d(stand)
    return Pose2D(stand.x, stand.y, math.atan2(facts.pose.y - stand.y, facts.pose.x - stand.x))


def _person_at_start(builder: PlanBuilder) -> str:
    """The one person who is known to be in the room of the start; else whoever stands there."""
    knowledge = builder.knowledge
    start = (knowledge.start.x, knowledge.start.y)
    rooms = [name for name, place in knowledge.places.items() if inside(place.polygon, start)]
    there = [name for name, facts in knowledge.people.items() if knowledge.room(builder.place(facts.at)) in rooms]
    return there[0] if len(there) == 1 else "person"
