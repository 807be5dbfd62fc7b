"""Runs only the tests that changed files touch: `--affected` (against HEAD) or `--affected REVISION`.

Touched are changed test files, the tests of the folder that mirrors a changed module's, and tests that import a changed
module directly or through one other. A changed data file counts as its folder's modules; one beside tests, and a
`conftest.py`, touch the tests of their folder and below, a page those of the pages. What is left out is said: the whole
suite still decides.
"""

from __future__ import annotations

import ast
import subprocess
from functools import cache, partial
from pathlib import Path

import pytest

from tests.sources import PLUGINS, ROOT

PRODUCT = ("executive", "skills", "plant", "plugins")
TESTS = {ROOT / "tests": ROOT} | {(ROOT / folder).parent / "tests": ROOT / folder for folder in PLUGINS}
"""Folders of tests, and the folders of modules that they mirror."""
EVERYTHING = {"tests/conftest.py", "pyproject.toml", "constraints.txt"}
WITHIN = 2
"""Most imports between a test and a changed module."""
NAMED = 10
"""Most changed files that are named."""


def add_option(parser):
    parser.addoption("--affected", nargs="?", const="HEAD", metavar="REVISION", help="only tests that changes touch")


class Affected:
    """Plugin that collects no tests that no change touches."""

    def __init__(self, revision: str) -> None:
        self.changed = changed_files(revision)
        if not self.changed:
            pytest.exit(f"nothing differs from {revision}", returncode=0)

    def pytest_ignore_collect(self, collection_path):
        return True if is_test(collection_path) and not touched(collection_path, self.changed) else None

    def pytest_sessionfinish(self, session, exitstatus):
        if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
            session.exitstatus = pytest.ExitCode.OK

    def pytest_terminal_summary(self, terminalreporter, config):
        asked = [ROOT / argument.partition("::")[0] for argument in config.args]
        tests = [test for folder in asked if folder.is_dir() for test in sorted(folder.rglob("*")) if is_test(test)]
        left_out = [test for test in tests if not touched(test, self.changed)]
        first, more = sorted(self.changed)[:NAMED], len(self.changed) - NAMED
        line = terminalreporter.write_line
        line(f"changed: {', '.join(first)}{f' and {more} more' if more > 0 else ''}")
        line(f"left out: {len(left_out)} of {len(tests)} files, which no change touches within {WITHIN} imports")


def is_test(path: Path) -> bool:
    """Whether a file holds tests."""
    return path.match("test_*.py") or path.match("*.skilltest.yaml")


def changed_files(revision: str) -> frozenset[str]:
    """Files that differ from a revision, gone ones and new ones included. Raises UsageError if there is no such one."""
    git = partial(subprocess.run, cwd=ROOT, capture_output=True, text=True)
    if git(["git", "rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}"]).returncode:
        raise pytest.UsageError(f"--affected: there is no revision '{revision}'; name a branch, a tag or a commit")
    listed = ["git", "diff", "--name-only", "--no-renames", "-z", revision, "--"]
    new = ["git", "ls-files", "--others", "--exclude-standard", "-z"]
    return frozenset(name for each in (listed, new) for name in git(each).stdout.split("\0") if name)


def touched(test: Path, changed: frozenset[str]) -> bool:
    """Whether a change touches the tests of a file."""
    if changed & EVERYTHING or name_of(test) in changed:
        return True
    folder = next(folder for folder in test.parents if folder in TESTS)
    mirrored, files = TESTS[folder] / test.parent.relative_to(folder), [ROOT / path for path in changed]
    if any(file.parent == mirrored for file in files):
        return True
    if any(file.suffix == ".md" for file in files) and test.is_relative_to(ROOT / "tests/docs"):
        return True
    beside = (file.parent for file in files if file.name == "conftest.py" or file.suffix != ".py")
    if any(each.is_relative_to(folder) and test.is_relative_to(each) for each in beside):
        return True
    near, modules = {test}, set[Path]()
    gone = frozenset(file for file in files if file.suffix == ".py" and not file.is_file())
    for _ in range(WITHIN):
        near = {imported for file in near for imported in imports(file, gone)} - modules
        modules |= near
    data = {modules_folder(ROOT / path) for path in changed if not path.endswith(".py") and path.startswith(PRODUCT)}
    return any(name_of(module) in changed or module.parent in data for module in modules)


def modules_folder(data: Path) -> Path:
    """The folder of a data file, or the next above it, that holds modules."""
    return next(folder for folder in data.parents if folder == ROOT or any(folder.glob("*.py")))


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@cache
def imports(file: Path, gone: frozenset[Path] = frozenset()) -> frozenset[Path]:
    """Files of the project that a file imports, within functions, too; `gone` ones included."""
    found = set[str]()
    for node in ast.walk(ast.parse(file.read_text() if file.suffix == ".py" and file.is_file() else "")):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    files = (module_file(Path(*name.split(".")), file.parent, gone) for name in found)
    return frozenset(each for each in files if each is not None and each != file)


@cache
def module_file(name: Path, beside: Path, gone: frozenset[Path]) -> Path | None:
    """File of a module of the project, or of a helper that stands beside a test or above it; None for others."""
    above = [folder for folder in (beside, *beside.parents) if any(map(folder.is_relative_to, TESTS))]
    for folder in (ROOT, *((ROOT / package).parent for package in PLUGINS), *above):
        for file in (folder / name.with_suffix(".py"), folder / name / "__init__.py"):
            if file.is_file() or file in gone:
                return file
    return None
