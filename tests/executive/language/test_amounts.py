import pytest

from executive.language.amounts import parse_seconds, parse_share, parse_time, parse_times


@pytest.mark.parametrize(
    ("text", "clock", "taken"),
    [
        ("half past two", "14:30", True),
        ("quarter to three", "14:45", True),
        ("ten past three", "15:10", True),
        ("14:30", "14:30", False),
        ("02:30", "02:30", False),
        ("two thirty", "14:30", True),
        ("eight o'clock", "08:00", True),
        ("8 pm", "20:00", False),
        ("nine in the morning", "09:00", False),
        ("eleven at night", "23:00", False),
        ("noon", "12:00", False),
        ("midnight", "00:00", False),
    ],
)
def test_a_time_of_day(text, clock, taken):
    time = parse_time(text)
    assert (time.text, time.taken) == (clock, taken)


@pytest.mark.parametrize("text", ["25:00", "half past", "half to three", "the cows", "14 pm", "", "twelve thirteen"])
def test_other_texts_are_no_time_of_day(text):
    assert parse_time(text) is None


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("ten minutes", 600),
        ("half an hour", 1800),
        ("hour", 3600),
        ("a quarter of an hour", 900),
        ("an hour and a half", 5400),
        ("two and a half hours", 9000),
        ("45 seconds", 45),
        ("zero minutes", None),
        ("a while", None),
    ],
)
def test_a_span(text, seconds):
    assert parse_seconds(text) == seconds


@pytest.mark.parametrize(("text", "times"), [("twice", 2), ("three times", 3), ("0 times", None), ("900 times", None)])
def test_number_of_times(text, times):
    assert parse_times(text) == times


@pytest.mark.parametrize(
    ("text", "share"), [("thirty percent", 0.3), ("5 percent", 0.05), ("half", 0.5), ("150 percent", None)]
)
def test_a_share(text, share):
    assert parse_share(text) == share
