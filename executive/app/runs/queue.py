"""Runs missions of a store one after another: a single run is a queue of one; a server is a queue that waits."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from executive.app.prepare.from_request import Setting, prepare
from executive.app.prepare.prepared import Prepared
from executive.app.report.run_report import RunReport
from executive.app.runs.backend import Durable
from executive.app.runs.folders import KeptRun, holds_run, kept_run, new_run
from executive.app.runs.one_run import FinishedRun, log_name, return_memory, run_request
from executive.language.questions import Answerer
from executive.run.control import Control
from executive.run.visitor import RunVisitor
from executive.store.database import STORE_FILE, StoreError
from executive.store.journal import StoreJournal
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.store.recollection import Recollection
from executive.store.resuming import ended_tree, resumed_tree
from skills.inputs.errors import InputError, shortage, shortage_of_files

if TYPE_CHECKING:
    pass

FILES_OF_A_MISSION: Final = 200
"""Files that must be free when a queued mission begins."""
ROOM_WAIT_S: Final = 2.0
_ENDED: Final = (MissionState.SUCCESS, MissionState.FAILURE, MissionState.CANCELLED, MissionState.ERROR)


@dataclass(frozen=True)
class RunOptions:
    """Arguments of `run_request` that a screen chooses: the control and the visitors."""

    control: Control
    visitors: Sequence[RunVisitor] = ()


class Screen(Protocol):
    """Display of runs, which also provides their control."""

    def tell(self, line: str, *, title: bool = False) -> None:
        """Shows a line."""

    def watch(self, prepared: Prepared) -> AbstractContextManager[RunOptions]:
        """Shows a run from its beginning to its end."""

    def conclude(self, finished: FinishedRun) -> None:
        """Shows the result of a run."""

    def name_files(self, out: Path) -> None:
        """Names the files of a run in its folder."""


@dataclass(frozen=True)
class MissionResult:
    """Result of a stored mission; `report` is None if the mission could not be run.

    `past` has a line for each restored part of a resumed mission; `hung_up` says that the terminal was closed.
    """

    mission: int
    outcome: str
    achieved: bool
    message: str = ""
    report: RunReport | None = None
    past: tuple[str, ...] | None = None
    hung_up: bool = False

    def to_json(self) -> dict[str, Any]:
        """Returns the report as JSON values, with the mission's number."""
        values = {"outcome": self.outcome, "message": self.message} if self.report is None else self.report.to_json()
        values |= {"mission": self.mission, "achieved": self.achieved}
        return values if self.past is None else {**values, "resumed": list(self.past)}


class Runner(Protocol):
    """Runner of missions of the store."""

    def run(self, mission: StoredMission) -> MissionResult:
        """Runs a mission to its end, or sets it aside. Raises InputError if no further mission can be run."""

    def set_aside(self, mission: StoredMission, cause: str) -> MissionResult:
        """Ends a mission that cannot be run, and stores the cause."""

    def cancel(self, reason: str) -> None:
        """Cancels the mission under way and all later ones. Signal handlers may call it."""


def run_in_turn(
    missions: Iterable[StoredMission],
    runner: Runner,
    advance: Callable[[], None] = lambda: None,
    *,
    until_cancelled: bool = True,
) -> list[MissionResult]:
    """Runs missions one after another, and calls `advance` after each.

    With `until_cancelled` it stops after a cancelled mission. Raises InputError if the runner does.
    """
    ended = list[MissionResult]()
    for mission in missions:
        ended.append(runner.run(mission))
        advance()
        if until_cancelled and ended[-1].outcome == MissionState.CANCELLED.value:
            break
    return ended


def queued_missions(missions: MissionStore) -> Iterator[StoredMission]:
    """Yields the queued missions in turn. Raises InputError if an interrupted mission must be resumed first."""
    interrupted = missions.missions(MissionState.RUNNING)
    if interrupted:
        raise interrupted_error(missions, interrupted[-1])
    while (mission := next_queued(missions)) is not None:
        yield mission


def next_queued(missions: MissionStore) -> StoredMission | None:
    """Returns the queued mission that comes next."""
    return next((each for each in missions.missions(MissionState.QUEUED) if each.queued), None)


