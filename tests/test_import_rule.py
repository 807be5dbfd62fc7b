"""The import rule: executive -> the interface of skills; plant -> executive.words, skills.robot, skills.inputs.

Skills import neither. Only executive.app and executive.cli import all three. Nothing of the core imports executive.cli,
nor a plug-in.
Plug-ins and their tests import the public names of the core, and of others what a table lists.
The homes of executive import each other one way, from the last of `HOMES` to the first, the words nothing but a few
plain modules of skills. No files import each other in a circle, not for types either.
"""

import re
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest

from tests.sources import PLUGINS, PRODUCT, ROOT, dotted, graph_of, import_graph, modules, read
from tests.tables import yaml_beside

sys.path.insert(0, str(ROOT / "docs"))
from make_api import public_names

Check = Callable[[str, str], list[str]]
Graph = Mapping[str, frozenset[str]]
WORDS_MAY = (
    *("executive.words", "skills.api", "skills.inputs", "skills.quantities", "skills.relations", "skills.robot"),
    *("skills.world_model", "skills.class_forms"),
)
"""All that the words import: what things are, how files are read, and which numbers a quantity may have."""
PLANT_MAY = (
    *("executive.words", "skills.command_table", "skills.robot", "skills.robot_wrapper", "skills.inputs"),
    *("skills.map_drawing", "skills.relations"),
)
"""All that the plant imports of others."""
HOMES = (
    ("executive.words",),
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
APP = ("prepare", "report", "runs", "fleet", "evaluate")
"""The folders of executive.app, the lowest first; modules beside them stand above all."""
SKILL_ROOMS = (
    ("skills",),
    ("skills.estimate",),
    ("skills.perception",),
    ("skills.manipulation.arm",),
    ("skills.navigate",),
    ("skills.detect",),
    ("skills.small",),
    ("skills.manipulation",),
    ("skills.people",),
    ("skills.faults", "skills.testing"),
)
"""The rooms of skills, the lowest first; the lowest is the interface: modules beside the rooms, and `skills.inputs`."""
PLANT_ROOMS = (
    ("plant.rendering", "plant.saved_state"),
    ("plant.sensors",),
    ("plant.models",),
    ("plant.robots",),
    ("plant.worlds",),
    ("plant.diagram", "plant.events", "plant.recording", "plant.scene_pictures"),
    ("plant.people", "plant.referee"),
    ("plant",),
)
"""The rooms of the plant, the lowest first; what steps the plant stands above what stands in it."""
PUBLIC = {f"{module}.{name}" for module, names in public_names().items() for name in names}
PRIVATE = yaml_beside(__file__, "test_import_rule.yaml")
"""What each plug-in and its tests import of the core that `docs/api.md` does not name, which may only become less."""
TESTS = tuple(str(Path(folder).with_name("tests")) for folder in PLUGINS)
"""Folders of the tests of plug-ins."""


def within(name: str, *packages: str) -> bool:
    return any(name == package or name.startswith(package + ".") for package in packages)


def breaches(path: str, source: str) -> list[str]:
    """What a module imports against the rule."""
    own, names = dotted(path), ours(source)
    allowed = {
        "skills": ("skills",),
        "plant": ("plant", *PLANT_MAY),
        "executive": ("executive", "skills"),
    }[own.partition(".")[0]]
    if own.startswith("executive") and (inside := [name for name in names if in_a_room(name)]):
        return inside
    if within(own, "executive.cli"):
        return []
    if within(own, "executive.words"):
        return [name for name in names if not within(name, *WORDS_MAY)]
    sees_all = own == "executive" or within(own, "executive.app")
    outside = [name for name in names if not within(name, *allowed) and not sees_all]
    return outside + [name for name in names if within(name, "executive.cli")]


def in_a_room(name: str) -> bool:
    """Returns whether a module stands in a room of skills, which the executive reaches by entry points."""
    return within(name, "skills") and room(name, SKILL_ROOMS) not in (0, len(SKILL_ROOMS) - 1)


def ours(source: str) -> list[str]:
    """The imports of a source from the product."""
    return [name for name in read(source).imports if name.partition(".")[0] in PRODUCT]


def room(name: str, rooms: Sequence[tuple[str, ...]]) -> int:
    """How high the room of a module stands, which is the one with the longest name that fits."""
    return max((len(each), number) for number, names in enumerate(rooms) for each in names if within(name, each))[1]


def upward_in_rooms(path: str, source: str) -> list[str]:
    """The modules of the same package that a module imports although their room stands above its own."""
    own = dotted(path)
    rooms = {"skills": SKILL_ROOMS, "plant": PLANT_ROOMS}[own.partition(".")[0]]
    names = [name for name in ours(source) if within(name, own.partition(".")[0])]
    return [name for name in names if room(name, rooms) > room(own, rooms)]


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


def app_rank(name: str) -> int:
    """How high a module of executive.app stands."""
    folder = name.split(".")[2]
    return APP.index(folder) if folder in APP else len(APP)


def upward_in_app(path: str, source: str) -> list[str]:
    """The modules of executive.app that a module of a folder imports although they stand above that folder."""
    own = dotted(path)
    names = [name for name in ours(source) if within(own, "executive.app") and within(name, "executive.app")]
    return [name for name in names if app_rank(name) > app_rank(own)]


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


def test_the_folders_of_the_application_import_each_other_one_way() -> None:
    assert {path.split("/")[2] for path in modules("executive/app") if path.count("/") == 3} == set(APP)
    assert found(upward_in_app, *(f"executive/app/{folder}" for folder in APP)) == {}


@pytest.mark.parametrize("package", ["skills", "plant"])
def test_the_rooms_of_a_package_import_each_other_one_way(package: str) -> None:
    assert found(upward_in_rooms, package) == {}


def test_the_root_of_executive_holds_no_modules() -> None:
    assert [path for path in modules("executive") if path.count("/") == 1] == ["executive/__init__.py"]


def test_the_core_imports_no_plug_in() -> None:
    assert found(plugin_imports, *PRODUCT, "missions") == {}


@pytest.mark.parametrize("folder", [*PLUGINS, *TESTS])
def test_a_plug_in_imports_no_further_private_name_of_the_core(folder: str) -> None:
    """A name that is gone leaves the table; a new one becomes public, or is done without."""
    assert sorted(imported_names(private_imports, folder)) == PRIVATE[folder]


@pytest.mark.parametrize("folder", PLUGINS)
def test_plug_ins_use_of_the_command_line_only_what_is_public(folder: str) -> None:
    assert [name for name in PRIVATE[folder] if within(name, "executive.cli")] == []


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
        (breaches, "plant/worlds/world.py", "from skills.inputs.yaml_source import read_yaml", []),
        (breaches, "plant/referee/judge.py", "from executive.words.goal import GoalCondition", []),
        (breaches, "plant/referee/judge.py", "from executive.tree import goals", ["executive.tree.goals"]),
        (breaches, "executive/words/goal.py", "from executive.language import u", ["executive.language.u"]),
        (breaches, "executive/words/goal.py", "from skills import stack", ["skills.stack"]),
        (breaches, "executive/run/runner.py", f"{CALL}import plant.simulation", ["plant.simulation"]),
        (breaches, "executive/run/runner.py", "from executive.cli.entry import app", ["executive.cli.entry.app"]),
        (breaches, "executive/run/runner.py", "from skills.api import Cause", []),
        (breaches, "executive/app/runs/simulated.py", "from plant.simulation import Simulation", []),
        (breaches, "executive/app/runs/simulated.py", "from executive.cli.output import c", ["executive.cli.output.c"]),
        (breaches, "executive/app/a.py", f"{CALL}import skills.navigate.skill", ["skills.navigate.skill"]),
        (breaches, "executive/cli/a.py", "import skills.people.u, skills.testing.u, skills.path", ["skills.people.u"]),
        (upward, "executive/words/command.py", "from executive.language import u", ["executive.language.u"]),
        (upward, "executive/mission/resolve.py", "from executive.language import u", []),
        (upward, "executive/tree/estimate.py", f"{CALL}import executive.run.runner", ["executive.run.runner"]),
        (upward, "executive/tree/estimate.py", "from executive.attic import old", ["executive.attic.old"]),
        (upward, "executive/view/formats.py", "from executive.tree.node_view import NodeView", []),
        (upward_in_app, "executive/app/runs/a.py", "import executive.app.fleet.chain", ["executive.app.fleet.chain"]),
        (upward_in_app, "executive/app/runs/a.py", "from executive.app.kernels import k", ["executive.app.kernels.k"]),
        (upward_in_app, "executive/app/runs/a.py", "from executive.app.report.run_report import RunReport", []),
        (upward_in_rooms, "skills/estimate/a.py", "import skills.navigate.skill", ["skills.navigate.skill"]),
        (upward_in_rooms, "skills/manipulation/arm/a.py", f"{CALL}import skills.detect.u", ["skills.detect.u"]),
        (upward_in_rooms, "skills/manipulation/place/a.py", "import skills.navigate.skill, skills.api", []),
        (upward_in_rooms, "skills/geometry.py", "import skills.detect.look", ["skills.detect.look"]),
        (upward_in_rooms, "skills/stack.py", "import skills.navigate.u", ["skills.navigate.u"]),
        (upward_in_rooms, "plant/people/walkers.py", "from plant.engine import Engine", ["plant.engine.Engine"]),
        (upward_in_rooms, "plant/engine.py", "from plant.people.walkers import Walkers", []),
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
    assert circles(import_graph(*PRODUCT, *PLUGINS)) == []


def test_the_check_finds_circles_through_functions_and_through_types() -> None:
    sources = {
        "executive.a": "from executive.b import one",
        "executive.b": f"{CALL}from executive import a",
        "executive.c": "if TYPE_CHECKING:\n    from executive.d import two",
        "executive.d": "import executive.c",
    }
    assert circles(graph_of(sources)) == [("executive.a", "executive.b"), ("executive.c", "executive.d")]
