"""Values and types against type hints."""

from typing import Any

import pytest

from executive.tree.types import assignable, conforms, describe_type
from skills.quantities import Count, Speed


@pytest.mark.parametrize(
    ("value", "hint", "expected"),
    [
        (1, float, True),
        (True, float, False),
        ("x", float, False),
        ((), tuple[str, ...], True),
        (("a", 1), tuple[str, ...], False),
        ((1, "a"), tuple[int, str], True),
        ((1,), tuple[int, str], False),
        (["a"], tuple[str, ...], False),
        (None, str | None, True),
        (3, str | None, False),
        (object(), Any, True),
        (3.0, Speed, True),
        (3.1, Speed, False),
        ((1.0, 0.0), tuple[Speed, ...], False),
    ],
)
def test_conforms(value, hint, expected):
    assert conforms(value, hint) is expected


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [(int, float, True), (float, int, False), (float, Speed, True), (bool, int, True), (str, str | None, True),
     (int, Any, True), (tuple[str, ...], tuple[str, ...], True), (tuple[str, ...], tuple[int, ...], False)],
)  # fmt: skip
def test_assignable(source, target, expected):
    assert assignable(source, target) is expected


def test_types_are_described_as_users_read_them():
    assert [describe_type(hint) for hint in (float, tuple[str, ...], tuple[Speed, Count] | None)] == [
        "number",
        "list of text",
        "[number above 0 and at most 3 m/s, whole number from 1 to 100000] or nothing",
    ]
