"""Missions of what was said: from a sentence to its meaning, from commands to a mission."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from executive.language.questions import Answerer, answer_by
from executive.words.command import Command, parse_command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Do, steps_of_commands
from executive.words.mission import Mission, QuestionPolicy
from executive.words.step import Step
from executive.words.yaml_steps import steps_from_yaml, steps_to_yaml
from skills.files.errors import InputError

if TYPE_CHECKING:
    from executive.language.parser import DependencyParser
    from executive.language.understand import Understanding


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
    return mission_from_steps(steps_of(meant), world=world, robot_name=robot_name).with_notes(meant.notes)


def steps_of(meant: Understanding) -> tuple[Step, ...]:
    """The steps of a sentence that was understood."""
    return meant.steps or steps_of_commands(meant.commands)


def mission_from_commands(commands: Sequence[Command], *, world: str, robot_name: str) -> Mission:
    """A mission of these commands, named for the first of them."""
    return mission_from_steps(steps_of_commands(commands), world=world, robot_name=robot_name)


def mission_from_steps(steps: Sequence[Step], *, world: str, robot_name: str) -> Mission:
    """A mission of these steps, named for the first command, or else for the first block."""
    return Mission(name=_name(steps), world=world, robot=robot_name or None, steps=tuple(steps))


def mission_from_lines(lines: Sequence[str], *, world: str, robot_name: str) -> Mission:
    """The mission of commands in their text form, or of steps in YAML. Raises ValueError."""
    try:
        steps: Sequence[Step] = steps_of_commands(tuple(map(parse_command, lines)))
    except ValueError:
        steps = steps_from_yaml(lines)
    return mission_from_steps(steps, world=world, robot_name=robot_name)


def lines_of(steps: Sequence[Step]) -> tuple[str, ...]:
    """What `mission_from_lines` reads: the commands where there are only such, else the steps in YAML.

    Of a mission file, whose steps can be more than that, only the commands.
    """
    walked = [step for one in steps for step in one.walk()]
    if all(isinstance(step, Do) for step in walked) or any(step.source is not None for step in walked):
        return tuple(str(command) for step in walked for command in step.commands)
    return steps_to_yaml(steps)


def _name(steps: Sequence[Step]) -> str:
    """A few words for the whole: the verb and the thing or place of the first command."""
    first = next((command for step in steps for each in step.walk() for command in each.commands), None)
    if first is None:
        return type(steps[0]).__name__.lower() if steps else "do"
    return " ".join(filter(None, (first.verb or "do", str(first.object or first.item or first.goal or ""))))
