"""Regular expressions in the tables: what stands around them is said beside them."""

import re
from pathlib import Path

import pytest

import executive.language
from executive.language.lexicon import expression

TABLES = [Path(executive.language.__file__).with_name("tables") / f"{name}.yaml" for name in ("rephrasing", "repairs")]
LONGEST_LINE = 120


@pytest.mark.parametrize("table", TABLES, ids=lambda path: path.stem)
def test_no_expression_of_a_table_looks_around_or_is_long(table):
    lines = table.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if re.search(r"\(\?<?[=!]", line)] == []
    assert [line for line in lines if len(line) > LONGEST_LINE] == []


@pytest.mark.parametrize(
    ("entry", "text", "found"),
    [
        ("a+", "baa", "aa"),
        (["a", "b?"], "ab", "ab"),
        ({"say": "a", "behind": "b"}, "aab", "a"),
        ({"say": "a.", "not_behind": "b"}, "axbay", "ay"),
        ({"not_before": ["x", "y"], "say": "a."}, "xayaza1", "a1"),
        ({"before": "x", "say": "a."}, "yaxa1", "a1"),
        ({"not": "ab", "say": "a."}, "abac", "ac"),
        ({"say": ["a", "."], "behind": ["c", "d"]}, "abcacd", None),
    ],
)
def test_an_expression_says_what_stands_around_it(entry, text, found):
    match = re.search(expression(entry), text)
    assert (None if match is None else match[0]) == found
