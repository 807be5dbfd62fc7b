"""Missions: a name, a world, and steps that are commands. They come from a sentence or from a YAML file.

A mission file has the keys `name`, `world` ("flat" unless said), `robot` (the world's own unless said) and `steps`. A
step is a sentence, `say: "fetch me a drink"`, or a command, `{take: drink, to: bedroom, do: place, object: drink}`, of
which what is Nothing is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_validator

from executive.command import Command, Task, Thing, parse_command
from executive.errors import InputError, did_you_mean, listing
from executive.knowledge import Knowledge
from executive.language import DependencyParser, Status, understand
from executive.yaml_source import YamlSource, read_yaml, validate

__all__ = [
    "DEFAULT_WORLD",
    "Mission",
    "MissionFile",
    "MissionStep",
    "SourceLine",
    "StepFile",
    "load_mission",
    "mission_from_commands",
    "mission_from_file",
    "mission_from_sentence",
]

DEFAULT_WORLD: Final = "flat"
_NOTHING: Final = "Nothing"
_START: Final = "start"


@dataclass(frozen=True)
class SourceLine:
    """A line of a mission file, from 1."""

    file: Path
    line: int


@dataclass(frozen=True)
class MissionStep:
    """One step's commands, and the line that it comes from (None when it was spoken)."""

    commands: tuple[Command, ...]
    source: SourceLine | None = None


@dataclass(frozen=True)
class Mission:
    """What one robot is to do in one world."""

    name: str
    world: str
    robot_name: str
    steps: tuple[MissionStep, ...]

    @property
    def commands(self) -> tuple[Command, ...]:
        """The commands of all steps, in order."""
        return tuple(command for step in self.steps for command in step.commands)


class StepFile(BaseModel):
    """A step as it stands in a mission file: a sentence, or the parts of a command."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    say: Annotated[str, Field(min_length=1)] | None = None
    take: str | None = None
    to: str | None = None
    do: Task | None = None
    object: str | None = None

    @model_validator(mode="after")
    def _one_form(self) -> StepFile:
        parts = [name for name in ("take", "to", "do", "object") if getattr(self, name) is not None]
        if self.say is not None and parts:
            raise ValueError(f"a step has either 'say' or {listing(parts)}, not both")
        if self.say is None and not parts:
            raise ValueError("the step is empty: give it 'say', or some of 'take', 'to', 'do' and 'object'")
        if (self.do is None) != (self.object is None):
            raise ValueError("'do' and 'object' go together")
        return self


class MissionFile(BaseModel):
    """A mission file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(min_length=1)]
    world: str = DEFAULT_WORLD
    robot: str | None = None
    steps: Annotated[tuple[StepFile, ...], Field(min_length=1)]
    _source: YamlSource | None = PrivateAttr(default=None)

    def error(self, path: tuple[str | int, ...], message: str, mend: str) -> InputError:
        """An error in what stands at `path`, for instance ("world",)."""
        return InputError(message, mend=mend) if self._source is None else self._source.error(path, message, mend)

    def source_line(self, path: tuple[str | int, ...]) -> SourceLine | None:
        """Where `path` stands in the file."""
        return None if self._source is None else SourceLine(self._source.path, self._source.line(path))


def load_mission(path: Path | str) -> MissionFile:
    """Read a mission file.

    Raises:
        InputError: with file, line and mend, for broken YAML, unknown keys and wrong values.
    """
    source = read_yaml(path)
    mission = validate(MissionFile, source)
    mission._source = source
    return mission


def mission_from_file(file: MissionFile | Path | str, *, parser: DependencyParser, knowledge: Knowledge) -> Mission:
    """The mission of a file, its sentences understood and its names checked against `knowledge`.

    Raises:
        InputError: with file, line and mend, also for a sentence that is not understood and for unknown names.
    """
    loaded = file if isinstance(file, MissionFile) else load_mission(file)
    robot_name = loaded.robot or knowledge.robot.name
    steps = tuple(
        MissionStep(_step_commands(loaded, index, parser, knowledge, robot_name), loaded.source_line(("steps", index)))
        for index in range(len(loaded.steps))
    )
    return Mission(loaded.name, loaded.world, robot_name, steps)


