"""Listeners: a port is open and a plug-in started only while a standing mission waits for it."""

import http.client
import json
import stat
import threading

import pytest

from executive.app import queue_server as listeners_module
from executive.app.prepare import prepare
from executive.app.queue_server import CallAddress, CallToken, Listeners, TriggerCalls, call_token
from executive.mission.request import Request
from executive.store.missions import MissionState, MissionStore
from executive.store.standing_missions import MOST_WAITING, StandingMissions
from executive.store.triggers import OnCall, OnTopic, trigger_of
from executive.view.serving import CallError
from skills.files.errors import InputError

TOKEN = "a-token-of-the-test"


class Source:
    """A trigger source that notes what becomes of it."""

    def __init__(self, notes):
        self.notes = notes

    def start(self, topics, fire):
        self.fire = fire
        self.notes.append(("start", *topics))

    def stop(self):
        self.notes.append(("stop",))


@pytest.fixture
def notes():
    return []


@pytest.fixture
def sources(monkeypatch, notes):
    """The sources that were made, of any kind but `gone`."""
    made = []

    def trigger_source(kind):
        if kind == "gone":
            raise InputError("there is no trigger source 'gone'")
        made.append(Source(notes))
        return made[-1]

    monkeypatch.setattr(listeners_module, "trigger_source", trigger_source)
    return made


@pytest.fixture
def lines():
    return []


@pytest.fixture
def listeners(tmp_path, lines, sources):
    with Listeners(tmp_path / "missions.sqlite", CallAddress(port=0, token=TOKEN), lines.append) as listeners:
        yield listeners


def status(port):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("POST", "/missions/x", b"", {"Authorization": f"Bearer {TOKEN}"})
    return connection.getresponse().status


def test_the_port_is_open_only_while_a_mission_waits_for_a_call(listeners, lines):
    listeners.follow([trigger_of("every 1h"), trigger_of("battery full")])
    assert lines == []
    listeners.follow([OnCall("x")])
    (line,) = lines
    port = int(line.split(":")[3].split("/")[0])
    assert (line, status(port)) == (f"Calls: POST http://127.0.0.1:{port}/missions/NAME", 503)  # there is no store
    listeners.follow([OnCall("x"), OnCall("y")])
    assert (len(lines), status(port)) == (1, 503)
    listeners.follow([])
    with pytest.raises(OSError):
        status(port)


def test_a_token_that_is_made_is_told_once(tmp_path, lines, sources):
    for _ in range(2):
        with Listeners(tmp_path / "missions.sqlite", CallAddress(port=0), lines.append) as listeners:
            listeners.follow([OnCall("x")])
    token = (tmp_path / "missions.sqlite-token").read_text().strip()
    assert [token in line for line in lines] == [False, True, False, False]


def test_a_plug_in_hears_the_topics_that_missions_wait_for(listeners, notes):
    listeners.follow([OnTopic("bell", "a"), OnTopic("bell", "b"), OnTopic("bell", "a")])
    listeners.follow([OnTopic("bell", "a"), OnTopic("bell", "b")])
    assert notes == [("start", "a", "b")]
    listeners.follow([OnTopic("bell", "b")])
    listeners.follow([])
    assert notes == [("start", "a", "b"), ("stop",), ("start", "b"), ("stop",)]


def test_what_a_plug_in_hears_is_that_of_its_kind(listeners, sources, lines):
    listeners.follow([OnTopic("bell", "a")])
    sources[0].fire("a", b"")
    assert lines[0].startswith("topic bell:a: ")  # there is no store


def test_a_missing_plug_in_is_told_once_and_others_go_on(listeners, notes, lines):
    for _ in range(2):
        listeners.follow([OnTopic("gone", "a"), OnTopic("bell", "a")])
    assert notes == [("start", "a")]
    assert ["no trigger source 'gone'" in line for line in lines] == [True]
    listeners.close()
    assert notes[-1] == ("stop",)


def test_a_plug_in_that_does_not_start_is_named(listeners, lines, monkeypatch):
    def start(self, topics, fire):
        raise ConnectionError("no broker")

    monkeypatch.setattr(Source, "start", start)
    listeners.follow([OnTopic("bell", "a")])
    assert "'bell' does not start (ConnectionError: no broker)" in lines[0]


