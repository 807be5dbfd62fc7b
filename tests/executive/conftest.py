"""A scripted robot, a clock that is moved by hand, and scripted skills: whole missions without a plant."""

from __future__ import annotations

import gc
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.app import prepare, worlds
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.store.database import Database
from executive.tree.board import Board
from executive.tree.compiler import CompiledTree, compile_mission
from executive.tree.context import RunContext
from executive.tree.node import Change, TreeObserver
from executive.tree.registry import installed_skills
from executive.words.command import parse_command
from executive.words.knowledge import Knowledge, load_knowledge
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from plant.worlds.world import WORLDS_FOLDER, World, known_worlds, load_world
from skills.api import (
    Cause,
    Failed,
    LocalisationEstimate,
    ObjectKind,
    ObjectObservation,
    Running,
    Skill,
    Succeeded,
    Surface,
)
from skills.api import Step as SkillStep
from skills.quantities import Coordinate
from skills.robot import (
    Battery,
    Capabilities,
    CommandId,
    CommandState,
    CommandStatus,
    Gripper,
    Joints,
    Lease,
    LeaseError,
    Odometry,
    Pose2D,
    Scan,
)
from skills.testing.robot import BASE_ONLY
from tests.visitors import OnMessage, OnTick


class ManualClock:
    """Time that only `advance` moves."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    def advance(self, dt_s: float) -> None:
        self.time_s = round(self.time_s + dt_s, 9)


class ScriptedRobot:
    """Remembers what was asked of it; `raising` maps a verb to the exception that it raises."""

    def __init__(self, clock: ManualClock, name: str = "Alice") -> None:
        self.name = name
        self.clock = clock
        self.holding = False
        self.opening, self.empty_rad = 0.3, 0.0
        self.clamps_n: list[float] = []
        self.driving = self.silent = False
        self.charge = 0.9
        self.standing = Pose2D(0.0, 0.0, 0.0)
        self.lease: Lease | None = None
        self.leases = 0
        self.calls: list[str] = []
        self.raising: dict[str, BaseException] = {}
        self._odometry: tuple[object, Odometry] | None = None

    def _called(self, verb: str) -> CommandId:
        self.calls.append(verb)
        if verb in self.raising:
            raise self.raising[verb]
        return CommandId(len(self.calls))

    def odometry(self) -> Odometry:
        if "odometry" in self.raising:
            raise self.raising["odometry"]
        now = self.clock.now(), self.standing
        if self._odometry is None or (
            self._odometry[0] != now and not self.silent
        ):  # one reading for all who ask at one time
            self._odometry = now, Odometry(now[0], self.standing.transform(), (0.0, 0.0, 0.0))
        return self._odometry[1]

    def gripper(self) -> Gripper:
        opening = self.opening if self.holding else self.empty_rad
        return Gripper(self.clock.now(), opening, 10.0 * self.holding, self.holding)

    def joints(self) -> Joints:
        return Joints(self.clock.now(), {"elbow": 0.5}, {"elbow": 0.1}, {"elbow": 2.0})

    def scan(self) -> Scan:
        """A wall 2 m away on all sides, without a return straight behind."""
        ranges, azimuths = np.full((2, 8), 2.0, np.float32), np.linspace(-np.pi, np.pi, 8, endpoint=False)
        ranges[:, 0] = np.nan
        X_BL = RigidTransform([0.1, 0.0, 0.4])
        return Scan(self.clock.now(), ranges, np.array([-0.3, 0.0]), azimuths, X_BL, self.standing.transform())

    def let_go(self) -> None:
        """Open the gripper, as a skill that puts something down does."""
        self.holding, self.empty_rad = False, 1.0

    def capabilities(self) -> Capabilities:
        return BASE_ONLY

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        self.clamps_n.append(force_n)
        return self._called("set_gripper")

    def carry(self, holding: bool, *, lease: Lease) -> None:
        self._called("carry")

    def battery(self) -> Battery:
        return Battery(self.clock.now(), self.charge)

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        command = self._called("drive")
        self.driving = True
        return command

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        command = self._called("stop")
        self.driving = False
        return command

    def command_status(self, command: CommandId) -> CommandStatus:
        return CommandStatus(CommandState.DONE)

    @property
    def holder(self) -> str | None:
        return self.lease.holder if self.lease else None

    @holder.setter
    def holder(self, name: str | None) -> None:
        self.leases += 1
        self.lease = Lease(self.name, name, self.leases) if name else None

    def lease_holder(self) -> Lease | None:
        return self.lease

    def acquire_lease(self, holder: str) -> Lease:
        if self.holder is not None:
            raise LeaseError(f"{self.holder} holds the lease of {self.name}")
        self.holder = holder
        assert self.lease is not None
        return self.lease

    def return_lease(self, lease: Lease) -> None:
        self._called("return_lease")
        if lease == self.lease:
            self.lease, self.driving = None, False


ORIGIN = RigidTransform()


class StillLocaliser:
    """Stands at the origin of the world."""

    def __init__(self) -> None:
        self.localised = True
        self.updates = 0
        self.stamp_s = 0.0

    def estimate(self) -> LocalisationEstimate:
        return LocalisationEstimate(self.stamp_s, ORIGIN, np.zeros((3, 3)), self.localised)

    def update(self, robot: Any) -> None:
        self.updates += 1
        self.stamp_s = robot.odometry().stamp_s


class EmptyCostmap:
    def clearance_m(self, points_W: Any) -> Any:
        return np.full(len(points_W), 9.0)

    def update(self, robot: Any, localisation: LocalisationEstimate) -> None:
        pass


@dataclass
class Script:
    """What the scripted skills do: `ends[name]` gives the last step; `seen_on` the surfaces where things are seen.

    `says` gives a skill's sentence from its name and how many steps are left.
    """

    ends: dict[str, Callable[[Any], SkillStep]] = field(default_factory=dict)
    seen_on: tuple[str, ...] = ("counter",)
    steps: int = 3
    says: Callable[[str, int], str] = lambda name, left: f"{name} goes on"
    begun: list[str] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)


COKE = ObjectObservation(0.0, ObjectKind("coke"), (1.0, 2.0, 0.9), (0.06, 0.06, 0.12), 0.0, 0.9, "counter")


def scripted_skill(
    script: Script, skill_name: str, inputs_type: type, outputs_: Mapping[str, type]
) -> type[Skill[Any]]:
    """A skill that drives for a few steps and then ends as the script says."""

    class Scripted(Skill[Any]):
        name: ClassVar[str] = skill_name
        Inputs: ClassVar[type] = inputs_type
        outputs: ClassVar[Mapping[str, type]] = outputs_
        default_timeout_s: ClassVar[float] = 30.0
        gripper_before, gripper_after = GRIPPER.get(skill_name, (None, None))

        def begin(self, inputs: Any) -> None:
            script.begun.append(skill_name)
            self.inputs, self.left, self.open = inputs, script.steps, True

        def step(self) -> SkillStep:
            robot, lease = self.context.robot, self.context.lease
            robot.drive(0.1, 0.0, 0.0, until_s=self.context.clock.now() + 0.5, lease=lease)
            self.left -= 1
            if self.left > 0:
                return Running(script.says(skill_name, self.left))
            return script.ends.get(skill_name, default_end(script, skill_name))(self)

        def end(self) -> None:
            if getattr(self, "open", False):
                script.ended.append(skill_name)
                self.open = False
            self.context.robot.stop(lease=self.context.lease)

    return Scripted


def default_end(script: Script, name: str) -> Callable[[Any], SkillStep]:
    """What a scripted skill does when nothing else was said."""

    def detect(skill: Any) -> SkillStep:
        seen = any(surface.name in script.seen_on for surface in skill.inputs.surfaces)
        return (
            Succeeded("seen", {"observation": COKE, "observations": (COKE,)})
            if seen
            else Failed(Cause.POSTCONDITION, "not seen")
        )

    def grasp(skill: Any) -> SkillStep:
        skill.context.robot._robot.holding = True
        return Succeeded("held", {"tried": (*skill.inputs.avoid, 1)})

    def release(skill: Any) -> SkillStep:
        return Succeeded(f"{name} done", {"released_W": (0.0, 0.0, 0.9)})

    special = {"detect": detect, "grasp": grasp, "approach": lambda s: Succeeded("near", {"observation": COKE})}
    special |= {"place": release, "hand_over": release}
    return special.get(name, lambda skill: Succeeded(f"{name} done"))


@dataclass(frozen=True)
class NavigateInputs:
    goal: Pose2D
    position_tolerance_m: float = 0.15


@dataclass(frozen=True)
class DetectInputs:
    classes: tuple[str, ...]
    attributes: tuple[str, ...]
    surfaces: tuple[Surface, ...]
    floor: bool = False
    count: int = 1
    avoid: tuple[ObjectObservation, ...] = ()


@dataclass(frozen=True)
class ApproachInputs:
    observation: ObjectObservation
    surfaces: tuple[Surface, ...]


@dataclass(frozen=True)
class GraspInputs:
    observation: ObjectObservation
    avoid: tuple[int, ...] = ()


@dataclass(frozen=True)
class PlaceInputs:
    surface: Surface


@dataclass(frozen=True)
class HandOverInputs:
    person: str


@dataclass(frozen=True)
class FindPeopleInputs:
    area_W: tuple[tuple[float, float], ...]
    place: str
    person: str
    count: int
    avoid: tuple[ObjectObservation, ...] = ()
    moves: bool = False


@dataclass(frozen=True)
class MeetPersonInputs:
    person: str
    place_W: tuple[Coordinate, Coordinate] | None = None
    place: str = ""


@dataclass(frozen=True)
class FollowPersonInputs(MeetPersonInputs):
    until_W: tuple[tuple[float, float], ...] | None = None
    until: str = ""


@dataclass(frozen=True)
class GuidePersonInputs(MeetPersonInputs):
    goal: Pose2D | None = None
    place: str = ""
    area_W: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class SpeakInputs:
    text: str


@dataclass(frozen=True)
class ChargeInputs:
    level: float


@dataclass(frozen=True)
class NoInputs:
    pass


PORTS: dict[str, tuple[type, dict[str, type]]] = {
    "navigate": (NavigateInputs, {}),
    "detect": (DetectInputs, {"observation": ObjectObservation, "observations": tuple[ObjectObservation, ...]}),
    "find_people": (
        FindPeopleInputs,
        {"observation": ObjectObservation, "observations": tuple[ObjectObservation, ...]},
    ),
    "meet_person": (MeetPersonInputs, {"person": ObjectObservation}),
    "follow_person": (FollowPersonInputs, {}),
    "guide_person": (GuidePersonInputs, {}),
    "speak": (SpeakInputs, {}),
    "approach": (ApproachInputs, {"observation": ObjectObservation}),
    "grasp": (GraspInputs, {"tried": tuple[int, ...]}),
    "place": (PlaceInputs, {}),
    "hand_over": (HandOverInputs, {}),
    "stow": (NoInputs, {}),
    "clear_costmap": (NoInputs, {}),
    "back_off": (NoInputs, {}),
    "relocalise": (NoInputs, {}),
    "charge": (ChargeInputs, {}),
}

GRIPPER = {"grasp": (False, True), "place": (True, False), "hand_over": (True, None)}  # held before, held after

KNOWLEDGE = {
    "robot": {"name": "Alice"},
    "start": {"x": 0, "y": 0},
    "dock": {"x": 0, "y": -1},
    "places": {
        "kitchen": {"pose": {"x": 4, "y": 0}, "polygon": [[3, -2], [6, -2], [6, 2]]},
        "bedroom": {"pose": {"x": -4, "y": 0}, "polygon": [[-3, -2], [-6, -2], [-6, 2]]},
        "hall": {"pose": {"x": 0, "y": 0}, "polygon": [[-2, -2], [2, -2], [2, 2], [-2, 2]]},
        "bathroom": {"pose": {"x": 0, "y": 4}, "polygon": [[0, 3], [1, 3], [1, 5]]},
    },
    "surfaces": {
        "shelf": {
            "place": "kitchen",
            "height": 1.0,
            "polygon": [[5, 1], [6, 1], [6, 2]],
            "viewpoints": [{"x": 4.5, "y": 1}],
        },
        "counter": {
            "place": "kitchen",
            "height": 0.9,
            "polygon": [[5, -2], [6, -2], [6, -1]],
            "viewpoints": [{"x": 4.5, "y": -1}, {"x": 5, "y": -0.5}],
        },
        "bedside table": {
            "place": "bedroom",
            "height": 0.5,
            "polygon": [[-5, 1], [-6, 1], [-6, 2]],
            "viewpoints": [{"x": -4.5, "y": 1}],
        },
    },
    "things": {
        "coke": {"categories": ["drink"], "usual": ["counter"]},
        "beer": {"categories": ["drink"], "usual": ["counter"]},
        "hammer": {},
    },
    "people": {"Sam": {"at": "bathroom", "pose": {"x": 0.5, "y": 4.5}}, "Robin": {"at": "hall"}},
}

FETCH = (
    "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
    "Take [drink] to [start] and do [Nothing] to [Nothing]",
)


@pytest.fixture(autouse=True, scope="session")
def what_is_shipped_is_read_once() -> Iterator[None]:
    """Worlds of the project, their knowledge, and the installed skills; a world elsewhere is read each time."""
    world, knowledge = cache(load_world), cache(load_knowledge)
    names = known_worlds()

    def load(name: str) -> World:
        return world(name) if name in names else load_world(name)

    def know(path: Path, own: tuple[str, ...] = ()) -> Knowledge:
        return knowledge(path, own) if path.is_relative_to(WORLDS_FOLDER) else load_knowledge(path, own)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worlds, "load_world", load)
        patch.setattr(worlds, "load_knowledge", know)
        patch.setattr(prepare, "installed_skills", cache(installed_skills))
        yield


@pytest.fixture(autouse=True, scope="session")
def stores_do_not_wait_for_the_disk() -> Iterator[None]:
    """What a killed process has written stays without that, too; no test here takes the power from the machine."""
    prepared = Database._prepare

    def unsynchronised(self: Database) -> None:
        prepared(self)
        self._connection.execute("PRAGMA synchronous = OFF")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Database, "_prepare", unsynchronised)
        yield


@pytest.fixture(autouse=True, scope="session")
def missions_collect_no_garbage() -> Iterator[None]:
    """A collection of all that the tests of a process hold takes longer than most of the missions here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "get_freeze_count", lambda: 0)
        patch.setattr("executive.app.runs.return_memory", lambda: None)
        patch.setattr("executive.app.evaluate.evaluation.return_memory", lambda: None)
        yield


