"""Durations as people write them."""

from __future__ import annotations

import re

import pytest

from skills.durations import DURATION_PATTERN, seconds_in


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90", 90.0),
        ("0.5", 0.5),
        ("-5", -5.0),
        ("90 s", 90.0),
        ("2 min", 120.0),
        ("5 minutes", 300.0),
        ("30m", 1800.0),
        ("1 h 30 min", 5400.0),
        ("1h30m", 5400.0),
        ("1 hour and 30 minutes", 5400.0),
        ("1 hour, 5 seconds", 3605.0),
        ("1.5 h", 5400.0),
        ("250 ms", 0.25),
        ("2 days", 172800.0),
        ("PT5M", 300.0),
        ("PT1H30M", 5400.0),
        ("P1DT12H", 129600.0),
        ("pt0.5s", 0.5),
    ],
)
def test_a_duration_is_read(text: str, seconds: float) -> None:
    assert seconds_in(text) == pytest.approx(seconds)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "soon",
        "5 parsecs",
        "5 min 3 min",
        "1 h 5",
        "0,5",
        "1:30",
        "010",
        "P",
        "PT",
        "five minutes",
        "- 5 s",
        "nan",
        "9" * 70,
    ],
)
def test_a_text_without_a_duration_gives_none(text: str) -> None:
    assert seconds_in(text) is None


@pytest.mark.parametrize("text", ["2 min", "1 h 30 min", "90 s", "PT5M", "1 hour and 30 minutes"])
def test_an_editor_takes_the_usual_forms(text: str) -> None:
    assert re.search(DURATION_PATTERN, text)