class MissionRuns:
    """Runner of the missions in a store; it stores when each mission begins and ends.

    A queued mission begins in the world as the mission before left it, and writes its files into a folder of its own.
    """

    def __init__(
        self,
        missions: MissionStore,
        screen: Screen,
        *,
        ask: Answerer | None = None,
        run: Callable[..., FinishedRun] | None = None,
        out: Path | None = None,
        record: bool = True,
    ) -> None:
        """`ask` answers open questions of a mission file; `run` replaces `run_request`, and `out` the missions' own.

        Without `record` no mission leaves a recording.
        """
        self._records = record
        self._out = None if out is None else out.resolve()
        self._missions, self._screen, self._ask, self._run_prepared = missions, screen, ask, run or run_request
        self._control: Control | None = None
        self._cancelled: str | None = None
        self._stopped, self._lack = threading.Event(), ""

    def run(self, mission: StoredMission, prepared: Prepared | None = None) -> MissionResult:
        """Runs a mission from its beginning, or resumes an interrupted or cancelled one, to its end.

        Sets aside a queued mission that cannot be run. While this machine lacks disk, files or memory, a queued mission
        waits. `prepared` is the prepared mission; None: it is prepared here.

        Raises:
            StoreError: the store cannot be used, or the queue is cancelled while it waits; no mission can be run.
            InputError: a mission outside a queue has a file, world or plant state that cannot be used.
        """
        if not mission.queued:
            for other in self._missions.missions(MissionState.RUNNING) if mission.state is MissionState.QUEUED else ():
                what = f"interrupted, and given up for mission {mission.id}"  # its world is replaced
                self._missions.finish(other.id, MissionState.CANCELLED, what)
                self._screen.tell(f"Mission {other.id} ({other.request.name}) had been interrupted; it is given up.")
            return self._run(mission, prepared)
        lack = shortage_of_files(FILES_OF_A_MISSION)
        while True:
            if lack is not None:
                self._wait_for_room(lack)
            try:
                return self._run(self._missions.mission(mission.id), prepared)
            except Exception as error:
                lack = shortage(error) or shortage_of_files(FILES_OF_A_MISSION)
                if lack is None:
                    if isinstance(error, StoreError):
                        raise
                    return self.set_aside(mission, self._cause_of(mission, error))
            finally:
                return_memory()

    def _wait_for_room(self, lack: str) -> None:
        """Waits a little, and says why unless it has said so. Raises StoreError if the queue is cancelled."""
        if self._lack != lack:
            self._screen.tell(f"errand: {lack}; the queue waits until there is room")
        self._lack = lack
        if self._stopped.wait(ROOM_WAIT_S):
            raise STORE_FILE.shortage_error(self._missions.path, lack)

    def _cause_of(self, mission: StoredMission, error: Exception) -> str:
        """Returns why a mission cannot be run; writes the traceback of a defect to a file."""
        if isinstance(error, InputError):
            return str(error)
        if isinstance(error, OSError):
            return f"{error.filename}: {error.strerror}" if error.filename else str(error)
        file = mission.request.out / f"mission-{mission.id}-traceback.txt"
        with suppress(OSError):
            file.write_text(traceback.format_exc(), encoding="utf-8")
        self._screen.tell(f"The traceback is in {file}")
        return f"a defect of errand or of a plug-in ended it ({type(error).__name__}: {error})"

    def set_aside(self, mission: StoredMission, cause: str) -> MissionResult:
        """Ends a mission that cannot be run, and stores the cause."""
        self._missions.finish(mission.id, MissionState.ERROR, cause)
        self._screen.tell(f"Mission {mission.id} ({mission.request.name}) is set aside: {cause}")
        again = f"errand resume --mission {mission.id} --store {self._missions.path}"
        self._screen.tell(f"  `{again}` tries again")
        return MissionResult(mission.id, MissionState.ERROR.value, False, cause)

    def cancel(self, reason: str) -> None:
        """Cancels the mission under way and all later ones. Signal handlers may call it.

        A mission that the same signal has cancelled goes on with its steps under `always`.
        """
        self._cancelled = reason
        self._stopped.set()
        if self._control is not None and not self._control.cancelled:
            self._control.cancel(reason)

    def _run(self, mission: StoredMission, prepared: Prepared | None) -> MissionResult:
        name, begun, resumed = mission.request.name, mission.state is not MissionState.QUEUED, None
        if begun and self._missions.has_steps(mission.id):
            resumed = resume_mission(self._missions, mission, ask=self._ask)
            self._screen.tell(f"Mission {mission.id} ({name}) goes on.")
            prepared = resumed.prepared
        elif begun:
            self._screen.tell(f"Mission {mission.id} ({name}) had not begun; it begins now.")
        if prepared is None:
            prepared = prepare(mission.request, ask=self._ask)
            self._screen.tell(f"Mission {mission.id}: {name}", title=True)
        record = self._records and prepared.request.record
        prepared = replace(prepared, request=replace(prepared.request, record=record))
        known = begun and holds_run(out := mission.request.out) and self._out in (None, out.parent)
        asked = replace(prepared.request, out=self._out or prepared.request.out)
        kept = kept_run(mission.request.out) if known else new_run(asked, self._missions.now())
        prepared = replace(prepared, request=replace(prepared.request, out=kept.request.out))
        with kept.going_on(), note_run(self._missions, mission, kept) as ended:
            before = self._before(mission) if mission.queued and resumed is None else None
            durable = durable_run(self._missions, mission, prepared, before) if resumed is None else resumed.durable
            with self._screen.watch(prepared) as options, self._cancelling(options.control):
                finished = self._run_prepared(
                    prepared, durable=durable, control=options.control, visitors=options.visitors
                )
            self._screen.conclude(finished)
            ended(finished.report)
        report, past, hung_up = finished.report, None if resumed is None else resumed.lines, finished.hung_up
        if past is not None:
            self._screen.tell("\n  ".join(["How it went on after the restart:", *past]))
        self._screen.name_files(prepared.request.out)
        return MissionResult(mission.id, report.outcome, report.achieved, report.message, report, past, hung_up)

    @contextmanager
    def _cancelling(self, control: Control) -> Iterator[None]:
        """Lets `cancel` reach the run's control; a `cancel` from before the run is passed on at once."""
        self._control = control
        if self._cancelled is not None:
            control.cancel(self._cancelled)
        try:
            yield
        finally:
            self._control = None

    def _before(self, mission: StoredMission) -> StoredMission | None:
        """Returns the mission that left the world in which this mission begins; None if it begins in a new world."""
        ended = [each for each in self._missions.missions(*_ENDED) if each.queued and each.starts]
        last = max((each for each in ended if each.id < mission.id), key=lambda each: each.id, default=None)
        if last is None or not same_world(last, mission) or last.clock_s is None:
            return None
        plant = plant_file(self._missions)
        return last if plant.with_name(f"{plant.name}.a").exists() else None


