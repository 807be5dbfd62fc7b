"""What makes a run outlive its process: the request in the store, the journal, and where the plant keeps its state."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from executive.cli.report import RunReport
from executive.cli.requests import Prepared, prepare, replacing
from executive.mission.errors import InputError, disk_is_full
from executive.mission.request import Request
from executive.record.reader import Event, read_events
from executive.record.schemas import RUN
from executive.store.database import full_disk
from executive.store.journal import StoreJournal
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.store.recollection import Recollection
from executive.store.resuming import resumed_tree
from skills.robot import Pose2D

STORE: Final = "missions.sqlite"
_MOST_STARTS: Final = 1000


def run_arguments(asked: Request, prepared: Prepared) -> list[str]:
    """The arguments by which `errand run` does the same in a process of its own, where nobody can be asked.

    A sentence has the answers in their places; to the questions of a file they are given again.
    """
    arguments = ["--say", prepared.request.sentence or ""] if asked.file is None else [str(asked.file)]
    arguments += ["--world", asked.world] if asked.world else []
    arguments += [] if asked.require_wake is None else ["--wake" if asked.require_wake else "--no-wake"]
    arguments += ["--stack", str(asked.stack)] if asked.stack else []
    arguments += [] if asked.start is None else [f"--start={asked.start}"]
    arguments += [f"--set={name}={json.dumps(value)}" for name, value in asked.given.items()]
    arguments += ["--map", str(asked.map)] if asked.map else []
    arguments += [f"--fault={words}" for words in asked.scenario.faults]
    arguments += [f"--random-faults={asked.scenario.random}"] if asked.scenario.random else []
    arguments += [f"--scenario={path}" for path in asked.scenario_files]
    arguments += asked.variation.arguments()
    if asked.file is None:
        return arguments
    arguments += [part for answer in asked.answers for part in ("--answer", answer)]
    return [*arguments, *([] if asked.questions is None else ["--questions", asked.questions.value])]


@dataclass(frozen=True)
class Durable:
    """What a run needs to be taken up later, or to take up an earlier one.

    `plant` is the name of the file in which the plant keeps its state for the mission `label`. With `take_up` it
    begins from what was kept for `take_up_label` (None: for any). `pose` is where the robot last believed to be.
    """

    plant: Path
    journal: StoreJournal
    label: str
    take_up: bool = False
    take_up_label: str | None = None
    pose: Pose2D | None = None
    log: str = "log.mcap"


def plant_file(store: MissionStore) -> Path:
    """Where the plant of a store's missions keeps its state; nobody but the plant reads it."""
    return store.path.with_suffix(".plant")


def new_run(store: MissionStore, mission: StoredMission) -> Durable:
    """A mission that begins in a fresh world."""
    return Durable(plant_file(store), _journal(store, mission), str(mission.id))


def _journal(store: MissionStore, mission: StoredMission) -> StoreJournal:
    """The journal of a mission; what takes its place by a correction is kept in its stead."""
    return store.journal(mission.id).replaceable(lambda tree: replacing(mission.request, tree))


def next_run(store: MissionStore, mission: StoredMission, before: StoredMission) -> Durable:
    """A mission that begins in the world as another has left it."""
    return replace(new_run(store, mission), take_up=True, pose=before.pose)


def same_world(one: StoredMission, other: StoredMission) -> bool:
    """Whether two missions are to be done by one robot in one world."""
    a, b = one.request, other.request
    same = (a.world, a.world_name, a.seed, a.robot) == (b.world, b.world_name, b.seed, b.robot)
    return same and (a.scenario, a.variation) == (b.scenario, b.variation)


@dataclass(frozen=True)
class TakenUp:
    """A mission that was broken off, ready to go on."""

    prepared: Prepared
    durable: Durable
    recollection: Recollection


def take_up(store: MissionStore, mission: StoredMission) -> TakenUp:
    """All that is needed to go on with a mission.

    Raises:
        InputError: what the store knows of it cannot be read, or its tree is no longer the one that was begun.
    """
    prepared = prepare(as_it_was(mission, store.path))
    if prepared.request.fingerprint != mission.request.fingerprint:
        hint = f"go back to the version that began it, or `errand queue remove {mission.id}` and give it again"
        what = f"mission {mission.id} was begun with another version of errand, of the world or of the skills"
        raise InputError(what, hint=hint, file=store.path)
    memory = store.memory(mission.id)
    resumed, recollection = resumed_tree(prepared.tree, memory)
    journal = _journal(store, mission).remembering(recollection)
    log = _log_name(mission.starts + 1)
    label = str(mission.id)
    durable = Durable(plant_file(store), journal, label, True, label, memory.pose, log)
    return TakenUp(replace(prepared, tree=resumed), durable, recollection)


def _log_name(start: int) -> str:
    """The name of the log of a mission's first start, second start, and so on."""
    return "log.mcap" if start == 1 else f"log-{start}.mcap"


def mission_events(log: Path) -> tuple[Event, ...]:
    """The events of a log, after those of the earlier starts of the mission, as far as their logs can still be read.

    Raises InputError: the log itself cannot be read.
    """
    events, before = read_events(log), list[Event]()
    for name in (_log_name(start) for start in range(1, _MOST_STARTS)):
        if name == log.name:
            break
        with suppress(InputError):
            earlier = read_events(log.with_name(name))
            before += earlier if _facts(earlier) == _facts(events) else ()
    return (*before, *events)


def _facts(events: Sequence[Event]) -> object:
    """What a log says at its beginning: the commands, the world, the seed."""
    return next((event.data for event in events if event.topic == RUN), None)


def as_it_was(mission: StoredMission, store: Path) -> Request:
    """What was asked for then. A file that has changed since is taken as it was.

    Raises:
        InputError: the file has changed, and its old text cannot be laid beside it.
    """
    file, text = mission.request.file, mission.request.text
    if file is None or text is None or _text(file) == text:
        return mission.request
    file = file.with_name(f".{file.stem}.mission-{mission.id}{file.suffix}")
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        what = f"the file of mission {mission.id} has changed, and its old text cannot be laid beside it"
        raise InputError(f"{what} ({error.strerror})", hint="put the old file back", file=file) from error
    return replace(mission.request, file=file)


def _text(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


@contextmanager
def kept(store: MissionStore, mission: StoredMission) -> Iterator[Callable[[RunReport], None]]:
    """Note in the store that a mission is under way, and, when told the report, how it ended.

    A run that could not begin leaves things as they were; of one that is killed, or breaks off since the disk is full,
    nobody notes anything. Raises InputError, which names the way on: the disk is full.
    """
    store.begin(mission.id)
    over = False

    def ended(report: RunReport) -> None:
        nonlocal over
        over = True
        store.finish(mission.id, MissionState(report.outcome), report.message)

    try:
        yield ended
    except OSError as error:
        raise full_disk(store.path) if disk_is_full(error) else error from error
    except InputError:
        if over:
            raise
        if mission.queued or mission.starts:
            store.finish(mission.id, mission.state, mission.message)
        else:
            store.remove(mission.id)
        raise


def give_up_broken(store: MissionStore, mission: StoredMission) -> Sequence[StoredMission]:
    """Missions that were broken off can no longer be taken up once another begins in a fresh world."""
    broken = store.missions(MissionState.RUNNING)
    for each in broken:
        store.finish(each.id, MissionState.CANCELLED, f"broken off, and given up for mission {mission.id}")
    return broken
