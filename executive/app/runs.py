"""Runs missions of a store one after another: a single run is a queue of one, and a server a queue that waits."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

from executive.app.durable import Durable, new_run, next_run, plant_file, same_world, take_up
from executive.app.mission_run import Finished, return_memory
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.app.report import RunReport
from executive.app.signals import HUNG_UP
from executive.app.simulated import run_simulated
from executive.language.questions import Answerer
from executive.run.control import Control
from executive.store.database import STORE_FILE, StoreError
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.store.standing import StandingMissions
from executive.store.triggers import Trigger
from executive.words.slug import slug
from skills.files.errors import InputError, disk_is_full

__all__ = [
    "MOST_STARTS",
    "Ended",
    "MissionRuns",
    "QueueServer",
    "Runner",
    "Screen",
    "Waiting",
    "broken_off",
    "note_run",
    "queued_missions",
    "resumable_line",
    "run_in_turn",
]

MOST_STARTS: Final = 3
"""A mission that has been started so often is not taken up by itself: what ends the process would end it for ever."""
_ENDED: Final = (MissionState.SUCCESS, MissionState.FAILURE, MissionState.CANCELLED, MissionState.ERROR)


class Screen(Protocol):
    """What people see of runs, and what they control them by."""

    def tell(self, line: str, *, title: bool = False) -> None:
        """Show a line."""

    def control(self, prepared: Prepared) -> Control:
        """The control of the next run, before it is shown."""

    def show(self, prepared: Prepared, control: Control, start: Callable[..., Finished]) -> Finished:
        """Show a run, which `start` begins with this control and those who watch it."""

    def name_files(self, out: Path) -> None:
        """Name what a run has left in its folder."""


@dataclass(frozen=True)
class Ended:
    """How a mission of the store ended. One that was set aside has no report.

    `past` tells what was done with its past when it went on after it had been broken off.
    """

    mission: int
    outcome: str
    achieved: bool
    message: str = ""
    report: RunReport | None = None
    past: tuple[str, ...] | None = None

    @property
    def hung_up(self) -> bool:
        """Whether it ended since its terminal was closed."""
        return self.message == HUNG_UP

    def to_json(self) -> dict[str, Any]:
        """Its report as JSON values, with the mission's number."""
        told = {"outcome": self.outcome, "message": self.message} if self.report is None else self.report.to_json()
        told |= {"mission": self.mission, "achieved": self.achieved}
        return told if self.past is None else {**told, "resumed": list(self.past)}


class Runner(Protocol):
    """Runs missions of the store."""

    def run(self, mission: StoredMission) -> Ended:
        """Run one to its end, or set it aside. Raises InputError: no further one can be run."""

    def set_aside(self, mission: StoredMission, cause: str) -> Ended:
        """End one that cannot be run with its cause."""

    def cancel(self, reason: str) -> None:
        """Cancel the one under way, and any that begins later; from signal handlers."""


def run_in_turn(missions: Iterable[StoredMission], runner: Runner, *, until_cancelled: bool = True) -> list[Ended]:
    """Run missions as they come, the next one when one has ended; `until_cancelled`, none after one was cancelled.

    Raises InputError: as the runner.
    """
    ended = list[Ended]()
    for mission in missions:
        ended.append(runner.run(mission))
        if until_cancelled and ended[-1].outcome == MissionState.CANCELLED.value:
            break
    return ended


def queued_missions(missions: MissionStore) -> Iterator[StoredMission]:
    """The missions that are queued, each as it comes to its turn.

    Raises InputError: one was broken off before, and waits to be taken up.
    """
    broken = missions.missions(MissionState.RUNNING)
    if broken:
        raise broken_off(missions, broken[-1])
    while (mission := _next_queued(missions)) is not None:
        yield mission


def _next_queued(missions: MissionStore) -> StoredMission | None:
    return next((each for each in missions.missions(MissionState.QUEUED) if each.queued), None)


