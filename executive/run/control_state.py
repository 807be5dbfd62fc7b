"""What a control says of a run, and what it asks of the runner at one moment."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.tree.compiler import CompiledTree
from skills.api import Question


class Mode(enum.Enum):
    """What a run does just now; the strongest reason not to move counts."""

    READY = "ready"  # it has not begun
    RUNNING = "running"  # trees are ticked
    PAUSED = "paused"  # by the operator or at a breakpoint
    LEASE_LOST = "lease lost"  # another moves the robot
    STOPPED = "stopped"  # the stop button is pressed
    ENDED = "ended"  # it is over


@dataclass(frozen=True)
class RobotMode:
    """What one robot of a run does just now, and why it does not move."""

    mode: Mode
    reason: str = ""


@dataclass(frozen=True)
class OpenQuestion:
    """A robot's question and until when it may be answered, on the robot's clock."""

    question: Question
    until_s: float
    robot: str = ""

    @property
    def id(self) -> str:
        """The question's id."""
        return self.question.id

    @property
    def options(self) -> tuple[str, ...]:
        """The answers to choose from; empty when any text will do."""
        return self.question.options


@dataclass(frozen=True)
class ControlState:
    """What can be seen of a run's control at one moment.

    `version` grows with every change. `mode` is that of the whole run, `robots` has that of each robot. `missions`
    gives for each robot the missions begun and not ended, the one under way last. `at` is the path id of the breakpoint
    that the run waits at; `buttons` are those that missions wait for or decide by.
    """

    version: int = 0
    mode: Mode = Mode.READY
    reason: str = ""
    at: str | None = None
    questions: tuple[OpenQuestion, ...] = ()
    breakpoints: frozenset[str] = frozenset()
    missions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    buttons: tuple[str, ...] = ()
    robots: Mapping[str, RobotMode] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """Something done through or told by the control, for the log."""

    what: str
    message: str


@dataclass(frozen=True)
class Replacement:
    """A mission, and the name of the one whose place it takes; None is the one under way."""

    tree: CompiledTree
    instead_of: str | None = None


@dataclass(frozen=True)
class ControlRequests:
    """What is asked of the run now; `preempts` are missions to do first, `instead` and `later` as they say.

    `insists` says that a run that is cancelled already was cancelled once more. `holds` says for single robots why they
    stand still, `cancels` names those whose missions end, and why.
    """

    cancel: str | None = None
    insists: bool = False
    hold: str | None = None
    breakpoints: frozenset[str] = frozenset()
    events: tuple[Event, ...] = ()
    preempts: tuple[CompiledTree, ...] = ()
    instead: tuple[Replacement, ...] = ()
    later: tuple[CompiledTree, ...] = ()
    holds: Mapping[str, str] = field(default_factory=dict)
    cancels: tuple[tuple[str, str], ...] = ()

    @property
    def of_robots(self) -> bool:
        """Returns whether anything is asked of single robots, or they are to stand still."""
        asked = self.preempts or self.instead or self.later or self.cancels or self.holds
        return bool(asked) or self.hold is not None

    def held(self, robot_name: str) -> bool:
        """Returns whether a robot stands still, alone or with all others."""
        return self.hold is not None or robot_name in self.holds
