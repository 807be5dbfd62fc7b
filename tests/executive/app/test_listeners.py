"""Listeners: a port is open and a plug-in started only while a standing mission waits for it."""

import http.client
import threading

import pytest

from executive.app import listeners as listeners_module
from executive.app.listeners import CallAddress, Listeners
from executive.store.triggers import OnCall, OnTopic, trigger_of
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
