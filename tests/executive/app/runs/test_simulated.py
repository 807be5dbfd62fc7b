"""A simulated run: compiled code, robots that fit, and people who answer and speak."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from tiny_detector import CLASSES, model_bytes, write_model

from executive.app.prepare.placed_robots import TURNING_M, refuse_blocked, shared_detector, stand_at
from executive.app.runs import simulated
from executive.app.runs.simulated import Bystanders, TruthLog, compile_first
from executive.run.control import Control
from executive.run.visitor import Progress
from executive.words.schemas import schemas
from plant.worlds.seeding import place_people
from plant.worlds.world import load_world
from skills.api import Question
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from skills.perception.detector import Cascade
from skills.robot import Pose2D
from skills.stack import default_stack


@pytest.fixture
def commands(monkeypatch):
    """The commands that were run in place of those that take long."""
    run = []
    monkeypatch.setattr(simulated.subprocess, "run", lambda command, **_: run.append(command))
    return run


def test_the_first_run_on_a_machine_compiles_and_says_so_once(commands, tmp_path, caplog):
    compile_first(tmp_path)
    assert [command[-1] for command in commands] == ["warm-up"]
    assert len(caplog.messages) == 1


def test_a_later_run_compiles_nothing_and_says_nothing(commands, tmp_path, caplog):
    (tmp_path / "compiled.distances-93.py311.nbi").touch()
    compile_first(tmp_path)
    assert (commands, caplog.messages) == ([], [])


def with_detector(file):
    return replace(default_stack(), detector=Cascade(file))


def test_a_process_has_one_detector_of_a_stack(tmp_path):
    write_model(tmp_path / "model.onnx")
    stack = with_detector(tmp_path / "model.onnx")
    assert shared_detector(stack) is shared_detector(stack)
    assert shared_detector(stack).class_names == CLASSES


@pytest.mark.parametrize(("content", "part"), [(None, "there is no such model"), (model_bytes()[:-300], "damaged")])
def test_a_model_that_cannot_be_used_is_named_before_anything_moves(tmp_path, content, part):
    file = tmp_path / "model.onnx"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=part) as error:
        shared_detector(with_detector(file))
    assert error.value.file == file
    assert error.value.hint.startswith("name an ONNX file; ")


def test_an_unknown_start_is_free_ground_that_the_seed_chooses():
    world = load_world("flat")
    keepout = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    poses = [stand_at(world, "unknown", seed) for seed in range(20)]
    assert (poses[3], len(set(poses))) == (stand_at(world, "unknown", 3), 20)
    for seed, pose in enumerate(poses):
        here = np.array([[pose.x_m, pose.y_m]])
        assert keepout.distance_m(here)[0] > TURNING_M - 0.03
        people = [person.X_WO.translation()[:2] for person in place_people(world, seed)]
        assert all(np.linalg.norm(here - person) > 1.0 for person in people)


def test_a_start_in_a_wall_or_outside_is_refused():
    world = load_world("flat")
    refuse_blocked(world, world.start)
    for x, y in ((0.0, 0.0), (-30.0, 4.0)):
        with pytest.raises(InputError, match="stands in an obstacle or outside"):
            refuse_blocked(world, Pose2D(x, y, 0.0))


WHO = Question("who", "Are you Robin?", ("yes", "no"), "no", 30.0)


class Stage:
    """A plant of which only the ears and voices are there."""

    def __init__(self, hearer="Robin", answer="yes"):
        self.now_s, self.heard, self.settled = 0.0, [], 0
        self.words = []
        listeners = SimpleNamespace(hearer=lambda robot: hearer, answer=lambda person, text, options: answer)
        walkers = SimpleNamespace(still=False, hear=self.heard.append)
        simulation = SimpleNamespace(listeners=listeners, engine=SimpleNamespace(walkers=walkers))
        self.control = Control()
        self.people = Bystanders(simulation, self, self.control)

    def settle(self):
        self.settled += 1

    def now(self):
        return self.now_s

    def ask(self, question=WHO):
        return self.control.ask(question, self, "Alice")

    def after(self, seconds):
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self.people.tick(Progress(self.now_s, 0, 0, {}))


def test_a_person_who_hears_a_question_answers_it_after_a_second():
    stage = Stage()
    asked = stage.ask()
    stage.after(0.9)
    assert not asked.done()
    stage.after(0.3)
    assert asked.done() and asked.result() == "yes" and stage.settled == 1


@pytest.mark.parametrize(("hearer", "answer"), [(None, "yes"), ("Robin", None)])
def test_a_question_without_hearer_or_answer_stays_open(hearer, answer):
    stage = Stage(hearer, answer)
    asked = stage.ask()
    stage.after(3.0)
    assert not asked.done()


def test_an_answer_that_is_no_option_is_heard():
    stage = Stage("Robin", "perhaps")
    asked = stage.ask()
    stage.after(1.2)
    assert asked.result() == "perhaps"


def test_a_question_that_is_put_again_is_answered_again():
    stage = Stage()
    for text in ("Are you Robin?", "I did not understand. Are you Robin?"):
        asked = stage.ask(Question("who", text, (), "no", 30.0))
        stage.after(1.2)
        assert asked.done()


def test_people_hear_what_the_robot_says():
    stage = Stage()
    stage.people.message("speech", {"robot": "Alice", "text": "Please follow me."})
    stage.people.message("answer", {"robot": "Alice"})
    assert stage.heard == ["Alice"] and stage.settled == 1


def test_words_of_people_reach_the_skill_that_listens_once():
    stage = Stage()
    first = stage.control.listen("Alice")
    stage.words.append((0.05, "Robin", "thank you"))
    stage.after(0.1)
    second = stage.control.listen("Alice")
    stage.after(0.1)
    assert first.done() and first.result() == "thank you" and not second.done()


def test_the_truth_is_logged_beside_an_estimate_and_added_to_no_message_of_the_robot():
    logged, true = [], RigidTransform([1.0, 2.0, 0.5])
    visitor = TruthLog(SimpleNamespace(poses_W={"Alice": true}), lambda topic, message: logged.append((topic, message)))
    turn, place = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, {"x": 1.3, "y": 2.4, "z": 0.1}
    pose = {"timestamp": {"sec": 1, "nsec": 0}, "frame_id": "world", "robot": "Alice", "covariance": [0.0]}
    pose["pose"] = {"position": place, "orientation": turn}
    for topic, message in (("pose", pose), ("state", {"robot": "Alice"})):
        assert visitor.message(topic, message) == message
    ((topic, message),) = logged
    assert (topic, message["robot"], message["error_m"]) == ("truth", "Alice", 0.5)
    assert message["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 0.5}
    assert message.keys() <= schemas()["truth"].properties.keys()