@contextmanager
def note_run(missions: MissionStore, mission: StoredMission, kept: KeptRun) -> Iterator[Callable[[RunReport], None]]:
    """Stores that a mission runs, and its end when the yielded function gets the report; so does the run's folder.

    If the run raises InputError before it begins, the store is restored. Raises StoreError if this machine lacks
    disk, files or memory.
    """
    missions.begin(mission.id, replace(mission.request, out=kept.request.out.resolve()))
    over = False

    def ended(report: RunReport) -> None:
        nonlocal over
        over = True
        missions.finish(mission.id, MissionState(report.outcome), report.message)
        kept.end(report.to_json())

    try:
        yield ended
    except InputError:
        if over:
            raise
        kept.undo()
        if mission.queued or mission.starts:
            missions.undo_begin(mission)
        else:
            missions.remove(mission.id)
        raise
    except Exception as error:
        if (lack := shortage(error)) is None:
            raise
        raise STORE_FILE.shortage_error(missions.path, lack) from error


def plant_file(store: MissionStore) -> Path:
    """Returns the file in which the plant stores the state of a store's missions."""
    return store.path.with_suffix(".plant")


def durable_run(
    store: MissionStore, mission: StoredMission, prepared: Prepared, before: StoredMission | None = None
) -> Durable:
    """Returns the stored state for a mission in a new world, or in the world that the mission `before` left."""
    journals, label = _journals(store, mission, prepared), str(mission.id)
    starts = {name: robot.start for name, robot in prepared.robots.items()} if before is None else before.poses
    if prepared.request.robots:
        store.place(mission.id, starts)
    if before is None:
        return Durable(plant_file(store), journals, label)
    return Durable(plant_file(store), journals, label, take_up=True, poses=before.poses)


def _journals(store: MissionStore, mission: StoredMission, prepared: Prepared) -> Mapping[str, StoreJournal]:
    """Returns a journal for each robot of a mission; a correction of the mission is stored in place of the original."""
    bare = replace(prepared, request=replace(mission.request, sentence=None, file=None, text=None))
    return {
        each.mission.robot_name: store.journal(mission.id, _part_of(each)).allow_replacement(
            each.tree, lambda tree: bare.with_tree(tree).request
        )
        for each in prepared.all
    }


