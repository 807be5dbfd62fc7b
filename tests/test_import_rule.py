"""The import rule: executive -> skills; plant -> skills.robot only; skills imports neither; only executive.cli all."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
OURS = ("executive", "skills", "plant")


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
        "plant": ("plant", "skills.robot"),
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
        ("executive/run/runner.py", "def f():\n    import plant.simulation", ["plant.simulation"]),
        ("executive/run/runner.py", "from executive.cli.entry import app", ["executive.cli.entry.app"]),
        ("executive/run/runner.py", "from skills.api import Cause", []),
        ("executive/cli/assembly.py", "from plant.simulation import Simulation", []),
    ],
)
def test_the_check_finds_breaches(path: str, source: str, expected: list[str]) -> None:
    assert breaches(ROOT / path, source) == expected
