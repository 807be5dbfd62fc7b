"""Several objects at once: the robot carries one at a time, so it goes as often as there are objects."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from executive.tree.goals import surfaces_to_search
from executive.tree.node import NodeSpec
from executive.tree.nodes.commands import carry_plan, grasp_plan
from executive.tree.plan import PlanBuilder
from executive.words.command import START, Command, Task

__all__ = ["are_trips", "refuse_several", "trips_plan"]

MAX_TRIPS: Final = 20


def are_trips(get: Command, bring: Command | None) -> bool:
    """True when two commands in a row ask to get several objects and to bring as many of them somewhere."""
    if bring is None or get.task is not Task.GRASP or get.object is None or get.object_count < 2:
        return False
    carried, count = (bring.item, bring.item_count) if bring.task is None else (bring.object, bring.object_count)
    return bring.task in (None, Task.PLACE) and carried == get.object and count == get.object_count


def trips_plan(builder: PlanBuilder, bring: Command) -> NodeSpec:
    """Get one and bring it there, as often as was said; `builder` is that of the command to get them.

    Raises InputError: too many; to a person, who takes one; no place to take them from, or
    one where those that were brought would be found again.
    """
    get, goal = builder.command, bring.goal
    count, thing = get.object_count, get.object
    several = f"{count} of '{thing}'"
    if count > MAX_TRIPS:
        raise builder.error(f"{several} are too many trips", f"ask for {MAX_TRIPS} at most")
    if goal == START or (goal is not None and builder.knowledge.person(goal) is not None):
        hint = "name a place with a surface to put them on"
        raise builder.error(f"{several} cannot be handed over: a person takes one object", hint)
    if get.goal is None:
        raise builder.error(f"it is not said where to take {several} from", "name the place")
    brought = set(builder.knowledge.surfaces_in(builder.place(goal))) if goal is not None else set()
    if thing is not None and brought & set(surfaces_to_search(builder.knowledge, thing.name, builder.place(get.goal))):
        hint = "name the surface that they are to be taken from"
        raise builder.error(
            f"{several} that lie in the {get.goal} already cannot be told from those brought there", hint
        )
    trips = tuple(_trip(builder, bring, number) for number in range(1, count + 1))
    return builder.sequence(f"bring {count} {thing} to {goal}, one at a time", *trips)


def refuse_several(builder: PlanBuilder) -> None:
    """Refuse a count that no trips are made of; in a question and of a time any count will do.

    Raises InputError: more than one object, or an open number of objects.
    """
    command = builder.command
    asked = 1 if command.task in (Task.FIND, Task.WAIT) else command.object_count
    for thing, count in ((command.item, command.item_count), (command.object, asked)):
        if count != 1:
            said = f"{count} of '{thing}'" if count else f"an open number of '{thing}'"
            hint = "say from where to where, and how many, or ask for one at a time"
            raise builder.error(f"{said} cannot be carried in one go", hint)


def _trip(builder: PlanBuilder, bring: Command, number: int) -> NodeSpec:
    """Get one object and bring it."""
    trip = builder.at(f"trip-{number}")
    get_one = replace(trip.at("get"), command=replace(builder.command, object_count=1))
    bring_one = replace(trip.at("bring"), command=replace(bring, item_count=1, object_count=1))
    return trip.sequence(f"trip {number}", grasp_plan(get_one, anywhere=False), carry_plan(bring_one))
