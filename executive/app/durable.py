"""What makes a run outlive its process: the request in the store, the journal, and where the plant keeps its state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from executive.app.prepare import Setting, prepare
from executive.app.prepared import Prepared, compiled_request
from executive.language.questions import Answerer
from executive.record.reader import Event, read_events
from executive.record.schemas import RUN
from executive.store.journal import StoreJournal
from executive.store.memory import Recollection
from executive.store.missions import MissionStore, StoredMission
from executive.store.resuming import ended_tree, resumed_tree
from skills.files.errors import InputError
from skills.robot import Pose2D

STORE: Final = "missions.sqlite"
_MOST_STARTS: Final = 1000


@dataclass(frozen=True)
class Durable:
    """What a run needs to be taken up later, or to take up an earlier one.

    `plant` is the name of the file in which the plant keeps its state for the mission `label`. With `take_up` it
    begins from what was kept for `take_up_label` (None: for any). `journals` are those of the robots by their names,
    `poses` where each last believed to be.
    """

    plant: Path
    journals: Mapping[str, StoreJournal]
    label: str
    take_up: bool = False
    take_up_label: str | None = None
    poses: Mapping[str, Pose2D] = field(default_factory=dict)
    log: str = "log.mcap"

    @property
    def troubles(self) -> tuple[str, ...]:
        """What could not be kept."""
        return tuple(dict.fromkeys(trouble for each in self.journals.values() for trouble in each.troubles))


def plant_file(store: MissionStore) -> Path:
    """Where the plant of a store's missions keeps its state; nobody but the plant reads it."""
    return store.path.with_suffix(".plant")


def new_run(store: MissionStore, mission: StoredMission, prepared: Prepared) -> Durable:
    """A mission that begins in a fresh world."""
    if prepared.request.robots:
        store.place(mission.id, {name: robot.start for name, robot in prepared.robots.items()})
    return Durable(plant_file(store), _journals(store, mission, prepared), str(mission.id))


def _journals(store: MissionStore, mission: StoredMission, prepared: Prepared) -> Mapping[str, StoreJournal]:
    """The journals of a mission's robots; what takes the place of one's part by a correction is kept in its stead."""
    return {
        each.mission.robot_name: store.journal(mission.id, _part_of(each)).replaceable(
            each.tree,
            lambda tree: compiled_request(replace(mission.request, sentence=None, file=None, text=None), tree),
        )
        for each in prepared.all
    }


def _part_of(prepared: Prepared) -> str | None:
    """The robot under whose name the store keeps a part of a mission; None for the only robot of a run."""
    return prepared.mission.robot_name if prepared.request.robots else None


def next_run(store: MissionStore, mission: StoredMission, prepared: Prepared, before: StoredMission) -> Durable:
    """A mission that begins in the world as another has left it."""
    if prepared.request.robots:
        store.place(mission.id, before.poses)
    return replace(new_run(store, mission, prepared), take_up=True, poses=before.poses)


def same_world(one: StoredMission, other: StoredMission) -> bool:
    """Whether two missions are to be done by the same robots in one world."""
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
        """What became of its past so far."""
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
    label, log = str(mission.id), _log_name(mission.starts + 1)
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
