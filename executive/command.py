"""Commands of the form *Take [item] to [goal] and do [task] to [object]*, and their text form."""

from __future__ import annotations

import enum
import re
from dataclasses import dataclass

from skills.api import Thing

__all__ = ["Command", "Task", "Thing", "parse_command"]


class Task(enum.Enum):
    """What to do to the object at the goal."""

    GRASP = "grasp"
    FIND = "find"
    PLACE = "place"


@dataclass(frozen=True)
class Command:
    """One command. None stands for Nothing; a count of 0 is a plural without a number, 1 a singular.

    `goal` is a place or a person ("start" is where the robot stood when it was spoken to), `goal_at` the place where
    a person is to be found, `verb` the word that was spoken.
    """

    item: Thing | None = None
    goal: str | None = None
    goal_at: str | None = None
    task: Task | None = None
    object: Thing | None = None
    item_count: int = 1
    object_count: int = 1
    verb: str = ""
