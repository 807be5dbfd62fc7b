"""Triggers: what their texts mean, when they are due, and what the days do on which clocks are set."""

import re
import time as system_time
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.store.triggers import (
    Every,
    OnBatteryFull,
    OnCall,
    Once,
    OnTopic,
    Schedule,
    event_of,
    schedule_of,
    trigger_of,
)
from skills.inputs.errors import InputError
from tests.tables import yaml_beside

TEXTS = yaml_beside(__file__, "triggers.yaml")

BERLIN = ZoneInfo("Europe/Berlin")
ANCHOR = datetime(2026, 1, 1, tzinfo=UTC)

schedules = st.builds(
    Schedule,
    st.sets(st.integers(0, 6), min_size=1).map(lambda days: tuple(sorted(days))),
    st.sets(st.times().map(lambda at: at.replace(second=0, microsecond=0)), min_size=1).map(lambda at: (*sorted(at),)),
)
others = st.one_of(
    st.datetimes(datetime(2000, 1, 1), datetime(2999, 12, 31)).map(
        lambda at: Once(at.date(), at.time().replace(second=0, microsecond=0))
    ),
    st.integers(1, 366 * 86400).map(lambda seconds: Every(timedelta(seconds=seconds))),
    st.integers(1, 1000).map(lambda thousandths: OnBatteryFull(thousandths / 1000)),
    st.from_regex(r"[A-Za-z0-9_-]{1,64}", fullmatch=True).map(OnCall),
    st.builds(
        OnTopic, st.from_regex(r"[a-z0-9_-]{1,8}", fullmatch=True), st.sampled_from(("a", "home/+/door #1", "ü"))
    ),
)


def berlin(text):
    return datetime.fromisoformat(text).replace(tzinfo=BERLIN)


def due(text, moment, zone=BERLIN):
    """When a trigger is due next after a local moment, as local wall time."""
    at = trigger_of(text).after(moment, ANCHOR, zone)
    return None if at is None else f"{at.astimezone(zone):%a %Y-%m-%d %H:%M}"


@given(st.one_of(schedules, others))
def test_a_trigger_is_its_text(trigger):
    assert trigger_of(str(trigger)) == trigger


@pytest.mark.parametrize(("said", "canonical"), TEXTS["times"].items())
def test_times_may_be_written_in_several_forms(said, canonical):
    assert str(schedule_of(said)) == canonical


@pytest.mark.parametrize(("said", "canonical"), TEXTS["periods"].items())
def test_periods_may_be_written_in_several_forms(said, canonical):
    assert str(Every.from_text(said)) == str(trigger_of(f"every {said}")) == canonical


READERS = {"event": event_of, "period": Every.from_text, "time": schedule_of}
REFUSED = yaml_beside(__file__, "refused_triggers.yaml")


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case["input"])
def test_other_texts_are_refused_with_a_hint(case):
    with pytest.raises(InputError, match=re.escape(case["message"])):
        READERS[case["kind"]](case["input"])


@pytest.mark.parametrize("said", ["battery full", "Battery 95 %", "battery 95%"])
def test_a_full_battery_is_one_of_95_percent(said):
    assert event_of(said) == OnBatteryFull(0.95)


@pytest.mark.parametrize(
    ("text", "moment", "expected"),
    TEXTS["due"],
)
def test_the_next_occurrence_is_later_than_now(text, moment, expected):
    assert due(text, berlin(moment)) == expected


@given(schedules, st.datetimes(datetime(2020, 1, 1), datetime(2030, 1, 1), timezones=st.just(UTC)))
def test_nothing_is_due_between_the_last_occurrence_and_the_next(schedule, now):
    last, following = (find(now, ANCHOR, BERLIN) for find in (schedule.latest, schedule.after))
    assert last <= now < following
    assert schedule.after(last, ANCHOR, BERLIN) == following
    assert schedule.latest(following, ANCHOR, BERLIN) == following


def test_a_time_that_clocks_skip_comes_as_long_after_midnight_as_on_other_days():
    """Clocks go from 02:00 to 03:00 on 2026-03-29."""
    assert due("every day 02:30", berlin("2026-03-28 12:00")) == "Sun 2026-03-29 03:30"
    assert due("every day 02:30", berlin("2026-03-29 03:30")) == "Mon 2026-03-30 02:30"
    assert due("every day 09:00", berlin("2026-03-28 12:00")) == "Sun 2026-03-29 09:00"


def test_a_time_that_clocks_show_twice_comes_once_the_first_time():
    """Clocks go from 03:00 back to 02:00 on 2026-10-25."""
    schedule = schedule_of("every day 02:30")
    first = schedule.after(berlin("2026-10-24 12:00"), ANCHOR, BERLIN)
    assert first == datetime(2026, 10, 25, 0, 30, tzinfo=UTC)
    assert schedule.after(first, ANCHOR, BERLIN) == datetime(2026, 10, 26, 1, 30, tzinfo=UTC)
    assert schedule.latest(datetime(2026, 10, 25, 1, 45, tzinfo=UTC), ANCHOR, BERLIN) == first


def test_a_period_counts_the_time_that_passes_also_when_clocks_are_set():
    every, anchor = Every.from_text("1d"), berlin("2026-03-28 12:00")
    assert every.after(anchor, anchor, BERLIN).astimezone(BERLIN) == berlin("2026-03-29 13:00")


def test_a_period_is_counted_from_its_anchor():
    every = Every.from_text("30m")
    assert every.latest(ANCHOR + timedelta(minutes=29), ANCHOR, None) is None
    assert every.latest(ANCHOR + timedelta(minutes=95), ANCHOR, None) == ANCHOR + timedelta(minutes=90)
    assert every.after(ANCHOR + timedelta(minutes=90), ANCHOR, None) == ANCHOR + timedelta(minutes=120)
    assert every.after(ANCHOR - timedelta(days=9), ANCHOR, None) == ANCHOR + timedelta(minutes=30)


def test_without_a_zone_times_are_those_of_the_system(monkeypatch):
    monkeypatch.setenv("TZ", "Europe/Berlin")
    system_time.tzset()
    try:
        for moment in ("2026-03-28 12:00", "2026-10-24 12:00", "2026-07-01 00:00"):
            for text in ("every day 02:30", "every day 09:00"):
                trigger = trigger_of(text)
                assert trigger.after(berlin(moment), ANCHOR, None) == trigger.after(berlin(moment), ANCHOR, BERLIN)
    finally:
        monkeypatch.undo()
        system_time.tzset()
