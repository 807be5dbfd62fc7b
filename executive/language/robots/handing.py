"""Things that go from robot to robot: where one has put down what another is to take."""

from __future__ import annotations

from dataclasses import replace

from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.understand import Status, Understanding
from executive.words.command import Task

__all__ = ["handed_on", "moved", "takes_what_was_put", "with_place"]


def handed_on(meant: Understanding) -> Memory | None:
    """What was spoken of, for another robot: things are where they were put, or looked for."""
    memory, place = meant.memory, _where(meant)
    return memory if memory is None or place is None else replace(memory, where=place, place=place)


def with_place(memory: Memory, place: Location) -> Memory:
    """The memory of things that are at `place`, whatever was said of them last."""
    return replace(memory, told=(*memory.told, *((thing, place) for thing in memory.things)))


def moved(before: Understanding, meant: Understanding) -> Location | None:
    """Where a thing was put that `meant` names once more, without saying where it is ("the beer")."""
    if meant.trace is None or before.trace is None or meant.status is not Status.OK or before.memory is None:
        return None
    named = (one for one in meant.trace.resolved if one.target is not None and one.source is None and not one.again)
    same = any(
        one.target is not None and not one.target.indefinite and one.target.text == thing.text
        for one in named
        for thing in before.memory.things
    )
    return _where(before) if same and _puts(before) else None


def takes_what_was_put(before: Understanding, meant: Understanding) -> bool:
    """Whether a thing is taken from where it was put before."""
    put = {(str(command.item), command.goal) for command in before.commands if command.item is not None}
    taken = {(str(command.object), command.goal) for command in meant.commands if command.task is Task.GRASP}
    return bool(put & taken)


def _puts(meant: Understanding) -> bool:
    return any(command.item is not None for command in meant.commands)


def _where(meant: Understanding) -> Location | None:
    """The place where the things that were spoken of are at last; None with somebody, or where nothing is known."""
    memory = meant.memory
    if memory is None or meant.trace is None:
        return None
    for action in reversed(meant.trace.resolved):
        if action.target in memory.things:
            place = action.goal or action.source
            return None if place is None or place.phrase is None or place.living else place
    place = memory.place
    return None if meant.trace.resolved or place is None or place.phrase is None or place.living else place
