"""Runner of missions: the only place that advances time and ticks trees."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

from executive.run.control import Control
from executive.run.control_state import ControlRequests, Event
from executive.run.outcome import Ending, Outcome, RobotResult, RobotStatus, RunResult, ending_of
from executive.run.resting import Resting
from executive.run.session import RunRobot, Session
from executive.run.visitor import (
    Assigner,
    MissionEnd,
    Progress,
    RunEntry,
    RunSettings,
    RunShared,
    RunVisitor,
    TickNote,
    Visitors,
)
from executive.run.watchdog import VerbHung
from executive.tree.behaviour import StoppableTime
from executive.words.schemas import CONTROL, OUTCOME, RESERVED_PATH
from skills.api import Cause, Worker
from skills.inputs.errors import shortage
from skills.robot import Clock

_PATHS_PERIOD_S: Final = 0.5
_LOOK_PERIOD_S: Final = 0.5
_EPSILON_S: Final = 1e-9


def run(
    missions: Sequence[RunEntry] | Assigner,
    *,
    clock: Clock,
    worker: Worker,
    visitors: Sequence[RunVisitor] = (),
    settings: RunSettings | None = None,
    control: Control | None = None,
    spare: Sequence[RunEntry] = (),
) -> RunResult:
    """Runs the missions of one or more robots to their end; robots act in the order of their names.

    Each tick: poll `control`, advance the clock by the tick period, update each robot's estimators, tick each tree,
    call the `visitors`. While a robot is held (pause, stop button, lost lease), time passes and it senses, but its tree
    is not ticked, and no time limit counts this time. A robot that fails ends only its own mission, and is then an
    obstacle to the others. In every case all trees and robots are stopped and all leases returned before this returns.
    Without control, equal seeds give equal logs.

    An assigner assigns missions until none is left; the result has one entry for each mission. `spare` robots have no
    mission, or none yet: their trees are not run. Like robots that have finished, they clear paths that others reserve.

    Raises ValueError when there are no missions, two robots have one name, a robot waits for a robot that is not in the
    run, or a breakpoint is at an unknown node. Raises the error, after all is stopped, when this
    machine lacks disk, files or memory.
    """
    assigner = missions if isinstance(missions, Assigner) else _AllAtOnce(missions)
    entries = () if isinstance(missions, Assigner) else missions
    names = [entry.robot.name for entry in (*entries, *spare)]
    if (assigner is not missions and not entries) or len(set(names)) != len(names):
        raise ValueError(f"a run needs robots of different names, not {names}")
    if strangers := {name for entry in entries for name in entry.after} - set(names):
        raise ValueError(f"there is no robot {', '.join(sorted(strangers))} to wait for")
    settings, control = settings or RunSettings(), control or Control(pace=None)
    control.begin({entry.tree.robot_name: entry.tree for entry in entries})
    all_visitors = Visitors((assigner, *visitors))
    for each in all_visitors:
        each.begin(settings, worker)
    return _Run(assigner, RunShared(clock, worker, all_visitors, settings, control)).run(spare)


class _AllAtOnce(Assigner):
    """Assigner that assigns all missions at the beginning."""

    def __init__(self, entries: Sequence[RunEntry]) -> None:
        self._entries = sorted(entries, key=lambda entry: entry.robot.name)

    def assign(self) -> Sequence[RunEntry]:
        """Returns all missions at the first call, and none at later calls."""
        entries, self._entries = self._entries, []
        return entries


class _Run:
    """State of one run. `_sessions` has each robot's last mission, `_ended` has all ended missions in order.

    The first `_reported` ended missions have been reported to the visitors.
    """

    def __init__(self, assigner: Assigner, shared: RunShared) -> None:
        self._assigner, self._shared = assigner, shared
        self._clock, self._visitors = shared.clock, shared.visitors
        self._settings, self._control = shared.settings, shared.control
        self._traffic, self._watchdog = shared.traffic, shared.watchdog
        self._resting = Resting(shared.traffic, shared.watchdog, shared.settings.tick_limit_s)
        self._assigned: list[RunEntry] = []
        self._sessions: dict[str, Session] = {}
        self._ended: list[MissionEnd] = []
        self._reported = 0
        self._idle: list[Session] = []  # robots whose missions ended in the last tick
        self._seen: dict[str, RobotStatus] = {}
        self._looks_always = type(assigner).recall is not Assigner.recall
        self._look_due_s = shared.clock.now()
        self._stopping = False
        self._paths_due_s = shared.clock.now()
        self._ticks = self._overruns = 0
        self._left_s = shared.settings.time_limit_s
        self._begun_s, self._begun_wall_s = shared.clock.now(), time.perf_counter()
        self._time = StoppableTime(shared.clock)

    def run(self, spare: Sequence[RunEntry]) -> RunResult:
        """Runs until no mission is left."""
        full: BaseException | None = None
        with self._watchdog:
            ending: Ending | None = None
            try:
                for entry in spare:
                    self._rest_apart(entry)
                while self._has_work():
                    self._cycle()
            except (Exception, VerbHung, KeyboardInterrupt) as stop:
                self._visitors.ending = True
                ending = ending_of(stop, self._visitors.publish)
                full = stop if shortage(stop) else None
            finally:
                self._end(ending)
        if full is not None:
            raise full
        result = self._result()
        for each in self._visitors:
            each.end(result)
        return result

    @property
    def _live(self) -> list[Session]:
        return [session for session in self._sessions.values() if session.result is None]

    def _has_work(self) -> bool:
        """Begins the missions that are assigned now; returns whether any mission is under way."""
        while not self._stopping and (assigned := self._assigner.assign()):  # once more where one cannot begin
            self._assigned = list(assigned)
            while self._assigned:
                self._begin(self._assigned[0])
                self._assigned.pop(0)
            self._report_ends()
        return bool(self._live)

    def _rest_apart(self, entry: RunEntry) -> None:
        """Lets a robot without a mission rest; does not use the robot if one of its verbs fails."""
        try:
            self._resting.rest(RunRobot(entry, self._shared))
        except (Exception, VerbHung) as stop:
            if shortage(stop):
                raise
            ending_of(stop, self._visitors.publish)

    def _begin(self, entry: RunEntry) -> None:
        """Begins a robot's mission, even if the robot is resting. Raises what a shortage caused."""
        name = entry.robot.name
        self._resting.leave(name)
        try:
            session = Session(entry, self._shared)
        except (Exception, VerbHung) as stop:
            if shortage(stop):
                raise
            ending = ending_of(stop, self._visitors.publish)
            self._note_end(_never_began(entry, ending), ending.message)
            return
        self._sessions = dict(sorted({**self._sessions, name: session}.items()))
        self._control.mission_begun(name, entry.tree)

    def _cycle(self) -> None:
        """Runs one period: polls requests, advances time, updates estimators, ticks trees, calls visitors."""
        begun_wall_s = time.perf_counter()
        live, idle, self._idle = self._live, self._idle, []
        for session in idle:
            if self._sessions[session.name] is session:
                self._resting.rest(session)
        requests = self._poll(live)
        if not any(session.result is None for session in live):
            self._note_ends(live)
            self._report_ends()
            return
        self._clock.advance(self._settings.tick_period_s)
        for session in live:
            session.call_guarded(session.sense)
        if self._clock.now() >= self._paths_due_s:
            self._paths_due_s = self._clock.now() + _PATHS_PERIOD_S
            for path in self._traffic.news():
                self._visitors.publish(RESERVED_PATH, path)
        turn = [session for session in live if session.result is None and session.has_its_turn(self._results)]
        free = [session for session in turn if session.call_guarded(session.may_move)]
        self._rest(live, turn, requests.holds_robot)
        moving = [session for session in free if not requests.holds_robot(session.name)]
        began_wall_s = time.perf_counter()
        notes = self._tick(moving, requests.breakpoints)
        tick_wall_s = time.perf_counter() - began_wall_s
        self._overruns += tick_wall_s > self._settings.tick_period_s
        self._note_ends(live)
        states = {name: session.states for name, session in self._sessions.items()}
        trees = {name: session.tree for name, session in self._sessions.items()}
        counts, seen = (self._ticks, self._overruns), dict(self._seen)
        progress = Progress(self._clock.now(), *counts, states, trees, seen, notes, tick_wall_s, self._left_s)
        for each in self._visitors:
            each.tick(progress)
        self._report_ends()
        self._recall()
        self._keep_pace(begun_wall_s)

    def _poll(self, live: Sequence[Session]) -> ControlRequests:
        """Carries out the requests of the control."""
        requests = self._control.poll()
        self._publish_events(requests.events)
        if requests.cancel is not None:
            self._stop(Ending(Outcome.CANCELLED, Cause.CANCELLED, requests.cancel or "cancelled"), requests.insists)
        if requests.of_robots:
            for session in (each for each in live if each.result is None):
                session.call_guarded(partial(self._obey, session, requests))
        under_way = [session for session in live if session.result is None]
        if not under_way:
            return requests
        if any(not requests.holds_robot(session.name) for session in under_way):
            self._time.go_on()
        else:
            self._time.stop()
            self._control.extend_questions(self._settings.tick_period_s)
        limit_s = self._settings.time_limit_s + self._assigner.more_s
        self._left_s = limit_s - self._time.elapsed_s()
        if self._left_s <= 0.0:
            message = f"the mission was not done within {limit_s:g} s"
            self._stop(Ending(Outcome.FAILURE, Cause.TIMEOUT, message))
        return requests

    def _obey(self, session: Session, requests: ControlRequests) -> None:
        """Carries out the requests that concern one robot."""
        for request in (each for each in requests.missions if each.tree.robot_name == session.name):
            session.take(request)
        for _, reason in (each for each in requests.cancels if each[0] == session.name):
            if session.cancelled:
                session.close()
            else:
                ending = Ending(Outcome.CANCELLED, Cause.CANCELLED, reason)
                session.cancel(ending, self._settings.endings_limit_s)
        if session.result is None and requests.holds_robot(session.name):
            session.hold()

    def _stop(self, ending: Ending, at_once: bool = False) -> None:
        """Ends all missions and assigns no more; the steps under `always` still run, unless `at_once`."""
        self._stopping = True
        for session in self._live:
            session.cancel(ending, self._settings.endings_limit_s)
            if at_once:
                session.close(ending)

    def _rest(self, live: Sequence[Session], turn: Sequence[Session], held: Callable[[str], bool]) -> None:
        """Lets robots without a mission, and robots whose missions wait for others, clear reserved paths."""
        for session in live:
            if session in turn:
                self._resting.leave(session.name)
            elif session.result is None:
                self._resting.wait(session)
        self._resting.tick(held)

    def _tick(self, moving: Sequence[Session], breakpoints: frozenset[str]) -> Mapping[str, TickNote]:
        """Ticks the trees of the robots that may move; returns the note of each tick by the robot's name."""
        notes: dict[str, TickNote] = {}
        changes: list[bool] = []
        for session in moving:
            with self._watchdog.over_tick(session.name, self._settings.tick_limit_s):
                changed = session.call_guarded(partial(session.tick, breakpoints))
            if changed is not None and session.note is not None:
                changes.append(changed)
                notes[session.name] = session.note
        self._ticks += 1
        if moving:
            self._control.note_tick(changed=any(changes))
        under_way = (each for each in moving if each.result is None and not each.cancelled)
        for path_id in filter(None, (session.waiting_at for session in under_way)):
            self._control.stop_at_breakpoint(path_id)
        return notes

    def _note_ends(self, live: Sequence[Session]) -> None:
        """Closes the missions that have ended.

        Reads the status of all robots twice a second, or in each tick if the assigner may recall missions.
        """
        due = self._looks_always or self._clock.now() >= self._look_due_s - _EPSILON_S
        self._look_due_s += _LOOK_PERIOD_S if due else 0.0
        for session in live:
            if not session.finished and (not due or self._look(session)):
                continue
            result = session.close()
            session.context.traffic.release()
            if session.gone is None and self._look(session, now=True):
                self._idle.append(session)
            self._note_end(result, session.gone)

    def _look(self, session: Session, *, now: bool = False) -> bool:
        """Reads a robot's status; returns whether the robot still answers."""
        status = session.call_guarded(partial(session.status, now=now))
        if status is None:
            return False
        self._seen[session.name] = status
        return True

    def _note_end(self, result: RobotResult, gone: str | None) -> None:
        self._ended.append(MissionEnd(result, self._seen.get(result.robot_name), gone))

    @property
    def _results(self) -> Mapping[str, RobotResult]:
        """Result of each robot's last mission."""
        return {end.result.robot_name: end.result for end in self._ended}

    def _report_ends(self) -> None:
        """Reports the newly ended missions to the control and the visitors."""
        ends, self._reported = self._ended[self._reported :], len(self._ended)
        for end in ends:
            self._control.mission_ended(end.result.robot_name)
            self._visitors.publish(OUTCOME, {**end.result.message_of_end(), "ticks": self._ticks})
            for each in self._visitors:
                each.mission_ended(end)

    def _recall(self) -> None:
        """Ends the missions that the assigner wants to end."""
        why = self._assigner.recall(self._seen)
        recalled = [session for session in self._live if session.name in why]
        for session in recalled:
            session.close(Ending(Outcome.CANCELLED, Cause.CANCELLED, why[session.name]))
        self._note_ends(recalled)
        self._report_ends()

    def _keep_pace(self, begun_wall_s: float) -> None:
        """Waits, so that simulated time does not run ahead of an operator who has to react."""
        people = self._control.attended and any(session.waits_for_people for session in self._sessions.values())
        if self._control.pace is None or not (people or self._control.slow):
            return
        left_s = self._settings.tick_period_s / self._control.pace - (time.perf_counter() - begun_wall_s)
        if left_s > 0.0:
            self._control.rest(left_s)

    def _publish_events(self, events: Sequence[Event]) -> None:
        for event in events:
            message = {"t": round(self._clock.now(), 6), "what": event.what, "message": event.message}
            self._visitors.publish(CONTROL, message)

    def _end(self, ending: Ending | None) -> None:
        """Stops all robots and missions, and reports their ends."""
        self._visitors.ending = True
        self._resting.close()
        for session in self._sessions.values():
            if self._results.get(session.name) is not session.result or session.result is None:
                result = session.close(ending)
                self._note_end(result, session.gone)
        if ending is not None:
            for entry in self._assigned:
                self._note_end(_never_began(entry, ending), None)
        self._publish_events(self._control.end())
        self._report_ends()

    def _result(self) -> RunResult:
        over = sorted((end.result for end in self._ended), key=lambda each: each.robot_name)
        aside = self._resting.stepped_aside
        return RunResult(
            robots=tuple(replace(result, stepped_aside=result.robot_name in aside) for result in over),
            ticks=self._ticks,
            overruns=self._overruns,
            sim_time_s=self._clock.now() - self._begun_s,
            wall_time_s=time.perf_counter() - self._begun_wall_s,
            work=self._shared.work.totals(),
        )


def _never_began(entry: RunEntry, ending: Ending) -> RobotResult:
    """Returns the result for a mission that did not begin."""
    return RobotResult(entry.tree, ending.outcome, ending.cause, ending.message)
