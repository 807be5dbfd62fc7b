"""The names in a command, checked against the world and put into its own words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from executive.words.command import START, TIME_UNITS_S, Command, Task
from executive.words.knowledge import Knowledge
from skills.api import Thing
from skills.files.errors import suggestion


def unknown_names(command: Command, knowledge: Knowledge) -> Iterator[tuple[str, str, str]]:
    """The names that a world does not have: the key, a sentence and a hint for each."""

    def unknown(kind: str, name: str, known: Sequence[str]) -> tuple[str, str]:
        return f"unknown {kind} {name!r}", suggestion(name, knowledge.spellings(known), shown=known)

    waits = command.task is Task.WAIT and command.object is not None and command.object.name in TIME_UNITS_S
    for key, thing in (("take", command.item), ("object", None if waits else command.object)):
        person = command.task is Task.FIND and thing is not None and knowledge.somebody(thing.name) is not None
        if thing is not None and knowledge.thing(thing.name) is None and not person:
            yield key, *unknown("object", thing.name, knowledge.thing_names())
    goals = (*knowledge.place_names(), *knowledge.people, START)
    if command.goal is not None and _goal(command.goal, knowledge) is None:
        yield "to", *unknown("place or person", command.goal, goals)
    if command.goal_at is not None and knowledge.place(command.goal_at) is None:
        yield "to", *unknown("place", command.goal_at, knowledge.place_names())


def in_world_names(command: Command, knowledge: Knowledge) -> Command:
    """The command in the world's own names."""

    def named(thing: Thing | None) -> Thing | None:
        known = thing and (knowledge.thing(thing.name) or knowledge.somebody(thing.name))
        return thing and Thing(known or thing.name, thing.attributes)

    return Command(
        item=named(command.item),
        goal=command.goal and _goal(command.goal, knowledge),
        goal_at=command.goal_at and knowledge.place(command.goal_at),
        task=command.task,
        object=named(command.object),
        item_count=command.item_count,
        object_count=command.object_count,
    )


def _goal(name: str, knowledge: Knowledge) -> str | None:
    return START if name == START else knowledge.place(name) or knowledge.person(name)
