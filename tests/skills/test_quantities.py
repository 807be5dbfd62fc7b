"""Quantities: ranges of numbers in files and options, their messages, and durations as people write them."""

import re

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from skills import quantities
from skills.inputs.schema import first_error
from skills.quantities import (
    DURATION_PATTERN,
    Count,
    Delay,
    Duration,
    Number,
    QuantityError,
    Share,
    clock_text,
    number_in,
    number_of,
    seconds_in,
)
from tests.tables import table


@pytest.mark.parametrize(
    ("value", "hint", "number"),
    [(0.2, Share, 0.2), (1, Share, 1.0), (3, Count, 3), ("2 min", Duration, 120.0), (1e300, Number, 1e300)],
)
def test_a_number_in_its_range_is_taken(value, hint, number):
    assert number_of(value, hint) == number


HUGE = [pytest.param(10**5000, hint, "a smaller number", "too large to show", id=hint) for hint in ("Number", "Share")]


@pytest.mark.parametrize(*table(__file__, "wrong_values", *HUGE))
def test_a_wrong_value_is_refused_with_the_range_and_the_likely_mistake(value, hint, what, mistake):
    with pytest.raises(QuantityError) as error:
        number_of(value, getattr(quantities, hint))
    assert what in error.value.what
    assert mistake in error.value.hint


@pytest.mark.parametrize(("word", "hint", "number"), [("0.2", Share, 0.2), ("12", Count, 12), ("2h", Delay, 7200.0)])
def test_a_word_of_the_command_line_gives_a_number(word, hint, number):
    assert number_in(word, hint) == number


@pytest.mark.parametrize(
    ("word", "says"),
    [("9" * 5000, "5000 digits"), ("nan", "finite"), ("-inf", "finite"), ("010", "write 10"), ("1e3", "write 1000")],
    ids=lambda value: value[:10],
)
def test_a_word_that_gives_no_number_is_refused(word, says):
    with pytest.raises(QuantityError, match=says):
        number_in(word, Count)


@pytest.mark.parametrize(("text", "clock"), [("08:30", "08:30"), ("7:05", "07:05"), (" 23:59 ", "23:59")])
def test_a_time_of_day_is_read(text, clock):
    assert clock_text(text) == clock


@pytest.mark.parametrize(*table(__file__, "wrong_times"))
def test_a_wrong_time_of_day_is_refused_with_the_range(value, says):
    with pytest.raises(QuantityError, match=says):
        clock_text(value)


class Limits(BaseModel):
    """Numbers of a file."""

    charge: Share
    limit: Duration | None = None


def test_a_model_checks_its_quantities_and_takes_durations_with_units():
    assert Limits.model_validate({"charge": 1, "limit": "PT5M"}) == Limits(charge=1.0, limit=300.0)
    with pytest.raises(ValidationError) as error:
        Limits.model_validate({"charge": 20})
    first = (("charge",), "should be from 0 to 1", "it reads 20 now; write 0.2 for 20 %")
    assert first_error(error.value.errors()) == first


def test_the_json_schema_of_a_quantity_has_its_range_and_the_form_of_a_duration():
    assert TypeAdapter(Share).json_schema() == {"type": "number", "minimum": 0.0, "maximum": 1.0}
    kinds = [option["type"] for option in TypeAdapter(Duration).json_schema()["anyOf"]]
    assert kinds == ["number", "string"]


@pytest.mark.parametrize(*table(__file__, "durations"))
def test_a_duration_is_read(text, seconds):
    assert seconds_in(text) == pytest.approx(seconds)


@pytest.mark.parametrize(*table(__file__, "no_durations"))
def test_a_text_without_a_duration_gives_none(text):
    assert seconds_in(text) is None


@pytest.mark.parametrize("text", ["2 min", "1 h 30 min", "90 s", "PT5M", "1 hour and 30 minutes"])
def test_an_editor_takes_the_usual_forms(text):
    assert re.search(DURATION_PATTERN, text)
