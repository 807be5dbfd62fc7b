"""The words of docstrings, code and docs: how a docstring begins, and metaphors that have a term of the field."""

import re
from pathlib import Path

import pytest

from tests.sources import PLUGINS, PRODUCT, ROOT, modules, read

PACKAGES = (*PRODUCT, *PLUGINS)
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


def begins_with_a_clause(line: str) -> bool:
    first, _, rest = line.partition(" ")
    return first in BEGINNINGS or f"{first} {rest.partition(' ')[0]}" in BEGINNINGS


@pytest.mark.parametrize("package", PACKAGES)
def test_public_docstrings_begin_with_a_verb_or_a_noun(package: str) -> None:
    lines = {f"{path} {name}": line for path, text in modules(package).items() for name, line in read(text).docstrings}
    assert 0 < len(modules(package)) <= len(lines)
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
    folders = ("tests", *(f"{Path(package).parent}/tests" for package in PLUGINS))
    sources = {path: text for path, text in modules(*folders).items() if "/test_" in path}
    assert len(sources) > 100
    assert {path: names for path, text in sources.items() if (names := found.findall(text))} == {}


@pytest.mark.parametrize("word", METAPHORS)
def test_no_metaphor_stands_for_a_term_of_the_field(word: str) -> None:
    pattern = re.compile(rf"\b(?:{word})\b", re.IGNORECASE)
    pages = {str(page): page.read_text() for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]}
    found = [path for path, text in {**modules(*PACKAGES), **pages}.items() if pattern.search(text)]
    assert found == [], f"say: {METAPHORS[word]}"
