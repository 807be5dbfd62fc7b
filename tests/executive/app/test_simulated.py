"""The first run on a machine has its numeric code compiled."""

from dataclasses import replace

import numpy as np
import pytest
from tiny_detector import CLASSES, model_bytes, write_model

from executive.app import simulated
from executive.app.placed_robots import TURNING_M, refuse_blocked, shared_detector, stand_at
from executive.app.simulated import compile_first
from plant.worlds.seeding import place_people
from plant.worlds.world import load_world
from skills.estimate.grid_map import load_grid_map
from skills.files.errors import InputError
from skills.perception.cascade import Cascade
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
    (tmp_path / "lattice.search-93.py311.nbi").touch()
    compile_first(tmp_path)
    assert (commands, caplog.messages) == ([], [])


def with_detector(file):
    return replace(default_stack(), detector=Cascade(str(file)))


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
    assert error.value.hint == "make a new one: errand dataset train --data DIR --out DIR"


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
