"""How missions and runs end: by themselves, or by what stops them."""

from __future__ import annotations

import enum
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from executive.run.watchdog import VerbHung
from executive.tree.compiler import CompiledTree
from executive.tree.node import Snapshot
from executive.tree.nodes.skill_leaf import ERROR_TOPIC
from skills.api import Cause, Publish
from skills.robot import LeaseError, Pose2D


class Outcome(enum.Enum):
    """The end of a mission, the worst last."""

    SUCCESS = "success"  # all that was asked for is done, as far as the tree knows
    FAILURE = "failure"  # something could not be done
    CANCELLED = "cancelled"  # somebody stopped it
    ERROR = "error"  # a defect: an exception, a hung verb


@dataclass(frozen=True)
class Finding:
    """One answer that a mission gave, or was given: by which node, when (s on the robot's clock), and in words."""

    path_id: str
    t_s: float
    question: str
    answer: bool | str | float | None
    sentence: str


@dataclass(frozen=True)
class Said:
    """Something that the robot said or `asked`, and when it began to (s on the robot's clock)."""

    t_s: float
    text: str
    asked: bool = False


@dataclass(frozen=True)
class Execution:
    """One time that a part of a mission ran, from `began_s` to `ended_s` (s on the robot's clock; None: not over).

    It is `done` when it succeeded and nothing that holds it failed or was stopped in that time: what a failed branch,
    attempt or round did was done in vain.
    """

    path_id: str
    began_s: float
    ended_s: float | None = None
    done: bool = False


@dataclass(frozen=True)
class Ending:
    """An end that a tree did not come to by itself."""

    outcome: Outcome
    cause: Cause
    message: str


@dataclass(frozen=True)
class RobotResult:
    """How one robot's mission ended, of its `tree` or of the one that took its place, and the last state of its nodes.

    `answers` has the last answer of each node to a status check by path id, `findings` all answers in order, and `said`
    what the robot said. `preempting` are the results of the missions that came in between, in the order of their ends.
    `stepped_aside` when the robot made way for another after its end. `executions` tells when each part of the mission
    ran, and `moved_s` when a skill that may drive last did (s on the robot's clock; None: never).
    """

    tree: CompiledTree
    outcome: Outcome
    cause: Cause | None
    message: str
    answers: Mapping[str, bool] = field(default_factory=dict)
    states: Snapshot = field(default_factory=dict)
    preempting: tuple[RobotResult, ...] = ()
    findings: tuple[Finding, ...] = ()
    said: tuple[Said, ...] = ()
    stepped_aside: bool = False
    executions: tuple[Execution, ...] = ()
    moved_s: float | None = None

    @property
    def robot_name(self) -> str:
        """The robot's name."""
        return self.tree.robot_name

    def message_of_end(self) -> Mapping[str, object]:
        """What the log says of it."""
        end = {"robot": self.robot_name, "outcome": self.outcome, "cause": self.cause, "message": self.message}
        return {**end, "answers": self.answers}


@dataclass(frozen=True)
class RobotStatus:
    """A robot at one moment: where it believes to be (world frame; None when lost), whether it holds something, and
    its battery's charge (0 to 1; None: not asked for)."""

    pose: Pose2D | None
    holding: bool
    charge: float | None = None


@dataclass(frozen=True)
class RunResult:
    """How a run ended. Times in seconds: `sim_time_s` on the robots' clock, `wall_time_s` on the wall's.

    `overruns` counts the ticks that took longer on the wall clock than the tick period; `work` is what was computed, by
    name.
    """

    robots: tuple[RobotResult, ...]
    ticks: int
    overruns: int
    sim_time_s: float
    wall_time_s: float
    work: Mapping[str, int] = field(default_factory=dict)

    @property
    def trees(self) -> Mapping[str, CompiledTree]:
        """The trees of the missions by robot."""
        return {each.robot_name: each.tree for each in self.robots}

    @property
    def worst(self) -> RobotResult:
        """The robot that ended worst, the first by name among equals."""
        order = list(Outcome)
        return max(self.robots, key=lambda result: order.index(result.outcome))

    @property
    def outcome(self) -> Outcome:
        """Success only when all robots succeeded."""
        return self.worst.outcome


def ending_of(stop: BaseException, publish: Publish) -> Ending:
    """The end of a mission that an exception stopped; the trace of a defect is logged."""
    for kind, (outcome, cause, sentence) in _ENDINGS.items():
        if isinstance(stop, kind):
            return Ending(outcome, cause, str(stop) or sentence)
    trace = "".join(traceback.format_exception(stop))
    publish(ERROR_TOPIC, {"node": "runner", "traceback": trace})
    return Ending(Outcome.ERROR, Cause.ERROR, f"{type(stop).__name__}: {stop}")


_ENDINGS: Final[dict[type[BaseException], tuple[Outcome, Cause, str]]] = {
    KeyboardInterrupt: (Outcome.CANCELLED, Cause.CANCELLED, "cancelled from the keyboard"),
    LeaseError: (Outcome.FAILURE, Cause.PRECONDITION, "the lease is held by another"),
    VerbHung: (Outcome.ERROR, Cause.ERROR, "a verb hung"),
}
