"""The import rule: executive -> skills; plant -> executive.words, skills.robot, skills.files; skills imports neither.

Only executive.app and executive.cli import all three. Nothing imports executive.cli, nor training, which imports all.
The homes of executive import each other one way, from the last of `HOMES` to the first, the words nothing but a few
plain modules of skills. No files import each other in a circle, not for types either.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
OURS = ("executive", "skills", "plant")
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
BUILDERS = ("plant.models.builder", "plant.worlds.builder")
"""What makes models and worlds; at run time only the commands import it that make them."""
USES_BUILDERS = (*BUILDERS, "executive.cli.new_command", "executive.cli.object_command", "executive.cli.world_command")
FOR_COMMANDS = ("executive.cli.number_options", "executive.cli.output")
"""What a command of any distribution may use of the command line."""


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(source: str) -> Iterator[str]:
    """All our modules that a source imports, absolutely named; relative imports stay inside their package."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] in OURS)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and (node.module or "").split(".")[0] in OURS:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def within(name: str, *packages: str) -> bool:
    return any(name == package or name.startswith(package + ".") for package in packages)


def breaches(path: Path, source: str) -> list[str]:
    """What a module imports against the rule."""
    parts = path.relative_to(ROOT).parts
    allowed = {
        "skills": ("skills",),
        "plant": ("plant", "executive.words", "skills.robot", "skills.robot_wrapper", "skills.files"),
        "executive": ("executive", "skills"),
    }[parts[0]]
    if parts[:2] == ("executive", "cli"):
        return []
    names = list(imported(source))
    if parts[:2] == ("executive", "words"):
        return [name for name in names if not within(name, *WORDS_MAY)]
    sees_all = parts[:2] in (("executive", "app"), ("executive", "__init__.py"))
    outside = [name for name in names if not within(name, *allowed) and not sees_all]
    return outside + [name for name in names if within(name, "executive.cli")]


@pytest.mark.parametrize("package", OURS)
def test_no_module_breaks_the_import_rule(package: str) -> None:
    found = {str(path.relative_to(ROOT)): breaches(path, path.read_text()) for path in modules(package)}
    assert modules(package)
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        (
            "skills/manipulation/grasp/skill.py",
            "from plant.simulation import Simulation",
            ["plant.simulation.Simulation"],
        ),
        ("skills/manipulation/grasp/skill.py", "import executive.run.runner", ["executive.run.runner"]),
        ("plant/robots/spot/robot.py", "from skills.api import Surface", ["skills.api.Surface"]),
        ("plant/robots/spot/robot.py", "from skills.robot import Robot", []),
        ("plant/worlds/world.py", "from skills.files.yaml_source import read_yaml", []),
        ("plant/referee/judge.py", "from executive.words.goal import GoalCondition", []),
        ("plant/referee/judge.py", "from executive.tree import goals", ["executive.tree.goals"]),
        ("executive/words/goal.py", "from executive.language import pipeline", ["executive.language.pipeline"]),
        ("executive/words/goal.py", "from skills import ports", ["skills.ports"]),
        ("executive/run/runner.py", "def f():\n    import plant.simulation", ["plant.simulation"]),
        ("executive/run/runner.py", "from executive.cli.entry import app", ["executive.cli.entry.app"]),
        ("executive/run/runner.py", "from skills.api import Cause", []),
        ("executive/app/simulated.py", "from plant.simulation import Simulation", []),
        (
            "executive/app/simulated.py",
            "from executive.cli.output import console_for",
            ["executive.cli.output.console_for"],
        ),
    ],
)
def test_the_check_finds_breaches(path: str, source: str, expected: list[str]) -> None:
    assert breaches(ROOT / path, source) == expected


def rank(name: str) -> int | None:
    """How high a module of executive stands, its facade beside `app`; None for one that has no home."""
    if name == "executive":
        return HOMES.index(("executive.app",))
    return next((number for number, homes in enumerate(HOMES) if within(name, *homes)), None)


def upward(path: Path, source: str) -> list[str]:
    """The modules of executive that a module imports although they stand above it, or have no home."""
    own = rank(".".join(path.relative_to(ROOT).with_suffix("").parts))
    names = [name for name in imported(source) if within(name, "executive")]
    return [name for name in names if own is None or (above := rank(name)) is None or above > own]


