"""A mission is broken off at every moment and taken up by another process: nothing is done twice."""

import dataclasses
import shutil
from functools import cache
from typing import ClassVar

import pytest
from py_trees.common import Status

from executive.mission.request import Request
from executive.run.mission_history import history_keys
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunVisitor
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.store.recollection import Memory, StepRecord
from executive.store.resuming import resumed_tree
from executive.tree.compiler import compile_mission
from executive.tree.node import NodeSpec
from executive.tree.registry import installed_skills
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.step import Policy
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Running, Succeeded, Surface
from skills.quantities import Coordinate, Length
from tests.executive.conftest import PATIENT
from tests.executive.store.copies import copy_database

TIDY = ("Take [Nothing] to [kitchen] and do [grasp] to [drink]", "Take [drink] to [bedroom] and do [place] to [drink]")
FETCH_AND_ASK = (
    "Take [Nothing] to [bedroom] and do [find] to [hammer]",
    "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
    "Take [drink] to [start] and do [Nothing] to [Nothing]",
)
CLEAR = (
    "Take [Nothing] to [counter] and do [grasp] to [everything]",
    "Take [everything] to [bedroom] and do [Nothing] to [Nothing]",
)
REQUEST = Request("fetch me a drink", seed=3, name="fetch drink", world_name="flat", robot="Alice", fingerprint="print")


class KilledError(BaseException):
    """The process is gone."""

    stops_run = True


class World:
    """What outlives the process: what the gripper holds, where the thing is and what is in the way of it."""

    def __init__(self):
        self.grasps = self.places = 0
        self.in_the_way = ()
        self.work = []
        self.transitions = []


@dataclasses.dataclass(frozen=True)
class PlaceInputs:
    surface: Surface
    clear_of: tuple[tuple[Coordinate, Coordinate, Length], ...] = ()


@pytest.fixture
def world():
    return World()


@pytest.fixture
def handling(world, robot, script, registry):
    """Skills of which the fourth step changes the world, and the fifth is the last."""

    class Handling(registry["stow"].__mro__[1]):
        changes_world = True

        def begin(self, inputs):
            world.work.append(self.name)
            self.inputs, self.count = inputs, 0

        def step(self):
            self.count += 1
            if self.count == 4:
                self.change()
            done = Succeeded(f"{self.name} done", dict.fromkeys(self.outputs, ()))
            return done if self.count == 5 else Running(f"{self.name} goes on")

    class Grasp(Handling):
        name, Inputs = "grasp", registry["grasp"].Inputs
        outputs: ClassVar = {"in_the_way": tuple[ObjectObservation, ...]}

        def step(self):
            if world.in_the_way and self.count == 2 and self.inputs.observation.kind.name == "coke":
                return Failed(Cause.PLANNING, "it is behind another", {"in_the_way": world.in_the_way})
            return super().step()

        def change(self):
            assert not robot.holding, "grasped what is in the gripper"
            robot.holding, world.grasps = True, world.grasps + 1

        def resume(self, inputs):
            self.begin(inputs)
            self.count = 4 if robot.holding else 0

        def undone(self, inputs):
            return None if robot.holding else "the gripper is empty"

    class Place(Handling):
        name, Inputs = "place", PlaceInputs

        def change(self):
            assert robot.holding, "put down what is not held"
            robot.let_go()
            world.places += 1
            world.in_the_way = () if self.inputs.clear_of else world.in_the_way

        def step(self):
            step = super().step()
            self.checkpoint = {"over": True} if self.count >= 1 else {}
            return step

        def resume(self, inputs):
            over = self.checkpoint.get("over", False)
            self.begin(inputs)
            assert robot.holding or over, "the checkpoint is lost"
            self.count = 0 if robot.holding else 4

    script.steps = 2
    return {**installed_skills(), **registry, "grasp": Grasp, "place": Place}


@pytest.fixture
def store(tmp_path):
    with MissionStore(tmp_path / "store.sqlite") as opened:
        yield opened


