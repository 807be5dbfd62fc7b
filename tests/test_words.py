"""The words of docstrings, code and docs: how a docstring begins, and metaphors that have a term of the field."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("executive", "skills", "plant", "training/errand_train")
BEGINNINGS = frozenset(
    {*("What", "How", "Where", "Who", "Why", "Which", "Whether", "When", "That", "Those", "From", "As"), "One that"}
)
"""Clauses: a docstring begins with a verb in the third person, or with a noun of the field."""
METAPHORS = {
    r"anew": "again",
    r"whoever|who of them": "the robot that, the person who",
    r"seen[ _]layer": "obstacle layer",
    r"happenings?": "events",
    r"deeds?": "action",
    r"sightings?": "detection in 3D",
    r"rivals?": "competing hypotheses",
    r"held clear": "clearance",
}


def first_lines(package: str) -> Iterator[tuple[str, str]]:
    """Each public module, class and function of a package with its docstring's first line."""
    for path in sorted((ROOT / package).rglob("*.py")):
        module = ast.parse(path.read_text())
        for node in [module, *public_parts(module)]:
            if text := ast.get_docstring(node):
                name = getattr(node, "name", "")
                yield f"{path.relative_to(ROOT)} {name}".strip(), text.partition("\n")[0]


def public_parts(node: ast.AST) -> Iterator[ast.ClassDef | ast.FunctionDef]:
    """Public classes and functions, and the public methods of these classes."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.ClassDef | ast.FunctionDef) and not part.name.startswith("_"):
            yield part
            if isinstance(part, ast.ClassDef):
                yield from public_parts(part)


def begins_with_a_clause(line: str) -> bool:
    first, _, rest = line.partition(" ")
    return first in BEGINNINGS or f"{first} {rest.partition(' ')[0]}" in BEGINNINGS


@pytest.mark.parametrize("package", PACKAGES)
def test_public_docstrings_begin_with_a_verb_or_a_noun(package: str) -> None:
    lines = dict(first_lines(package))
    assert len(lines) > 100
    assert {name: line for name, line in lines.items() if begins_with_a_clause(line)} == {}


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("What is asked for.", True),
        ("One that waits.", True),
        ("One line of a log.", False),
        ("Returns what a sensor measured.", False),
        ("Asks for a robot's position.", False),
    ],
)
def test_the_check_finds_clauses(line: str, expected: bool) -> None:
    assert begins_with_a_clause(line) is expected


def test_names_of_tests_begin_with_what_acts() -> None:
    found = re.compile(r"def (test_(?:what|where|who|whoever|why|how|which)_\w*)")
    sources = [path.read_text() for path in (ROOT / "tests").rglob("test_*.py")]
    assert len(sources) > 100
    assert [name for source in sources for name in found.findall(source)] == []


@pytest.mark.parametrize("word", METAPHORS)
def test_no_metaphor_stands_for_a_term_of_the_field(word: str) -> None:
    pattern = re.compile(rf"\b(?:{word})\b", re.IGNORECASE)
    sources = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    found = [str(path.relative_to(ROOT)) for path in [*sources, *pages] if pattern.search(path.read_text())]
    assert found == [], f"say: {METAPHORS[word]}"
