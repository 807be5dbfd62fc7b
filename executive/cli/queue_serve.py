"""`errand queue serve`: waits for triggers, and runs what is queued, one mission after another."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Final, Protocol

from rich.console import Console

from executive.cli.queue_run import broken_off, go_on, next_queued, run_or_set_aside, set_aside, start_of
from executive.cli.shown import control_for
from executive.run.control import Control
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.store.standing import StandingMissions
from executive.store.triggers import Trigger
from skills.files.errors import InputError

MOST_STARTS: Final = 3
"""A mission that has been started so often is not taken up by itself: what ends the process would end it for ever."""

__all__ = ["Ended", "MissionRunner", "QueueServer", "Runner", "Waiting"]


class Waiting(Protocol):
    """Waits for the next thing to do; `executive.store.wakeup.WakeupPipe` is one."""

    def wait(self, until: datetime | None) -> None:
        """Block until somebody calls `wake` or, at the latest, a moment comes."""

    def wake(self) -> None:
        """End the wait, from any thread or signal handler."""


@dataclass(frozen=True)
class Ended:
    """How one mission ended, for the result of a server."""

    mission: int
    outcome: str
    achieved: bool


class Runner(Protocol):
    """Runs missions of the store."""

    def run(self, mission: StoredMission) -> Ended:
        """Run one to its end, or set it aside. Raises InputError: no further one can be run."""

    def set_aside(self, mission: StoredMission, cause: str) -> Ended:
        """End one that cannot be run with its cause."""

    def cancel(self, reason: str) -> None:
        """Cancel the one under way, and any that begins later; from signal handlers."""


class QueueServer:
    """Serves one store, which this process has claimed.

    When it is stopped while a mission runs, that is cancelled, and `errand resume` goes on with it. What is queued
    stays queued.
    """

    def __init__(
        self,
        missions: MissionStore,
        standing: StandingMissions,
        waiting: Waiting,
        runner: Runner,
        *,
        follow: Callable[[Iterable[Trigger]], None],
        tell: Callable[[str], None],
    ) -> None:
        """`follow` has the other listeners hear what the standing missions wait for; `tell` prints a line."""
        self._missions, self._standing, self._waiting, self._runner = missions, standing, waiting, runner
        self._follow, self._tell = follow, tell
        self._refused = ""
        self.stopped: str | None = None

    def stop(self, reason: str) -> None:
        """Serve no longer; from any thread and from signal handlers."""
        self.stopped = self.stopped or reason
        self._runner.cancel(reason)
        self._waiting.wake()

    def serve(self, *, end: datetime | None = None, until_idle: bool = False) -> list[Ended]:
        """Serve until it is stopped, until a moment (no mission begins after it), or until nothing is queued.

        Raises:
            InputError: a listener cannot be opened at the beginning, or the store cannot be used any more.
        """
        now, ended = self._missions.now, list[Ended]()
        self._follow(each.trigger for each in self._standing.missions())
        serving_since = now()
        ended += self._take_up()
        waiting_since = now() if ended else serving_since
        while self.stopped is None:
            self._follow_again()
            fired = self._standing.fire_due(waiting_since=waiting_since, serving_since=serving_since)
            for each in fired:
                self._tell(f"Mission {each.id} is queued: {each.request.name} ({each.why})")
            if end is not None and now() >= end:
                break
            mission = next_queued(self._missions)
            if mission is not None:
                ended.append(self._runner.run(mission))
                waiting_since = now()
            elif until_idle:
                break
            else:
                self._waiting.wait(min(filter(None, (self._standing.due_next(), end)), default=None))
        return ended

    def _take_up(self) -> list[Ended]:
        """Go on with the mission of the queue that was broken off; one that ends the process each time is set aside.

        Raises InputError: it is none of the queue.
        """
        ended = list[Ended]()
        for each in self._missions.missions(MissionState.RUNNING):
            if not each.queued:
                raise broken_off(self._missions, each)
            if each.starts >= MOST_STARTS:
                ended.append(self._runner.set_aside(each, f"it was started {each.starts} times and broken off"))
            elif self.stopped is None:
                ended.append(self._runner.run(each))
        return ended

    def _follow_again(self) -> None:
        """Standing missions may have come or gone. What cannot be listened to is told once; the rest goes on."""
        try:
            self._follow(each.trigger for each in self._standing.missions())
        except InputError as error:
            if str(error) != self._refused:
                self._tell(f"errand: {error}")
            self._refused = str(error)


class MissionRunner:
    """Runs missions of a store in the simulated world (`Runner`)."""

    def __init__(self, missions: MissionStore, console: Console, *, quiet: bool) -> None:
        self._missions, self._console, self._quiet = missions, console, quiet
        self._control: Control | None = None
        self._cancelled: str | None = None

    def run(self, mission: StoredMission) -> Ended:
        """Run one, or go on with one that was broken off; one that cannot be run is set aside.

        Raises InputError: the store cannot be used, or the disk is full.
        """
        begin = go_on if mission.state is MissionState.RUNNING else start_of
        control = self._control = control_for(self._console, quiet=self._quiet)
        if self._cancelled is not None:
            control.cancel(self._cancelled)
        try:
            result = run_or_set_aside(begin, self._missions, mission, self._console, quiet=self._quiet, control=control)
        finally:
            self._control = None
        return Ended(mission.id, result["outcome"], result["achieved"])

    def set_aside(self, mission: StoredMission, cause: str) -> Ended:
        """End one that cannot be run with its cause."""
        set_aside(self._missions, mission, cause, self._console)
        return Ended(mission.id, MissionState.ERROR.value, achieved=False)

    def cancel(self, reason: str) -> None:
        """Cancel the one under way, and any that begins later; from signal handlers."""
        self._cancelled = reason
        if self._control is not None:
            self._control.cancel(reason)
