"""The runner: the only place that advances time and ticks trees."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

from executive.record.profile import Profile
from executive.record.schemas import CONTROL, RESERVED_PATH
from executive.record.ticks import TickMeter
from executive.record.work import Work
from executive.run.control import Control, ControlRequests, Event
from executive.run.dispatch import Dispatch, DispatchedSessions, never_began
from executive.run.endings import CancelledError, LastingLog, TimeOverError, ending_of
from executive.run.opening import Opening, RunEntry, RunSettings
from executive.run.outcome import Outcome, RobotStatus, RunResult
from executive.run.resting import Resting, WithoutWork
from executive.run.session import Session
from executive.run.traffic import TrafficTable
from executive.run.tree_run import Ending
from executive.run.watchdog import VerbHung
from executive.tree.behaviours.skill_leaf import ERROR_TOPIC
from executive.tree.behaviours.suspension import StoppableTime
from executive.tree.compiler import CompiledTree
from executive.tree.snapshot import Snapshot
from skills.api import Cause, Publish, Worker
from skills.files.errors import disk_is_full
from skills.robot import Clock

_PATHS_PERIOD_S = 0.5
ResultT = TypeVar("ResultT")

__all__ = ["Observer", "Progress", "RunEntry", "RunSettings", "run"]


@dataclass(frozen=True)
class Progress:
    """The state of a run after each tick, for observers: node states, mission and status of each robot."""

    now_s: float
    ticks: int
    overruns: int
    states: Mapping[str, Snapshot]
    trees: Mapping[str, CompiledTree] = field(default_factory=dict)
    robots: Mapping[str, RobotStatus] = field(default_factory=dict)


Observer = Callable[[Progress], None]


def run(
    entries: Sequence[RunEntry],
    *,
    clock: Clock,
    worker: Worker,
    publish: Publish,
    settings: RunSettings | None = None,
    control: Control | None = None,
    observer: Observer | None = None,
    work: Work | None = None,
    profile: Profile | None = None,
    dispatch: Dispatch | None = None,
    spare: Sequence[RunEntry] = (),
) -> RunResult:
    """Run trees to their end, robots in the order of their names.

    Each tick: poll `control`, advance the clock by the tick period, update each robot's estimators, tick each tree, log
    what changed. While a robot is held (pause, stop button, lost lease), time passes and it senses, but its tree is not
    ticked, and that time counts against no limit. In every case all trees and robots are stopped and all leases
    returned before this returns. Without control, equal seeds give equal logs. `work` counts what is computed,
    `profile` times the skills. With `dispatch`, robots are given missions as long as it has any, one that fails ends
    only its own, and the result has one entry for each mission. Robots that are `spare` have no mission, or none yet:
    their trees do not count, and they clear ways that others reserve, as those do whose missions are over. Raises
    ValueError: no entries, two robots of one name, one that waits for a robot that is not there, or a breakpoint at a
    node that there is not. Raises OSError, when all is stopped: the disk is full.
    """
    names = [entry.robot.name for entry in (*entries, *spare)]
    if (not entries and dispatch is None) or len(set(names)) != len(names):
        raise ValueError(f"a run needs robots of different names, not {names}")
    if strangers := {name for entry in entries for name in entry.after} - set(names):
        raise ValueError(f"there is no robot {', '.join(sorted(strangers))} to wait for")
    settings, control = settings or RunSettings(), control or Control(pace=None)
    control.begin({entry.tree.robot_name: entry.tree for entry in entries})
    traffic = TrafficTable({}, clock.now) if len(names) > 1 or dispatch is not None else None
    log = LastingLog(publish)
    made = _Run(Opening(clock, worker, log, settings, control, work or Work(), profile, traffic), log)
    made.observer, made.spare = observer, spare
    if dispatch is not None:
        made.give_out(dispatch)
    return made.run(entries)


class _Run:
    """The state of one run."""

    def __init__(self, opening: Opening, publish: LastingLog) -> None:
        clock, settings = opening.clock, opening.settings
        self._opening, self._clock, self._publish = opening, clock, publish
        self._settings, self._control, self._traffic = settings, opening.control, opening.traffic
        self._watchdog = opening.watchdog
        self.observer: Observer | None = None
        self.spare: Sequence[RunEntry] = ()
        self._given: DispatchedSessions | None = None
        self._sessions: list[Session] = []
        self._paths_due_s = clock.now()
        self._resting: Resting | None = None
        self._after: dict[str, tuple[str, ...]] = {}
        self._ticks = 0
        self._meter = TickMeter(publish, clock, limit_s=settings.tick_period_s)
        self._begun_s, self._begun_wall_s = clock.now(), time.perf_counter()
        self._time = StoppableTime(clock)

    def give_out(self, dispatch: Dispatch) -> None:
        """Robots are given missions as long as there are any."""
        self._given = DispatchedSessions(dispatch, self._sessions, self._control, self._publish, lambda: self._ticks)

    def run(self, entries: Sequence[RunEntry]) -> RunResult:
        """The whole run."""
        with self._watchdog:
            return self._watched_run(entries)

    def _watched_run(self, entries: Sequence[RunEntry]) -> RunResult:
        ending: Ending | None = None
        full: BaseException | None = None
        try:
            if self._traffic is not None:
                tick_limit_s = self._settings.tick_limit_s
                self._resting = Resting(self._traffic, self._watchdog, tick_limit_s, self._sense)
                for entry in self.spare:
                    self._resting.rest(self._opening.spare(entry))
            for entry in sorted(entries, key=lambda entry: entry.robot.name):
                self._sessions.append(self._opening.session(entry))
                self._after[entry.robot.name] = entry.after
            while self._has_work():
                self._cycle()
        except (Exception, VerbHung, KeyboardInterrupt) as stop:
            self._publish.ending = True
            ending = ending_of(stop, self._publish)
            if isinstance(stop, CancelledError | TimeOverError):
                self._end_early()
            full = stop if disk_is_full(stop) else None
        finally:
            self._publish.ending = True
            if self._resting is not None:
                self._resting.close()
            for session in self._sessions:
                session.close(ending)
                if self._given is not None:
                    self._given.tell(session, None)
            self._tell(self._control.end())
        if full is not None:
            raise full
        return self._result(entries, ending)

    def _has_work(self) -> bool:
        """Whether a mission is under way, after those were begun that are given out now."""
        if self._given is not None:
            self._given.begin(self._begin_given)
        return not all(session.finished for session in self._sessions)

    def _begin_given(self, entry: RunEntry) -> Session:
        """Begin a mission that was given out, of a robot that may be resting. Raises what its verbs raise."""
        if self._resting is not None:
            self._resting.leave(entry.robot.name)
        return self._opening.session(entry)

    def _for(self, session: Session, call: Callable[[], ResultT], otherwise: ResultT) -> ResultT:
        """What a call for one robot gives. With several robots, one that fails ends only its own mission.

        It is no more than an obstacle to the others then. Raises OSError: the disk is full.
        """
        if self._traffic is None:
            return call()
        try:
            return call()
        except (Exception, VerbHung) as stop:
            if disk_is_full(stop):
                raise
            ending = ending_of(stop, self._publish)
            session.close(ending)
            session.context.traffic.release()
            self._end_given(session, ending.message)
            return otherwise

    def _end_early(self) -> None:
        """Do what missions always do in the end, for `endings_limit_s` at most; a second cancel ends that as well."""
        until_s = self._clock.now() + self._settings.endings_limit_s
        try:
            for session in self._sessions:
                session.end_early()
            while any(session.ends for session in self._sessions) and self._clock.now() < until_s:
                requests = self._control.poll()
                self._tell(requests.events)
                if requests.insists:
                    return
                self._clock.advance(self._settings.tick_period_s)
                for session in self._sessions:
                    if session.ends:
                        self._sense(session)
                        if requests.held(session.name):
                            session.hold()
                        elif session.may_move():
                            session.tick_end()
                self._ticks += 1
                if self.observer is not None:
                    self.observer(self._progress())
        except (Exception, VerbHung, KeyboardInterrupt):
            self._publish(ERROR_TOPIC, {"node": "runner", "traceback": traceback.format_exc()})

    def _cycle(self) -> None:
        """One period: requests are polled, time passes, estimators see, trees tick."""
        begun_wall_s = time.perf_counter()
        live = [session for session in self._sessions if session.result is None]
        requests = self._poll(live)
        self._clock.advance(self._settings.tick_period_s)
        for session in live:
            self._for(session, partial(self._sense, session), None)
        if self._traffic is not None and self._clock.now() >= self._paths_due_s:
            self._paths_due_s = self._clock.now() + _PATHS_PERIOD_S
            for path in self._traffic.news():
                self._publish(RESERVED_PATH, path)
        turn = [session for session in live if session.result is None and self._is_its_turn(session)]
        free = [session for session in turn if self._for(session, session.may_move, False)]
        moving = [session for session in free if not requests.held(session.name)]
        self._rest(live, turn, requests.held)
        self._tick(moving, requests.breakpoints)
        for session in live:
            if session.finished:
                lost = session.result is not None and session.result.outcome is not Outcome.CANCELLED
                result = session.close()
                session.context.traffic.release()
                self._end_given(session, result.message if lost else None)  # its lease was another's for too long
                if not lost and self._resting is not None and self._others_go_on(session):
                    self._resting.rest(session)
            elif self._given is not None:
                self._for(session, partial(self._given.look, session), None)
        if self._given is not None:
            self._given.recall()
        if self.observer is not None:
            self.observer(self._progress())
        self._keep_pace(begun_wall_s)

    def _end_given(self, session: Session, gone: str | None) -> None:
        """Where missions are given out, the robot has none any more, and is free again unless it is `gone`."""
        if self._given is not None:
            self._given.end(session, gone)

    def _others_go_on(self, session: Session) -> bool:
        """Whether a robot whose mission is over may still be in somebody's way."""
        return self._given is not None or any(not one.finished for one in self._sessions if one is not session)

    def _rest(self, live: Sequence[Session], turn: Sequence[Session], held: Callable[[str], bool]) -> None:
        """Let the robots that wait for others, and those whose missions are over, clear ways that are reserved."""
        if self._resting is None:
            return
        for session in live:
            if session in turn:
                self._resting.leave(session.name)
            elif session.result is None:
                self._resting.wait(session)
        self._resting.tick(held)

    def _sense(self, session: WithoutWork) -> None:
        """Bring a robot's estimators up to date, and tell the others where it believes to be."""
        if self._traffic is not None and (estimators := session.context.leave_others_out):
            covered_W = self._traffic.covered_W(session.name)
            for estimator in estimators:
                estimator.leave_out(covered_W)
        session.sense()
        if self._traffic is not None:
            self._traffic.heard(session.name, session.context.known_pose())

    def _is_its_turn(self, session: Session) -> bool:
        """Whether the robots that a mission waits for are done; it ends when one of them has failed."""
        results = {each.name: each.result for each in self._sessions}
        for name in self._after.get(session.name, ()):
            result = results[name]
            if result is None:
                return False
            if result.outcome is not Outcome.SUCCESS:
                message = f"{name}, whose part comes first, did not do it: {result.message}"
                session.close(Ending(Outcome.FAILURE, Cause.PRECONDITION, message))
                return False
        return True

    def _poll(self, live: Sequence[Session]) -> ControlRequests:
        """Do what is asked for before time passes. Raises CancelledError or TimeOverError."""
        requests = self._control.poll()
        self._tell(requests.events)
        if requests.cancel is not None:
            raise CancelledError(requests.cancel)
        for session in live:
            for request in requests.instead:
                if request.tree.robot_name == session.name:
                    session.replace(request.tree, request.instead_of)
            for tree in _for_robot(session, requests.preempts):
                session.preempt(tree)
            for tree in _for_robot(session, requests.later):
                session.later(tree)
            for _, reason in (each for each in requests.cancels if each[0] == session.name):
                session.cancel(reason, self._settings.endings_limit_s)
        held = [session for session in live if session.result is None and requests.held(session.name)]
        if len(held) < len(live):
            self._time.go_on()
        else:
            self._time.stop()
            self._control.held(self._settings.tick_period_s)
        for session in held:
            session.hold()
        if self._time.elapsed_s() >= self._settings.time_limit_s:
            raise TimeOverError(f"the mission was not done within {self._settings.time_limit_s:g} s")
        return requests

    def _tick(self, moving: Sequence[Session], breakpoints: frozenset[str]) -> None:
        """Tick the trees of robots that may move."""
        begun = time.perf_counter()
        changes = []
        for session in moving:
            with self._watchdog.over_tick(session.name, self._settings.tick_limit_s):
                changes.append(self._for(session, partial(session.tick, breakpoints), False))
        self._ticks += 1
        self._meter(time.perf_counter() - begun)
        if moving:
            self._control.ticked(changed=any(changes))
        for path_id in filter(None, (session.waiting_at for session in moving if session.result is None)):
            self._control.arrived_at(path_id)

    def _progress(self) -> Progress:
        states = {session.name: session.states for session in self._sessions}
        trees = {session.name: session.tree for session in self._sessions}
        seen = {session.name: session.status for session in self._sessions} if self._given is None else self._given.seen
        return Progress(self._clock.now(), self._ticks, self._meter.overruns, states, trees, seen)

    def _keep_pace(self, begun_wall_s: float) -> None:
        """Do not let simulated time run ahead of people who have something to decide."""
        people = self._control.attended and any(session.waits_for_people for session in self._sessions)
        if self._control.pace is None or not (people or self._control.slow):
            return
        left_s = self._settings.tick_period_s / self._control.pace - (time.perf_counter() - begun_wall_s)
        if left_s > 0.0:
            self._control.rest(left_s)

    def _tell(self, events: Sequence[Event]) -> None:
        for event in events:
            self._publish(CONTROL, {"t": round(self._clock.now(), 6), "what": event.what, "message": event.message})

    def _result(self, entries: Sequence[RunEntry], ending: Ending | None) -> RunResult:
        if self._given is None:
            for session in self._sessions:
                session.log_end(self._ticks)
            over = [(session.close(ending), session.main_tree) for session in self._sessions]
        else:
            over = self._given.over
        stepped_aside = frozenset[str]() if self._resting is None else self._resting.stepped_aside
        robots = tuple(replace(result, stepped_aside=result.robot_name in stepped_aside) for result, _ in over)
        wall_time_s = time.perf_counter() - self._begun_wall_s
        self._meter.close(wall_time_s)
        began = {session.name for session in self._sessions}
        absent = tuple(never_began(e, ending) for e in entries if ending is not None and e.robot.name not in began)
        sim_time_s = self._clock.now() - self._begun_s
        trees = {result.robot_name: tree for result, tree in over}
        overruns, work = self._meter.overruns, self._opening.work.totals()
        return RunResult(robots + absent, self._ticks, overruns, sim_time_s, wall_time_s, trees, work)


def _for_robot(session: Session, trees: Sequence[CompiledTree]) -> Sequence[CompiledTree]:
    return [tree for tree in trees if tree.robot_name == session.name]
