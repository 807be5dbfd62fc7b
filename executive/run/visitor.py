"""What a run is given, and what it tells those who watch it: the log, a page, the store, counters, whoever assigns."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from py_trees.behaviour import Behaviour

from executive.record.work import Work
from executive.run.control import Control
from executive.run.outcome import RobotResult, RobotStatus, RunResult
from executive.run.traffic_table import TrafficTable
from executive.run.watchdog import IMAGE_LIMIT_S, TICK_LIMIT_S, VERB_LIMIT_S, Watchdog
from executive.tree.compiler import CompiledTree
from executive.tree.context import RunContext
from executive.tree.node import Change, Snapshot
from skills.api import Costmap, Detector, Localiser, Worker
from skills.detection import NO_DETECTOR
from skills.robot import Clock, Pose2D, Robot
from skills.stack import RobotStack, default_stack


@dataclass(frozen=True)
class RunEntry:
    """One robot with its tree, estimators, detector and stack.

    The mission begins when the robots `after` have done theirs, and cannot when one of them fails; whoever asked for it
    stands at `speaker_W` (world frame; None: where the robot begins).
    """

    tree: CompiledTree
    robot: Robot
    localiser: Localiser
    costmap: Costmap
    detector: Detector = NO_DETECTOR
    stack: RobotStack = field(default_factory=default_stack)
    after: tuple[str, ...] = ()
    speaker_W: Pose2D | None = None


@dataclass(frozen=True)
class RunSettings:
    """Seed, tick period and limits. `time_limit_s` counts the robots' clock for the whole run, without pauses, and
    `endings_limit_s` what missions that were cancelled always do in the end. `time_of_day_s` is the time of day (s
    after midnight) at which the run begins; None: what it is on this machine.

    The other limits are the watchdog's, on the wall clock: for one verb, for taking a picture, for one robot's tick.
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
    """What a tick brought of the mission that a robot began with, or that took its place; not the halt at its end.

    `changes` are the nodes that changed, `board` all values on the blackboard, and `checkpoints` those of the running
    skills by path id. `pose` is X_WB, given with changes and once a second while the robot is localised, else None;
    `charge` is the battery's (0 to 1), given as often as the pose.
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
    """The state of a run after each tick: node states and mission of each robot, and how it was seen in the last 0.5 s.

    `notes` has the robots whose trees were ticked. Computing the tick took `tick_wall_s` on the wall's clock, which was
    too long `overruns` times so far.
    """

    now_s: float
    ticks: int
    overruns: int
    states: Mapping[str, Snapshot]
    trees: Mapping[str, CompiledTree] = field(default_factory=dict)
    robots: Mapping[str, RobotStatus] = field(default_factory=dict)
    notes: Mapping[str, TickNote] = field(default_factory=dict)
    tick_wall_s: float = 0.0


@dataclass(frozen=True)
class MissionEnd:
    """How one robot's mission ended, and how the robot was last seen (None: never).

    `gone` is why nothing more is asked of this robot in the run: it does not answer, or its lease is another's.
    """

    result: RobotResult
    seen: RobotStatus | None
    gone: str | None = None


class RunVisitor:
    """Watches a run, which calls its visitors in the order of their list. Each method does nothing by itself."""

    def begin(self, settings: RunSettings, worker: Worker) -> None:
        """The run begins. What this raises, `run` raises: no robot has been touched yet."""

    def mission_begun(self, nodes: Sequence[Behaviour], context: RunContext) -> None:
        """A tree of these nodes, parents first, is about to be ticked for the first time."""

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Something was published. Returns it, perhaps with more in it, for the visitors that come after."""
        return message

    def tick(self, progress: Progress) -> None:
        """A tick has passed."""

    def mission_ended(self, end: MissionEnd) -> None:
        """A robot's mission has come to an end, after the tick that ended it was told."""

    def end(self, result: RunResult) -> None:
        """The run is over and all robots stand."""


class Assigner(RunVisitor):
    """Assigns missions to robots while a run goes on; the run's first visitor."""

    def assign(self) -> Sequence[RunEntry]:
        """The missions that begin now, each for a robot that has none; called before each tick.

        The run ends when there is none, and none is under way.
        """
        raise NotImplementedError

    def recall(self, seen: Mapping[str, RobotStatus]) -> Mapping[str, str]:
        """The robots whose missions end now, and why, by how all were last seen."""
        return {}


class Visitors:
    """All visitors of a run, in order. While the run is `ending`, a broken log keeps no robot from being stopped."""

    def __init__(self, visitors: Sequence[RunVisitor]) -> None:
        self._all = tuple(visitors)
        self._readers = tuple(each.message for each in self._all if type(each).message is not RunVisitor.message)
        self.ending = False

    def __iter__(self) -> Iterator[RunVisitor]:
        return iter(self._all)

    def publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """Tells all of a message. Raises what a visitor raises, but not while the run is ending."""
        try:
            for read in self._readers:
                message = read(topic, message)
        except Exception:
            if not self.ending:
                raise


@dataclass
class RunShared:
    """What all robots of a run share. `day_began_s` is the time of day (s after midnight) at the clock's zero."""

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
        limits, told_s = self.settings, self.settings.time_of_day_s
        self.traffic = TrafficTable({}, self.clock.now)
        self.watchdog = Watchdog(min(limits.verb_limit_s, limits.image_limit_s, limits.tick_limit_s))
        now = time.localtime()
        here_s = 3600.0 * now.tm_hour + 60.0 * now.tm_min + now.tm_sec
        self.day_began_s = (here_s if told_s is None else told_s) - self.clock.now()
