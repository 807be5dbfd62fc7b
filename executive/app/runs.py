"""Runs missions of a store one after another: a single run is a queue of one, and a server a queue that waits."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Protocol

from executive.app.backend import Durable
from executive.app.mission_run import Finished, log_name, return_memory, run_request
from executive.app.page_view import PageView
from executive.app.prepare import Setting, prepare
from executive.app.prepared import Prepared
from executive.app.report import RunReport
from executive.app.signals import HUNG_UP
from executive.language.questions import Answerer
from executive.record.work import Profile
from executive.run.control import Control
from executive.run.visitor import RunVisitor
from executive.store.database import STORE_FILE, StoreError
from executive.store.journal import StoreJournal
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.store.recollection import Recollection
from executive.store.resuming import ended_tree, resumed_tree
from executive.words.slug import slug
from skills.files.errors import InputError, disk_is_full

_ENDED: Final = (MissionState.SUCCESS, MissionState.FAILURE, MissionState.CANCELLED, MissionState.ERROR)


@dataclass(frozen=True)
class Watching:
    """The control and the watchers of a run, as `run_request` takes them."""

    control: Control
    visitors: Sequence[RunVisitor] = ()
    page: PageView | None = None
    profile: Profile | None = None


class Screen(Protocol):
    """What people see of runs, and what they control them by."""

    def tell(self, line: str, *, title: bool = False) -> None:
        """Shows a line."""

    def watching(self, prepared: Prepared) -> AbstractContextManager[Watching]:
        """Shows a run from before its beginning to its end."""

    def conclude(self, finished: Finished) -> None:
        """Shows how a run ended."""

    def name_files(self, out: Path) -> None:
        """Names what a run has left in its folder."""


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
        """Returns whether it ended since its terminal was closed."""
        return self.message == HUNG_UP

    def to_json(self) -> dict[str, Any]:
        """Its report as JSON values, with the mission's number."""
        told = {"outcome": self.outcome, "message": self.message} if self.report is None else self.report.to_json()
        told |= {"mission": self.mission, "achieved": self.achieved}
        return told if self.past is None else {**told, "resumed": list(self.past)}


class Runner(Protocol):
    """Runs missions of the store."""

    def run(self, mission: StoredMission) -> Ended:
        """Runs one to its end, or sets it aside. Raises InputError: no further one can be run."""

    def set_aside(self, mission: StoredMission, cause: str) -> Ended:
        """Ends one that cannot be run with its cause."""

    def cancel(self, reason: str) -> None:
        """Cancels the one under way, and any that begins later; from signal handlers."""


def run_in_turn(missions: Iterable[StoredMission], runner: Runner, *, until_cancelled: bool = True) -> list[Ended]:
    """Runs missions as they come, the next one when one has ended; `until_cancelled`, none after one was cancelled.

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
    while (mission := next_queued(missions)) is not None:
        yield mission


def next_queued(missions: MissionStore) -> StoredMission | None:
    """The mission whose turn it is."""
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
        """`ask` is who is asked what a file leaves open; `run` runs what is prepared, in the place of `run_request`."""
        self._missions, self._screen, self._ask, self._run_prepared = missions, screen, ask, run or run_request
        self._control: Control | None = None
        self._cancelled: str | None = None

    def run(self, mission: StoredMission, prepared: Prepared | None = None) -> Ended:
        """Runs a mission from its beginning, or goes on with one that was broken off or cancelled, to its end.

        One of a queue that cannot be run is set aside, so that the next one can. `prepared` is the mission where it is
        understood already.

        Raises:
            StoreError: the store cannot be used, or the disk is full; no other mission can be run either.
            InputError: it is none of a queue, and its file, its world or the plant's state cannot be used.
        """
        if not mission.queued:
            if mission.state is MissionState.QUEUED:
                self._give_up_broken_off(mission)
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
            file = self._missions.path.with_name(f"mission-{mission.id}-traceback.txt")
            with suppress(OSError):
                file.write_text(traceback.format_exc(), encoding="utf-8")
            self._screen.tell(f"The traceback is in {file}")
        finally:
            return_memory()
        return self.set_aside(mission, cause)

    def _give_up_broken_off(self, mission: StoredMission) -> None:
        """Gives up missions that were broken off, because the mission that runs now replaces their world."""
        for broken in self._missions.missions(MissionState.RUNNING):
            self._missions.finish(
                broken.id, MissionState.CANCELLED, f"broken off, and given up for mission {mission.id}"
            )
            self._screen.tell(f"Mission {broken.id} ({broken.request.name}) had been broken off; it is given up.")

    def set_aside(self, mission: StoredMission, cause: str) -> Ended:
        """Ends a mission that cannot be run with its cause."""
        self._missions.finish(mission.id, MissionState.ERROR, cause)
        self._screen.tell(f"Mission {mission.id} ({mission.request.name}) is set aside: {cause}")
        again = f"errand resume --mission {mission.id} --store {self._missions.path}"
        self._screen.tell(f"  `{again}` tries again")
        return Ended(mission.id, MissionState.ERROR.value, False, cause)

    def cancel(self, reason: str) -> None:
        """Cancels the mission under way, and any that begins later; from signal handlers."""
        self._cancelled = reason
        if self._control is not None:
            self._control.cancel(reason)

    def _run(self, mission: StoredMission, prepared: Prepared | None) -> Ended:
        name, begun, taken = mission.request.name, mission.state is not MissionState.QUEUED, None
        if begun and self._missions.has_steps(mission.id):
            taken = take_up(self._missions, mission, ask=self._ask)
            self._screen.tell(f"Mission {mission.id} ({name}) goes on.")
            prepared = _in_its_folder(mission, taken.prepared)
        elif begun:
            self._screen.tell(f"Mission {mission.id} ({name}) had not begun; it begins now.")
        if prepared is None:
            prepared = _in_its_folder(mission, prepare(mission.request, ask=self._ask))
            self._screen.tell(f"Mission {mission.id}: {name}", title=True)
        with note_run(self._missions, mission) as ended:
            before = self._before(mission) if mission.queued and taken is None else None
            durable = new_run(self._missions, mission, prepared, before) if taken is None else taken.durable
            with self._screen.watching(prepared) as by, self._cancelling(by.control):
                finished = self._run_prepared(prepared, durable=durable, **vars(by))
            self._screen.conclude(finished)
            ended(finished.report)
        report, past = finished.report, None if taken is None else taken.told
        if past is not None:
            self._screen.tell("\n  ".join(["What became of its past:", *past]))
        self._screen.name_files(prepared.request.out)
        return Ended(mission.id, report.outcome, report.achieved, report.message, report, past)

    @contextmanager
    def _cancelling(self, control: Control) -> Iterator[None]:
        """Lets `cancel` cancel this run, also when `cancel` was called before the run began."""
        self._control = control
        if self._cancelled is not None:
            control.cancel(self._cancelled)
        try:
            yield
        finally:
            self._control = None

    def _before(self, mission: StoredMission) -> StoredMission | None:
        """The mission that left the world in which this one begins; None when it begins in a fresh one."""
        ended = [each for each in self._missions.missions(*_ENDED) if each.queued and each.starts]
        last = max((each for each in ended if each.id < mission.id), key=lambda each: each.id, default=None)
        if last is None or not same_world(last, mission) or last.clock_s is None:
            return None
        plant = plant_file(self._missions)
        return last if plant.with_name(f"{plant.name}.a").exists() else None


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


def plant_file(store: MissionStore) -> Path:
    """Where the plant of a store's missions keeps its state; nobody but the plant reads it."""
    return store.path.with_suffix(".plant")


