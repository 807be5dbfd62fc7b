"""The names that may be said: the recogniser expects them, and what it heard is matched to them by sound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Final

from executive.words.knowledge import Knowledge
from skills.files.errors import InputError
from skills.files.outside import read_text

__all__ = ["Vocabulary", "of_world", "read_vocabulary"]

_MOST_NAMES = 5_000
_MOST_LETTERS = 80


@dataclass(frozen=True)
class Vocabulary:
    """Names of things, places and people as they are spoken, the most usual last, and the robot's own name.

    Without `robot_name` nobody need call the robot; `other_robots` are more that may be called.
    """

    names: tuple[str, ...] = ()
    robot_name: str | None = None
    other_robots: tuple[str, ...] = ()

    @property
    def robots(self) -> tuple[str, ...]:
        """All robots that may be called."""
        return () if self.robot_name is None else (self.robot_name, *self.other_robots)

    @property
    def prompt(self) -> str:
        """What the recogniser is told was said before: the names, and the turns in which people ask."""
        call: tuple[str, ...] = _UNCALLED
        if self.robots:
            call = tuple(form.format(name) for form, name in zip(_CALLED, cycle(self.robots), strict=False))
        turns = (
            f"{call[0]} you bring me two? {call[1]} you go there. {call[2]} it back. "
            f"{call[3]} pick it up, move it and put it there."
        )
        return f"{', '.join(_longest(self.names))}. {turns}" if self.names else turns


def _longest(names: Sequence[str]) -> list[str]:
    """The names that stand in no other one: what is said in a longer name is expected alone as well."""
    spaced = [f" {name.lower()} " for name in names]
    return [name for name in names if sum(f" {name.lower()} " in other for other in spaced) == 1]


def of_world(knowledge: Knowledge, *, called: bool) -> Vocabulary:
    """All names of a world; `called` says whether the robot is to be called by its name."""
    groups = (knowledge.surfaces, knowledge.places, knowledge.things, knowledge.people)
    aliases = [alias for group in groups for facts in group.values() for alias in facts.aliases]
    names = [name for group in groups for name in group]
    robot = knowledge.robot.name
    everything = dict.fromkeys([*aliases, *names, *knowledge.categories(), *([robot] if called else [])])
    return Vocabulary(tuple(everything), robot if called else None)


def read_vocabulary(file: Path, robot_name: str | None) -> Vocabulary:
    """The names in a text file, one on each line; empty lines are left out.

    Raises:
        InputError: it cannot be read, is no text, or holds more than 5000 names or one of more than 80 letters.
    """
    lines = [" ".join(line.split()) for line in read_text(file, hint="name a text file in UTF-8").splitlines()]
    for number, line in enumerate(lines, 1):
        if len(line) > _MOST_LETTERS:
            raise InputError("the name is too long", hint="write one name on each line", file=file, line=number)
    names = tuple(dict.fromkeys(filter(None, lines)))
    if len(names) > _MOST_NAMES:
        raise InputError(f"{len(names)} names are too many", hint=f"keep {_MOST_NAMES} at most", file=file)
    return Vocabulary((*names, *([robot_name] if robot_name else [])), robot_name)


_CALLED: Final = ("Hey {}, could", "Hi {}, would", "OK {}, take", "{}, please")
_UNCALLED: Final = ("Could", "Would", "Take", "Please")