@pytest.fixture
def live(store, clock, robot, make, world, script, handling, knowledge):
    """One life of the executive: it ends by itself, or is killed in some tick, before or after that was noted."""

    @cache
    def tree_of(texts, policy):
        steps = tuple(Do.from_command(parse_command(text)) for text in texts)
        mission = Mission(name="fetch drink", robot="Alice", steps=steps).with_policy(policy)
        return compile_mission(mission, knowledge=knowledge, registry=handling)

    def one_life(texts, *, kill_after=None, kill_when=None, policy=Policy(), store=store, copy=lambda: None):  # noqa: B008 - frozen
        missions = store.missions()
        mission = missions[0] if missions else store.add(REQUEST, queued=False)
        tree, journal, recollection = tree_of(texts, policy), store.journal(mission.id), None
        if missions:
            tree, recollection = resumed_tree(tree, store.memory(mission.id))
            journal.use_recollection(recollection)
        store.begin(mission.id)
        ticks = Ticks(journal, kill_after, kill_when, copy, world.transitions)
        for each in (script.begun, world.work, world.transitions):
            each.clear()
        robot.holder = None
        entry = RunEntry(tree, robot, make.StillLocaliser(), make.EmptyCostmap())
        try:
            result = run([entry], clock=clock, worker=LockStepWorker(clock), visitors=[ticks], settings=PATIENT)
        except KilledError:
            return None, ticks.count, recollection
        return result, ticks.count, recollection

    return one_life


class Ticks(RunVisitor):
    """Passes notes on, calls `copy`, and kills."""

    def __init__(self, journal, kill_after, kill_when, copy, transitions):
        self.journal, self.kill_after, self.kill_when, self.copy, self.count = journal, kill_after, kill_when, copy, 0
        self.transitions = transitions

    def message(self, topic, message):
        if topic == "transitions":
            self.transitions.append(message)
        return message

    def tick(self, progress):
        self.count += 1
        self.journal.tick(progress)
        self.copy()
        changes = [change for note in progress.notes.values() for change in note.changes]
        if self.count == self.kill_after or (self.kill_when is not None and any(map(self.kill_when, changes))):
            raise KilledError


def begins(leaf):
    return lambda change: change.path_id.endswith(f"/{leaf}") and change.after.status is Status.RUNNING


@pytest.fixture
def moved_once(live, store, robot, world, tmp_path):
    """Resumes a mission that moves so many objects after any tick, or every second one: each object is moved once.

    A kill leaves the world of its tick, and a store that may lack the last notes, as many as each of `lags` says.
    """

    def kill(texts, objects, *, lags=(0,), every=1, in_the_way=(), says="", **options):
        left, world.in_the_way = [], in_the_way

        def copy():
            copy_database(store.path, tmp_path / f"{len(left) + 1}.sqlite")
            left.append((robot.holding, world.grasps, world.places, world.in_the_way))

        result, ticks, _ = live(texts, copy=copy, **options)
        assert (result.outcome, world.grasps, world.places) == (Outcome.SUCCESS, objects, objects)
        for moment, lag in ((each, late) for late in lags for each in range(1 + late, ticks, every)):
            robot.holding, world.grasps, world.places, world.in_the_way = left[moment - 1]
            shutil.copy(tmp_path / f"{moment - lag}.sqlite", tmp_path / "left.sqlite")
            with MissionStore(tmp_path / "left.sqlite") as resumed:
                result, _, recollection = live(texts, store=resumed, **options)
            told = (lag, moment, result.worst.message, recollection.log, world.work)
            assert (result.outcome, result.worst.message.startswith(says)) == (Outcome.SUCCESS, True), told
            assert (world.grasps, world.places, robot.holding) == (objects, objects, False), told

    return kill


@pytest.fixture
def resumed(live):
    """A mission that is killed and resumed to its success: its result, and the recollection."""

    def run_twice(texts, **kill):
        assert live(texts, **kill)[0] is None
        result, _, recollection = live(texts)
        assert result.outcome is Outcome.SUCCESS
        return result, recollection

    return run_twice


def test_a_kill_in_any_tick_repeats_nothing(moved_once):
    moved_once(TIDY, 1, lags=(0, 1, 3))


def test_kills_one_after_another_lead_to_the_end_all_the_same(live, script, world):
    lives, script.steps = 0, 4
    while live(TIDY, kill_after=14)[0] is None:
        lives += 1
        assert lives < 30
    assert (world.grasps, world.places) == (1, 1)
    assert lives >= 2


