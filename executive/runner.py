"""The runner: the only place that advances time and ticks trees."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from executive.behaviours.board import Board
from executive.behaviours.context import RunContext
from executive.behaviours.skill_leaf import ERROR_TOPIC
from executive.compiler import CompiledTree
from executive.compiling.workshop import slug
from executive.journal import Journal
from executive.outcome import Outcome, RobotResult, RunResult
from executive.record.ticks import TickMeter
from executive.session import Ending, Session
from executive.snapshot import Snapshot
from executive.watchdog import VERB_LIMIT_S, VerbHung, watched
from skills.api import Cause, Costmap, Localiser, Publish, Worker
from skills.robot import Clock, LeaseError, Robot

HOLDER = "errand"


@dataclass(frozen=True)
class RunEntry:
    """One robot with its tree and estimators, and who keeps notes of its mission."""

    tree: CompiledTree
    robot: Robot
    localiser: Localiser
    costmap: Costmap
    journal: Journal | None = None


@dataclass(frozen=True)
class RunSettings:
    """`time_limit_s` counts the robots' clock for the whole run; `verb_limit_s` the wall's clock for one verb."""

    seed: int = 0
    tick_period_s: float = 0.05
    time_limit_s: float = 1200.0
    verb_limit_s: float = VERB_LIMIT_S


@dataclass(frozen=True)
class Progress:
    """What an observer is told after each tick."""

    now_s: float
    ticks: int
    overruns: int
    states: Mapping[str, Snapshot]


Observer = Callable[[Progress], None]


class CancelToken:
    """A wish to end the run, to be heard at the next tick. May be set from a signal handler or another thread."""

    def __init__(self) -> None:
        self.reason: str | None = None

    def request(self, reason: str) -> None:
        """Ask for the end; the first reason stays."""
        self.reason = self.reason or reason


class _CancelledError(Exception):
    """The token was set."""


class _TimeOverError(Exception):
    """The run's time limit has passed."""


def run(
    entries: Sequence[RunEntry],
    *,
    clock: Clock,
    worker: Worker,
    publish: Publish,
    settings: RunSettings = RunSettings(),
    cancel: CancelToken | None = None,
    observer: Observer | None = None,
) -> RunResult:
    """Run trees to their end, robots in the order of their names.

    Each tick: advance the clock by the tick period, update each robot's estimators, tick each tree, log what changed.
    Whatever happens, all trees and robots are stopped and all leases returned before this returns.

    Raises:
        ValueError: no entries, or two robots of one name.
    """
    names = [entry.robot.name for entry in entries]
    if not entries or len(set(names)) != len(names):
        raise ValueError(f"a run needs robots of different names, not {names}")
    return _Run(clock, worker, publish, settings, cancel or CancelToken(), observer).run(entries)


class _Run:
    """The state of one run."""

    def __init__(
        self,
        clock: Clock,
        worker: Worker,
        publish: Publish,
        settings: RunSettings,
        cancel: CancelToken,
        observer: Observer | None,
    ) -> None:
        self._clock, self._worker, self._publish = clock, worker, publish
        self._settings, self._cancel, self._observer = settings, cancel, observer
        self._sessions: list[Session] = []
        self._ticks = 0
        self._meter = TickMeter(publish, clock, limit_s=settings.tick_period_s)
        self._begun_s, self._begun_wall_s = clock.now(), time.perf_counter()

    def run(self, entries: Sequence[RunEntry]) -> RunResult:
        """The whole run."""
        ending: Ending | None = None
        try:
            for entry in sorted(entries, key=lambda entry: entry.robot.name):
                self._sessions.append(self._open(entry))
            while not all(session.finished for session in self._sessions):
                self._cycle()
        except (Exception, VerbHung, KeyboardInterrupt) as stop:
            ending = self._ending(stop)
        finally:
            for session in self._sessions:
                session.close(ending)
        return self._result(entries, ending)

    def _open(self, entry: RunEntry) -> Session:
        robot = watched(entry.robot, limit_s=self._settings.verb_limit_s)
        context = RunContext(
            robot=robot,
            lease=robot.acquire_lease(HOLDER),
            clock=self._clock,
            worker=self._worker,
            localiser=entry.localiser,
            costmap=entry.costmap,
            publish=self._publish,
            seed=self._settings.seed,
            board=Board(slug(entry.tree.robot_name)),
        )
        return Session(entry.tree, context, entry.journal)

    def _cycle(self) -> None:
        """One period: time passes, estimators see, trees tick."""
        if self._cancel.reason is not None:
            raise _CancelledError(self._cancel.reason)
        if self._clock.now() - self._begun_s >= self._settings.time_limit_s:
            raise _TimeOverError(f"the mission was not done within {self._settings.time_limit_s:g} s")
        self._clock.advance(self._settings.tick_period_s)
        live = [session for session in self._sessions if session.result is None]
        for session in live:
            session.sense()
        begun = time.perf_counter()
        for session in live:
            session.tick()
        self._ticks += 1
        self._meter(time.perf_counter() - begun)
        for session in live:
            if session.finished:
                session.close()
        if self._observer is not None:
            states = {session.name: session.states for session in self._sessions}
            self._observer(Progress(self._clock.now(), self._ticks, self._meter.overruns, states))

    def _ending(self, stop: BaseException) -> Ending:
        """What an exception means for the missions that are not done yet."""
        for kind, (outcome, cause, sentence) in _ENDINGS.items():
            if isinstance(stop, kind):
                return Ending(outcome, cause, str(stop) or sentence)
        trace = "".join(traceback.format_exception(stop))
        self._publish(ERROR_TOPIC, {"node": "runner", "traceback": trace})
        return Ending(Outcome.ERROR, Cause.ERROR, f"{type(stop).__name__}: {stop}")

    def _result(self, entries: Sequence[RunEntry], ending: Ending | None) -> RunResult:
        robots = tuple(session.close(ending) for session in self._sessions)
        for session in self._sessions:
            session.log_end(self._ticks)
        wall_time_s = time.perf_counter() - self._begun_wall_s
        self._meter.close(wall_time_s)
        began = {session.name for session in self._sessions}
        absent = tuple(_never_began(e, ending) for e in entries if ending is not None and e.robot.name not in began)
        sim_time_s = self._clock.now() - self._begun_s
        return RunResult(robots + absent, self._ticks, self._meter.overruns, sim_time_s, wall_time_s)


def _never_began(entry: RunEntry, ending: Ending) -> RobotResult:
    """The result of a robot whose mission did not begin."""
    return RobotResult(entry.robot.name, ending.outcome, ending.cause, ending.message, {}, {})


_ENDINGS: dict[type[BaseException], tuple[Outcome, Cause, str]] = {
    _CancelledError: (Outcome.CANCELLED, Cause.CANCELLED, "cancelled"),
    KeyboardInterrupt: (Outcome.CANCELLED, Cause.CANCELLED, "cancelled from the keyboard"),
    _TimeOverError: (Outcome.FAILURE, Cause.TIMEOUT, "time over"),
    LeaseError: (Outcome.FAILURE, Cause.PRECONDITION, "the lease is held by another"),
    VerbHung: (Outcome.ERROR, Cause.ERROR, "a verb hung"),
}
