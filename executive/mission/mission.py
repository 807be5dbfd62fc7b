"""Missions of what was said: from a sentence to its meaning, from commands to a mission. Those of files: `file`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from executive.language.questions import Answerer, QuestionPolicy, answer_by
from executive.words.command import Command, parse_command
from executive.words.knowledge import Knowledge
from executive.words.steps import Mission, MissionStep
from executive.words.written import parse_written, written
from skills.files.errors import InputError

if TYPE_CHECKING:
    from executive.language.parser import DependencyParser
    from executive.language.understand import Understanding

__all__ = [
    "lines_of",
    "mission_from_commands",
    "mission_from_lines",
    "mission_from_meaning",
    "mission_from_steps",
    "steps_of",
    "understood",
]


def understood(
    sentence: str,
    *,
    parser: DependencyParser,
    knowledge: Knowledge,
    require_wake: bool = False,
    answer: Answerer | None = None,
) -> Understanding:
    """What a sentence means when it can be done; `answer` is asked where it could mean several things.

    Raises:
        InputError: it is refused, leaves a question open or is not for this robot; the message says why.
    """
    from executive.language.understand import Status, understand_asking

    nobody = answer_by(QuestionPolicy.REFUSE)
    meant = understand_asking(
        sentence, answer=answer or nobody, parser=parser, knowledge=knowledge, require_wake=require_wake
    )
    if meant.status is not Status.OK:
        raise InputError(meant.reason or "the sentence was not understood")
    return meant


def mission_from_meaning(meant: Understanding, *, world: str, robot_name: str) -> Mission:
    """The mission of a sentence that was understood."""
    return replace(mission_from_steps(steps_of(meant), world=world, robot_name=robot_name), notes=meant.notes)


def steps_of(meant: Understanding) -> tuple[MissionStep, ...]:
    """The steps of a sentence that was understood."""
    return meant.steps or (MissionStep(meant.commands),)


def mission_from_commands(commands: Sequence[Command], *, world: str, robot_name: str) -> Mission:
    """A mission of these commands, named for the first of them."""
    return mission_from_steps((MissionStep(tuple(commands)),), world=world, robot_name=robot_name)


def mission_from_steps(steps: Sequence[MissionStep], *, world: str, robot_name: str) -> Mission:
    """A mission of these steps, named for the first command, or else for the first block."""
    mission = Mission("", world, robot_name, tuple(steps))
    return replace(mission, name=_name(mission))


def mission_from_lines(lines: Sequence[str], *, world: str, robot_name: str) -> Mission:
    """The mission of commands in their text form, or of steps in their written form. Raises ValueError."""
    try:
        steps: tuple[MissionStep, ...] = (MissionStep(tuple(map(parse_command, lines))),)
    except ValueError:
        steps = parse_written(lines)
    return mission_from_steps(steps, world=world, robot_name=robot_name)


def lines_of(steps: Sequence[MissionStep]) -> tuple[str, ...]:
    """What `mission_from_lines` reads: the commands where there are only such, else the written form.

    Of a mission file, whose steps can be more than that, only the commands.
    """
    walked = [step for one in steps for step in one.walk()]
    if all(step.block is None for step in walked) or any(step.source is not None for step in walked):
        return tuple(str(command) for step in walked for command in step.commands)
    return written(steps)


def _name(mission: Mission) -> str:
    """A few words for the whole: the verb and the thing or place of the first command."""
    commands = mission.commands
    block = mission.steps[0].block if mission.steps else None
    if not commands and block is not None:
        return type(block).__name__.lower()
    first = commands[0] if commands else Command()
    return " ".join(filter(None, (first.verb or "do", str(first.object or first.item or first.goal or ""))))
