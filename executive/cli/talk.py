"""The conversation beside a run of the command line: how its sentences are parsed and compiled."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace

from executive.cli.requests import Prepared
from executive.conversation import Conversation, Speech
from executive.language import Understanding, load_parser, understand
from executive.language.parser import SpacyParser
from executive.language.reference import Memory
from executive.mission.command import Command
from executive.mission.mission import mission_from_commands
from executive.run.control import Control
from executive.tree.compiler import CompiledTree, compile_mission
from executive.tree.registry import installed_skills

__all__ = ["LateParser", "conversation_of"]


class LateParser:
    """The parser, loaded when it is first needed, or ahead of that in a thread of its own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._parser: SpacyParser | None = None

    def __call__(self) -> SpacyParser:
        """The parser. Raises InputError when the model is missing."""
        with self._lock:
            if self._parser is None:
                self._parser = load_parser()
            return self._parser

    def load_ahead(self) -> None:
        """Begin to load it."""
        threading.Thread(target=lambda: self().load(), name="errand-parser", daemon=True).start()


def conversation_of(
    prepared: Prepared, control: Control, parser: LateParser, *, require_wake: bool = False
) -> Conversation:
    """A conversation with the robot of a request, in its world."""
    speech = Speech(
        knowledge=prepared.knowledge,
        robot_name=prepared.mission.robot_name,
        understand=lambda text, memory: _understood(text, memory, prepared, parser),
        compile=lambda commands, taken: _compiled(commands, taken, prepared),
    )
    return Conversation(speech, control, require_wake=require_wake, others=prepared.knowledge.robot.others)


def _understood(text: str, memory: Memory | None, prepared: Prepared, parser: LateParser) -> Understanding:
    return understand(
        text,
        parser=parser(),
        knowledge=prepared.knowledge,
        require_wake=False,
        robot_name=prepared.mission.robot_name,
        memory=memory,
    )


def _compiled(commands: Sequence[Command], taken: frozenset[str], prepared: Prepared) -> CompiledTree:
    """The tree of a mission of these commands, under a name that is not taken. Raises InputError."""
    mission = mission_from_commands(commands, world=prepared.world.name, robot_name=prepared.mission.robot_name)
    names = (mission.name, *(f"{mission.name} {number}" for number in range(2, len(taken) + 3)))
    name = next(each for each in names if each not in taken)
    return compile_mission(replace(mission, name=name), knowledge=prepared.knowledge, registry=installed_skills())