def test_a_kill_in_any_round_moves_each_object_once(moved_once, world, script, make):
    def look(skill):
        if world.places == 2:
            return Failed(Cause.POSTCONDITION, "nothing is left")
        seen = dataclasses.replace(make.COKE, position_W=(1.0 + world.places, 2.0, 0.9))
        return Succeeded("seen", {"observation": seen, "observations": (seen,), "unexplained": ()})

    script.ends["detect"] = look
    moved_once(CLEAR, 2, lags=(0, 3), every=2, says="moved two cokes")


def test_after_a_kill_in_any_tick_each_person_has_been_greeted(live, store, script, make):
    places = ((0.5, 0.0, 0.8), (-0.5, 1.0, 0.8))

    def person(place):
        return dataclasses.replace(make.COKE, kind=ObjectKind("person"), position_W=place)

    def look(skill):
        left = [place for place in places if all(one.position_W != place for one in skill.inputs.avoid)]
        seen = tuple(map(person, left))
        found = {"observation": seen[0], "observations": seen, "unexplained": ()} if seen else {}
        return Succeeded("seen", found) if seen else Failed(Cause.POSTCONDITION, "nobody else is there")

    script.ends["find_people"] = look
    script.ends["meet_person"] = lambda skill: Succeeded("beside", {"person": person((*skill.inputs.place_W, 0.8))})
    greet = ("Take [Nothing] to [hall] and do [greet] to [some person]",)
    _, ticks, _ = live(greet)
    for moment in range(1, ticks):
        store.remove(store.missions()[0].id)
        assert live(greet, kill_after=moment)[0] is None
        greeted = script.begun.count("speak")
        result, _, recollection = live(greet)
        told = (moment, result.worst.message, recollection.log)
        assert (result.outcome, result.worst.message) == (Outcome.SUCCESS, "greeted 2 people in the hall"), told
        assert 2 <= greeted + script.begun.count("speak") <= 3, told


def test_a_kill_while_something_is_moved_aside_moves_it_once(moved_once, script, make):
    script.ends["approach"] = lambda skill: Succeeded("near", {"observation": skill.inputs.observation})
    cube = dataclasses.replace(make.COKE, kind=ObjectKind("cube"))
    moved_once(TIDY, 2, every=2, in_the_way=(cube,), policy=Policy(move_aside=1))


def test_finished_steps_are_reported_and_not_repeated(resumed, script):
    _, recollection = resumed(TIDY, kill_after=12)
    assert "detect" not in script.begun
    told = "\n".join(recollection.log)
    assert "find/counter-1/detect: success before the restart: seen" in told
    assert "goes on here" in told


def test_only_an_interrupted_skill_is_said_to_go_on(resumed):
    _, recollection = resumed(TIDY, kill_when=begins("approach"))
    going_on = [line.split(": ")[0] for line in recollection.log if "goes on here" in line]
    assert [path_id.rsplit("/", 1)[-1] for path_id in going_on] == ["approach"]


def test_the_log_marks_the_transitions_that_repeat_results_from_before(resumed, world):
    resumed(FETCH_AND_ASK, kill_after=12)
    ended = [each for each in world.transitions if each["to"] in ("SUCCESS", "FAILURE")]
    restored = {(each["node"].rsplit("/", 1)[-1], each["to"]) for each in ended if each.get("restored")}
    assert restored >= {("remember-start", "SUCCESS"), ("detect", "FAILURE"), ("detect", "SUCCESS")}
    assert [each["node"] for each in ended if each["node"].endswith("hand-over") and "restored" not in each]


def test_a_look_that_found_nothing_anywhere_is_not_repeated(resumed):
    """Nothing was ever written to the port of its detections: that is no reason to look again."""
    _, recollection = resumed(FETCH_AND_ASK, kill_after=12)
    looks = [told for told in recollection.log if "1-bedroom/search" in told and "/detect: " in told]
    assert [look.partition(": ")[2] for look in looks] == ["failure before the restart: not seen"]


def test_answers_and_the_start_pose_outlive_the_process(resumed):
    result, _ = resumed(FETCH_AND_ASK, kill_after=12)
    assert list(result.worst.answers.values()) == [False]
    (found,) = result.worst.findings
    assert (found.answer, found.t_s < 2.0) == (False, True)
    remembered = next(state for path, state in result.worst.states.items() if path.endswith("remember-start"))
    assert remembered.message.endswith("(before the restart)")


