"""A scripted robot that stands, and scripted skills: whole missions without a plant."""

import gc
import types
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import count
from typing import Any, ClassVar

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.app.prepare import from_request, worlds
from executive.record.event_log import EventLog
from executive.run.runner import run
from executive.run.tree_run import TreeObserver
from executive.run.visitor import RunEntry, RunSettings
from executive.run.worker import LockStepWorker
from executive.store.database import Database
from executive.tree.board import Board
from executive.tree.compiler import compile_mission
from executive.tree.context import RunContext
from executive.tree.node import Change
from executive.tree.registry import installed_skills
from executive.words.command import parse_command
from executive.words.knowledge import Knowledge, load_knowledge
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from plant.worlds.world import WORLDS_FOLDER, load_world
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
from skills.relations import Relation
from skills.robot import CommandState, CommandStatus, Lease
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot
from tests.executive.house_tasks import MORE_TASKS, TASKS, tasks_installed
from tests.project import shipped_worlds
from tests.tables import yaml_beside
from tests.visitors import OnMessage, OnTick

SENSES = {"battery", "faults", "gripper", "imu", "joints", "odometry", "own_localisation", "scan"}


class Verbs(list[str]):
    """Verbs that act, as they are used; each verb in `raising` raises its exception."""

    def __init__(self):
        super().__init__()
        self.raising: dict[str, BaseException] = {}

    def append(self, verb):
        if verb not in SENSES:
            super().append(verb)
        if verb in self.raising:
            raise self.raising[verb]


class StandingRobot(ScriptedRobot):
    """The scripted robot, which stands and holds as a test says; `raising` is that of its `Verbs`."""

    def __init__(self, clock, name="Alice"):
        super().__init__(clock, name=name)
        self.clock, self.calls, self.lidar, self.silent = clock, Verbs(), (8, 0.0), False
        self.raising, self.clamp_force_n, self._holding = self.calls.raising, 10.0, False

    def _pass_time(self, dt_s):
        pass

    def odometry(self):
        if not self.silent:
            self._reading = super().odometry()
        return self._reading

    @property
    def standing(self):
        return self.odometry_pose

    @standing.setter
    def standing(self, pose):
        self.odometry_pose = pose

    @property
    def driving(self):
        return "drive" in self._commands.moving_parts

    @property
    def holding(self):
        return self._holding

    @holding.setter
    def holding(self, holding):
        self._holding, self.opening = holding, 0.3 if holding else 0.0

    def let_go(self):
        """Opens the gripper, as a skill that puts something down does."""
        self.holding, self.opening = False, 1.0

    def command_status(self, command):
        return CommandStatus(CommandState.DONE)

    @property
    def lease(self):
        return self._leases.current

    @lease.setter
    def lease(self, lease):
        self._commands.stop(None)
        self._leases._current = lease

    @property
    def holder(self):
        return self.lease.holder if self.lease else None

    @holder.setter
    def holder(self, name):
        self.lease = self.take_lease(name) if name else None


class StillLocaliser:
    """Stands at the origin of the world."""

    def __init__(self):
        self.localised, self.stamp_s = True, 0.0

    def estimate(self):
        return LocalisationEstimate(self.stamp_s, RigidTransform(), np.zeros((3, 3)), self.localised)

    def update(self, robot):
        self.stamp_s = robot.odometry().stamp_s


class EmptyCostmap:
    def clearance_m(self, points_W):
        return np.full(len(points_W), 9.0)

    def update(self, robot, localisation):
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


