"""Runs only the tests that changed files touch: `--affected` (against HEAD) or `--affected REVISION`.

Touched are changed test files, the tests of the folder that mirrors a changed module's, and tests that import a changed
module directly or through one other. A changed data file counts as its folder's modules. What is left out is said: the
whole suite still decides.
"""

from __future__ import annotations

import ast
import subprocess
from functools import cache, partial
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PRODUCT = ("executive", "skills", "plant", "training")
TESTS = {ROOT / "tests": ROOT, ROOT / "training/tests": ROOT / "training/errand_train"}
"""Folders of tests, and the folders of modules that they mirror."""
EVERYTHING = {"tests/conftest.py", "pyproject.toml", "constraints.txt"}
WITHIN = 2
"""Most imports between a test and a changed module."""


def add_option(parser):
    parser.addoption("--affected", nargs="?", const="HEAD", metavar="REVISION", help="only tests that changes touch")


class Affected:
    """Plugin that collects no tests that no change touches."""

    def __init__(self, revision: str) -> None:
        self.changed = changed_files(revision)

    def pytest_ignore_collect(self, collection_path):
        is_test = collection_path.match("test_*.py") or collection_path.match("*.skilltest.yaml")
        return True if is_test and not touched(collection_path, self.changed) else None

    def pytest_terminal_summary(self, terminalreporter):
        tests = sorted(test for folder in TESTS for test in folder.rglob("test_*.py"))
        left_out = [test for test in tests if not touched(test, self.changed)]
        line = terminalreporter.write_line
        line(f"changed: {', '.join(sorted(self.changed)) or 'nothing'}")
        line(
            f"left out: {len(left_out)} of {len(tests)} files of tests, which no change touches within {WITHIN} imports"
        )


def changed_files(revision: str) -> frozenset[str]:
    """Files that differ from a revision, and new ones. Raises CalledProcessError for an unknown revision."""
    git = partial(subprocess.run, cwd=ROOT, capture_output=True, text=True, check=True)
    differing = git(["git", "diff", "--name-only", revision]).stdout
    new = git(["git", "ls-files", "--others", "--exclude-standard"]).stdout
    return frozenset((differing + new).splitlines())


def touched(test: Path, changed: frozenset[str]) -> bool:
    """Whether a change touches the tests of a file."""
    if changed & EVERYTHING or name_of(test) in changed:
        return True
    mirrored = next(TESTS[folder] / test.parent.relative_to(folder) for folder in test.parents if folder in TESTS)
    if any((ROOT / path).parent == mirrored for path in changed):
        return True
    near, modules = {test}, set[Path]()
    for _ in range(WITHIN):
        near = {imported for file in near for imported in imports(file)} - modules
        modules |= near
    data = {modules_folder(ROOT / path) for path in changed if not path.endswith(".py") and path.startswith(PRODUCT)}
    return any(name_of(module) in changed or module.parent in data for module in modules)


def modules_folder(data: Path) -> Path:
    """The folder of a data file, or the next above it, that holds modules."""
    return next(folder for folder in data.parents if folder == ROOT or any(folder.glob("*.py")))


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def imports(file: Path) -> frozenset[Path]:
    """Files of the project that a file imports, within functions, too."""
    found = set[str]()
    for node in ast.walk(ast.parse(file.read_text() if file.suffix == ".py" else "")):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    files = (module_file(Path(*name.split(".")), file.parent) for name in found)
    return frozenset(each for each in files if each is not None and each != file)


@cache
def module_file(name: Path, beside: Path) -> Path | None:
    """File of a module of the project, or of a helper that stands beside a test or above it; None for others."""
    above = [folder for folder in (beside, *beside.parents) if any(map(folder.is_relative_to, TESTS))]
    for folder in (ROOT, ROOT / "training", *above):
        for file in (folder / name.with_suffix(".py"), folder / name / "__init__.py"):
            if file.is_file():
                return file
    return None
