"""Calls and messages: which missions they queue, and with which values."""

import json

import pytest

from executive.app.prepare import prepare
from executive.app.trigger_calls import TriggerCalls
from executive.mission.request import Request
from executive.store.missions import MissionState, MissionStore
from executive.store.standing import MOST_WAITING, StandingMissions
from executive.store.triggers import trigger_of
from executive.view.calls import CallError

MISSION = """
name: pose
parameters: {x: 5.2, fast: 0.5}
steps:
  - skill: navigate
    with: {x: "${x}", y: 4.5, yaw: 0.0, max_speed: "${fast}"}
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "missions.sqlite"


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "pose.yaml"
    file.write_text(MISSION)
    return file


@pytest.fixture
def stand(path, file, monkeypatch):
    monkeypatch.setattr("executive.app.prepare.load_parser", lambda: None)  # no step here is a sentence
    request = prepare(Request(file=file, given={"fast": 0.3})).request.from_anywhere()

    def standing(*triggers):
        with MissionStore(path) as store:
            for each in triggers:
                StandingMissions(store).add(request, trigger_of(each))

    return standing


@pytest.fixture
def queued(path):
    def read():
        with MissionStore(path) as store:
            return [(each.id, dict(each.request.given), each.why) for each in store.missions(MissionState.QUEUED)]

    return read


@pytest.fixture
def lines():
    return []


@pytest.fixture
def calls(path, lines):
    return TriggerCalls(path, lines.append)


def test_a_call_queues_every_mission_that_waits_for_its_name(calls, stand, queued, lines):
    stand("call a", "call b", "call a", "every 1h")
    assert calls.called("a", b"") == {"missions": [5, 6]}
    assert queued() == [(5, {"fast": 0.3}, "call a"), (6, {"fast": 0.3}, "call a")]
    assert lines == ["Mission 5 is queued: pose (call a)", "Mission 6 is queued: pose (call a)"]


def test_a_call_gives_values_as_set_does(calls, stand, queued, file):
    stand("call a")
    calls.called("a", json.dumps({"x": 6.0}).encode())
    assert queued() == [(2, {"fast": 0.3, "x": 6.0}, "call a")]


def test_values_are_put_into_the_file_as_it_was_when_it_was_given(calls, stand, path, file):
    stand("call a")
    file.write_text("name: other\nsteps: [{to: kitchen}]\n")
    calls.called("a", b'{"x": 6.0}')
    with MissionStore(path) as store:
        request = store.mission(2).request
    assert (request.file, request.text, request.name) == (file.resolve(), MISSION, "pose")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (b"[]", "are no JSON object"),
        (b"{", "are no JSON object"),
        (b"\xff", "are no JSON object"),
        (b"[" * 10_000, "are no JSON object"),
        (b'{"x": null}', "'x' is not a name with a value"),
        (b'{"x": [1]}', "'x' is not a name with a value"),
        (b'{"x": NaN}', "'x' is not a name with a value"),
        (b'{"no name": 1}', "'no name' is not a name with a value"),
        (b'{"z": 1}', "has no parameter 'z'; it has x and fast"),
        (b'{"x": "left"}', "'left' .*give (it )?a number"),
        (b'{"x": 500.0}', "no|not"),
    ],
)
def test_values_that_do_not_fit_are_refused_and_nothing_is_queued(calls, stand, queued, body, words):
    stand("call a")
    with pytest.raises(CallError, match=words) as refusal:
        calls.called("a", body)
    assert (refusal.value.status, queued()) == (400, [])


def test_a_name_that_nothing_waits_for_is_not_found(calls, stand):
    stand("call a")
    with pytest.raises(CallError, match="no standing mission waits for 'call b'") as refusal:
        calls.called("b", b"")
    assert refusal.value.status == 404


def test_too_many_calls_are_told_to_come_later(calls, stand):
    stand("call a")
    for _ in range(MOST_WAITING):
        calls.called("a", b"")
    with pytest.raises(CallError, match="wait already") as refusal:
        calls.called("a", b"")
    assert refusal.value.status == 429


def test_a_store_that_cannot_be_used_is_no_fault_of_the_caller(calls):
    with pytest.raises(CallError, match="there is no store") as refusal:
        calls.called("a", b"")
    assert refusal.value.status == 503


def test_a_message_queues_what_waits_for_its_topic(calls, stand, queued):
    stand("topic mqtt:home/door", "topic zenoh:home/door")
    calls.heard("mqtt", "home/door", b'{"x": 6.0}')
    assert queued() == [(3, {"fast": 0.3, "x": 6.0}, "topic mqtt:home/door")]


def test_a_message_that_cannot_be_used_is_told_and_raises_nothing(calls, stand, queued, lines, monkeypatch):
    stand("topic mqtt:home/door")
    calls.heard("mqtt", "home/door", b"open!")
    calls.heard("mqtt", "elsewhere", b"")
    monkeypatch.setattr("executive.app.trigger_calls.values_in_json", lambda text: 1 / 0)
    calls.heard("mqtt", "home/door", b"")
    assert [line.split(";")[0] for line in lines] == [
        "topic mqtt:home/door: the values are no JSON object",
        "topic mqtt:elsewhere: no standing mission waits for 'topic mqtt:elsewhere'",
        "topic mqtt:home/door: a defect of errand or of a plug-in (ZeroDivisionError: division by zero)",
    ]
    assert queued() == []
