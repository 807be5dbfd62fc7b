"""A run with two robots is broken off at every moment and taken up by another process: nothing is done twice."""

from collections import Counter

import pytest

from executive.mission.request import Request
from executive.run.mission_history import BEFORE
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunVisitor
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.store.resuming import ended_tree, resumed_tree
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.robot_config import RobotConfig
from skills.api import Cause, Failed, Running, Succeeded
from tests.executive.conftest import PATIENT

TAKE_AND_PUT = (
    "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
    "Take [drink] to [bedroom] and do [place] to [drink]",
)
ROBOTS = (RobotConfig("Alice", "spot"), RobotConfig("Bob", "fetch"))
REQUEST = Request("tidy", name="tidy", world_name="flat", robot="Alice", fingerprint="print", robots=ROBOTS)


class KilledError(BaseException):
    """The process is gone."""

    stops_run = True


class World:
    """What outlives the process: who has the drink, who put it down last, and how often each did what."""

    def __init__(self):
        self.holder = self.put_by = None
        self.done = Counter()


@pytest.fixture
def world():
    return World()


@pytest.fixture
def robots(clock, make):
    return {robot.name: make.StandingRobot(clock, robot.name) for robot in ROBOTS}


@pytest.fixture
def handling(world, robots, registry, script):
    """Skills of which the third step changes the world, and the fourth is the last."""

    class Handling(registry["stow"].__mro__[1]):
        changes_world = True

        @property
        def robot(self):
            return robots[self.context.robot.name]

        def begin(self, inputs):
            self.count = 0

        def step(self):
            self.count += 1
            if self.count == 3:
                world.done[self.name, self.robot.name] += 1
                self.change()
            return Succeeded("done", dict.fromkeys(self.outputs, ())) if self.count == 4 else Running("goes on")

    class Grasp(Handling):
        name, Inputs, outputs = "grasp", registry["grasp"].Inputs, registry["grasp"].outputs

        def change(self):
            world.holder, self.robot.holding = self.robot.name, True

        def resume(self, inputs):
            self.count = 3 if self.robot.holding else 0

        def undone(self, inputs):
            return None if self.robot.holding else "the gripper is empty"

    class Place(Handling):
        name, Inputs = "place", registry["place"].Inputs

        def change(self):
            world.holder, world.put_by = None, self.robot.name
            self.robot.let_go()

        def resume(self, inputs):
            self.count = 0 if self.robot.holding else 3

        def undone(self, inputs):
            return None if world.put_by == self.robot.name and world.holder is None else "it is not there any more"

    script.steps = 2
    return {**installed_skills(), **registry, "grasp": Grasp, "place": Place}


@pytest.fixture
def store(tmp_path):
    with MissionStore(tmp_path / "store.sqlite") as opened:
        yield opened


class Killing(RunVisitor):
    """Passes the notes of one robot on, and kills when both together have made so many."""

    def __init__(self, name, journal, made, kill_after):
        self.name, self.journal, self.made, self.kill_after = name, journal, made, kill_after

    def tick(self, progress):
        if self.name in progress.notes:
            self.made.append(progress.notes[self.name])
            self.journal.tick(progress)
            if len(self.made) == self.kill_after:
                raise KilledError


@pytest.fixture
def live(store, clock, robots, make, handling, knowledge):
    """One life of the executive: it ends by itself, or is killed when so many ticks of robots were noted."""

    steps = tuple(Do.from_command(parse_command(text)) for text in TAKE_AND_PUT)
    missions = {name: Mission(name="tidy", robot=name, steps=steps) for name in robots}
    trees = {name: compile_mission(each, knowledge=knowledge, registry=handling) for name, each in missions.items()}

    def entry_for(mission, name, made, kill_after, after):
        tree, journal, robots[name].holder = trees[name], store.journal(mission.id, name), None
        if mission.starts:
            memory = store.memory(mission.id, name)
            tree, recollection = ended_tree(tree, memory) or resumed_tree(tree, memory)
            journal.use_recollection(recollection)
        entry = RunEntry(tree, robots[name], make.StillLocaliser(), make.EmptyCostmap(), after=after)
        return entry, Killing(name, journal, made, kill_after)

    def one_life(*, kill_after=None, after=()):
        (mission,) = store.missions() or (store.add(REQUEST, queued=False),)
        made = []
        given = [
            entry_for(mission, name, made, kill_after, after if name == "Bob" else ()) for name in ("Alice", "Bob")
        ]
        store.begin(mission.id)
        try:
            result = run(
                [entry for entry, _ in given],
                clock=clock,
                worker=LockStepWorker(clock),
                visitors=[killing for _, killing in given],
                settings=PATIENT,
            )
        except KilledError:
            return None, len(made)
        return result, len(made)

    return one_life


@pytest.mark.parametrize("after", [(), ("Alice",)])
def test_a_kill_in_any_tick_of_two_robots_repeats_nothing(live, store, robots, world, after):
    result, ticks = live(after=after)
    once = {(what, name): 1 for what in ("grasp", "place") for name in robots}
    assert (result.outcome, world.done) == (Outcome.SUCCESS, once)
    for moment in range(1 + len(after), ticks, 2):  # odd moments of one order of the robots, even ones of the other
        store.remove(store.missions()[0].id)
        world.__init__()
        for robot in robots.values():
            robot.holding = False
        assert live(kill_after=moment, after=after)[0] is None
        result, _ = live(after=after)
        told = (moment, result.worst.message, world.done)
        assert (result.outcome, world.done) == (Outcome.SUCCESS, once), told


def test_a_robot_that_was_done_says_so_and_does_nothing_though_another_has_moved_on(live, store, robots, world):
    _, ticks = live(after=("Alice",))
    store.remove(store.missions()[0].id)
    live(kill_after=ticks - 2, after=("Alice",))
    robots["Alice"].calls.clear()
    result, _ = live(after=("Alice",))
    alice = result.robots[0]
    assert (alice.outcome, alice.message.endswith(f"({BEFORE})")) == (Outcome.SUCCESS, True)
    assert set(robots["Alice"].calls) <= {"stop", "return_lease"}
    assert sum(state.status.value == "SUCCESS" for state in alice.states.values()) > 10


def test_a_robot_that_had_failed_stays_so_while_the_other_goes_on(live, store, script, world):
    slow = iter(range(300))

    def drive(skill):
        if skill.context.robot.name == "Bob":
            return Failed(Cause.EXECUTION, "stuck")
        return Succeeded("there") if next(slow, None) is None else Running("drives slowly")

    script.ends["navigate"] = drive
    assert live(kill_after=330)[0] is None
    script.ends["navigate"] = lambda skill: Succeeded("there")
    alice, bob = live()[0].robots
    assert (alice.outcome, bob.outcome, bob.cause) == (Outcome.SUCCESS, Outcome.FAILURE, Cause.EXECUTION)
    assert (world.done["grasp", "Alice"], world.done["grasp", "Bob"]) == (1, 0)
