"""What makes a run outlive its process: the order in the store, the journal, and where the plant keeps its state."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from executive.cli.answers import NO_ANSWERS, Answers
from executive.cli.assembly import take_up_plant
from executive.cli.report import RunReport
from executive.cli.requests import Request, commanded, filed, said
from executive.mission.errors import InputError
from executive.store.journal import StoreJournal
from executive.store.missions import MissionState, MissionStore, Order, StoredMission
from executive.store.recollection import Recollection
from executive.store.resuming import resumed_tree
from executive.tree.compiler import CompiledTree
from plant.simulation import Simulation
from skills.robot import Pose2D

STORE: Final = "missions.sqlite"


@dataclass(frozen=True)
class SpokenMission:
    """A mission that was spoken of during a run, of which the name and the commands (as text) are known."""

    name: str
    robot: str
    commands: tuple[str, ...]


@dataclass(frozen=True)
class Asked:
    """What the user asked for: a file or a sentence, in a world (None: the file's own, or the usual one).

    `spoken` stands for both where the mission came about in a conversation.
    `answers` are to the questions that it leaves open; what is kept of a sentence has them in their places.
    """

    file: Path | None = None
    say: str | None = None
    world: str | None = None
    require_wake: bool = False
    answers: Answers = NO_ANSWERS
    spoken: SpokenMission | None = None

    def request(self) -> Request:
        """What it means. Raises InputError."""
        if self.spoken is not None:
            return commanded(self.spoken.commands, name=self.spoken.name, robot=self.spoken.robot, world=self.world)
        if (self.file is None) == (self.say is None):
            raise InputError("a mission file or --say is needed, and not both", mend='try: --say "Hey Alice, ..."')
        if self.say is not None:
            return said(self.say, world=self.world, require_wake=self.require_wake, answers=self.answers)
        assert self.file is not None
        return filed(self.file, world=self.world, answers=self.answers)

    def order(self, request: Request, tree: CompiledTree, *, seed: int, out: Path, record: bool) -> Order:
        """The same, complete enough to be taken up by another process in another folder."""
        here = self.world is not None and Path(self.world).exists()
        return Order(
            name=request.mission.name,
            world=str(Path(self.world).resolve()) if here and self.world is not None else self.world,
            world_name=request.world.name,
            robot=request.mission.robot_name,
            seed=seed,
            out=str(out.resolve()),
            commands=tuple(map(str, request.mission.commands)),
            fingerprint=fingerprint(tree),
            sentence=self.say if request.meant is None else request.meant.text,
            file=None if self.file is None else str(self.file.resolve()),
            text=None if self.file is None else self.file.read_text(encoding="utf-8"),
            require_wake=self.require_wake,
            record=record,
        )


def run_arguments(asked: Asked, request: Request) -> list[str]:
    """The arguments by which `errand run` does the same in a process of its own, where nobody can be asked.

    A sentence has the answers in their places; to the questions of a file they are given again.
    """
    sentence = asked.say if request.meant is None else request.meant.text
    arguments = [str(asked.file)] if asked.file else ["--say", sentence or ""]
    arguments += ["--world", asked.world] if asked.world else []
    arguments += [] if asked.require_wake else ["--no-wake"]
    given = asked.answers.given if asked.file else ()
    arguments += [part for answer in given for part in ("--answer", answer)]
    policy = asked.answers.policy if asked.file else None
    return [*arguments, *([] if policy is None else ["--questions", policy.value])]


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

    def begin(self, simulation: Simulation) -> None:
        """Take up the plant's state where that is wanted, and let it be kept from now on. Raises InputError."""
        if self.take_up:
            take_up_plant(simulation, self.plant, label=self.take_up_label)
        self.journal.keep_world = simulation.keep_in(self.plant, label=self.label)


def fingerprint(tree: CompiledTree) -> str:
    """Equal for trees of the same nodes."""
    nodes = "\n".join(f"{node.kind} {node.path_id}" for node in tree.root.walk())
    return hashlib.sha256(nodes.encode()).hexdigest()[:16]


def plant_file(store: MissionStore) -> Path:
    """Where the plant of a store's missions keeps its state; nobody but the plant reads it."""
    return store.path.with_suffix(".plant")


def new_run(store: MissionStore, mission: StoredMission) -> Durable:
    """A mission that begins in a fresh world."""
    return Durable(plant_file(store), _journal(store, mission), str(mission.id))


def _journal(store: MissionStore, mission: StoredMission) -> StoreJournal:
    """The journal of a mission; what takes its place by a correction is kept in its stead."""

    def order_of(tree: CompiledTree) -> Order:
        """The order of a tree that takes the mission's place."""
        commands, nodes = tuple(map(str, tree.commands)), fingerprint(tree)
        return replace(
            mission.order,
            name=tree.mission_name,
            commands=commands,
            fingerprint=nodes,
            sentence=None,
            file=None,
            text=None,
        )

    return store.journal(mission.id).replaceable(order_of)


def next_run(store: MissionStore, mission: StoredMission, before: StoredMission) -> Durable:
    """A mission that begins in the world as another has left it."""
    return replace(new_run(store, mission), take_up=True, pose=before.pose)


def same_world(one: StoredMission, other: StoredMission) -> bool:
    """Whether two missions are to be done by one robot in one world."""
    a, b = one.order, other.order
    return (a.world, a.world_name, a.seed, a.robot) == (b.world, b.world_name, b.seed, b.robot)


@dataclass(frozen=True)
class TakenUp:
    """A mission that was broken off, ready to go on."""

    request: Request
    tree: CompiledTree
    durable: Durable
    recollection: Recollection


def take_up(store: MissionStore, mission: StoredMission) -> TakenUp:
    """All that is needed to go on with a mission.

    Raises:
        InputError: what the store knows of it cannot be read, or its tree is no longer the one that was begun.
    """
    request = asked_again(mission, store.path).request()
    tree = request.compile()
    if fingerprint(tree) != mission.order.fingerprint:
        mend = f"go back to the version that began it, or `errand queue remove {mission.id}` and give it again"
        what = f"mission {mission.id} was begun with another version of errand, of the world or of the skills"
        raise InputError(what, mend=mend, file=store.path)
    memory = store.memory(mission.id)
    resumed, recollection = resumed_tree(tree, memory)
    journal = _journal(store, mission).remembering(recollection)
    log = f"log-{mission.starts + 1}.mcap"
    label = str(mission.id)
    durable = Durable(plant_file(store), journal, label, True, label, memory.pose, log)
    return TakenUp(request, resumed, durable, recollection)


def asked_again(mission: StoredMission, store: Path) -> Asked:
    """What was asked for then. A file that has changed since is taken as it was.

    Raises:
        InputError: the file has changed, and its old text cannot be laid beside it.
    """
    order = mission.order
    if order.sentence is None and order.file is None:
        spoken = SpokenMission(order.name, order.robot, order.commands)
        return Asked(world=order.world or order.world_name, spoken=spoken)
    file = None if order.file is None else Path(order.file)
    if file is not None and order.text is not None and _text(file) != order.text:
        file = file.with_name(f".{file.stem}.mission-{mission.id}{file.suffix}")
        try:
            file.write_text(order.text, encoding="utf-8")
        except OSError as error:
            what = f"the file of mission {mission.id} has changed, and its old text cannot be laid beside it"
            raise InputError(f"{what} ({error.strerror})", mend="put the old file back", file=file) from error
    return Asked(file, order.sentence, order.world, order.require_wake)


def _text(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


@contextmanager
def kept(store: MissionStore, mission: StoredMission) -> Iterator[Callable[[RunReport], None]]:
    """Note in the store that a mission is under way, and, when told the report, how it ended.

    A run that could not begin leaves things as they were; of one that is killed nobody notes anything.
    """
    store.begin(mission.id)

    def ended(report: RunReport) -> None:
        store.finish(mission.id, MissionState(report.outcome), report.message)

    try:
        yield ended
    except InputError:
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
