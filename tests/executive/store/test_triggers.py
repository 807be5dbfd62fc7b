"""Triggers: what their texts mean, when they are due, and what the days do on which clocks are set."""

import time as system_time
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.store.triggers import (
    Day,
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
from skills.files.errors import InputError

BERLIN = ZoneInfo("Europe/Berlin")
ANCHOR = datetime(2026, 1, 1, tzinfo=UTC)

schedules = st.builds(
    Schedule,
    st.sets(st.sampled_from(Day), min_size=1).map(lambda days: tuple(sorted(days, key=lambda day: day.value))),
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


@pytest.mark.parametrize(
    ("said", "canonical"),
    [
        ("every weekday at 9:00", "every weekday 09:00"),
        ("Every Day 14:30", "every day 14:30"),
        ("every fri, mon and wednesdays 08:15 and 07:00", "every monday, wednesday and friday 07:00 and 08:15"),
        ("every saturday and sunday 10:00", "every weekend 10:00"),
        ("every weekend and weekday 10:00", "every day 10:00"),
        ("2026-12-01T09:00", "2026-12-01 09:00"),
    ],
)
def test_times_may_be_written_in_several_forms(said, canonical):
    assert str(schedule_of(said)) == canonical


@pytest.mark.parametrize(
    ("said", "canonical"),
    [
        ("30m", "every 30m"),
        ("2 hours", "every 2h"),
        ("90 s", "every 90s"),
        ("120 sec", "every 2m"),
        ("1 day", "every 1d"),
    ],
)
def test_periods_may_be_written_in_several_forms(said, canonical):
    assert str(Every.from_text(said)) == canonical


@pytest.mark.parametrize("said", ["battery full", "Battery 95 %", "battery 95%"])
def test_a_full_battery_is_one_of_95_percent(said):
    assert event_of(said) == OnBatteryFull(0.95)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("every wekday 09:00", "'wekday' is no day; did you mean 'weekday'"),
        ("every day", "says no times; write 'every weekday 09:00'"),
        ("every 09:00", "says no times"),
        ("every day and 09:00 monday", "'monday' in .* is no time of day"),
        ("every day 24:00", "no time of day; write it from 00:00 to 23:59"),
        ("every day 9", "no time of day"),
        ("tomorrow 09:00", "says no times"),
        ("2026-02-30 09:00", "there is no such day"),
        ("2026-12-01", "says no times"),
        ("", "says no times"),
    ],
)
def test_other_times_are_refused_with_a_hint(said, words):
    with pytest.raises(InputError, match=words):
        schedule_of(said)


@pytest.mark.parametrize(
    ("said", "written"), [("30", "every 30s"), ("1.5h", "every 90m"), ("1 h 30 min", "every 90m"), ("PT5M", "every 5m")]
)
def test_a_period_takes_every_form_of_a_duration(said, written):
    assert str(Every.from_text(said)) == written
    assert str(trigger_of(f"every {said}")) == written


@pytest.mark.parametrize("said", ["0m", "m", "-5m", "0.5s", "400d", "9999999999s", "30 mm", "5 daysx"])
def test_other_periods_are_refused_with_a_hint(said):
    with pytest.raises(InputError, match="is no period; give whole seconds"):
        Every.from_text(said)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("batery full", "did you mean 'battery'"),
        ("battery 0%", "above 0 % and at most 100 %"),
        ("battery 101%", "above 0 % and at most 100 %"),
        ("battery", "write 'battery full'"),
        ("call two words", "one name of letters"),
        ("call ../x", "one name of letters"),
        ("topic door", "write 'topic KIND:TOPIC'"),
        ("topic mqtt:a\x1bb", "write 'topic KIND:TOPIC'"),
        ("noon", "write 'battery full', 'battery 80%', 'call NAME' or"),
    ],
)
def test_other_events_are_refused_with_a_hint(said, words):
    with pytest.raises(InputError, match=words):
        event_of(said)


@pytest.mark.parametrize(
    ("text", "moment", "expected"),
    [
        ("every weekday 09:00", "2026-11-24 08:59", "Tue 2026-11-24 09:00"),
        ("every weekday 09:00", "2026-11-24 09:00", "Wed 2026-11-25 09:00"),
        ("every weekday 09:00", "2026-11-27 12:00", "Mon 2026-11-30 09:00"),
        ("every tuesday 09:00", "2026-11-24 09:00", "Tue 2026-12-01 09:00"),
        ("every monday and friday 08:15 and 17:00", "2026-11-27 08:15", "Fri 2026-11-27 17:00"),
        ("2026-12-01 09:00", "2026-11-24 09:00", "Tue 2026-12-01 09:00"),
        ("2026-12-01 09:00", "2026-12-01 09:00", None),
    ],
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
