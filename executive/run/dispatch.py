"""Missions that are given to robots while a run goes on: who gives them, and how the run begins and ends each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from executive.run.control import Control
from executive.run.endings import ending_of
from executive.run.opening import RunEntry
from executive.run.outcome import Outcome, RobotResult, RobotStatus
from executive.run.session import Session
from executive.run.tree_run import Ending
from executive.run.watchdog import VerbHung
from executive.tree.compiler import CompiledTree
from skills.api import Cause, Publish

__all__ = ["Dispatch", "DispatchedSessions", "MissionEnd", "never_began"]


@dataclass(frozen=True)
class MissionEnd:
    """How one robot's mission ended, and how the robot was last seen (None: never).

    `gone` is why nothing more is asked of this robot in the run: it does not answer, or its lease is another's.
    """

    result: RobotResult
    seen: RobotStatus | None
    gone: str | None = None


class Dispatch(Protocol):
    """Gives out missions. A robot that fails ends its own mission, and the run goes on with the others."""

    def begin(self) -> Sequence[RunEntry]:
        """The missions that begin now, each for a robot that has none. The run ends when there is none, and none is
        under way."""

    def recalled(self, seen: Mapping[str, RobotStatus]) -> Mapping[str, str]:
        """The robots whose missions end now, and why, by how all were last seen."""

    def ended(self, end: MissionEnd) -> None:
        """A robot's mission has come to an end."""


class DispatchedSessions:
    """The sessions of a run whose missions a dispatch gives out: each begins, and fails, for itself.

    `sessions` are those of the run, which are added to and taken from; `ticks` counts its ticks.
    """

    def __init__(
        self,
        dispatch: Dispatch,
        sessions: list[Session],
        control: Control,
        publish: Publish,
        ticks: Callable[[], int],
    ) -> None:
        self._dispatch, self._sessions, self._control = dispatch, sessions, control
        self._publish, self._ticks = publish, ticks
        self.seen: dict[str, RobotStatus] = {}
        self.over: list[tuple[RobotResult, CompiledTree]] = []

    def begin(self, open_session: Callable[[RunEntry], Session]) -> None:
        """Begin the missions that are given out now; a robot that cannot be had is told of."""
        while given := self._dispatch.begin():  # again while one cannot begin
            for entry in given:
                self._begin(entry, open_session)

    def _begin(self, entry: RunEntry, open_session: Callable[[RunEntry], Session]) -> None:
        try:
            session = open_session(entry)
        except (Exception, VerbHung) as stop:
            ending = ending_of(stop, self._publish)
            result = never_began(entry, ending)
            self.over.append((result, entry.tree))
            self._dispatch.ended(MissionEnd(result, self.seen.get(entry.robot.name), gone=ending.message))
            return
        self._sessions.append(session)
        self._control.mission_begun(session.name, entry.tree)

    def look(self, session: Session) -> None:
        """See how a robot is."""
        charge = session.context.robot.battery().charge
        self.seen[session.name] = replace(session.status, charge=charge)

    def recall(self) -> None:
        """End the missions that are recalled now."""
        why = self._dispatch.recalled(self.seen)
        for session in [each for each in self._sessions if each.name in why and each.result is None]:
            session.close(Ending(Outcome.CANCELLED, Cause.CANCELLED, why[session.name]))
            session.context.traffic.release()
            self.end(session, None)

    def end(self, session: Session, gone: str | None) -> None:
        """A robot's mission is over, and it is free again unless it is `gone`."""
        if session not in self._sessions:
            return
        if gone is None:
            try:
                self.look(session)
            except (Exception, VerbHung) as stop:
                gone = ending_of(stop, self._publish).message
        self.tell(session, gone)
        self._sessions.remove(session)
        self._control.mission_ended(session.name)

    def tell(self, session: Session, gone: str | None) -> None:
        """Tell how a mission ended, once it has."""
        if session.result is not None:
            session.log_end(self._ticks())
            self.over.append((session.result, session.main_tree))
            self._dispatch.ended(MissionEnd(session.result, self.seen.get(session.name), gone))


def never_began(entry: RunEntry, ending: Ending) -> RobotResult:
    """The result of a robot whose mission did not begin."""
    return RobotResult(entry.robot.name, ending.outcome, ending.cause, ending.message, {}, {})
