"""Everyone and every room: one errand for each person of the world that is meant, and looks over all rooms."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from executive.language.questions import RefusalError
from executive.language.structure.leaves import Leaf, Leaves, State
from executive.words.command import Command, Task
from executive.words.steps import MissionStep
from skills.files.errors import listing

__all__ = ["EVERY_ROOM", "GOES_EVERYWHERE", "everywhere", "for_everyone", "look_for", "serves_all"]

_EVERYONE: Final = re.compile(
    r"(?:to |for )?(?P<who>everyone|everybody|(?:each|every)(?: single)? (?:person|one|guest)|all (?:of )?"
    r"(?:the )?(?:people|persons|guests)|each of the people)"
    r"(?: who(?: is|'s| are)| that(?: is| are)| sitting| standing)*(?: (?:in"
    r"|at) (?P<where>the [\w ]+?))?(?= an? | some | one | two | the |$)",
    re.IGNORECASE,
)
_GIVES: Final = re.compile(r"(?:bring|give|serve|hand|take|get|fetch|deliver|pass|offer|carry)\b", re.IGNORECASE)


def serves_all(text: str) -> bool:
    """Whether something is brought to several people at once."""
    return _GIVES.match(text) is not None and _EVERYONE.search(text) is not None


def for_everyone(text: str, state: State, leaves: Leaves) -> tuple[tuple[MissionStep, ...], State] | None:
    """A step for each person to whom something is brought; None where it is brought to nobody of that kind.

    Raises RefusalError: it does not say in which room, nobody is known to be there, or there is only one of the thing.
    """
    match = _EVERYONE.search(text)
    if match is None or not _GIVES.match(text):
        return None
    who = match["who"]
    if match["where"] is None:
        raise RefusalError(f"I bring things to one person at a time, not to {who}; name one, or a room", [who])
    room = leaves.room(match["where"], state)
    knowledge = leaves.knowledge
    people = [name for name, facts in knowledge.people.items() if knowledge.room(facts.at) == room]
    if not people:
        raise RefusalError(f"I know nobody in the {room} to bring anything to: {who}", [who])
    steps: list[MissionStep] = []
    begun = state
    for name in people:
        to = "to " if re.match(r"(?:to|for) ", match[0], re.IGNORECASE) else ""
        leaf = leaves.leaf(f"{text[: match.start()]}{to}{name}{text[match.end() :]}", begun)
        if any(action.target is not None and not action.target.indefinite for action in leaf.trace.resolved):
            raise RefusalError(f"there is one of it, and I cannot bring it to {who}", [who])
        steps.append(MissionStep(tuple(_at(command, room, people) for command in leaf.commands)))
        begun = replace(leaf.state, memory=state.memory)
    return tuple(steps), begun


def _at(command: Command, room: str, people: list[str]) -> Command:
    """The command, to somebody in that room."""
    return replace(command, goal_at=room) if command.goal in people and command.goal_at is None else command


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
    leaf = leaves.leaf(f"find {what}", state)
    finds = [command for command in leaf.commands if command.task is Task.FIND]
    if len(finds) != len(leaf.commands) or re.search(r"\b(?:in|on|at|near)\b", what):
        raise RefusalError(f"I cannot look for {listing([what])} in every room", [what])
    commands = tuple(replace(command, goal=None, goal_at=None) for command in finds)
    return replace(leaf, commands=commands, state=replace(leaf.state, goal=None, at=None))
