"""Counts of the structure, held to budgets, so that it does not grow again unseen: code, modules, single importers.

A line of code holds a token: blank lines, comments and docstrings are free. A room's budget is its base and the lines
that issues have granted it, so that a change without a grant takes as much out elsewhere in the same room. A room that
has shrunk gets a smaller base.
"""

from collections import Counter

import pytest

from tests.sources import PRODUCT, code_lines, dotted, import_graph, modules, read

BASE = {
    "executive/words": 2585,
    "executive/language": 5961,
    "executive/speech": 1076,
    "executive/mission": 1273,
    "executive/tree": 6034,
    "executive/run": 2290,
    "executive/record": 774,
    "executive/store": 1072,
    "executive/conversation": 441,
    "executive/view": 1362,
    "executive/testing": 617,
    "executive/app": 5890,
    "executive/cli": 2908,
    "skills": 19686,
    "plant": 8108,
}
"""Lines of code of each room on 2026-11-30, before issue 85."""
GRANTS = (
    (85, "skills", 440),
    (85, "executive/tree", 27),
    (85, "executive/app", 43),
    (85, "plant", 26),
    (85, "executive/cli", 1),
)
"""Issue, room, and the lines that the issue has added to the room."""
GRANTED = {85: 700}
"""Lines that an issue grants to all rooms together."""
MODULES, ONE_IMPORTER, SAME_NAME = 430, 61, 7
"""All modules; those that one other imports; file names that stand more than once. Three modules more by 85."""
LONGEST_FUNCTION, LONGEST_MODULE = 60, 450
"""Lines."""


SOURCES = {dotted(path): text for path, text in modules(*PRODUCT).items()}
FILES = [path for path in modules(*PRODUCT) if not path.endswith("/__init__.py")]


def code_of(room: str) -> int:
    return sum(map(code_lines, modules(room).values()))


@pytest.mark.parametrize("room", BASE)
def test_a_room_keeps_to_its_budget_of_code(room: str) -> None:
    assert 0 < code_of(room) <= BASE[room] + sum(lines for _, name, lines in GRANTS if name == room)


def test_rooms_take_no_more_lines_than_an_issue_grants() -> None:
    taken = Counter[int]()
    for issue, _, lines in GRANTS:
        taken[issue] += lines
    assert {issue: lines for issue, lines in taken.items() if lines > GRANTED[issue]} == {}


# a docstring, a blank line and a comment; a statement of two lines; a text of two lines
def test_code_is_counted_without_docstrings_blanks_and_comments() -> None:
    assert code_lines('"""A.\n\nB."""\n\nx = (1,\n     2)  # three\n# four\ny = """a\nb"""\n') == 4


def test_every_module_stands_in_a_room_with_a_budget() -> None:
    rooms = tuple(f"{room}/" for room in BASE)
    assert [path for path in modules(*PRODUCT) if not path.startswith(rooms)] == ["executive/__init__.py"]


def test_the_number_of_modules_keeps_to_its_budget() -> None:
    assert 0 < len(SOURCES) <= MODULES


def test_few_modules_have_one_importer() -> None:
    importers = Counter(name for names in import_graph(*PRODUCT).values() for name in names)
    assert 0 < sum(importers[dotted(path)] == 1 for path in FILES) <= ONE_IMPORTER


def test_few_file_names_stand_more_than_once() -> None:
    names = Counter(path.rpartition("/")[2] for path in FILES)
    assert 0 < sum(count > 1 for count in names.values()) <= SAME_NAME


def test_no_module_is_too_long() -> None:
    lines = {name: len(text.splitlines()) for name, text in SOURCES.items()}
    assert {name: count for name, count in lines.items() if count > LONGEST_MODULE} == {}


def test_no_function_is_too_long() -> None:
    functions = [
        (f"{name}.{function}", lines) for name, text in SOURCES.items() for function, lines in read(text).functions
    ]
    assert len(functions) > 1000
    assert [each for each in functions if each[1] > LONGEST_FUNCTION] == []