def test_a_plug_in_that_hangs_at_its_start_is_named_and_not_asked_again(tmp_path, sources, lines, monkeypatch):
    asked, over, stopped = [], threading.Event(), threading.Event()

    def start(self, topics, fire):
        asked.append(topics)
        over.wait(10)
        fire("a", b"")

    monkeypatch.setattr(Source, "start", start)
    monkeypatch.setattr(Source, "stop", lambda self: stopped.set())
    with Listeners(tmp_path / "missions.sqlite", CallAddress(port=0), lines.append, limit_s=0.1) as hearing:
        hearing.follow([OnTopic("bell", "a")])
        hearing.follow([OnTopic("bell", "a")])
        assert (len(asked), len(lines)) == (1, 1)
        assert "'bell' does not start (it is not done within 0.1 s)" in lines[0]
        over.set()
        assert stopped.wait(10)
    assert len(lines) == 1


@pytest.mark.parametrize("host", ["", "a b", "x" * 300, "[::1]", "h\u00f6st", "..", "-"])
def test_what_is_no_host_is_refused_by_its_option(host, tmp_path, lines):
    with pytest.raises(InputError, match="--host"):
        Listeners(tmp_path / "m", CallAddress(host, 0, TOKEN), lines.append).follow([OnCall("beer")])


def test_a_plug_in_that_does_not_stop_is_named_and_the_others_stop(listeners, notes, lines, monkeypatch):
    stop = Source.stop

    def broken(self):
        stop(self)
        raise ConnectionError("gone already")

    monkeypatch.setattr(Source, "stop", broken)
    listeners.follow([OnTopic("bell", "a"), OnTopic("horn", "a")])
    listeners.close()
    assert notes[2:] == [("stop",), ("stop",)]
    assert lines[0] == "trigger source 'bell' does not stop (ConnectionError: gone already)"


@pytest.mark.parametrize("host", ["192.0.2.1", "no-host-at-all", "::ffff:zz"])
def test_an_address_that_cannot_be_served_is_refused(tmp_path, lines, host):
    with (
        pytest.raises(InputError, match=f"cannot serve calls at {host} port 0 .*; name another --host or --port"),
        Listeners(tmp_path / "missions.sqlite", CallAddress(host, 0, TOKEN), lines.append) as listeners,
    ):
        listeners.follow([OnCall("x")])


@pytest.fixture
def store(tmp_path):
    return tmp_path / "missions.sqlite"


def test_a_token_is_made_once_and_kept_for_its_owner_only(store):
    made = call_token(None, store)
    assert (made.new, len(made.text) >= 32, stat.S_IMODE(made.file.stat().st_mode)) == (True, True, 0o600)
    assert call_token(None, store) == CallToken(made.text, made.file)


def test_each_store_has_a_token_of_its_own(store):
    assert call_token(None, store).text != call_token(None, store.with_name("other.sqlite")).text


def test_a_token_that_is_given_is_kept_nowhere(store):
    assert call_token("given-by-hand", store) == CallToken("given-by-hand")
    assert list(store.parent.iterdir()) == []


@pytest.mark.parametrize("given", ["", "short", "two words here", "line\nbreak-in-it", "ümlauts-in-it"])
def test_a_token_that_no_header_bears_is_refused(store, given):
    with pytest.raises(InputError, match="cannot be used; give at least 8 letters"):
        call_token(given, store)


def test_a_token_that_others_can_read_is_refused(store):
    made = call_token(None, store)
    made.file.chmod(0o640)
    with pytest.raises(InputError, match="others can read the token; chmod 600"):
        call_token(None, store)


def test_an_empty_file_is_refused(store):
    call_token(None, store).file.write_text("")
    with pytest.raises(InputError, match="cannot be used"):
        call_token(None, store)


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
    monkeypatch.setattr("executive.app.queue_server.parse_json_values", lambda text: 1 / 0)
    calls.heard("mqtt", "home/door", b"")
    assert [line.split(";")[0] for line in lines] == [
        "topic mqtt:home/door: the values are no JSON object",
        "topic mqtt:elsewhere: no standing mission waits for 'topic mqtt:elsewhere'",
        "topic mqtt:home/door: a defect of errand or of a plug-in (ZeroDivisionError: division by zero)",
    ]
    assert queued() == []
