import pytest

from executive.language.amounts import parse_seconds, parse_share, parse_time, parse_times
from tests.tables import table


@pytest.mark.parametrize(*table(__file__, "times_of_day"))
def test_a_time_of_day(text, clock, taken):
    time = parse_time(text)
    assert time and (time.text, time.taken) == (clock, taken)


@pytest.mark.parametrize("text", ["25:00", "half past", "half to three", "the cows", "14 pm", "", "twelve thirteen"])
def test_other_texts_are_no_time_of_day(text):
    assert parse_time(text) is None


@pytest.mark.parametrize(*table(__file__, "amounts"))
def test_an_amount(text, parse, amount):
    assert {"seconds": parse_seconds, "times": parse_times, "share": parse_share}[parse](text) == amount
