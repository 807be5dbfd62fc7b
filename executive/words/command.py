"""Commands of the form *Take [item] to [goal] and do [task] to [object]*, and their text form.

A name with several words needs no quotes ("[orange juice]"). If its words could be read as attributes, a number or
Nothing, the text form puts the name in quotes ('["red wine"]'), so that every command parses back to itself.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from skills.api import ObjectKind

_ATTRIBUTE: Final = re.compile(
    r"red|green|blue|yellow|orange|white|black|gr[ae]y|brown|pink|purple|violet|silver|golden|dark|bright|light"
    r"|big|small|large|little|tiny|huge|tall|short|long|wide|thin|thick|heavy|round|square|full|empty|open|closed"
    r"|clean|dirty|new|old|hot|cold|warm|fresh|wooden|plastic|metal|other|same|left|right|\w{3,}est",
    re.IGNORECASE,
)
_NOTHING: Final = "Nothing"
START: Final = "start"
"""Goal at the pose where the robot stood when the speaker addressed it."""
SPEAKER: Final = "speaker"
"""Person who spoke to the robot, as the object of a task on people."""
TIME_UNITS_S: Final = {"second": 1.0, "seconds": 1.0, "minute": 60.0, "minutes": 60.0, "hour": 3600.0, "hours": 3600.0}
"""Seconds of each time unit that a command to wait takes as its object: "do [wait] to [10 second]"."""
_PLURAL: Final = "some"
_RESERVED: Final = re.compile(r'[\[\]"]|^\s|\s$|\s\s|[^\S ]|^$')
_NO_ATTRIBUTE: Final = re.compile(rf"\d+|{_PLURAL}|.*\s.*")
_FORM: Final = re.compile(r"\s*Take \[(.+?)\] to \[(.+?)\] and do \[(.+?)\] to \[(.+?)\]\s*")
_GOAL: Final = re.compile(r'("[^"]+"|.+?)(?: at ("[^"]+"|.+))?')
_COUNTED: Final = re.compile(r'(?:(\d+|some) )?(?:([^"]*) )?(?:"([^"]+)"|([^"]+))')


class Task(enum.Enum):
    """Task of a command at its goal. WAIT has a time as its object, FOLLOW, GUIDE and GREET a person, CHARGE none."""

    GRASP = "grasp"
    FIND = "find"
    PLACE = "place"
    WAIT = "wait"
    CHARGE = "charge"
    FOLLOW = "follow"  # until the person stands at the goal, or until told
    GUIDE = "guide"
    GREET = "greet"  # of an open number of people: each person at the goal once


PEOPLE_TASKS: Final = frozenset({Task.FOLLOW, Task.GUIDE, Task.GREET})
"""Tasks whose object is a person."""


@dataclass(frozen=True)
class Command:
    """Command to one robot. None stands for Nothing; a count of 0 is a plural without a number, 1 a singular.

    `goal` is a place or a person ("start": the pose where the robot stood when the speaker addressed it), `goal_at` the
    place where that person is, `verb` the spoken verb.

    Raises ValueError when a name contains brackets, quotes or stray blanks, a count is negative, Nothing is counted, or
    `goal_at` is given without a goal.
    """

    item: ObjectKind | None = None
    goal: str | None = None
    goal_at: str | None = None
    task: Task | None = None
    object: ObjectKind | None = None
    item_count: int = 1
    object_count: int = 1
    verb: str = ""

    def __post_init__(self) -> None:
        for name in (self.goal, self.goal_at, *_words(self.item), *_words(self.object)):
            if name is not None and _RESERVED.search(name):
                raise ValueError(f"{name!r} cannot be a name in a command")
        for kind, count in ((self.item, self.item_count), (self.object, self.object_count)):
            if count < 0 or (kind is None and count != 1):
                raise ValueError(f"{count} cannot be the count of {kind or _NOTHING}")
            if not all(map(may_be_attribute, _words(kind)[1:])):
                raise ValueError(f"{kind} has an attribute that is no single word, or a number")
        if self.goal_at is not None and self.goal is None:
            raise ValueError(f"a goal is missing at {self.goal_at!r}")

    def __str__(self) -> str:
        """Text form, for instance "Take [Nothing] to [kitchen] and do [grasp] to [drink]"."""
        item = _counted_text(self.item, self.item_count)
        task = _NOTHING if self.task is None else self.task.value
        target = _counted_text(self.object, self.object_count)
        return f"Take [{item}] to [{_goal_text(self.goal, self.goal_at)}] and do [{task}] to [{target}]"

    def to_json(self) -> dict[str, Any]:
        """Returns the command as JSON values: names as text, and null for Nothing, with count 0."""
        return {
            "item": None if self.item is None else str(self.item),
            "goal": self.goal,
            "goal_at": self.goal_at,
            "task": None if self.task is None else self.task.value,
            "object": None if self.object is None else str(self.object),
            "item_count": 0 if self.item is None else self.item_count,
            "object_count": 0 if self.object is None else self.object_count,
            "verb": self.verb,
        }


def is_attribute(word: str) -> bool:
    """Returns whether `word` is an attribute of the words that follow it ("red", "biggest")."""
    return _ATTRIBUTE.fullmatch(word) is not None


def may_be_attribute(word: str) -> bool:
    """Returns whether `word` can describe an object, like a colour: a single word that is no number."""
    return _NO_ATTRIBUTE.fullmatch(word) is None


def parse_object(text: str) -> ObjectKind:
    """Parses words as a kind of object: leading attributes, and the rest as its name."""
    words = text.split()
    first = next((n for n, word in enumerate(words) if not is_attribute(word)), len(words) - 1)
    return ObjectKind(" ".join(words[first:]), tuple(words[:first]))


def parse_command(text: str) -> Command:
    """Parses the text form of a command, which does not include its `verb`.

    Raises ValueError when the text is no command.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is not of the form 'Take [item] to [goal] and do [task] to [object]'")
    item, goal, task, target = match.groups()
    item_kind, item_count = _parse_counted(item)
    target_kind, target_count = _parse_counted(target)
    goal_name, goal_at = _parse_goal(goal)
    return Command(item_kind, goal_name, goal_at, _parse_task(task), target_kind, item_count, target_count)