def _part_of(prepared: Prepared) -> str | None:
    """Name under which the store holds the robot's part of a mission; None for the only robot of a run."""
    return prepared.mission.robot_name if prepared.request.robots else None


def same_world(one: StoredMission, other: StoredMission) -> bool:
    """Returns whether two missions are for the same robots in the same world."""
    a, b = one.request, other.request
    same = (a.world, a.world_name, a.seed, frozenset(a.robots)) == (b.world, b.world_name, b.seed, frozenset(b.robots))
    return same and (a.robots or a.robot == b.robot) and (a.scenario, a.variation) == (b.scenario, b.variation)


@dataclass(frozen=True)
class ResumedMission:
    """Interrupted mission that is ready to continue, with the restored state of each robot as a recollection."""

    prepared: Prepared
    durable: Durable
    recollections: Sequence[Recollection]

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines for the user on the restored parts of the mission."""
        return tuple(line for each in self.recollections for line in each.log)


def resume_mission(store: MissionStore, mission: StoredMission, *, ask: Answerer | None = None) -> ResumedMission:
    """Restores an interrupted mission, each robot at its last pose; `ask` answers questions as in `prepare`.

    Raises:
        InputError: the stored state cannot be read, or another version of the code or the world gives another tree.
    """
    prepared = prepare(mission.request, ask=ask)
    if prepared.request.fingerprint != mission.request.fingerprint:
        raise _other_version(store, mission)
    every = [_with_replacement(store, mission, each) for each in prepared.all]
    memories = [store.memory(mission.id, _part_of(each)) for each in every]
    resumed = [
        (ended_tree(each.tree, memory) if prepared.request.robots else None) or resumed_tree(each.tree, memory)
        for each, memory in zip(every, memories, strict=True)
    ]
    journals = _journals(store, mission, prepared)
    for each, (tree, recollection) in zip(every, resumed, strict=True):
        journals[each.mission.robot_name].use_recollection(recollection, tree)
    names = [each.mission.robot_name for each in every]
    poses = {name: memory.pose for name, memory in zip(names, memories, strict=True) if memory.pose is not None}
    label, log = str(mission.id), log_name(mission.starts + 1)
    durable = Durable(plant_file(store), journals, label, True, label, poses, log)
    first, *others = (replace(each, tree=tree) for each, (tree, _) in zip(every, resumed, strict=True))
    whole = replace(first, request=prepared.request, others=tuple(others))
    return ResumedMission(whole, durable, [recollection for _, recollection in resumed])


def _with_replacement(store: MissionStore, mission: StoredMission, prepared: Prepared) -> Prepared:
    """Returns a robot's mission, or the correction that replaced it. Raises InputError if its tree has changed."""
    name = prepared.mission.robot_name
    other = mission.instead.get(name)
    if other is None:
        return prepared
    asked = replace(prepared.request, name=other.name, commands=other.commands, robot=name)
    instead = Setting(asked, prepared.world, prepared.knowledge, prepared.robots).mission_of_commands()
    own = replace(prepared, request=asked).with_mission(instead)
    if own.request.fingerprint != other.fingerprint:
        raise _other_version(store, mission)
    return replace(prepared, mission=own.mission, tree=own.tree)


def _other_version(store: MissionStore, mission: StoredMission) -> InputError:
    hint = f"go back to the version that began it, or `errand queue remove {mission.id}` and give it again"
    what = f"mission {mission.id} was begun with another version of errand, of the world or of the skills"
    return InputError(what, hint=hint, file=store.path)


def interrupted_error(missions: MissionStore, mission: StoredMission) -> InputError:
    """Returns the error which says that an interrupted mission must be resumed first."""
    what = f"mission {mission.id} ({mission.request.name}) was interrupted"
    return InputError(what, hint="`errand resume` goes on with it and then with the queue", file=missions.path)


def resumable_line(missions: MissionStore) -> str | None:
    """Returns the line on how to resume the last mission; None unless that mission was cancelled."""
    begun = [each for each in missions.missions() if each.starts]
    if not begun or begun[-1].state is not MissionState.CANCELLED:
        return None
    last = begun[-1]
    what = f"Mission {last.id} ({last.request.name}) was cancelled"
    return f"{what}; `errand resume --store {missions.path}` goes on with it{' and then with the queue' * last.queued}."
