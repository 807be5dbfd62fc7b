"""Standing missions: what fires, what is missed, and that nothing is lost or comes twice."""

import sqlite3
from datetime import UTC, datetime, timedelta

import pytest

from executive.mission.request import Request
from executive.run.visitor import TickNote
from executive.store import standing_missions as standing_module
from executive.store.missions import MissionState, MissionStore
from executive.store.standing_missions import MOST_WAITING, StandingMissions, TooManyError
from executive.store.triggers import Missed, trigger_of
from skills.files.errors import InputError

REQUEST = Request("go to the kitchen", seed=3, name="go kitchen", world_name="flat", robot="Alice", commands=("Take",))
START = datetime(2026, 11, 24, 8, 0, tzinfo=UTC)  # a Tuesday


class Clock:
    """The wall's clock, set by hand."""

    def __init__(self):
        self.now = START

    def __call__(self):
        return self.now

    def pass_by(self, **time):
        self.now += timedelta(**time)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "missions.sqlite"


@pytest.fixture
def store(path, clock):
    with MissionStore(path, now=clock) as store:
        yield store


@pytest.fixture
def standing(store):
    return StandingMissions(store, zone=UTC)


@pytest.fixture
def add(standing):
    return lambda text, missed=Missed.SKIP: standing.add(REQUEST, trigger_of(text), missed)


@pytest.fixture
def fire(standing):
    """What fires in a server that serves, and waits, since some moments; at all times where none is given."""

    def fired(waiting_since=START, serving_since=START):
        return [
            each.why for each in standing.fire_due(waiting_since=waiting_since, serving_since=serving_since)
        ]  # fmt: skip

    return fired


def end_mission(store, *charges):
    """A mission that noted these charges has ended."""
    number = store.add(REQUEST, queued=True).id
    store.begin(number)
    journal = store.journal(number)
    for charge in charges:
        journal.note(TickNote(None, 1.0, (), {}, None, {}, charge))
    journal.note(TickNote(None, 2.0, (), {"alice/x": len(charges)}, None, {}))
    store.finish(number, MissionState.SUCCESS, "done")


def test_a_standing_mission_is_kept_and_never_run_itself(add, path, store):
    added = add("every weekday 09:00", Missed.ONCE)
    with MissionStore(path) as other:
        assert StandingMissions(other).missions() == (added,)
        assert [each.state for each in other.missions()] == [MissionState.STANDING]
        assert other.missions(MissionState.QUEUED) == ()


def test_a_trigger_queues_a_copy_that_names_its_standing_mission(add, clock, standing, store):
    number = add("every weekday 09:00").id
    clock.pass_by(hours=1, seconds=1)
    (fired,) = standing.fire_due(waiting_since=START, serving_since=START)
    assert (fired.state, fired.queued, fired.request) == (MissionState.QUEUED, True, REQUEST)
    assert (fired.standing, fired.why) == (number, "every weekday 09:00, due 2026-11-24 09:00")
    assert store.missions(MissionState.QUEUED) == (fired,)


def test_an_occurrence_fires_once(add, clock, fire):
    add("every weekday 09:00")
    assert fire() == []
    clock.pass_by(hours=1)
    assert len(fire()) == 1
    clock.pass_by(seconds=1)
    assert fire() == []
    clock.pass_by(days=1, seconds=-1)
    assert len(fire()) == 1


@pytest.mark.parametrize(("missed", "count"), [(Missed.SKIP, 0), (Missed.ONCE, 1)])
def test_missed_occurrences_are_skipped_or_made_up_for_once(add, clock, fire, missed, count):
    add("every 10m", missed)
    clock.pass_by(minutes=31)
    assert fire(waiting_since=clock.now) == ["every 10m, due 2026-11-24 08:30, missed"] * count
    assert fire(waiting_since=clock.now) == []
    clock.pass_by(minutes=9)
    assert fire(waiting_since=START + timedelta(minutes=31)) == ["every 10m, due 2026-11-24 08:40"]


def test_an_occurrence_noticed_late_is_missed(add, clock, fire):
    """The machine has slept, or its clock was set forward."""
    add("every day 09:00"), add("every day 09:01", Missed.ONCE)
    clock.pass_by(hours=3)
    assert fire() == ["every day 09:01, due 2026-11-24 09:01, missed"]


def test_a_clock_that_is_set_back_a_little_has_nothing_fire_twice(add, clock, fire):
    add("every day 09:00")
    clock.pass_by(hours=1, seconds=1)
    assert len(fire()) == 1
    clock.pass_by(seconds=-5)
    assert fire() == []
    clock.pass_by(seconds=10)
    assert fire() == []


def test_a_clock_that_is_set_back_far_does_not_silence_a_mission(add, clock, fire):
    clock.pass_by(days=1000)
    add("every day 09:00")
    clock.pass_by(days=-1000)
    assert fire() == []
    clock.pass_by(hours=1)
    assert len(fire()) == 1