class MissionRuns:
    """Runs missions of a store (`Runner`), and notes there that one is under way and how it ended.

    A mission of a queue begins in the world as the one before has left it, and has a folder of its own.
    """

    def __init__(
        self,
        missions: MissionStore,
        screen: Screen,
        *,
        ask: Answerer | None = None,
        run: Callable[..., Finished] | None = None,
    ) -> None:
        """`ask` is who is asked what a file leaves open; `run` runs what is prepared, in the place of
        `run_simulated`."""
        self._missions, self._screen, self._ask, self._run_prepared = missions, screen, ask, run or run_simulated
        self._control: Control | None = None
        self._cancelled: str | None = None

    def add(self, prepared: Prepared) -> StoredMission:
        """Keep what is to be run at once. What was broken off is given up: it could not be taken up afterwards."""
        mission = self._missions.add(prepared.request.from_anywhere(), queued=False)
        for broken in self._missions.missions(MissionState.RUNNING):
            self._missions.finish(
                broken.id, MissionState.CANCELLED, f"broken off, and given up for mission {mission.id}"
            )
            self._screen.tell(f"Mission {broken.id} ({broken.request.name}) had been broken off; it is given up.")
        return mission

    def run(self, mission: StoredMission, prepared: Prepared | None = None) -> Ended:
        """Run a mission from its beginning, or go on with one that was broken off or cancelled, to its end.

        One of a queue that cannot be run is set aside, so that the next one can. `prepared` is the mission where it is
        understood already.

        Raises:
            StoreError: the store cannot be used, or the disk is full; no other mission can be run either.
            InputError: it is none of a queue, and its file, its world or the plant's state cannot be used.
        """
        if not mission.queued:
            return self._run(mission, prepared)
        try:
            return self._run(mission, prepared)
        except StoreError:
            raise
        except InputError as error:
            cause = str(error)
        except OSError as error:
            cause = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        except Exception as defect:
            cause = f"a defect of errand or of a plug-in ended it ({type(defect).__name__}: {defect})"
            self._screen.tell(f"The traceback is in {_traceback_file(self._missions, mission)}")
        finally:
            return_memory()
        return self.set_aside(mission, cause)

    def set_aside(self, mission: StoredMission, cause: str) -> Ended:
        """End a mission that cannot be run with its cause."""
        self._missions.finish(mission.id, MissionState.ERROR, cause)
        self._screen.tell(f"Mission {mission.id} ({mission.request.name}) is set aside: {cause}")
        again = f"errand resume --mission {mission.id} --store {self._missions.path}"
        self._screen.tell(f"  `{again}` tries again")
        return Ended(mission.id, MissionState.ERROR.value, False, cause)

    def cancel(self, reason: str) -> None:
        """Cancel the mission under way, and any that begins later; from signal handlers."""
        self._cancelled = reason
        if self._control is not None:
            self._control.cancel(reason)

    def _run(self, mission: StoredMission, prepared: Prepared | None) -> Ended:
        name, begun = mission.request.name, mission.state is not MissionState.QUEUED
        taken = (
            take_up(self._missions, mission, ask=self._ask) if begun and self._missions.has_steps(mission.id) else None
        )
        if taken is not None:
            self._screen.tell(f"Mission {mission.id} ({name}) goes on.")
            prepared, durable = _in_its_folder(mission, taken.prepared), taken.durable
        else:
            if begun:
                self._screen.tell(f"Mission {mission.id} ({name}) had not begun; it begins now.")
            prepared, durable = self._begin(mission, prepared)
        report = self._show(mission, prepared, durable)
        past = None if taken is None else taken.told
        if past is not None:
            self._screen.tell("\n  ".join(["What became of its past:", *past]))
        self._screen.name_files(prepared.request.out)
        return Ended(mission.id, report.outcome, report.achieved, report.message, report, past)

    def _begin(self, mission: StoredMission, prepared: Prepared | None) -> tuple[Prepared, Durable]:
        """A mission from its beginning. Raises InputError: its file, its world or the plant's state cannot be used."""
        if prepared is None:
            prepared = _in_its_folder(mission, prepare(mission.request, ask=self._ask))
            self._screen.tell(f"Mission {mission.id}: {mission.request.name}", title=True)
        before = self._before(mission) if mission.queued else None
        if before is None:
            return prepared, new_run(self._missions, mission, prepared)
        return prepared, next_run(self._missions, mission, prepared, before)

    def _before(self, mission: StoredMission) -> StoredMission | None:
        """The mission that left the world in which this one begins; None when it begins in a fresh one."""
        ended = [each for each in self._missions.missions(*_ENDED) if each.queued and each.starts]
        last = max((each for each in ended if each.id < mission.id), key=lambda each: each.id, default=None)
        if last is None or not same_world(last, mission) or last.clock_s is None:
            return None
        plant = plant_file(self._missions)
        return last if plant.with_name(f"{plant.name}.a").exists() else None

    def _show(self, mission: StoredMission, prepared: Prepared, durable: Durable) -> RunReport:
        """Run a mission, shown; its report, which is noted in the store."""
        control = self._control = self._screen.control(prepared)
        if self._cancelled is not None:
            control.cancel(self._cancelled)
        try:
            with note_run(self._missions, mission) as ended:
                start = partial(self._run_prepared, prepared, durable=durable)
                report = self._screen.show(prepared, control, start).report
                ended(report)
        finally:
            self._control = None
        return report