def test_an_object_lost_over_the_restart_is_grasped_again(live, robot, world):
    live(TIDY, kill_when=begins("stow"))
    assert (robot.holding, world.grasps) == (True, 1)
    robot.holding = False
    result, _, recollection = live(TIDY)
    assert result.outcome is Outcome.SUCCESS
    assert world.grasps == 2
    assert any(told.endswith("/grasp: does it again, since the gripper is empty") for told in recollection.log)


def test_a_failed_look_before_the_kill_is_not_looked_again(resumed, script):
    script.seen_on = ("shelf",)
    resumed(TIDY, kill_after=11)
    assert script.begun.count("detect") <= 1


def test_the_tree_of_a_resumed_mission_has_the_same_path_ids(live, store, compiled):
    tree = compiled(*TIDY)
    live(TIDY, kill_after=8)
    again, _ = resumed_tree(tree, store.memory(1))
    assert again.path_ids == tree.path_ids
    assert [type(node).__name__ for node in again.root.walk()] == [type(node).__name__ for node in tree.root.walk()]


def test_a_step_whose_output_could_not_be_kept_is_done_again(live, store, script):
    live(TIDY, kill_after=12)
    memory = store.memory(1)
    seen = {path for path, step in memory.steps.items() if path.endswith("/detect") and step.status is Status.SUCCESS}
    assert seen
    bare = dataclasses.replace(memory, board={k: v for k, v in memory.board.items() if not k.endswith("/detection")})
    store.memory = lambda number: bare
    result, _, _ = live(TIDY)
    assert result.outcome is Outcome.SUCCESS
    assert "detect" in script.begun


def test_causes_come_back_with_failures(live, store, script):
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "no way")
    live(TIDY, kill_when=lambda change: change.after.cause is Cause.PLANNING)
    failed = [step for step in store.memory(1).steps.values() if step.status is Status.FAILURE]
    assert failed
    assert all(step.cause is Cause.PLANNING for step in failed)


@pytest.mark.parametrize(("before", "after"), [(Status.SUCCESS, Status.SUCCESS), (None, Status.RUNNING)])
def test_the_operator_is_not_asked_again_about_a_step_that_was_skipped(compiled, context, before, after):
    tree = compiled(*TIDY)
    first, *others = tree.mission.children
    options = {"step": "get it", "options": ("skip", "stop"), "default": "stop", "limit_s": 60.0, "text": None}
    ask = NodeSpec("ask", "alice/ask", "ask", options, (first,))
    mission = dataclasses.replace(tree.mission, children=(ask, *others))
    asking = dataclasses.replace(tree, root=dataclasses.replace(tree.root, children=(mission,)))
    ended = {} if before is None else {ask.path_id: before, first.path_id: Status.FAILURE}
    steps = {path: StepRecord(status, None, "", 1.0, {}) for path, status in ended.items()}
    again, _ = resumed_tree(asking, Memory(steps, {}, None))
    node = next(node for node in again.build(context).iterate() if node.path_id == ask.path_id)
    node.decorated.status, node.decorated.cause = Status.FAILURE, Cause.EXECUTION
    assert node.update() is after


def test_a_question_that_was_answered_is_a_finding_of_its_own_when_it_is_asked_once_more(compiled):
    tree = compiled(*TIDY)
    asked = NodeSpec("question", "alice/question", "ask", {"key": "alice/answer", "gives": str})
    checked = NodeSpec("check", "alice/check", "check", {}, (NodeSpec("pause", "alice/wait", "wait"),))
    mission = dataclasses.replace(tree.mission, children=(*tree.mission.children, asked, checked))
    asking = dataclasses.replace(tree, root=dataclasses.replace(tree.root, children=(mission,)))
    steps = {path: StepRecord(Status.SUCCESS, None, "", 1.0, {}) for path in (asked.path_id, checked.path_id)}
    again, _ = resumed_tree(asking, Memory(steps, {"alice/answer": "tea"}, None))
    assert again.board[history_keys(tree.robot_name, tree.mission_name).answered_before] == {checked.path_id}
