"""Skills found by entry points: ours, and what is refused of others'."""

import dataclasses
import importlib
import inspect
import pkgutil
import sys
import textwrap
import tomllib
from collections import defaultdict
from collections.abc import Mapping
from importlib.metadata import distributions, entry_points
from pathlib import Path
from typing import ClassVar

import pytest

import skills
from executive.tree.registry import GROUP, faults_of, installed_skills, missing_skill, skills_of
from skills.api import Skill
from skills.inputs.errors import InputError
from tests.project import core_skills, project_skills
from tests.tables import yaml_beside

ROOMS = ("skills.small", "skills.people", "skills.manipulation")
"""Rooms of skills that are a module each; others are the module `skill` of a folder."""
ROOT = Path(__file__).resolve().parents[3]
BROKEN = yaml_beside(__file__, "broken_skills.yaml")
GOOD = '''
from dataclasses import dataclass
from skills.api import Cause, Skill, Succeeded

@dataclass(frozen=True)
class WaveInputs:
    """How often."""
    times: int = 1

class Wave(Skill[WaveInputs]):
    """Waves with the arm."""
    name = "wave"
    Inputs = WaveInputs
    outputs = {"waved": int}
    causes = {Cause.EXECUTION: "the arm did not move"}
    def begin(self, inputs): pass
    def step(self): return Succeeded("waved", {"waved": 1})
'''


@pytest.fixture
def others(tmp_path, monkeypatch):
    """Make a distribution `name` that registers `entry` from a module with `source`; gives its entry points."""
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)

    def make(source=GOOD, *, name="wavers", entry="wave = {module}:Wave", module="wavers_skill"):
        folder = tmp_path / name
        info = folder / f"{name}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{GROUP}]\n{entry.format(module=module)}\n")
        (folder / f"{module}.py").write_text(textwrap.dedent(source))
        monkeypatch.syspath_prepend(str(folder))
        monkeypatch.delitem(sys.modules, module, raising=False)
        importlib.invalidate_caches()
        (made,) = distributions(path=[str(folder)])
        return list(made.entry_points)

    return make


def test_our_skills_are_found_by_name_with_typed_ports():
    found = core_skills()
    assert {"navigate", "detect", "approach", "grasp", "place", "hand_over", "stow"} <= set(found)
    assert all(name == skill.name and dataclasses.is_dataclass(skill.Inputs) for name, skill in found.items())


def test_every_skill_in_the_skills_folder_is_registered_in_pyproject_and_installed():
    """After a new entry in pyproject.toml, `make env` registers it."""
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"][GROUP]
    written = defaultdict(set)  # a part of another skill may derive from a skill, and has its name
    for found in pkgutil.walk_packages(skills.__path__, "skills."):
        room, _, name = found.name.rpartition(".")
        if not found.ispkg and (name == "skill" or room in ROOMS):
            module = importlib.import_module(found.name)
            for kind in vars(module).values():
                ours = inspect.isclass(kind) and issubclass(kind, Skill) and kind.__module__ == module.__name__
                if ours and not inspect.isabstract(kind):
                    written[kind.name].add(f"{module.__name__}:{kind.__name__}")
    assert declared.keys() == written.keys()
    assert all(declared[name] in classes for name, classes in written.items())
    assert set(core_skills()) == set(written)


@pytest.mark.parametrize("name", sorted(project_skills()))
def test_our_skills_keep_the_rules_for_skills(name):
    assert list(faults_of(project_skills()[name], registered_as=name)) == []


def test_a_skill_of_another_distribution_is_found_beside_ours(others):
    others()
    assert {"wave", "navigate"} <= set(installed_skills())
    assert "wave" not in core_skills()


@pytest.mark.parametrize(("old", "new", "message"), BROKEN)
def test_a_skill_that_breaks_a_rule_is_refused_with_its_distribution_and_the_hint(others, old, new, message):
    assert old in GOOD
    entries = others(GOOD.replace(old, new))
    with pytest.raises(InputError) as refused:
        skills_of(entries)
    assert refused.value.message.startswith("skill 'wave' of distribution wavers: ")
    assert message in refused.value.message
    assert refused.value.hint


def test_two_distributions_with_one_name_are_refused_naming_both(others):
    entries = others() + others(name="others", module="others_skill")
    with pytest.raises(InputError, match="others and wavers both register a skill 'wave'"):
        skills_of(entries)


def test_another_distribution_cannot_take_the_name_of_one_of_ours(others):
    others(GOOD.replace('"wave"', '"navigate"'), entry="navigate = {module}:Wave")
    found = installed_skills()
    assert found["navigate"] is core_skills()["navigate"]
    assert "both register a skill 'navigate'" in str(found.broken["navigate"])


def test_a_skill_of_another_distribution_is_not_loaded_before_it_is_used(others):
    others("import sys\nsys.modules['was_loaded'] = sys\n" + GOOD)
    found = installed_skills()
    assert "navigate" in found and found["navigate"].name == "navigate" and "wave" in found.names
    assert "was_loaded" not in sys.modules
    assert found["wave"].name == "wave"
    assert sys.modules.pop("was_loaded")


@pytest.mark.parametrize(
    "source",
    [
        "raise SystemExit(3)",
        "1 / 0",
        "raise BaseException",
        "raise type('Gone', (KeyboardInterrupt,), {})",
        "raise GeneratorExit",
        GOOD.replace("def step", "def leap"),
    ],
)
def test_a_broken_skill_affects_no_other_and_a_file_that_uses_it_is_refused_with_the_reason(others, source):
    others(source)
    others(GOOD.replace('"wave"', '"wink"'), name="winkers", entry="wink = {module}:Wave", module="winkers_skill")
    found = installed_skills()
    assert {"wink", *core_skills()} <= set(found)
    assert "wave" not in found
    assert "distribution wavers" in missing_skill("wave", found)[0]
    assert "there is no skill" in missing_skill("wavy", found)[0]


def test_an_age_of_pictures_is_refused_with_what_to_declare_instead():
    class Gaze(Skill[WaveInputs]):
        """Looks."""

        name = "gaze"
        Inputs = WaveInputs
        max_data_age_s: ClassVar[Mapping[str, float]] = {"image": 1.0}

        def begin(self, inputs):
            pass

        def step(self):
            raise NotImplementedError

    found = dict(faults_of(Gaze, registered_as="gaze"))
    assert "the picture's stamp_s" in found["its max_data_age_s names 'image', which has no latest reading"]


@dataclasses.dataclass(frozen=True)
class WaveInputs:
    """None."""