@contextmanager
def note_run(missions: MissionStore, mission: StoredMission) -> Iterator[Callable[[RunReport], None]]:
    """Note in the store that a mission is under way, and, when told the report, how it ended.

    A run that could not begin leaves things as they were; of one that is killed, or breaks off since the disk is full,
    nobody notes anything. Raises InputError, which names the way on: the disk is full.
    """
    missions.begin(mission.id)
    over = False

    def ended(report: RunReport) -> None:
        nonlocal over
        over = True
        missions.finish(mission.id, MissionState(report.outcome), report.message)

    try:
        yield ended
    except OSError as error:
        raise STORE_FILE.full_disk(missions.path) if disk_is_full(error) else error from error
    except InputError:
        if over:
            raise
        if mission.queued or mission.starts:
            missions.never_began(mission)
        else:
            missions.remove(mission.id)
        raise


def _in_its_folder(mission: StoredMission, prepared: Prepared) -> Prepared:
    """With the folder for its files: each mission of a queue has its own."""
    asked = mission.request
    out = asked.out / f"{mission.id:03d}-{slug(asked.name)}" if mission.queued else asked.out
    return replace(prepared, request=replace(prepared.request, out=out))


def _traceback_file(missions: MissionStore, mission: StoredMission) -> Path:
    """Write the traceback of a defect beside the store, where that can be done; the file."""
    file = missions.path.with_name(f"mission-{mission.id}-traceback.txt")
    with suppress(OSError):
        file.write_text(traceback.format_exc(), encoding="utf-8")
    return file


def broken_off(missions: MissionStore, mission: StoredMission) -> InputError:
    """Why nothing else is run before a mission that was broken off."""
    what = f"mission {mission.id} ({mission.request.name}) was broken off"
    return InputError(what, hint="`errand resume` goes on with it and then with the queue", file=missions.path)


def resumable_line(missions: MissionStore) -> str | None:
    """How to go on with the mission that was begun last, where it was cancelled; None where it was not."""
    begun = [each for each in missions.missions() if each.starts]
    if not begun or begun[-1].state is not MissionState.CANCELLED:
        return None
    last = begun[-1]
    what = f"Mission {last.id} ({last.request.name}) was cancelled"
    return f"{what}; `errand resume --store {missions.path}` goes on with it{' and then with the queue' * last.queued}."


class Waiting(Protocol):
    """Waits for the next thing to do; `executive.store.wakeup.WakeupPipe` is one."""

    def wait(self, until: datetime | None) -> None:
        """Block until somebody calls `wake` or, at the latest, a moment comes."""

    def wake(self) -> None:
        """End the wait, from any thread or signal handler."""


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
        """`follow` has the other listeners hear what the standing missions wait for; `tell` shows a line."""
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
        serving_since = self._missions.now()
        self._follow(each.trigger for each in self._standing.missions())
        broken = self._missions.missions(MissionState.RUNNING)
        left = next((each for each in broken if not each.queued), None)
        if left is not None:
            raise broken_off(self._missions, left)
        aside = [
            self._runner.set_aside(each, f"it was started {each.starts} times and broken off")
            for each in broken
            if each.starts >= MOST_STARTS
        ]
        again = [each for each in broken if each.starts < MOST_STARTS]
        coming = self._next_missions(again, serving_since, end=end, until_idle=until_idle)
        return [*aside, *run_in_turn(coming, self._runner, until_cancelled=False)]

    def _next_missions(
        self, again: Sequence[StoredMission], serving_since: datetime, *, end: datetime | None, until_idle: bool
    ) -> Iterator[StoredMission]:
        """The missions that go on `again`, and then those that are queued, or that triggers queue."""
        now = self._missions.now
        for each in again:
            if self.stopped is None:
                yield each
        waiting_since = now() if again else serving_since
        while self.stopped is None:
            self._follow_again()
            fired = self._standing.fire_due(waiting_since=waiting_since, serving_since=serving_since)
            for each in fired:
                self._tell(f"Mission {each.id} is queued: {each.request.name} ({each.why})")
            if end is not None and now() >= end:
                return
            mission = _next_queued(self._missions)
            if mission is not None:
                yield mission
                waiting_since = now()
            elif until_idle:
                return
            else:
                self._waiting.wait(min(filter(None, (self._standing.due_next(), end)), default=None))

    def _follow_again(self) -> None:
        """Standing missions may have come or gone. What cannot be listened to is told once; the rest goes on."""
        try:
            self._follow(each.trigger for each in self._standing.missions())
        except InputError as error:
            if str(error) != self._refused:
                self._tell(f"errand: {error}")
            self._refused = str(error)