def test_the_homes_of_executive_import_each_other_one_way() -> None:
    paths = [path for path in modules("executive") if path.parent != ROOT / "executive"]
    found = {str(path.relative_to(ROOT)): upward(path, path.read_text()) for path in paths}
    assert {path: names for path, names in found.items() if names} == {}


def test_the_root_of_executive_holds_no_modules() -> None:
    assert [path.name for path in (ROOT / "executive").glob("*.py")] == ["__init__.py"]


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        (
            "executive/words/command.py",
            "from executive.language import understand",
            ["executive.language.understand"],
        ),
        ("executive/mission/resolve.py", "from executive.language import understand", []),
        ("executive/tree/estimate.py", "def f():\n    import executive.run.runner", ["executive.run.runner"]),
        ("executive/tree/estimate.py", "from executive.attic import old", ["executive.attic.old"]),
        ("executive/view/formats.py", "from executive.tree.node_view import NodeView", []),
    ],
)
def test_the_check_finds_imports_upward(path: str, source: str, expected: list[str]) -> None:
    assert upward(ROOT / path, source) == expected


def builder_imports(path: Path, source: str) -> list[str]:
    """What a module that is needed at run time imports of the builders."""
    own = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    return [] if within(own, *USES_BUILDERS) else [name for name in imported(source) if within(name, *BUILDERS)]


def test_only_the_commands_that_make_models_and_worlds_import_the_builders() -> None:
    paths = [path for package in OURS for path in modules(package)]
    found = {str(path.relative_to(ROOT)): builder_imports(path, path.read_text()) for path in paths}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        ("executive/cli/assembly.py", "import plant.models.builder.mesh", ["plant.models.builder.mesh"]),
        ("executive/cli/object_command.py", "def f():\n    import plant.models.builder.importing", []),
        ("plant/worlds/builder/own.py", "from plant.models.builder import mesh", []),
    ],
)
def test_the_check_finds_imports_of_builders(path: str, source: str, expected: list[str]) -> None:
    assert builder_imports(ROOT / path, source) == expected


def test_nothing_imports_training() -> None:
    paths = [path for package in (*OURS, "missions") for path in modules(package)]
    assert [str(path.relative_to(ROOT)) for path in paths if "errand_train" in imported_roots(path.read_text())] == []


def test_training_uses_of_the_command_line_only_what_plug_ins_use() -> None:
    paths = modules("training")
    found = {str(path.relative_to(ROOT)): list(imported(path.read_text())) for path in paths}
    of_cli = {path: [n for n in names if within(n, "executive.cli")] for path, names in found.items()}
    assert paths
    assert {path: names for path, names in of_cli.items() if not all(within(n, *FOR_COMMANDS) for n in names)} == {}


def imported_roots(source: str) -> set[str]:
    """The first names of all modules that a source imports."""
    nodes = list(ast.walk(ast.parse(source)))
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    named = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    return {name.split(".")[0] for name in plain | named}


def import_graph(sources: dict[str, str]) -> dict[str, set[str]]:
    """The modules among `sources` that each of them imports."""
    graph = {}
    for name, source in sources.items():
        names = set(imported(source))
        graph[name] = {each if each in sources else each.rpartition(".")[0] for each in names} & sources.keys() - {name}
    return graph


def reached(graph: dict[str, set[str]], start: str) -> set[str]:
    """All modules that a module imports, directly or through others."""
    found, pending = set[str](), [start]
    while pending:
        new = graph[pending.pop()] - found
        found |= new
        pending += new
    return found


def circles(graph: dict[str, set[str]]) -> list[tuple[str, ...]]:
    """The sets of modules that import each other."""
    reach = {name: reached(graph, name) for name in graph}
    inside = (name for name in graph if name in reach[name])
    return sorted({tuple(sorted(other for other in reach[name] if name in reach[other])) for name in inside})


def test_no_files_import_each_other_in_a_circle() -> None:
    paths = [path for package in OURS for path in modules(package)]
    names = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths}
    graph = import_graph({name: path.read_text() for path, name in names.items()})
    assert circles(graph) == []


def test_the_check_finds_circles_through_functions_and_through_types() -> None:
    sources = {
        "executive.a": "from executive.b import one",
        "executive.b": "def f():\n    from executive import a",
        "executive.c": "if TYPE_CHECKING:\n    from executive.d import two",
        "executive.d": "import executive.c",
    }
    assert circles(import_graph(sources)) == [("executive.a", "executive.b"), ("executive.c", "executive.d")]
