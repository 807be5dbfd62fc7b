"""Inputs of a run, and the visitors that watch it: log, page, store, counters, and the assigner of missions."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from py_trees.behaviour import Behaviour

from executive.run.control import Control
from executive.run.outcome import RobotResult, RobotStatus, RunResult
from executive.run.traffic_table import TrafficTable
from executive.run.watchdog import IMAGE_LIMIT_S, TICK_LIMIT_S, VERB_LIMIT_S, Watchdog
from executive.run.work import Work
from executive.tree.compiler import CompiledTree
from executive.tree.context import RunContext
from executive.tree.node import Change, Snapshot
from skills.api import Costmap, Detector, Localiser, Worker
from skills.detection import NO_DETECTOR
from skills.robot import Clock, Pose2D, Robot
from skills.stack import RobotStack, default_stack


@dataclass(frozen=True)
class RunEntry:
    """Robot with its tree, estimators, detector and stack.

    The mission begins when the missions of the robots `after` have succeeded, and fails when one of these fails. The
    person who asked for the mission stands at `speaker_W` (world frame; None: where the robot begins). `solid_columns`
    are walls and furniture on its map (`skills.api.SkillContext`). People stand around a `real` robot: when another
    program has taken its lease, or it does not answer, the run pauses (`Session.may_move`).
    """

    tree: CompiledTree
    robot: Robot
    localiser: Localiser
    costmap: Costmap
    detector: Detector = NO_DETECTOR
    stack: RobotStack = field(default_factory=default_stack)
    after: tuple[str, ...] = ()
    speaker_W: Pose2D | None = None
    solid_columns: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    real: bool = False


@dataclass(frozen=True)
class RunSettings:
    """Seed, tick period and limits of a run.

    `time_limit_s` limits the whole run on the robots' clock, without pauses, and `endings_limit_s` limits the steps
    under `always` of cancelled missions. `time_of_day_s` is the time of day (s after midnight) at which the run begins
    (None: the time of this machine). The watchdog has limits on the wall clock for one verb, one picture, and one
    robot's tick.
    """

    seed: int = 0
    tick_period_s: float = 0.05
    time_limit_s: float = 1200.0
    endings_limit_s: float = 120.0
    time_of_day_s: float | None = None
    verb_limit_s: float = VERB_LIMIT_S
    image_limit_s: float = IMAGE_LIMIT_S
    tick_limit_s: float = TICK_LIMIT_S


@dataclass(frozen=True)
class TickNote:
    """Changes that one tick made in a robot's first mission or its replacement; the final halt gives no note.

    `changes` are the nodes that changed, `board` has all values on the blackboard, and `checkpoints` has the
    checkpoints of running skills by path id. `pose` is X_WB, given once a second and with each change while the robot
    is localised, else None. `charge` is the battery's charge (0 to 1), given as often as the pose.
    """

    tree: CompiledTree
    now_s: float
    changes: Sequence[Change]
    board: Mapping[str, Any]
    pose: Pose2D | None
    checkpoints: Mapping[str, Mapping[str, Any]]
    charge: float | None = None


@dataclass(frozen=True)
class Progress:
    """State of a run after a tick: node states, mission and status (at most 0.5 s old) of each robot.

    `notes` has the notes of the robots whose trees were ticked. The tick took `tick_wall_s` on the wall clock;
    `overruns` counts the ticks that took too long so far. The time limit ends the run in `left_s`.
    """

    now_s: float
    ticks: int
    overruns: int
    states: Mapping[str, Snapshot]
    trees: Mapping[str, CompiledTree] = field(default_factory=dict)
    robots: Mapping[str, RobotStatus] = field(default_factory=dict)
    notes: Mapping[str, TickNote] = field(default_factory=dict)
    tick_wall_s: float = 0.0
    left_s: float = math.inf


@dataclass(frozen=True)
class MissionEnd:
    """End of one robot's mission, with the robot's last status (None: never read).

    `gone` is the reason why the run no longer uses the robot: the robot does not answer, or its lease is lost.
    """

    result: RobotResult
    seen: RobotStatus | None
    gone: str | None = None


class RunVisitor:
    """Base class of visitors, which the run calls in the order of their list. By default each method does nothing."""

    def begin(self, settings: RunSettings, worker: Worker) -> None:
        """Handles the beginning of the run, before any robot is used; `run` raises the errors of this method."""

    def mission_begun(self, nodes: Sequence[Behaviour], context: RunContext) -> None:
        """Handles a new tree of these nodes, parents first, before its first tick."""

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Handles a published message; returns it, perhaps extended, for the visitors that come after."""
        return message

    def tick(self, progress: Progress) -> None:
        """Handles the state of the run after a tick."""

    def mission_ended(self, end: MissionEnd) -> None:
        """Handles the end of a robot's mission, after the `tick` that ended it."""

    def end(self, result: RunResult) -> None:
        """Handles the end of the run, when all robots stand."""


class Assigner(RunVisitor):
    """Assigner of missions to robots during a run, and the run's first visitor; extends the time limit by `more_s`."""

    more_s: float = 0.0

    def assign(self) -> Sequence[RunEntry]:
        """Returns the missions that begin now, each for a robot without a mission; called before each tick.

        The run ends when it returns no mission, and no mission is under way.
        """
        raise NotImplementedError

    def recall(self, seen: Mapping[str, RobotStatus]) -> Mapping[str, str]:
        """Returns the robots whose missions must end now, with reasons; `seen` has the last status of all robots."""
        return {}


class Visitors:
    """All visitors of a run, in order. While the run is `ending`, errors of visitors are ignored."""

    def __init__(self, visitors: Sequence[RunVisitor]) -> None:
        self._all = tuple(visitors)
        self._readers = tuple(each.message for each in self._all if type(each).message is not RunVisitor.message)
        self.ending = False

    def __iter__(self) -> Iterator[RunVisitor]:
        return iter(self._all)

    def publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """Passes a message to all visitors. Raises their errors, but not while the run is ending."""
        try:
            for read in self._readers:
                message = read(topic, message)
        except Exception:
            if not self.ending:
                raise


@dataclass
class RunShared:
    """Objects that all robots in a run share; `day_began_s` is the time of day (s after midnight) at clock zero."""

    clock: Clock
    worker: Worker
    visitors: Visitors
    settings: RunSettings
    control: Control
    work: Work = field(default_factory=Work)
    traffic: TrafficTable = field(init=False)
    watchdog: Watchdog = field(init=False)
    day_began_s: float = field(init=False)

    def __post_init__(self) -> None:
        limits, begin_s = self.settings, self.settings.time_of_day_s
        self.traffic = TrafficTable({}, self.clock.now)
        self.watchdog = Watchdog(min(limits.verb_limit_s, limits.image_limit_s, limits.tick_limit_s))
        now = time.localtime()
        here_s = 3600.0 * now.tm_hour + 60.0 * now.tm_min + now.tm_sec
        self.day_began_s = (here_s if begin_s is None else begin_s) - self.clock.now()