@dataclass
class ChangesMissed:
    """Changes of nodes that were not looked at after a tick, while a test wants to know of them."""

    wanted: bool = False
    found: list[Change] = field(default_factory=list)


@pytest.fixture(scope="session")
def changes_missed() -> Iterator[ChangesMissed]:
    """Looks at all nodes after every third tick, since a change that is missed stays so."""
    looked, missed, number = TreeObserver.changes, ChangesMissed(), count()

    def checked(self: TreeObserver, *, of_all: bool = False) -> Sequence[Change]:
        found = looked(self, of_all=of_all)
        if missed.wanted and next(number) % 3 == 0:
            missed.found.extend(looked(self, of_all=True))
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TreeObserver, "changes", checked)
        yield missed


@pytest.fixture(autouse=True)
def no_change_is_missed(changes_missed: ChangesMissed) -> Iterator[None]:
    """In every run of every test: the nodes that are not looked at after a tick say what they said before."""
    changes_missed.wanted, changes_missed.found = True, []
    yield
    changes_missed.wanted = False
    assert changes_missed.found == []


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def robot(clock: ManualClock) -> ScriptedRobot:
    return ScriptedRobot(clock)


@pytest.fixture
def published() -> list[tuple[str, Mapping[str, Any]]]:
    return []


@pytest.fixture
def context(clock: ManualClock, robot: ScriptedRobot, published: list[Any]) -> RunContext:
    """What nodes share; messages go to `published`."""
    return RunContext(
        robot=robot,  # type: ignore[arg-type]
        lease=Lease("Alice", "test", 1),
        clock=clock,
        worker=LockStepWorker(clock),
        localiser=StillLocaliser(),
        costmap=EmptyCostmap(),
        publish=lambda topic, message: published.append((topic, message)),
        seed=7,
        board=Board("alice"),
    )


