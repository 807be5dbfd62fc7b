"""Counts of the structure, held to budgets, so that it does not grow again unseen: lines, modules, single importers.

A change that needs more than a budget takes as much out elsewhere in the same room, or says in its commit why not.
A room that has shrunk gets a smaller budget.
"""

import ast
from collections import Counter, defaultdict
from collections.abc import Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PRODUCT = ("executive", "skills", "plant")
LINES = {
    "executive/words": 3285,
    "executive/language": 8254,
    "executive/speech": 1582,
    "executive/mission": 1646,
    "executive/tree": 8439,
    "executive/run": 3218,
    "executive/record": 1412,
    "executive/store": 1666,
    "executive/conversation": 595,
    "executive/view": 1594,
    "executive/testing": 849,
    "executive/app": 8332,
    "executive/cli": 4997,
    "skills": 30315,
    "plant": 22156,
}
MODULES, ONE_IMPORTER, SAME_NAME = 517, 95, 14
"""All modules; those that one other imports; file names that stand more than once."""
LONGEST_FUNCTION, LONGEST_MODULE = 60, 450
"""Lines."""


def modules() -> Mapping[str, Path]:
    """The product's modules by dotted name."""
    paths = [path for package in PRODUCT for path in sorted((ROOT / package).rglob("*.py"))]
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


def importers(named: Mapping[str, Path]) -> Mapping[str, set[str]]:
    """Which modules import each module, imports within functions and for types included."""
    found: dict[str, set[str]] = defaultdict(set)
    for importer, path in named.items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                wanted = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                wanted = [
                    name if (name := f"{node.module}.{alias.name}") in named else node.module or ""
                    for alias in node.names
                ]
            else:
                continue
            for name in wanted:
                if name in named and name != importer:
                    found[name].add(importer)
    return found


@pytest.mark.parametrize("room", LINES)
def test_a_room_keeps_to_its_budget_of_lines(room: str) -> None:
    lines = sum(len(path.read_text().splitlines()) for path in (ROOT / room).rglob("*.py"))
    assert 0 < lines <= LINES[room]


def test_every_module_stands_in_a_room_with_a_budget() -> None:
    roots = {ROOT / "executive" / "__init__.py"}
    outside = [path for path in modules().values() if not any(path.is_relative_to(ROOT / room) for room in LINES)]
    assert set(outside) == roots


def test_the_number_of_modules_keeps_to_its_budget() -> None:
    assert 0 < len(modules()) <= MODULES


def test_few_modules_have_one_importer() -> None:
    named = modules()
    by = importers(named)
    alone = [name for name, path in named.items() if path.name != "__init__.py" and len(by[name]) == 1]
    assert 0 < len(alone) <= ONE_IMPORTER


def test_few_file_names_stand_more_than_once() -> None:
    names = Counter(path.name for path in modules().values() if path.name != "__init__.py")
    twice = [name for name, count in names.items() if count > 1]
    assert 0 < len(twice) <= SAME_NAME


def test_no_module_is_too_long() -> None:
    lines = {name: len(path.read_text().splitlines()) for name, path in modules().items()}
    assert {name: count for name, count in lines.items() if count > LONGEST_MODULE} == {}


def test_no_function_is_too_long() -> None:
    functions = {
        f"{name}.{node.name}": (node.end_lineno or node.lineno) - node.lineno + 1
        for name, path in modules().items()
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef)
    }
    assert len(functions) > 1000
    assert {name: count for name, count in functions.items() if count > LONGEST_FUNCTION} == {}