def scripted_skill(script, skill_name, inputs_type, outputs_):
    """A skill that drives for a few steps and then ends as the script says."""

    class Scripted(Skill[Any]):
        name: ClassVar[str] = skill_name
        Inputs: ClassVar[type] = inputs_type
        outputs: ClassVar[Mapping[str, type]] = outputs_
        default_timeout_s: ClassVar[float] = 30.0
        gripper_before, gripper_after = GRIPPER.get(skill_name, (None, None))

        def begin(self, inputs):
            script.begun.append(skill_name)
            self.inputs, self.left, self.open = inputs, script.steps, True

        def step(self):
            robot, lease = self.context.robot, self.context.lease
            robot.drive(0.1, 0.0, 0.0, until_s=self.context.clock.now() + 0.5, lease=lease)
            self.left -= 1
            if self.left > 0:
                return Running(script.says(skill_name, self.left))
            return script.ends.get(skill_name, default_end(script, skill_name))(self)

        def end(self):
            if getattr(self, "open", False):
                script.ended.append(skill_name)
                self.open = False
            self.context.robot.stop(lease=self.context.lease)

    return Scripted


def default_end(script, name):
    """What a scripted skill does when nothing else was said."""

    def detect(skill):
        seen = any(surface.name in script.seen_on for surface in skill.inputs.surfaces)
        return (
            Succeeded("seen", {"observation": COKE, "observations": (COKE,), "unexplained": ()})
            if seen
            else Failed(Cause.POSTCONDITION, "not seen")
        )

    def grasp(skill):
        skill.context.robot._robot.holding = True
        return Succeeded("held", {"tried": (*skill.inputs.avoid, 1)})

    def release(skill):
        return Succeeded(f"{name} done", {"released_W": (0.0, 0.0, 0.9)})

    special = {"detect": detect, "grasp": grasp, "approach": lambda s: Succeeded("near", {"observation": COKE})}
    special |= {"place": release, "hand_over": release}
    return special.get(name, lambda skill: Succeeded(f"{name} done"))


@dataclass(frozen=True)
class DetectInputs:
    """What to look for, and where: a skill that cannot be told a position."""

    classes: tuple[str, ...]
    attributes: tuple[str, ...]
    surfaces: tuple[Surface, ...]
    floor: bool = False
    count: int = 1
    avoid: tuple[ObjectObservation, ...] = ()
    relations: tuple[Relation, ...] = ()


@dataclass(frozen=True)
class GraspInputs:
    """What to grasp, and the numbers of the grasps that were tried before."""

    observation: ObjectObservation
    avoid: tuple[int, ...] = ()


SKILLS = (
    *("approach", "back_off", "charge", "clear_costmap", "detect", "find_people", "follow_person", "grasp"),
    *("guide_person", "hand_over", "meet_person", "navigate", "place", "relocalise", "speak", "stow", "take_picture"),
)
SELDOM = {"in_the_way", "released_W"}
"""Outputs of skills that the scripted ones lack."""
REAL = installed_skills()
PORTS: dict[str, tuple[type, dict[str, Any]]] = {
    name: (REAL[name].Inputs, {port: kind for port, kind in REAL[name].outputs.items() if port not in SELDOM})
    for name in SKILLS
}
PORTS["detect"] = (DetectInputs, PORTS["detect"][1])
PORTS["grasp"] = (GraspInputs, {"tried": tuple[int, ...]})
KNOWLEDGE = yaml_beside(__file__, "knowledge.yaml")
PATIENT = RunSettings(seed=3, verb_limit_s=60.0)
"""Settings under which a loaded machine, or a kernel that is compiled at first use, counts as no hang."""
GRIPPER = {"grasp": (False, True), "place": (True, False), "hand_over": (True, None)}  # held before, held after


FETCH = (
    "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
    "Take [drink] to [start] and do [Nothing] to [Nothing]",
)


@pytest.fixture(autouse=True, scope="session")
def what_is_shipped_is_read_once():
    """Worlds of the project, their knowledge, and the installed skills; a world elsewhere is read each time."""
    world, knowledge = cache(load_world), cache(load_knowledge)
    names = shipped_worlds()

    def load(name):
        return world(name) if name in names else load_world(name)

    def know(path, own=()):
        return knowledge(path, own) if path.is_relative_to(WORLDS_FOLDER) else load_knowledge(path, own)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(worlds, "load_world", load)
        patch.setattr(worlds, "load_knowledge", know)
        patch.setattr(from_request, "installed_skills", cache(installed_skills))
        yield


