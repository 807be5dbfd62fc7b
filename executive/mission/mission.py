"""Missions of what was said: from a sentence to its meaning, from commands to a mission. Those of files: `file`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executive.language import DependencyParser, Status, Understanding
from executive.language.questions import Answerer, QuestionPolicy, answer_by
from executive.language.understand import understand_asking
from executive.mission.command import Command
from executive.mission.errors import InputError
from executive.mission.file.model import Mission, MissionStep
from executive.mission.knowledge import Knowledge

__all__ = ["mission_from_commands", "mission_from_meaning", "understood"]


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
    nobody = answer_by(QuestionPolicy.REFUSE)
    meant = understand_asking(
        sentence, answer=answer or nobody, parser=parser, knowledge=knowledge, require_wake=require_wake
    )
    if meant.status is not Status.OK:
        raise InputError(meant.reason or "the sentence was not understood")
    return meant


def mission_from_meaning(meant: Understanding, *, world: str, robot_name: str) -> Mission:
    """The mission of a sentence that was understood."""
    mission = mission_from_commands(meant.commands, world=world, robot_name=robot_name)
    return replace(mission, notes=meant.notes)


def mission_from_commands(commands: Sequence[Command], *, world: str, robot_name: str) -> Mission:
    """A mission of these commands, named for the first of them."""
    return Mission(_name(commands), world, robot_name, (MissionStep(tuple(commands)),))


def _name(commands: Sequence[Command]) -> str:
    """A few words for the whole: the verb and the thing or place of the first command."""
    first = commands[0] if commands else Command()
    return " ".join(filter(None, (first.verb or "do", str(first.object or first.item or first.goal or ""))))
