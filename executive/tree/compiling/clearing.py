"""Clearing a place: all that stands there is taken elsewhere, one object after the other, until nothing is left."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from executive.tree.behaviours.board import FromBoardOr
from executive.tree.compiling.builder import PlanBuilder
from executive.tree.compiling.handling import pick_up_plan, tidied
from executive.tree.compiling.search import detect_plan, look_plans, required_surfaces, where
from executive.tree.compiling.steps import put_down_plan
from executive.tree.node import NodeSpec
from executive.words.command import START, Command, Task, Thing
from executive.words.knowledge import EVERYTHING
from skills.perception.class_forms import THING

__all__ = ["MOST_OBJECTS", "clear_plan", "is_clearing", "refuse_everything"]

MOST_OBJECTS: Final = 12
MOST_MISSES: Final = 3


def is_clearing(get: Command, bring: Command | None) -> bool:
    """True when two commands in a row ask to get everything and to bring everything somewhere."""
    if bring is None or get.task is not Task.GRASP or get.object is None or get.object.name != EVERYTHING:
        return False
    return bring.task in (None, Task.PLACE) and get.object == (bring.item if bring.task is None else bring.object)


def clear_plan(builder: PlanBuilder, bring: Command) -> NodeSpec:
    """Look whether anything is left, and take it away, until nothing is; `builder` is that of the command to get it.

    Raises InputError: it is not said from where to where, it is to be brought to a person, or where it is taken from.
    """
    get, goal = builder.command, bring.goal
    assert get.object is not None
    thing = Thing(THING, get.object.attributes)
    if get.goal is None or goal is None:
        raise builder.error("it is not said from where to where everything is to be taken", "name both places")
    if goal == START or builder.knowledge.person(goal) is not None:
        raise builder.error("everything cannot be handed over: there is one gripper", "name a place with a surface")
    place, to = builder.place(get.goal), builder.place(goal)
    surfaces = required_surfaces(builder, thing, place)
    if shared := set(surfaces) & set(builder.knowledge.surfaces_in(to)):
        raise builder.error(f"everything that is on the {min(shared)} is to be brought there", "name two surfaces")
    key, missed = builder.key("detection"), builder.key("missed")
    extra = {"avoid": FromBoardOr(missed, ())} if builder.has_ports("detect", ("avoid",)) else {}
    looks = (look for _, look in look_plans(builder.at("left"), thing, surfaces, key, extra))
    look = builder.at("left").node("selector", f"is anything left {where(builder.knowledge, place)}?", *looks)
    again = detect_plan(builder.at("find"), thing, surfaces, key, extra)
    around = tuple(map(builder.surface, surfaces))
    carry = replace(builder.at("bring"), command=bring)
    put = tidied(carry.at("tidy"), put_down_plan(carry, thing, to)[0], only_after_failure=True)
    take = pick_up_plan(builder, thing, again, key, around, seen=True)
    move = builder.at("move").sequence("move it", take, put)
    return builder.node(
        "for each found",
        f"clear the {place} onto the {to}, one object at a time",
        look,
        move,
        key=key,
        done=(done := builder.key("moved")),
        missed=missed,
        did=("moved", f"to the {to}"),
        where=where(builder.knowledge, place),
        limit=MOST_OBJECTS,
        misses=MOST_MISSES,
        forgets=(done, missed),
    )


def refuse_everything(builder: PlanBuilder) -> None:
    """Refuse to take everything in one go. Raises InputError: a command on its own that is about everything."""
    command = builder.command
    if any(thing is not None and thing.name == EVERYTHING for thing in (command.item, command.object)):
        hint = "say from where to where in one step: 'move everything from the desk to the shelf'"
        raise builder.error("everything cannot be taken in one go", hint)
