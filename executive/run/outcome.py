"""Outcomes of missions and runs, and the endings that stop them."""

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
from skills.robot import LeaseError, Pose2D, RobotStoppedError


class Outcome(enum.Enum):
    """Outcome of a mission, in order from the best to the worst."""

    SUCCESS = "success"  # everything is done, as far as the tree knows
    FAILURE = "failure"  # something could not be done
    CANCELLED = "cancelled"  # somebody stopped it
    ERROR = "error"  # a defect: an exception, a hung verb


@dataclass(frozen=True)
class Finding:
    """Answer that a node gave or received at `t_s` (s on the robot's clock), as a value and as a sentence.

    A number is the least possible one if it is `at_least` so.
    """

    path_id: str
    t_s: float
    question: str
    answer: bool | str | float | None
    sentence: str
    at_least: bool = False


@dataclass(frozen=True)
class Said:
    """Sentence that the robot began to say, or `asked`, at `t_s` (s on the robot's clock).

    In a silent zone, named by `silent`, the sentence was shown instead of spoken.
    """

    t_s: float
    text: str
    asked: bool = False
    silent: str = ""


@dataclass(frozen=True)
class Execution:
    """One execution of a step in a mission, from `began_s` to `ended_s` (s on the robot's clock; None: not ended).

    It is `done` when it `succeeded` and no node above it failed or was stopped in that time: work in a failed branch,
    attempt or round does not count.
    """

    path_id: str
    began_s: float
    ended_s: float | None = None
    done: bool = False
    succeeded: bool = False


@dataclass(frozen=True)
class Ending:
    """End of a mission that something other than its tree determined."""

    outcome: Outcome
    cause: Cause
    message: str


@dataclass(frozen=True)
class RobotResult:
    """Result of one robot's mission, or of the mission that replaced it, with the last states of the nodes.

    `answers` maps the path id of each status check to its last answer, `findings` has all answers in order, and `said`
    all sentences of the robot. `preempting` has the results of missions that interrupted this one, in the order in
    which they ended. `stepped_aside` is set when the robot cleared a reserved path after its mission. `executions` has
    the times at which the mission's steps ran; `moved_s` is the time at which a skill that may drive last ran (s on the
    robot's clock; None: never).
    """

    tree: CompiledTree
    outcome: Outcome
    cause: Cause | None
    message: str
    answers: Mapping[str, int] = field(default_factory=dict)
    states: Snapshot = field(default_factory=dict)
    preempting: tuple[RobotResult, ...] = ()
    findings: tuple[Finding, ...] = ()
    said: tuple[Said, ...] = ()
    stepped_aside: bool = False
    executions: tuple[Execution, ...] = ()
    moved_s: float | None = None

    @property
    def robot_name(self) -> str:
        """Name of the robot."""
        return self.tree.robot_name

    def message_of_end(self) -> Mapping[str, object]:
        """Message for the log at the end of the mission."""
        end = {"robot": self.robot_name, "outcome": self.outcome, "cause": self.cause, "message": self.message}
        return {**end, "answers": self.answers}


@dataclass(frozen=True)
class RobotStatus:
    """Status of a robot at one moment: its estimated pose (world frame; None: not localised), whether its gripper holds
    an object, and the charge of its battery (0 to 1; None: not read)."""

    pose: Pose2D | None
    holding: bool
    charge: float | None = None


@dataclass(frozen=True)
class RunResult:
    """Result of a run. Times in seconds: `sim_time_s` on the robots' clock, `wall_time_s` on the wall clock.

    `overruns` counts the ticks that took longer on the wall clock than the tick period; `work` has the work counters by
    name.
    """

    robots: tuple[RobotResult, ...]
    ticks: int
    overruns: int
    sim_time_s: float
    wall_time_s: float
    work: Mapping[str, int] = field(default_factory=dict)

    @property
    def every(self) -> tuple[RobotResult, ...]:
        """Results of all missions; a mission that interrupted another comes before it."""
        return tuple(each for robot in self.robots for each in (*robot.preempting, robot))

    @property
    def trees(self) -> Mapping[str, CompiledTree]:
        """Trees of the missions by the robot's name."""
        return {each.robot_name: each.tree for each in self.robots}

    @property
    def worst(self) -> RobotResult:
        """Result of the robot with the worst outcome; of several such robots, the first by name."""
        order = list(Outcome)
        return max(self.robots, key=lambda result: order.index(result.outcome))

    @property
    def outcome(self) -> Outcome:
        """Outcome of the whole run: success only if all robots succeeded."""
        return self.worst.outcome


def ending_of(stop: BaseException, publish: Publish) -> Ending:
    """Returns the ending for an exception that stopped a mission; logs the traceback of a defect."""
    for kind, (outcome, cause, sentence) in _ENDINGS.items():
        if isinstance(stop, kind):
            return Ending(outcome, cause, str(stop) or sentence)
    trace = "".join(traceback.format_exception(stop))
    publish(ERROR_TOPIC, {"node": "runner", "traceback": trace})
    return Ending(Outcome.ERROR, Cause.ERROR, f"{type(stop).__name__}: {stop}")


_ENDINGS: Final[dict[type[BaseException], tuple[Outcome, Cause, str]]] = {
    KeyboardInterrupt: (Outcome.CANCELLED, Cause.CANCELLED, "cancelled from the keyboard"),
    LeaseError: (Outcome.FAILURE, Cause.PRECONDITION, "the lease is held by another"),
    RobotStoppedError: (Outcome.FAILURE, Cause.EXECUTION, "the robot has stopped"),
    VerbHung: (Outcome.ERROR, Cause.ERROR, "a verb hung"),
}
