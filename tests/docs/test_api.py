"""What the page on the public API names is there, is documented and is typed."""

import inspect
import sys
import tomllib
from importlib import import_module

import pytest

from tests.docs.documents import DOCS, ROOT

sys.path.insert(0, str(DOCS))
from make_api import meaning, members_of, public_names

NAMES = [(module, name) for module, names in public_names().items() for name in names]
API = (DOCS / "api.md").read_text(encoding="utf-8")


def parts_of(thing):
    """The object, and of a class also its public methods and properties."""
    return [thing, *(member.function for member in members_of(thing))] if inspect.isclass(thing) else [thing]


@pytest.mark.parametrize(("module", "name"), NAMES)
def test_a_public_name_is_there_and_documented(module, name):
    thing = getattr(import_module(module), name)
    assert meaning(import_module(module), name)
    assert [part for part in parts_of(thing)[1:] if not part.__doc__] == []


@pytest.mark.parametrize(("module", "name"), NAMES)
def test_a_public_function_is_typed(module, name):
    functions = [part for part in parts_of(getattr(import_module(module), name)) if inspect.isfunction(part)]
    assert [function for function in functions if "return" not in function.__annotations__] == []


def test_no_name_stands_twice():
    names = [name for _, name in NAMES]
    assert sorted(names) == sorted(set(names))


def test_robot_context_and_skill_are_public():
    assert {("skills.robot", "Robot"), ("skills.api", "SkillContext"), ("skills.api", "Skill")} <= set(NAMES)


def test_every_group_of_entry_points_is_named():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    groups = {group for group in project["entry-points"] if group.startswith("errand.")}
    assert {group for group in groups if f"`{group}`" not in API} == set()


def test_the_template_of_a_skill_uses_only_the_public_api():
    (template,) = (ROOT / "executive/cli/new/skill").rglob("skill.py.template")
    modules = {line.split()[1] for line in template.read_text().splitlines() if line.startswith("from skills")}
    assert modules
    assert modules <= set(public_names())
