"""What a mission is, as plain data: steps, and the policy under which each runs."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from executive.words.blocks import Block, Group, steps_of
from executive.words.command import Command
from executive.words.expression import Value
from skills.files.errors import InputError, SourceLine

__all__ = [
    "DEFAULT_WORLD",
    "KeyPath",
    "Mission",
    "MissionStep",
    "OnFailure",
    "OperatorQuestion",
    "SkillCall",
    "SourceLine",
    "StaleData",
    "StepGuards",
    "StepPolicy",
]

DEFAULT_WORLD: Final = "flat"
KeyPath = tuple[str | int, ...]


class StaleData(enum.Enum):
    """What a condition makes of a reading that is older than it may be."""

    WAIT = "wait"  # stand still until there is a new one, and fail when the patience is over
    FAIL = "fail"  # count it as violated at once
    ACCEPT = "accept"  # judge by what there is


class OnFailure(enum.Enum):
    """What to do when a step has failed and no retries are left."""

    STOP = "stop"  # the mission fails
    RETRY = "retry"  # try again, once unless `retries` says otherwise, then stop
    SKIP = "skip"  # note it and go on with the next step; the mission's result names what was skipped
    ASK = "ask"  # ask the operator: retry, skip or stop
    RETURN = "return"  # go back to where the mission began, then stop


@dataclass(frozen=True)
class OperatorQuestion:
    """What to ask the operator; after `limit_s` on the robot's clock `default` counts as the answer."""

    text: str | None = None
    limit_s: float = 60.0
    default: str = "stop"


@dataclass(frozen=True)
class StepGuards:
    """What must hold while a step runs.

    `battery` is the least charge (0 to 1), `localised` that the robot knows where it is, `time_s` that no more than
    so many seconds have passed on the robot's clock since the run began; `stale` says what old readings mean (None:
    an old charge is accepted, an old place is waited for).
    """

    battery: float | None = None
    localised: bool = False
    time_s: float | None = None
    stale: StaleData | None = None


@dataclass(frozen=True)
class StepPolicy:
    """How a step or a mission runs: a limit for each attempt, further attempts, guards, and what if it fails.

    `pick_ups` is how often an object that falls on the way is picked up again; None: as the mission says, else twice.
    `move_aside` is how many objects may be moved aside that stand in the way; None: as the mission says, else none.
    """

    timeout_s: float | None = None
    retries: int = 0
    on_failure: OnFailure = OnFailure.STOP
    question: OperatorQuestion = OperatorQuestion()
    guards: StepGuards = StepGuards()
    pick_ups: int | None = None
    move_aside: int | None = None


@dataclass(frozen=True)
class SkillCall:
    """A skill with the values of its ports as they stand in the file.

    `gives` maps output ports to names, under which later steps read them. `places` tells the line of each value by its
    path below the step.
    """

    skill: str
    values: Mapping[str, Any] = field(default_factory=dict)
    gives: Mapping[str, str] = field(default_factory=dict)
    file: Path | None = None
    places: Mapping[KeyPath, int] = field(default_factory=dict)

    def error(self, path: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at `path` below the step."""
        known = (self.places[path[:n]] for n in range(len(path), -1, -1) if path[:n] in self.places)
        return InputError(message, hint=hint, file=self.file, line=next(known, None))


@dataclass(frozen=True)
class MissionStep:
    """One step: commands, a skill, the steps of another mission, or a block. `source` is None when it was spoken.

    With `elsewhere`, an object that is not in its place is also searched for elsewhere. `gives` maps what a status
    check answers ("answer", "count") to names, under which later steps read them.
    """

    commands: tuple[Command, ...] = ()
    source: SourceLine | None = None
    policy: StepPolicy = StepPolicy()
    skill: SkillCall | None = None
    used: Mission | None = None
    elsewhere: bool = True
    block: Block | None = None
    gives: Mapping[str, str] = field(default_factory=dict)

    def walk(self) -> Iterator[MissionStep]:
        """Itself and all steps that it holds, those of a used mission included."""
        yield self
        if self.used is not None:
            yield from self.used.walk()
        if self.block is not None:
            for step in steps_of(self.block):
                yield from step.walk()


@dataclass(frozen=True)
class Mission:
    """What one robot is to do in one world.

    `source` is the line of its name, None when it was spoken; `notes` say which name in a sentence was taken for which.
    `variables` are its values by name, as they are at the beginning. `whole` is what is watched while its steps run and
    what is done at the end (a group without steps of its own); None for nothing.
    """

    name: str
    world: str
    robot_name: str
    steps: tuple[MissionStep, ...]
    policy: StepPolicy = StepPolicy()
    source: SourceLine | None = None
    notes: tuple[str, ...] = ()
    variables: Mapping[str, Value] = field(default_factory=dict)
    whole: Group | None = None

    @property
    def commands(self) -> tuple[Command, ...]:
        """The commands of all steps, those of used missions included, in order."""
        return tuple(command for step in self.walk() for command in step.commands)

    def walk(self) -> Iterator[MissionStep]:
        """All steps in order; a step that holds others comes before them."""
        own = () if self.whole is None else tuple(steps_of(self.whole))
        for step in (*self.steps, *own):
            yield from step.walk()
