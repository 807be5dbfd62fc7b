"""Compares the names in a command with a world's: finds unknown names, and replaces aliases."""

from collections.abc import Iterator, Sequence

from executive.words.command import PEOPLE_TASKS, SPEAKER, START, TIME_UNITS_S, Command, Task
from executive.words.knowledge import ANYBODY, Knowledge
from skills.api import ObjectKind
from skills.inputs.errors import suggestion


def unknown_names(command: Command, knowledge: Knowledge) -> Iterator[tuple[str, str, str]]:
    """Yields each name that the world does not have: the command's key, a sentence and a hint."""

    def unknown(kind: str, name: str, known: Sequence[str]) -> tuple[str, str]:
        return f"unknown {kind} {name!r}", suggestion(name, knowledge.spellings(known), shown=known)

    waits = command.task is Task.WAIT and command.object is not None and command.object.name in TIME_UNITS_S
    on_people = command.task in PEOPLE_TASKS and command.object is not None
    if on_people:
        yield from _wrong_with_people(command, knowledge)
    for key, item in (("take", command.item), ("object", None if waits or on_people else command.object)):
        person = command.task is Task.FIND and item is not None and knowledge.somebody(item.name) is not None
        if item is not None and knowledge.object_name(item.name) is None and not person:
            yield key, *unknown("object", item.name, knowledge.object_names())
    goals = (*knowledge.place_names(), *knowledge.people, START)
    if command.goal is not None and _goal(command.goal, knowledge) is None:
        yield "to", *unknown("place or person", command.goal, goals)
    if command.goal_at is not None and knowledge.place(command.goal_at) is None:
        yield "to", *unknown("place", command.goal_at, knowledge.place_names())


def _wrong_with_people(command: Command, knowledge: Knowledge) -> Iterator[tuple[str, str, str]]:
    """Yields the faults in a command to follow, guide or greet people: the command's key, a sentence and a hint."""
    whom = command.object
    assert command.task is not None and whom is not None
    if whom.name != SPEAKER and (whom.attributes or knowledge.somebody(whom.name) is None):
        known = (ANYBODY, SPEAKER, *knowledge.people)
        yield "object", f"unknown person {str(whom)!r}", suggestion(whom.name, known, shown=known)
    if command.item is not None:
        hint = "take it there in a step of its own"
        yield "take", f"the {command.item} cannot be taken along by '{command.task.value}'", hint
    if command.task is not Task.GREET and command.object_count != 1:
        yield "object", f"it cannot {command.task.value} several people at a time", "name one person"
    if command.task is Task.GUIDE and command.goal is None:
        yield "object", f"it is not said where to guide {whom}", "name the place under 'to'"


def in_world_names(command: Command, knowledge: Knowledge) -> Command:
    """Replaces the names in a command by the world's own names."""

    def named(item: ObjectKind | None) -> ObjectKind | None:
        known = item and (knowledge.object_name(item.name) or knowledge.somebody(item.name))
        return item and ObjectKind(known or item.name, item.attributes)

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