def new_run(
    store: MissionStore, mission: StoredMission, prepared: Prepared, before: StoredMission | None = None
) -> Durable:
    """A mission that begins in a fresh world, or in the one that the mission `before` has left."""
    journals, label = _journals(store, mission, prepared), str(mission.id)
    starts = {name: robot.start for name, robot in prepared.robots.items()} if before is None else before.poses
    if prepared.request.robots:
        store.place(mission.id, starts)
    if before is None:
        return Durable(plant_file(store), journals, label)
    return Durable(plant_file(store), journals, label, take_up=True, poses=before.poses)


def _journals(store: MissionStore, mission: StoredMission, prepared: Prepared) -> Mapping[str, StoreJournal]:
    """The journals of a mission's robots; what takes the place of one's part by a correction is kept in its stead."""
    bare = replace(prepared, request=replace(mission.request, sentence=None, file=None, text=None))
    return {
        each.mission.robot_name: store.journal(mission.id, _part_of(each)).replaceable(
            each.tree, lambda tree: bare.with_tree(tree).request
        )
        for each in prepared.all
    }


def _part_of(prepared: Prepared) -> str | None:
    """The robot under whose name the store keeps a part of a mission; None for the only robot of a run."""
    return prepared.mission.robot_name if prepared.request.robots else None


def same_world(one: StoredMission, other: StoredMission) -> bool:
    """Returns whether two missions are to be done by the same robots in one world."""
    a, b = one.request, other.request
    same = (a.world, a.world_name, a.seed, frozenset(a.robots)) == (b.world, b.world_name, b.seed, frozenset(b.robots))
    return same and (a.robots or a.robot == b.robot) and (a.scenario, a.variation) == (b.scenario, b.variation)


@dataclass(frozen=True)
class TakenUp:
    """A mission that was broken off, ready to go on; a recollection for each robot."""

    prepared: Prepared
    durable: Durable
    recollections: Sequence[Recollection]

    @property
    def told(self) -> tuple[str, ...]:
        """Lines for the user: what was taken over of the mission's past."""
        return tuple(line for each in self.recollections for line in each.told)


def take_up(store: MissionStore, mission: StoredMission, *, ask: Answerer | None = None) -> TakenUp:
    """All that is needed to go on with a mission, each robot from where it was; `ask` is that of `prepare`.

    Raises:
        InputError: what the store knows of it cannot be read, or its tree is no longer the one that was begun.
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
        journals[each.mission.robot_name].remembering(recollection, tree)
    names = [each.mission.robot_name for each in every]
    poses = {name: memory.pose for name, memory in zip(names, memories, strict=True) if memory.pose is not None}
    label, log = str(mission.id), log_name(mission.starts + 1)
    durable = Durable(plant_file(store), journals, label, True, label, poses, log)
    first, *others = (replace(each, tree=tree) for each, (tree, _) in zip(every, resumed, strict=True))
    together = replace(first, request=prepared.request, others=tuple(others))
    return TakenUp(together, durable, [recollection for _, recollection in resumed])


def _with_replacement(store: MissionStore, mission: StoredMission, prepared: Prepared) -> Prepared:
    """What a robot is to do, or what has taken its place by a correction. Raises InputError: its tree is another."""
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
