"""The import rule: executive -> skills; plant -> skills.robot, skills.files; skills imports neither; executive.cli all.

The homes of executive import each other one way, from the last of `HOMES` to the first.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
OURS = ("executive", "skills", "plant")
HOMES = (
    ("executive.words", "executive.record.profile", "executive.record.work"),
    ("executive.language",),
    ("executive.speech",),
    ("executive.mission",),
    ("executive.tree",),
    ("executive.record",),
    ("executive.run",),
    ("executive.store",),
    ("executive.fleet",),
    ("executive.conversation",),
    ("executive.view",),
    ("executive.evaluation",),
    ("executive.testing",),
    ("executive.cli",),
)
"""The homes of executive, the lowest first."""
TRAINING = (
    "plant.dataset",
    "plant.models.builder",
    "plant.worlds.builder",
    "skills.perception.training",
    "executive.speech.training",
)
"""What makes pictures, models, worlds and networks; nothing at run time imports it."""
TRAINS = (
    "dataset_command",
    "learning",
    "object_command",
    "refine_command",
    "score_command",
    "score_report",
    "train_command",
    "world_command",
    "worst_sheet",
)
"""The modules of executive.cli that serve it."""


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
        "plant": ("plant", "skills.robot", "skills.files"),
        "executive": ("executive", "skills"),
    }[parts[0]]
    if parts[:2] == ("executive", "cli"):
        return []
    names = list(imported(source))
    outside = [name for name in names if not within(name, *allowed)]
    return outside + [name for name in names if within(name, "executive.cli")]


@pytest.mark.parametrize("package", OURS)
def test_no_module_breaks_the_import_rule(package: str) -> None:
    found = {str(path.relative_to(ROOT)): breaches(path, path.read_text()) for path in modules(package)}
    assert modules(package)
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        ("skills/grasp/skill.py", "from plant.simulation import Simulation", ["plant.simulation.Simulation"]),
        ("skills/grasp/skill.py", "import executive.run.runner", ["executive.run.runner"]),
        ("plant/spot/robot.py", "from skills.api import Surface", ["skills.api.Surface"]),
        ("plant/spot/robot.py", "from skills.robot import Robot", []),
        ("plant/worlds/world.py", "from skills.files.yaml_source import read_yaml", []),
        ("executive/run/runner.py", "def f():\n    import plant.simulation", ["plant.simulation"]),
        ("executive/run/runner.py", "from executive.cli.entry import app", ["executive.cli.entry.app"]),
        ("executive/run/runner.py", "from skills.api import Cause", []),
        ("executive/cli/assembly.py", "from plant.simulation import Simulation", []),
    ],
)
def test_the_check_finds_breaches(path: str, source: str, expected: list[str]) -> None:
    assert breaches(ROOT / path, source) == expected


def rank(name: str) -> int | None:
    """How high a module of executive stands; None for one that has no home."""
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
        ("executive/mission/mission.py", "from executive.language import understand", []),
        ("executive/tree/estimate.py", "def f():\n    import executive.run.runner", ["executive.run.runner"]),
        ("executive/tree/estimate.py", "from executive.attic import old", ["executive.attic.old"]),
        ("executive/view/svg.py", "from executive.tree.node_view import NodeView", []),
    ],
)
def test_the_check_finds_imports_upward(path: str, source: str, expected: list[str]) -> None:
    assert upward(ROOT / path, source) == expected


def training_imports(path: Path, source: str) -> list[str]:
    """What a module that is needed at run time imports of the packages for training."""
    own = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    if within(own, *TRAINING, *(f"executive.cli.{name}" for name in TRAINS)):
        return []
    serving = tuple(f"executive.cli.{name}" for name in TRAINS)
    at_run_time = (*TRAINING, *serving) if not within(own, "executive.cli") else TRAINING
    return [name for name in imported(source) if within(name, *at_run_time)]


def test_nothing_at_run_time_imports_what_makes_pictures_or_trains() -> None:
    paths = [path for package in OURS for path in modules(package)]
    found = {str(path.relative_to(ROOT)): training_imports(path, path.read_text()) for path in paths}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        ("plant/simulation.py", "from plant.dataset import coco", ["plant.dataset.coco"]),
        (
            "skills/detect/skill.py",
            "def f():\n    import skills.perception.training.learner",
            ["skills.perception.training.learner"],
        ),
        ("executive/cli/assembly.py", "import plant.models.builder.mesh", ["plant.models.builder.mesh"]),
        ("executive/cli/train_command.py", "import skills.perception.training.train", []),
        ("plant/dataset/render.py", "from plant.models.builder import gltf", []),
    ],
)
def test_the_check_finds_imports_of_training(path: str, source: str, expected: list[str]) -> None:
    assert training_imports(ROOT / path, source) == expected