def mission_from_sentence(
    sentence: str,
    *,
    parser: DependencyParser,
    knowledge: Knowledge,
    world: str = DEFAULT_WORLD,
    require_wake: bool = False,
) -> Mission:
    """The mission that a sentence asks for.

    Raises:
        InputError: the sentence is refused, leaves a question open or is not for this robot; the message says why.
    """
    answer = understand(sentence, parser=parser, knowledge=knowledge, require_wake=require_wake)
    if answer.status is not Status.OK:
        raise InputError(answer.reason or "the sentence was not understood")
    return mission_from_commands(answer.commands, world=world, robot_name=knowledge.robot.name)


def mission_from_commands(commands: Sequence[Command], *, world: str, robot_name: str) -> Mission:
    """A mission of these commands, named for the first of them."""
    return Mission(_name(commands), world, robot_name, (MissionStep(tuple(commands)),))


def _name(commands: Sequence[Command]) -> str:
    """A few words for the whole: the verb and the thing or place of the first command."""
    first = commands[0] if commands else Command()
    return " ".join(filter(None, (first.verb or "do", str(first.object or first.item or first.goal or ""))))


def _step_commands(
    file: MissionFile, index: int, parser: DependencyParser, knowledge: Knowledge, robot_name: str
) -> tuple[Command, ...]:
    step, path = file.steps[index], ("steps", index)
    if step.say is None:
        return (_typed_command(file, index, knowledge),)
    answer = understand(step.say, parser=parser, knowledge=knowledge, require_wake=False, robot_name=robot_name)
    if answer.status is not Status.OK:
        reason = answer.reason or "the sentence was not understood"
        raise file.error((*path, "say"), reason, "say it in other words, or write take, to, do and object")
    return answer.commands


def _typed_command(file: MissionFile, index: int, knowledge: Knowledge) -> Command:
    """The command of a step that gives its parts, with every name checked."""
    step, path = file.steps[index], ("steps", index)
    task = _NOTHING if step.do is None else step.do.value
    parts = [part or _NOTHING for part in (step.take, step.to, task, step.object)]
    try:
        command = parse_command("Take [{}] to [{}] and do [{}] to [{}]".format(*parts))
    except ValueError as error:
        raise file.error(path, str(error), "write names in plain words") from error
    for unknown in _unknown_names(file, path, command, knowledge):
        raise unknown
    return _known(command, knowledge)


def _unknown_names(
    file: MissionFile, path: tuple[str | int, ...], command: Command, knowledge: Knowledge
) -> Iterator[InputError]:
    for key, thing in (("take", command.item), ("object", command.object)):
        if thing is not None and knowledge.thing(thing.name) is None:
            yield _unknown(file, (*path, key), "thing", thing.name, knowledge.thing_names(), knowledge)
    goals = (*knowledge.place_names(), *knowledge.people, _START)
    if command.goal is not None and _goal(command.goal, knowledge) is None:
        yield _unknown(file, (*path, "to"), "place or person", command.goal, goals, knowledge)
    if command.goal_at is not None and knowledge.place(command.goal_at) is None:
        yield _unknown(file, (*path, "to"), "place", command.goal_at, knowledge.place_names(), knowledge)


def _unknown(
    file: MissionFile, path: tuple[str | int, ...], kind: str, name: str, known: Sequence[str], knowledge: Knowledge
) -> InputError:
    near = did_you_mean(name, knowledge.spellings(known))
    mend = f"did you mean {near!r}?" if near else f"known are {listing(known)}"
    return file.error(path, f"unknown {kind} {name!r}", mend)


def _known(command: Command, knowledge: Knowledge) -> Command:
    """The command in the world's own names."""

    def named(thing: Thing | None) -> Thing | None:
        return thing and Thing(knowledge.thing(thing.name) or thing.name, thing.attributes)

    return Command(
        item=named(command.item),
        goal=command.goal and _goal(command.goal, knowledge),
        goal_at=command.goal_at and knowledge.place(command.goal_at),
        task=command.task,
        object=named(command.object),
        item_count=command.item_count,
        object_count=command.object_count,
    )


def _goal(name: str, knowledge: Knowledge) -> str | None:
    return _START if name == _START else knowledge.place(name) or knowledge.person(name)
