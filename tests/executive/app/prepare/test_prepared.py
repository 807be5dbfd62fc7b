"""The time limit of a prepared run."""

import pytest

from executive.app.prepare.from_request import prepare
from executive.mission.request import TIME_LIMIT_S, Request

# sentence, --time-limit (s) -> time limit (s) of a run that begins at 17:30
LIMITS = [
    ("go to the kitchen", None, TIME_LIMIT_S),
    ("wait for two minutes, then go to the kitchen", None, TIME_LIMIT_S + 120.0),
    ("wait until 18:00, then go to the kitchen", None, TIME_LIMIT_S + 1800.0),
    ("wait until 17:00, then go to the kitchen", None, TIME_LIMIT_S),  # passed
    ("patrol the flat every ten minutes until 18:00", None, TIME_LIMIT_S + 1800.0),
    ("patrol the flat every ten minutes", None, TIME_LIMIT_S),  # for ever
    ("go to the kitchen every half hour three times", None, TIME_LIMIT_S + 3600.0),
    ("patrol the flat every ten minutes until 18:00", 60.0, 60.0),
]


@pytest.mark.parametrize(("sentence", "given_s", "limit_s"), LIMITS)
def test_the_default_time_limit_grows_by_the_waits_of_a_mission(sentence, given_s, limit_s):
    assert prepare(Request(sentence, time_of_day="17:30", time_limit_s=given_s)).time_limit_s == limit_s
