"""The import rule: executive -> skills; plant -> executive.words, skills.robot, skills.files; skills imports neither.

Only executive.app and executive.cli import all three. Nothing of the core imports executive.cli, nor a plug-in.
Plug-ins import the public names of the core, and of others what a table lists.
The homes of executive import each other one way, from the last of `HOMES` to the first, the words nothing but a few
plain modules of skills. No files import each other in a circle, not for types either.
"""

import re
import sys
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.sources import PLUGINS, PRODUCT, ROOT, dotted, graph_of, import_graph, modules, read
from tests.tables import yaml_beside

sys.path.insert(0, str(ROOT / "docs"))
from make_api import public_names

Check = Callable[[str, str], list[str]]
Graph = Mapping[str, frozenset[str]]
WORDS_MAY = (
    *("executive.words", "skills.api", "skills.files", "skills.quantities", "skills.durations", "skills.robot"),
    "skills.perception.class_forms",
)
"""All that the words import: what things are, how files are read, and which numbers a quantity may have."""
HOMES = (
    ("executive.words", "executive.record.schemas", "executive.record.work"),
    ("executive.language",),
    ("executive.speech",),
    ("executive.mission",),
    ("executive.tree",),
    ("executive.run",),
    ("executive.record",),
    ("executive.store",),
    ("executive.conversation",),
    ("executive.view",),
    ("executive.testing",),
    ("executive.app",),
    ("executive.cli",),
)
"""The homes of executive, the lowest first."""
PUBLIC = {f"{module}.{name}" for module, names in public_names().items() for name in names}
PRIVATE = yaml_beside(__file__, "test_import_rule.yaml")
"""What each plug-in imports of the core that `docs/api.md` does not name, which may only become less."""


def within(name: str, *packages: str) -> bool:
    return any(name == package or name.startswith(package + ".") for package in packages)


def breaches(path: str, source: str) -> list[str]:
    """What a module imports against the rule."""
    own, names = dotted(path), ours(source)
    allowed = {
        "skills": ("skills",),
        "plant": ("plant", "executive.words", "skills.robot", "skills.robot_wrapper", "skills.files"),
        "executive": ("executive", "skills"),
    }[own.partition(".")[0]]
    if within(own, "executive.cli"):
        return []
    if within(own, "executive.words"):
        return [name for name in names if not within(name, *WORDS_MAY)]
    sees_all = own == "executive" or within(own, "executive.app")
    outside = [name for name in names if not within(name, *allowed) and not sees_all]
    return outside + [name for name in names if within(name, "executive.cli")]


def ours(source: str) -> list[str]:
    """The imports of a source from the product."""
    return [name for name in read(source).imports if name.partition(".")[0] in PRODUCT]


def rank(name: str) -> int | None:
    """How high a module of executive stands, its facade beside `app`; None for one that has no home."""
    if name == "executive":
        return HOMES.index(("executive.app",))
    return next((number for number, homes in enumerate(HOMES) if within(name, *homes)), None)


def upward(path: str, source: str) -> list[str]:
    """The modules of executive that a module imports although they stand above it, or have no home."""
    own = rank(dotted(path))
    names = [name for name in ours(source) if within(name, "executive")]
    return [name for name in names if own is None or (above := rank(name)) is None or above > own]


def plugin_imports(_: str, source: str) -> list[str]:
    """What a module of the core imports of plug-ins."""
    return [name for name in read(source).imports if name.startswith("errand_")]


def private_imports(_: str, source: str) -> list[str]:
    """What a module imports of the core that is not public."""
    return [name for name in ours(source) if name not in PUBLIC]


def imported_names(check: Check, folder: str) -> set[str]:
    """The distinct names that a check finds in the modules of a folder."""
    return {name for names in found(check, folder).values() for name in names}


def found(check: Check, *folders: str) -> dict[str, list[str]]:
    """What a check finds in the modules of some folders."""
    assert modules(*folders)
    return {path: names for path, text in modules(*folders).items() if (names := check(path, text))}


@pytest.mark.parametrize("package", PRODUCT)
def test_no_module_breaks_the_import_rule(package: str) -> None:
    assert found(breaches, package) == {}


def test_the_homes_of_executive_import_each_other_one_way() -> None:
    assert set(found(upward, "executive")) <= {"executive/__init__.py"}


def test_the_root_of_executive_holds_no_modules() -> None:
    assert [path for path in modules("executive") if path.count("/") == 1] == ["executive/__init__.py"]


def test_the_core_imports_no_plug_in() -> None:
    assert found(plugin_imports, *PRODUCT, "missions") == {}