def test_a_single_time_fires_once_and_is_over(add, clock, fire, standing):
    add("2026-11-25 09:00")
    assert standing.due_next() == datetime(2026, 11, 25, 9, tzinfo=UTC)
    clock.pass_by(days=1, hours=1)
    assert len(fire()) == 1
    assert (fire(), standing.due_next()) == ([], None)


def test_a_single_time_that_has_passed_is_refused(add, store):
    with pytest.raises(InputError, match="2026-11-24 07:59 has passed; give a time to come"):
        add("2026-11-24 07:59")
    assert store.missions() == ()


def test_the_next_occurrence_is_the_earliest_of_all(add, standing):
    assert standing.due_next() is None
    add("call x"), add("battery full")
    assert standing.due_next() is None
    add("every day 09:00"), add("every 15m"), add("every 4h")
    assert standing.due_next() == START + timedelta(minutes=15)


def test_an_occurrence_and_its_mission_are_written_together(add, clock, fire, monkeypatch, standing, store):
    add("every day 09:00")
    before = standing.missions()
    clock.pass_by(hours=1)

    def broken(*_):
        raise sqlite3.OperationalError("killed in between")

    with monkeypatch.context() as patch, pytest.raises(InputError, match="killed in between"):
        patch.setattr(standing_module, "_queue", broken)
        fire()
    assert (standing.missions(), store.missions(MissionState.QUEUED)) == (before, ())
    assert len(fire()) == 1


def test_a_process_that_ends_between_firing_and_running_loses_nothing(add, clock, fire, path):
    add("every day 09:00")
    clock.pass_by(hours=1)
    fire()
    with MissionStore(path, now=clock) as after:
        standing = StandingMissions(after, zone=UTC)
        assert [each.why for each in after.missions(MissionState.QUEUED)] == ["every day 09:00, due 2026-11-24 09:00"]
        assert standing.fire_due(waiting_since=START, serving_since=START) == ()


def test_a_removed_standing_mission_fires_no_more_and_its_copies_stay(add, clock, fire, standing, store):
    number = add("every 10m").id
    clock.pass_by(minutes=10)
    fire()
    store.remove(number)
    clock.pass_by(minutes=10)
    assert (fire(), standing.missions()) == ([], ())
    assert [each.standing for each in store.missions()] == [number]


def test_a_standing_mission_removed_while_it_fires_is_refused(add, standing, store):
    added = add("call x")
    store.remove(added.id)
    with pytest.raises(InputError, match="was removed"):
        standing.fire([(added, REQUEST)], "")
    assert store.missions() == ()


def test_copies_that_wait_do_not_pile_up_without_end(add, standing, store):
    added = add("topic mqtt:x")
    for _ in range(MOST_WAITING):
        standing.fire([(added, REQUEST)], "")
    with pytest.raises(TooManyError, match=f"{MOST_WAITING} missions .* wait already"):
        standing.fire([(added, REQUEST)], "")
    store.finish(2, MissionState.SUCCESS, "done")
    assert len(standing.fire([(added, REQUEST)], "")) == 1


@pytest.mark.parametrize(
    ("charges", "fires"),
    [
        ((0.2, 0.6, 0.96), True),
        ((0.96, 0.2, 0.96), True),
        ((1.0, 0.97), False),
        ((0.2, 0.94), False),
        ((0.2, 0.97, 0.9), False),
        ((0.951, 0.945, 0.951), False),
        ((), False),
    ],
)
def test_a_battery_becomes_full_when_a_mission_ends_with_a_charge_that_was_lower_before(
    add, clock, fire, store, charges, fires
):
    add("battery full")
    clock.pass_by(minutes=1)
    end_mission(store, *charges)
    assert fire() == ["battery full"] * fires
    clock.pass_by(minutes=1)
    end_mission(store, 1.0, 0.99)
    assert fire() == []


def test_a_battery_trigger_uses_its_own_level(add, clock, fire, store):
    add("battery 50%")
    clock.pass_by(minutes=1)
    end_mission(store, 0.48, 0.5)
    assert fire() == ["battery 50%"]


def test_a_battery_that_was_full_before_is_no_occurrence(add, clock, fire, store):
    end_mission(store, 0.2, 0.97)
    clock.pass_by(minutes=1)
    add("battery full", Missed.ONCE)
    assert fire() == []


@pytest.mark.parametrize("missed", list(Missed))
def test_a_battery_that_became_full_while_nothing_served_is_missed(add, clock, fire, store, missed):
    add("battery full", missed)
    clock.pass_by(minutes=1)
    end_mission(store, 0.2, 0.97)
    clock.pass_by(minutes=1)
    assert fire(serving_since=clock.now) == ["battery full, missed"] * (missed is Missed.ONCE)


def test_the_battery_of_another_robot_does_not_matter(clock, fire, standing, store):
    standing.add(Request(**{**vars(REQUEST), "robot": "Bob"}), trigger_of("battery full"))
    clock.pass_by(minutes=1)
    end_mission(store, 0.2, 0.97)
    assert fire() == []
