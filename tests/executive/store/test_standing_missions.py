"""Standing missions: what fires, what is missed, and that nothing is lost or comes twice."""

import sqlite3
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from executive.mission.request import Request
from executive.run.visitor import TickNote
from executive.store import standing_missions as standing_module
from executive.store.missions import MissionState, MissionStore
from executive.store.standing_missions import MOST_WAITING, StandingMissions, TooManyError
from executive.store.triggers import Missed, trigger_of
from skills.inputs.errors import InputError
from tests.tables import yaml_beside

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

    def moment(self, minutes):
        """Now, or so many minutes after the start."""
        return self.now if minutes == "now" else START + timedelta(minutes=minutes)


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
        return [each.why for each in standing.fire_due(waiting_since=waiting_since, serving_since=serving_since)]

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


TIMELINES = yaml_beside(__file__, "standing.yaml")


@pytest.mark.parametrize("timeline", TIMELINES, ids=lambda timeline: timeline["name"])
def test_a_standing_mission_fires_when_it_is_due(clock, fire, standing, store, timeline):
    for step in timeline["steps"]:
        if "add" in step:
            request = replace(REQUEST, robot=step.get("robot", REQUEST.robot))
            standing.add(request, trigger_of(str(step["add"])), Missed(step.get("missed", "skip")))
        clock.pass_by(**step.get("pass", {}))
        if "ends" in step:
            end_mission(store, *step["ends"])
        if "fires" in step:
            assert fire(clock.moment(step.get("waiting", 0)), clock.moment(step.get("serving", 0))) == step["fires"]
        if "next" in step:
            assert standing.due_next() == (step["next"] and datetime.fromisoformat(step["next"]))


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


def test_a_single_time_that_has_passed_is_refused(add, store):
    with pytest.raises(InputError, match="2026-11-24 07:59 has passed; give a time to come"):
        add("2026-11-24 07:59")
    assert store.missions() == ()


def test_an_occurrence_and_its_mission_are_written_together(add, clock, fire, monkeypatch, standing, store):
    add("every day 09:00")
    before = standing.missions()
    clock.pass_by(hours=1)

    def broken(*_):
        raise sqlite3.OperationalError("killed in between")

    with monkeypatch.context() as patch, pytest.raises(InputError, match="killed in between"):
        patch.setattr(standing_module, "_queue", broken)
        fire()
    assert (standing.missions(), store.missions(MissionState.QUEUED), len(fire())) == (before, (), 1)


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