@pytest.fixture
def knowledge() -> Knowledge:
    return Knowledge.model_validate(KNOWLEDGE)


@pytest.fixture
def script() -> Script:
    return Script()


@pytest.fixture
def registry(script: Script) -> dict[str, type[Skill[Any]]]:
    return {name: scripted_skill(script, name, *ports) for name, ports in PORTS.items()}


@pytest.fixture
def compiled(knowledge: Knowledge, registry: dict[str, type[Skill[Any]]]) -> Callable[..., CompiledTree]:
    """Compile commands given in their text form."""

    def compile_texts(*texts: str, name: str = "fetch drink") -> CompiledTree:
        steps = steps_of_commands(list(map(parse_command, texts)))
        return compile_mission(Mission(name=name, robot="Alice", steps=steps), knowledge=knowledge, registry=registry)

    return compile_texts


@pytest.fixture
def run_tree(clock: ManualClock, robot: ScriptedRobot, published: list[Any]) -> Callable[..., Any]:
    """Run a compiled tree with the scripted robot."""

    def runner(tree: CompiledTree, **options: Any) -> Any:
        settings = replace(RunSettings(seed=3), **options.pop("settings", {}))
        localiser = options.pop("localiser", None) or StillLocaliser()
        costmap, real = EmptyCostmap(), options.pop("real", False)
        entry = RunEntry(tree, robot, localiser, costmap, real=real)  # type: ignore[arg-type]
        observer, log = options.pop("observer", None), options.pop("log", None)
        log = log or OnMessage(lambda topic, message: published.append((topic, message)))
        visitors = [log, *options.pop("visitors", ()), *([] if observer is None else [OnTick(observer)])]
        worker = LockStepWorker(clock)
        return run([entry], clock=clock, worker=worker, visitors=visitors, settings=settings, **options)

    return runner


@pytest.fixture
def make() -> types.SimpleNamespace:
    """The scripted classes, for tests that build their own."""
    return types.SimpleNamespace(
        default_end=default_end,
        FETCH=FETCH, COKE=COKE, ScriptedRobot=ScriptedRobot, StillLocaliser=StillLocaliser,
        EmptyCostmap=EmptyCostmap, scripted_skill=scripted_skill, Script=Script, PORTS=PORTS,
    )  # fmt: skip
