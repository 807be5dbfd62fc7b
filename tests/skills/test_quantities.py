"""Tests of quantities: ranges of numbers in files and options, and their messages."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from skills.files.schema import first_error
from skills.quantities import (
    Angle,
    Coordinate,
    Count,
    Delay,
    Duration,
    Length,
    Mass,
    Number,
    QuantityError,
    Share,
    Speed,
    clock_text,
    number_in,
    number_of,
)


@pytest.mark.parametrize(
    ("value", "hint", "number"),
    [(0.2, Share, 0.2), (1, Share, 1.0), (3, Count, 3), ("2 min", Duration, 120.0), (1e300, Number, 1e300)],
)
def test_a_number_in_its_range_is_taken(value: Any, hint: Any, number: float) -> None:
    assert number_of(value, hint) == number


@pytest.mark.parametrize(
    ("value", "hint", "what", "mistake"),
    [
        (20, Share, "should be from 0 to 1", "write 0.2 for 20 %"),
        (90, Angle, "should be from -6.283 to 6.283 rad", "write 1.57 for 90 degrees"),
        (-180.0, Angle, "should be from -6.283 to 6.283 rad", "write -3.14 for -180 degrees"),
        (300, Length, "above 0 and at most 100 m", "write 0.3 for 300 mm or 3 for 300 cm"),
        (300, Mass, "above 0 and at most 100 kg", "write 0.3 for 300 g"),
        (5, Speed, "above 0 and at most 3 m/s", "write 1.39 for 5 km/h"),
        (500_000, Coordinate, "from -10000 to 10000 m", "subtract the same from all places"),
        (-5, Delay, "from 0 to 86400 s", "it reads -5 now"),
        (0, Count, "from 1 to 100000", "it reads 0 now"),
        (2.0, Count, "a whole number", "write 2"),
        (2.5, Count, "a whole number", "it reads 2.5 now"),
        (True, Count, "a whole number", "it reads true now"),
        (None, Share, "a number", "it reads nothing now"),
        ([1], Share, "a number", "it reads a list now"),
        (float("inf"), Number, "a finite number", "it reads .inf now"),
        pytest.param(10**5000, Number, "a smaller number", "too large to show", id="huge"),
        pytest.param(10**5000, Share, "a smaller number", "too large to show", id="huge share"),
        ("0,3", Share, "a number", "write 0.3, with a point"),
        ("010", Count, "a whole number", "write 10, without the zero"),
        ("three", Count, "a whole number", "write 3"),
        ("20 %", Share, "a number", "write 0.2 for 20 %"),
        ("90 deg", Angle, "a number", "write 1.57 for 90 deg"),
        ("30 cm", Length, "a number", "write 0.3 for 30 cm"),
        ("0.5", Share, "a number", "write 0.5, without quotes"),
        ("1:30", Duration, "a number, seconds, or as in", "could be hours or minutes"),
        ("soon", Duration, "a number, seconds, or as in", "it reads 'soon' now"),
    ],
)
def test_a_wrong_value_is_refused_with_the_range_and_the_likely_mistake(
    value: Any, hint: Any, what: str, mistake: str
) -> None:
    with pytest.raises(QuantityError) as error:
        number_of(value, hint)
    assert what in error.value.what
    assert mistake in error.value.hint


@pytest.mark.parametrize(
    ("word", "hint", "number"),
    [("0.2", Share, 0.2), ("12", Count, 12), ("2h", Delay, 7200.0)],
)
def test_a_word_of_the_command_line_gives_a_number(word: str, hint: Any, number: float) -> None:
    assert number_in(word, hint) == number


@pytest.mark.parametrize(
    ("word", "says"),
    [("9" * 5000, "5000 digits"), ("nan", "finite"), ("-inf", "finite"), ("010", "write 10"), ("1e3", "write 1000")],
    ids=lambda value: value[:10],
)
def test_a_word_that_gives_no_number_is_refused(word: str, says: str) -> None:
    with pytest.raises(QuantityError, match=says):
        number_in(word, Count)


@pytest.mark.parametrize(("text", "clock"), [("08:30", "08:30"), ("7:05", "07:05"), (" 23:59 ", "23:59")])
def test_a_time_of_day_is_read(text: str, clock: str) -> None:
    assert clock_text(text) == clock


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("24:00", "write '00:00' for midnight"),
        (7, "write '07:00'"),
        ("12:60", "from 00:00 to 23:59"),
        ("noon", "as in"),
    ],
)
def test_a_wrong_time_of_day_is_refused_with_the_range(value: Any, says: str) -> None:
    with pytest.raises(QuantityError, match=says):
        clock_text(value)


class Limits(BaseModel):
    """Numbers of a file."""

    charge: Share
    limit: Duration | None = None


def test_a_model_checks_its_quantities_and_takes_durations_with_units() -> None:
    assert Limits.model_validate({"charge": 1, "limit": "PT5M"}) == Limits(charge=1.0, limit=300.0)
    with pytest.raises(ValidationError) as error:
        Limits.model_validate({"charge": 20})
    assert first_error(error.value.errors()) == (
        ("charge",),
        "should be from 0 to 1",
        "it reads 20 now; write 0.2 for 20 %",
    )


def test_the_json_schema_of_a_quantity_has_its_range_and_the_form_of_a_duration() -> None:
    schema = TypeAdapter(Share).json_schema()
    assert schema == {"type": "number", "minimum": 0.0, "maximum": 1.0}
    kinds = [option["type"] for option in TypeAdapter(Duration).json_schema()["anyOf"]]
    assert kinds == ["number", "string"]
