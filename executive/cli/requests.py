"""What the user asks for, a sentence or a mission file, in one world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from executive.cli.answers import NO_ANSWERS, Answers
from executive.cli.worlds import knowledge_of, open_world
from executive.language import Understanding, load_parser
from executive.mission.command import parse_command
from executive.mission.errors import InputError
from executive.mission.knowledge import Knowledge
from executive.mission.mission import (
    DEFAULT_WORLD,
    Mission,
    MissionFile,
    load_mission,
    mission_from_commands,
    mission_from_file,
    mission_from_meaning,
    overridden,
    understood,
)
from executive.tree.compiler import CompiledTree, compile_mission
from executive.tree.registry import installed_skills
from plant.worlds.world import World


@dataclass(frozen=True)
class Request:
    """A mission, the world that it runs in, and what is known of that; `meant` is the sentence that it comes from."""

    mission: Mission
    world: World
    knowledge: Knowledge
    meant: Understanding | None = None

    def compile(self) -> CompiledTree:
        """The mission's tree. Raises InputError."""
        return compile_mission(self.mission, knowledge=self.knowledge, registry=installed_skills())


def said(text: str, *, world: str | None, require_wake: bool, answers: Answers = NO_ANSWERS) -> Request:
    """The request of a sentence; `answers` are to the questions that it leaves open.

    Raises:
        InputError: the world is unknown or its knowledge broken, or the sentence was not understood.
    """
    opened = open_world(world or DEFAULT_WORLD)
    knowledge = knowledge_of(opened)
    meant = understood(
        text, parser=load_parser(), knowledge=knowledge, require_wake=require_wake, answer=answers.answerer(None)
    )
    mission = mission_from_meaning(meant, world=opened.name, robot_name=knowledge.robot.name)
    return Request(mission, opened, knowledge, meant)


def commanded(commands: Sequence[str], *, name: str, robot: str, world: str | None) -> Request:
    """The request of a mission of which only the commands are known, as text.

    Raises:
        InputError: the world is unknown or its knowledge broken, or a command is none.
    """
    opened = open_world(world or DEFAULT_WORLD)
    knowledge = knowledge_of(opened)
    try:
        read = [parse_command(command) for command in commands]
    except ValueError as error:
        raise InputError(f"the mission '{name}' cannot be read: {error}", mend="give it again") from error
    mission = mission_from_commands(read, world=opened.name, robot_name=robot)
    return Request(replace(mission, name=name), opened, knowledge)


def filed(file: Path, *, world: str | None, answers: Answers = NO_ANSWERS) -> Request:
    """The request of a mission file; `world` stands in for the file's own, `answers` are to open questions.

    Raises:
        InputError: with file and line: the file is broken, its world unknown, or a step not understood.
    """
    loaded = load_mission(file)
    opened = open_world(world) if world is not None else _own_world(loaded)
    knowledge = overridden(loaded, knowledge_of(opened))
    answer = answers.answerer(loaded.questions)
    mission = mission_from_file(loaded, parser=load_parser(), knowledge=knowledge, answer=answer)
    return Request(mission, opened, knowledge)


def _own_world(loaded: MissionFile) -> World:
    try:
        return open_world(loaded.world)
    except InputError as error:
        raise loaded.error(("world",), error.message, error.mend) from error