@pytest.fixture(autouse=True, scope="session")
def stores_do_not_wait_for_the_disk():
    """What a killed process has written stays without that, too; no test here takes the power from the machine."""
    prepared = Database._prepare

    def unsynchronised(self):
        prepared(self)
        self._connection.execute("PRAGMA synchronous = OFF")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Database, "_prepare", unsynchronised)
        yield


@pytest.fixture(autouse=True, scope="session")
def missions_collect_no_garbage():
    """A collection of all that the tests of a process hold takes longer than most of the missions here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "get_freeze_count", lambda: 0)
        patch.setattr("executive.app.runs.queue.return_memory", lambda: None)
        patch.setattr("executive.app.evaluate.evaluation.return_memory", lambda: None)
        yield


@dataclass
class ChangesMissed:
    """Changes of nodes that were not looked at after a tick, while a test wants to know of them."""

    wanted: bool = False
    found: list[Change] = field(default_factory=list)


@pytest.fixture(scope="session")
def changes_missed():
    """Looks at all nodes after every third tick, since a change that is missed stays so."""
    looked, missed, number = TreeObserver.changes, ChangesMissed(), count()

    def checked(self, *, of_all=False):
        found = looked(self, of_all=of_all)
        if missed.wanted and next(number) % 3 == 0:
            missed.found.extend(looked(self, of_all=True))
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TreeObserver, "changes", checked)
        yield missed


@pytest.fixture(autouse=True)
def no_change_is_missed(changes_missed):
    """In every run of every test: the nodes that are not looked at after a tick say what they said before."""
    changes_missed.wanted, changes_missed.found = True, []
    yield
    changes_missed.wanted = False
    assert changes_missed.found == []


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def robot(clock):
    return StandingRobot(clock)


@pytest.fixture
def published():
    return []


@pytest.fixture
def context(clock, robot, published):
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
def knowledge():
    return Knowledge.model_validate(KNOWLEDGE)


@pytest.fixture
def script():
    return Script()


@pytest.fixture
def registry(script):
    return {name: scripted_skill(script, name, *ports) for name, ports in PORTS.items()}


@pytest.fixture
def compiled(knowledge, registry):
    """Compile commands given in their text form."""

    def compile_texts(*texts, name="fetch drink"):
        steps = steps_of_commands(list(map(parse_command, texts)))
        return compile_mission(Mission(name=name, robot="Alice", steps=steps), knowledge=knowledge, registry=registry)

    return compile_texts


@pytest.fixture
def run_tree(clock, robot, published):
    """Run a compiled tree with the scripted robot."""

    def runner(tree, **options):
        settings = replace(PATIENT, **options.pop("settings", {}))
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
def write_log(tmp_path, clock):
    """Writes messages to a log."""

    def write(*messages, name="log.mcap", **options):
        with closing(EventLog(tmp_path / name, clock, **options)) as log:
            for topic, message in messages:
                log(topic, message)
        return log.path

    return write


@pytest.fixture
def log_run(tmp_path, clock, run_tree):
    """Runs a tree with a log; returns the path of the log and the result."""

    def run_with_log(tree):
        with closing(EventLog(tmp_path / "log.mcap", clock)) as log:
            result = run_tree(tree, log=log)
        return log.path, result

    return run_with_log


@pytest.fixture
def make():
    """The scripted classes, for tests that build their own."""
    return types.SimpleNamespace(
        default_end=default_end,
        FETCH=FETCH, COKE=COKE, StandingRobot=StandingRobot, StillLocaliser=StillLocaliser,
        EmptyCostmap=EmptyCostmap, scripted_skill=scripted_skill, Script=Script, PORTS=PORTS,
    )  # fmt: skip


@pytest.fixture
def house_tasks():
    """Installs the tasks of `house_tasks` beside the shipped ones."""
    with tasks_installed(*TASKS) as found:
        yield found


@pytest.fixture
def more_tasks():
    """Installs three more tasks beside the shipped ones."""
    with tasks_installed(*MORE_TASKS) as found:
        yield found
