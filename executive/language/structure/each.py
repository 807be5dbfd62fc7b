"""Everyone and every room: one errand for each person of the world that is meant, and looks over all rooms."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from executive.language.nouns import NounKind
from executive.language.questions import RefusalError
from executive.language.roles import Location
from executive.language.structure.leaves import Leaf, Leaves, State, named, verb
from executive.words.command import Task
from executive.words.steps import MissionStep
from skills.files.errors import listing

__all__ = ["EVERY_ROOM", "GOES_EVERYWHERE", "everywhere", "for_everyone", "look_for", "serves_all"]

_GIVES: Final = re.compile(r"(?:bring|give|serve|hand|take|get|fetch|deliver|pass|offer|carry)\b", re.IGNORECASE)
_EVERYONE: Final = re.compile(
    r"\b(?:everyone|everybody|(?:each|every)(?: single)? (?:person|one|guest)|all (?:of )?(?:the )?(?:people|persons"
    r"|guests)|each of the people)\b",
    re.IGNORECASE,
)


def serves_all(text: str) -> bool:
    """Whether something is brought to several people at once."""
    return _GIVES.match(text) is not None and _EVERYONE.search(text) is not None


def for_everyone(text: str, state: State, leaves: Leaves) -> tuple[tuple[MissionStep, ...], State] | None:
    """A step for each person to whom something is brought; None where it is brought to nobody of that kind.

    Raises RefusalError: it does not say in which room, nobody is known to be there, or there is only one of the thing.
    """
    trace = leaves.actions(text, state)
    to = next((one.goal for one in trace.actions if one.goal is not None and _all_people(one.goal)), None)
    if to is None or to.phrase is None:
        return None
    who = to.phrase.spoken
    if to.within is None:
        raise RefusalError(f"I bring things to one person at a time, not to {who}; name one, or a room", [who])
    room, knowledge = leaves.room_of(to.within, state), leaves.knowledge
    people = [name for name, facts in knowledge.people.items() if knowledge.room(facts.at) == room]
    if not people:
        raise RefusalError(f"I know nobody in the {room} to bring anything to: {who}", [who])
    steps: list[MissionStep] = []
    begun = state
    for name in people:
        person = Location(named(name, NounKind.PERSON), "to", to.within)
        actions = [replace(one, goal=person) if one.goal == to else one for one in trace.actions]
        leaf = leaves.acted(trace, actions, begun)
        if any(action.target is not None and not action.target.indefinite for action in leaf.trace.resolved):
            raise RefusalError(f"there is one of it, and I cannot bring it to {who}", [who])
        steps.append(MissionStep(leaf.commands))
        begun = replace(leaf.state, memory=state.memory)
    return tuple(steps), begun


def _all_people(goal: Location) -> bool:
    return goal.phrase is not None and _EVERYONE.fullmatch(goal.phrase.spoken) is not None


_ROOMS: Final = (
    r"(?:(?:every|each)(?: single)?(?: one of the)? rooms?|all (?:of )?(?:the )?rooms"
    r"|the whole (?:house|flat|place|home|apartment|shop|lab)|all over the (?:house|flat|place)|everywhere"
    r"|each of the rooms|from room to room|room by room|room after room)(?: (?:of|in) the (?:house|flat|apartment))?"
)
EVERY_ROOM: Final = re.compile(rf"\b{_ROOMS}(?![\w'])", re.IGNORECASE)
GOES_EVERYWHERE: Final = re.compile(
    rf"(?:check|search|look|scan|go|drive|visit|walk|inspect|explore)(?: (?:in|into|through|to|around|round|at"
    rf"|over))*(?: in| through)? {_ROOMS}",
    re.IGNORECASE,
)
_LOOKS: Final[tuple[re.Pattern[str], ...]] = tuple(
    re.compile(form, re.IGNORECASE)
    for form in (
        rf"(?:check|search|look|scan|inspect)(?: (?:in|into|through|around|at))* {_ROOMS} for (?P<what>.+)",
        rf"(?:look|search|check|hunt|scan)(?: for)? (?P<what>.+?) (?:in|through|all over)? ?{_ROOMS}",
        rf"(?:find) (?P<what>.+?) (?:in )?{_ROOMS}",
        rf"(?:check|search|look|scan|go|drive)(?: (?:in|into|through|to|around|at))* {_ROOMS} until you (?:find"
        rf"|see|have found) (?P<what>.+)",
        rf"in {_ROOMS},? (?:look|search|check) for (?P<what>.+)",
        rf"(?:check|see|look)(?: in)? {_ROOMS} (?:if|whether) (?:there (?:is|are) )?(?P<what>.+?)(?: (?:is"
        rf"|are) (?:there|in it|in there))?",
    )
)


def everywhere(text: str, state: State, leaves: Leaves) -> Leaf | None:
    """A look over all rooms; None where the text asks for none. Raises RefusalError: for what is unclear."""
    match = next((found for form in _LOOKS if (found := form.fullmatch(text)) is not None), None)
    return None if match is None else look_for(match["what"], state, leaves)


def look_for(what: str, state: State, leaves: Leaves) -> Leaf:
    """Looking for something or somebody wherever they may be. Raises RefusalError."""
    leaf = leaves.leaf(what, state, (verb("find"),))
    finds = [command for command in leaf.commands if command.task is Task.FIND]
    if len(finds) != len(leaf.commands) or re.search(r"\b(?:in|on|at|near)\b", what):
        raise RefusalError(f"I cannot look for {listing([what])} in every room", [what])
    commands = tuple(replace(command, goal=None, goal_at=None) for command in finds)
    return replace(leaf, commands=commands, state=replace(leaf.state, goal=None, at=None))
