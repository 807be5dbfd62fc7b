"""errand new skill and task: what is written, and which names and folders are refused."""

import os
import subprocess
import sys

import pytest

from executive.cli.new_command import render_skill, render_task
from skills.inputs.errors import InputError
from tests.executive.distribution import write_distribution


def test_a_package_with_skill_tests_and_registration_is_written(tmp_path):
    written = render_skill("wave_arm", tmp_path / "new")
    assert {str(path.relative_to(tmp_path / "new")) for path in written} == {
        "README.md",
        "pyproject.toml",
        "errand_skill_wave_arm/__init__.py",
        "errand_skill_wave_arm/skill.py",
        "tests/test_wave_arm.py",
        "tests/wave_arm.skilltest.yaml",
    }
    assert 'wave_arm = "errand_skill_wave_arm.skill:WaveArm"' in (tmp_path / "new/pyproject.toml").read_text()
    assert not any("$" in path.read_text() for path in written)


@pytest.mark.parametrize("name", ["Wave", "wave-arm", "2wave", "", "class", "wave_"])
def test_a_name_that_cannot_be_one_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="cannot be the name of a skill"):
        render_skill(name, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_name_that_is_taken_is_refused(tmp_path):
    with pytest.raises(InputError, match="a skill 'stow' exists already"):
        render_skill("stow", tmp_path / "new", taken=frozenset(("stow",)))


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="exists and is not empty"):
        render_skill("wave", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_package_with_a_task_is_three_files_and_ninety_lines(tmp_path):
    written = render_task("sweep_up", tmp_path / "new")
    assert {str(path.relative_to(tmp_path / "new")) for path in written} == {
        "pyproject.toml",
        "errand_task_sweep_up.py",
        "tests/test_sweep_up.py",
    }
    assert sum(path.read_text().count("\n") for path in written) <= 90
    assert 'sweep_up = "errand_task_sweep_up:SweepUp"' in (tmp_path / "new/pyproject.toml").read_text()


#   a task, a step of mission files, words that are no name, and words of sentences of Errand itself
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("grasp", "exists"),
        ("speak", "missions have a step of this name"),
        ("Sweep", "cannot be the name"),
        ("go", "'go the kitchen' is a sentence of Errand already; choose a verb"),
        ("patrol", "'patrol every room' is a sentence of Errand already"),
        ("fetch", "'fetch the beer' is a sentence of Errand already"),
        ("sweep_twice", "'sweep twice the kitchen' is no plain request; choose a verb, as in 'sweep_up'"),
        ("if", "'if' cannot be the name of a task"),
    ],
)
def test_a_word_of_a_task_that_cannot_be_one_is_refused(tmp_path, name, message):
    with pytest.raises(InputError, match=message):
        render_task(name, tmp_path / "new")


def test_a_new_task_is_said_and_passes_its_own_tests(tmp_path):
    render_task("sweep_up", tmp_path / "new")
    write_distribution(tmp_path / "new", "sweepers", "errand.tasks", "sweep_up = errand_task_sweep_up:SweepUp")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path / "new")],
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path / "new"), *filter(None, sys.path)))},
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path / "new",
    )
    assert "5 passed" in done.stdout, done.stdout