@pytest.mark.parametrize("folder", PLUGINS)
def test_a_plug_in_imports_no_further_private_name_of_the_core(folder: str) -> None:
    """A name that is gone leaves the table; a new one becomes public, or is done without."""
    assert sorted(imported_names(private_imports, folder)) == PRIVATE[Path(folder).name]


@pytest.mark.parametrize("folder", PLUGINS)
def test_plug_ins_use_of_the_command_line_only_what_is_public(folder: str) -> None:
    assert [name for name in PRIVATE[Path(folder).name] if within(name, "executive.cli")] == []


def test_a_plug_in_imports_another_only_where_its_project_requires_it() -> None:
    for folder in PLUGINS:
        project = tomllib.loads((ROOT / folder).with_name("pyproject.toml").read_text(encoding="utf-8"))["project"]
        required = {re.split(r"[^\w-]", each)[0].replace("-", "_") for each in project["dependencies"]}
        packages = {name.partition(".")[0] for name in imported_names(plugin_imports, folder)}
        assert packages <= {Path(folder).name, *required}, folder


CALL = "def f():\n    "


@pytest.mark.parametrize(
    ("check", "path", "source", "expected"),
    [
        (breaches, "skills/grasp/skill.py", "from plant.simulation import Simulation", ["plant.simulation.Simulation"]),
        (breaches, "skills/grasp/skill.py", "import executive.run.runner", ["executive.run.runner"]),
        (breaches, "plant/robots/robot.py", "from skills.api import Surface", ["skills.api.Surface"]),
        (breaches, "plant/robots/robot.py", "from skills.robot import Robot", []),
        (breaches, "plant/worlds/world.py", "from skills.files.yaml_source import read_yaml", []),
        (breaches, "plant/referee/judge.py", "from executive.words.goal import GoalCondition", []),
        (breaches, "plant/referee/judge.py", "from executive.tree import goals", ["executive.tree.goals"]),
        (breaches, "executive/words/goal.py", "from executive.language import u", ["executive.language.u"]),
        (breaches, "executive/words/goal.py", "from skills import ports", ["skills.ports"]),
        (breaches, "executive/run/runner.py", f"{CALL}import plant.simulation", ["plant.simulation"]),
        (breaches, "executive/run/runner.py", "from executive.cli.entry import app", ["executive.cli.entry.app"]),
        (breaches, "executive/run/runner.py", "from skills.api import Cause", []),
        (breaches, "executive/app/simulated.py", "from plant.simulation import Simulation", []),
        (breaches, "executive/app/simulated.py", "from executive.cli.output import c", ["executive.cli.output.c"]),
        (upward, "executive/words/command.py", "from executive.language import u", ["executive.language.u"]),
        (upward, "executive/mission/resolve.py", "from executive.language import u", []),
        (upward, "executive/tree/estimate.py", f"{CALL}import executive.run.runner", ["executive.run.runner"]),
        (upward, "executive/tree/estimate.py", "from executive.attic import old", ["executive.attic.old"]),
        (upward, "executive/view/formats.py", "from executive.tree.node_view import NodeView", []),
        (plugin_imports, "plant/work.py", f"{CALL}import errand_train", ["errand_train"]),
        (private_imports, "errand_train/a.py", f"{CALL}import executive.cli.screen", ["executive.cli.screen"]),
        (private_imports, "errand_train/a.py", "from executive.cli.output import console_for", []),
    ],
)  # fmt: skip
def test_a_check_finds_breaches(check: Check, path: str, source: str, expected: list[str]) -> None:
    assert check(path, source) == expected


def reached(graph: Graph, start: str) -> set[str]:
    """All modules that a module imports, directly or through others."""
    found, pending = set[str](), [start]
    while pending:
        new = graph[pending.pop()] - found
        found |= new
        pending += new
    return found


def circles(graph: Graph) -> list[tuple[str, ...]]:
    """The sets of modules that import each other."""
    reach = {name: reached(graph, name) for name in graph}
    inside = (name for name in graph if name in reach[name])
    return sorted({tuple(sorted(other for other in reach[name] if name in reach[other])) for name in inside})


def test_no_files_import_each_other_in_a_circle() -> None:
    assert circles(import_graph(*PRODUCT)) == []


def test_the_check_finds_circles_through_functions_and_through_types() -> None:
    sources = {
        "executive.a": "from executive.b import one",
        "executive.b": f"{CALL}from executive import a",
        "executive.c": "if TYPE_CHECKING:\n    from executive.d import two",
        "executive.d": "import executive.c",
    }
    assert circles(graph_of(sources)) == [("executive.a", "executive.b"), ("executive.c", "executive.d")]
