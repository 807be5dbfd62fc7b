"""Doors as they are spoken of, among those of a world: "the kitchen door", "the door between hall and office"."""

from __future__ import annotations

import re
from typing import Final

from executive.language.questions import RefusalError, RefusalKind, Slot, which
from executive.language.spelling import synonyms_of
from executive.words.condition import Condition, DoorOpen, Not
from executive.words.knowledge import Knowledge
from skills.files.errors import listing

__all__ = ["door_condition"]

_DOOR: Final = (
    r"(?P<door>(?:the |that |this |a )?(?P<room>(?!door)[\w' ]+? )?door"
    r"(?: (?:that (?:is|leads) |which (?:is|leads) |leading )?(?:between (?P<one>.+?) and (?P<other>.+?)"
    r"|from (?P<from>.+?) to (?P<to>.+?)|(?:of|to|into|in|at|for|from) (?P<of>.+?)))?)"
)
_STANDS: Final = re.compile(
    rf"(?:{_DOOR}|(?P<it>it))(?: is|'s| stands| gets| has been| are)(?: still| now| already| again)*(?P<not> not|n't)?"
    r"(?: still| now| already| wide)* (?P<how>open|opened|closed|shut|locked)(?: again| now| yet)?",
    re.IGNORECASE,
)
_TURNS: Final = re.compile(
    rf"(?:{_DOOR}|(?P<it>it)) (?P<how>opens|closes|to open|to close|is opening|is closing|has opened|has closed)",
    re.IGNORECASE,
)
_OPEN: Final = frozenset({"open", "opened", "opens", "to open", "is opening", "has opened"})


def door_condition(words: str, last: DoorOpen | None, knowledge: Knowledge) -> Condition | None:
    """That a door is open or not, where the words tell that; "it" is the door that was spoken of `last`.

    Raises:
        RefusalError: there is no such door, or several, with a question then.
    """
    match = _STANDS.fullmatch(words) or _TURNS.fullmatch(words)
    if match is None or (match["it"] and last is None):
        return None
    found = last if match["it"] and last is not None else DoorOpen(_between(match, knowledge))
    is_open = (match["how"].lower() in _OPEN) != bool(match.groupdict().get("not"))
    return found if is_open else Not(found)


def _between(match: re.Match[str], knowledge: Knowledge) -> tuple[str, str]:
    """The rooms on the two sides of the door that is meant."""
    said = match["door"]
    bare = re.sub(r"^(?:the|that|this|a) ", "", said, flags=re.IGNORECASE)
    if not knowledge.doors:
        what = f"I know no door here, so '{said}' cannot be looked at"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    named = [match[name] for name in ("room", "one", "other", "from", "to", "of") if match[name]]
    rooms = {_room(name.strip(), knowledge) for name in named}
    fitting = [door.between for door in knowledge.doors if rooms <= {*door.between}]
    if not fitting:
        known = listing(f"{one} and {other}" for one, other in (door.between for door in knowledge.doors))
        what = f"I know no such door as '{said}'; there are doors between {known}"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    if len(fitting) > 1:
        question = which(Slot.PLACE, bare, tuple(f"door between {one} and {other}" for one, other in fitting))
        raise RefusalError(question.text, [bare], question=question)
    return fitting[0]


def _room(name: str, knowledge: Knowledge) -> str:
    bare = re.sub(r"^(?:the|my|our|your) ", "", name, flags=re.IGNORECASE)
    known = {spelling.lower(): room for room in knowledge.places for spelling in knowledge.spellings([room])}
    found = knowledge.place(bare) or next(iter(synonyms_of(bare.lower(), known)), None)
    if found is None:
        what = f"I know no room '{bare}'; known are {listing(knowledge.places)}"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    return knowledge.room(found)
