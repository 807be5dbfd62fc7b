"""errand new skill: what is written, and which names and folders are refused."""

import pytest

from executive.cli.new_command import render_skill
from skills.inputs.errors import InputError


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
