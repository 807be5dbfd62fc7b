"""Commands that are written as their parts, with every name checked against the world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from executive.mission.file.schema import StepFile
from executive.mission.file.scope import Scope
from executive.words.command import START, TIME_UNITS_S, Command, Task, Thing, parse_command
from executive.words.knowledge import Knowledge
from executive.words.steps import KeyPath
from skills.files.errors import InputError, Problems, suggestion

__all__ = ["typed_command"]

_NOTHING: Final = "Nothing"


def typed_command(scope: Scope, step: StepFile, path: KeyPath, knowledge: Knowledge) -> Command:
    """The command of the step at `path`, which gives its parts, in the world's own names.

    Raises:
        InputError: a part that is no name, or names that the world does not have.
    """
    task = _NOTHING if step.do is None else step.do.value
    parts = [part or _NOTHING for part in (step.take, step.to, task, step.object)]
    try:
        command = parse_command("Take [{}] to [{}] and do [{}] to [{}]".format(*parts))
    except ValueError as error:
        raise scope.error(path, str(error), "write names in plain words") from error
    problems = Problems()
    for unknown in _unknown_names(scope, path, command, knowledge):
        problems.add(unknown)
    problems.raise_any()
    return _known(command, knowledge)


def _unknown_names(scope: Scope, path: KeyPath, command: Command, knowledge: Knowledge) -> Iterator[InputError]:
    waits = command.task is Task.WAIT and command.object is not None and command.object.name in TIME_UNITS_S
    for key, thing in (("take", command.item), ("object", None if waits else command.object)):
        person = command.task is Task.FIND and thing is not None and knowledge.somebody(thing.name) is not None
        if thing is not None and knowledge.thing(thing.name) is None and not person:
            yield _unknown(scope, (*path, key), "object", thing.name, knowledge.thing_names(), knowledge)
    goals = (*knowledge.place_names(), *knowledge.people, START)
    if command.goal is not None and _goal(command.goal, knowledge) is None:
        yield _unknown(scope, (*path, "to"), "place or person", command.goal, goals, knowledge)
    if command.goal_at is not None and knowledge.place(command.goal_at) is None:
        yield _unknown(scope, (*path, "to"), "place", command.goal_at, knowledge.place_names(), knowledge)


def _unknown(
    scope: Scope, path: KeyPath, kind: str, name: str, known: Sequence[str], knowledge: Knowledge
) -> InputError:
    hint = suggestion(name, knowledge.spellings(known), shown=known)
    return scope.error(path, f"unknown {kind} {name!r}", hint)


def _known(command: Command, knowledge: Knowledge) -> Command:
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