def parts_of_command(command: Command) -> dict[str, str]:
    """Splits a command's text form into its parts by the keys of mission files; omits parts that are Nothing."""
    parts = {
        "take": _counted_text(command.item, command.item_count),
        "to": _goal_text(command.goal, command.goal_at),
        "do": _NOTHING if command.task is None else command.task.value,
        "object": _counted_text(command.object, command.object_count),
    }
    return {key: text for key, text in parts.items() if text != _NOTHING}


def command_of_parts(parts: Mapping[str, str | None]) -> Command:
    """Builds a command from its parts. Raises ValueError when a part cannot be parsed."""
    take, to, do, target = (parts.get(key) or _NOTHING for key in ("take", "to", "do", "object"))
    return parse_command(f"Take [{take}] to [{to}] and do [{do}] to [{target}]")


def _words(kind: ObjectKind | None) -> tuple[str, ...]:
    return () if kind is None else (kind.name, *kind.attributes)


def _counted_text(of: ObjectKind | None, count: int) -> str:
    """Text between the brackets; in quotes if it would not parse back to the same object."""
    if of is None:
        return _NOTHING
    number = {0: f"{_PLURAL} ", 1: ""}.get(count, f"{count} ")
    plain = f"{number}{of}"
    return plain if _parse_counted(plain) == (of, count) else f'{number}{" ".join((*of.attributes, ""))}"{of.name}"'


def _parse_counted(text: str) -> tuple[ObjectKind | None, int]:
    if text == _NOTHING:
        return None, 1
    match = _COUNTED.fullmatch(text)
    if match is None:
        raise ValueError(f"[{text}] is no object")
    number, attributes, quoted, plain = match.groups()
    count = 1 if number is None else 0 if number == _PLURAL else int(number)
    if quoted is not None:
        return ObjectKind(quoted, tuple((attributes or "").split())), count
    return parse_object(" ".join(filter(None, (attributes, plain)))), count


def _goal_text(goal: str | None, goal_at: str | None) -> str:
    if goal is None:
        return _NOTHING
    name = _quoted_place(goal)
    return name if goal_at is None else f"{name} at {_quoted_place(goal_at)}"


def _quoted_place(name: str) -> str:
    return f'"{name}"' if name == _NOTHING or " at " in f" {name} " else name


def _parse_goal(text: str) -> tuple[str | None, str | None]:
    match = _GOAL.fullmatch(text)
    if text == _NOTHING or match is None:
        return None, None
    goal, goal_at = match.groups()
    return goal.strip('"'), goal_at.strip('"') if goal_at else None


def _parse_task(text: str) -> Task | None:
    if text == _NOTHING:
        return None
    try:
        return Task(text)
    except ValueError as error:
        known = ", ".join(task.value for task in Task)
        raise ValueError(f"[{text}] is no task; known are {known} and {_NOTHING}") from error
