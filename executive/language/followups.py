"""Parses follow-ups to a request: remarks about the run, and corrections, additions, repetitions, which amend it."""

import enum
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from executive.language.task_sentences import task_forms, task_openers
from executive.language.templates import page
from executive.language.tokens import in_present
from executive.words.command import START, Command
from executive.words.knowledge import Knowledge
from executive.words.task import basic
from skills.api import ObjectKind

_PAGE: Final = page("followups")
_MOST_LETTERS: Final = 200


class FollowUpKind(enum.Enum):
    """Relation of a sentence to the previous request, in the order of trying."""

    AGAIN = "again"  # the same once more, after it
    CORRECTION = "correction"  # in place of it
    ADDITION = "addition"  # after it


@dataclass(frozen=True)
class FollowUp:
    """Follow-up to a request: the words, the preposition before them, and the words that they replace."""

    kind: FollowUpKind
    said: str = ""
    preposition: str = ""
    instead_of: str = ""

    @property
    def whole(self) -> str:
        """Words with the preposition before them."""
        return f"{self.preposition} {self.said}".strip()


@dataclass(frozen=True)
class Amendment:
    """Grounded change to a request: an object, with the number that was said, or else a place or a person.

    `source` is True if the place is where the object is, not the destination; `old` is the replaced name, if said.
    """

    kind: ObjectKind | None = None
    count: int | None = None
    goal: str | None = None
    goal_at: str | None = None
    source: bool = False
    old: str | None = None


def parse_follow_up(text: str) -> FollowUp | None:
    """Parses a follow-up; None for a sentence that is complete without the earlier request."""
    plain = " ".join(text.replace("’", "'").split()).strip(" .!,")
    found = ((kind, _PAGE[kind.value].fullmatch(plain)) for kind in FollowUpKind)
    follow_ups = (FollowUp(kind, one["said"], one["preposition"].lower(), one["old"]) for kind, one in found if one)
    return next(follow_ups, None)


def parse_recall(text: str) -> str | None:
    """Request that a question is about: "go to the hall" for "have you been to the hall yet"; None for others."""
    match = _PAGE["recalled"].fullmatch(text.replace("’", "'").strip())
    return None if match is None else in_present(match["said"])


def amend(commands: Sequence[Command], by: Amendment, knowledge: Knowledge) -> tuple[Command, ...]:
    """Changes an object, a place or a person in commands.

    The robot looks for a new object at the old one's place only if the speaker named this place and it is not the old
    one's usual place. A place without a preposition becomes the destination if the request has one, otherwise the
    source.
    """
    if by.goal is None:
        return tuple(_with_thing(command, by, knowledge) for command in commands)
    changed = _place_of(commands, by)
    named = replace(commands[changed], goal=by.goal, goal_at=by.goal_at)
    return (*commands[:changed], named, *commands[changed + 1 :])


def skip_fetching(commands: Sequence[Command], held: ObjectKind | None, knowledge: Knowledge) -> tuple[Command, ...]:
    """Removes the fetching of the held object; another held object goes to its usual place before a command."""
    if held is None or not commands:
        return tuple(commands)
    first = commands[0]
    if first.takes and first.object == held and len(commands) > 1:
        return tuple(commands[1:])
    takes = any(command.item is not None or command.takes for command in commands)
    usual = next(iter(knowledge.usual_surfaces(held.name)), None) if takes else None
    back = Command(item=held, goal=usual, task=basic().put, object=held, verb="put back")
    return tuple(commands) if usual is None else (back, *commands)


def _with_thing(command: Command, by: Amendment, knowledge: Knowledge) -> Command:
    """Names another object in a command, or only another number of objects."""
    said = [role for role in ("item", "object") if getattr(command, role) is not None]
    changed: dict[str, Any] = {f"{role}_count": by.count for role in said if by.count is not None}
    old = command.object or command.item
    if by.kind is None or old is None:
        return replace(command, **changed)
    if by.old is not None and by.old not in (old.name, *knowledge.classes(old.name)):
        return command
    usual = (command.takes or command.looks) and command.goal == knowledge.default_place(command.task, old.name)
    goal = knowledge.default_place(command.task, by.kind.name) if usual else command.goal
    return replace(command, **{**changed, "goal": goal, **dict.fromkeys(said, by.kind)})


def _place_of(commands: Sequence[Command], by: Amendment) -> int:
    """Index of the command whose goal a new place changes."""
    named = [n for n, command in enumerate(commands) if by.old is not None and command.goal == by.old]
    sources = [n for n, command in enumerate(commands) if command.item is None and command.task is not None]
    goals = [n for n in range(len(commands)) if n not in sources]
    said = [n for n in goals if commands[n].goal != START]
    likeliest = (*sources, *goals) if by.source else (*said[-1:], *goals[-1:], *sources)
    return (*named, *likeliest)[0]


class Remark(enum.Enum):
    """Meaning of a remark about the run, in the order of trying."""

    FREEZE = "freeze"  # stand still at once
    WAIT = "wait"  # pause
    STOP = "stop"  # end a step that waits for this; else stand still
    ENOUGH = "enough"  # end a step that waits for this
    GO_ON = "go_on"  # go on after a pause or a stop
    CANCEL = "cancel"  # give the mission up
    WHERE = "where"  # where the robot is
    DOING = "doing"  # its present action, and the reason
    ABLE = "able"  # its abilities
    HURRY = "hurry"  # drive faster
    THANKS = "thanks"  # as ENOUGH
    PRAISE = "praise"  # nothing


def parse_remark(text: str) -> Remark | None:
    """Parses a whole sentence as a remark; None for any other sentence, such as a request."""
    words = re.sub(r"[^\w\s']", " ", text[:_MOST_LETTERS].replace("’", "'"))
    doing = tuple(form for form in task_forms() if form[-3:] == "ing")
    forms = page("remarks", opener=tuple(task_openers()), opener_form=doing)
    return next((remark for remark in Remark if forms[remark.value].fullmatch(words)), None)
