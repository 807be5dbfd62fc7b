"""The server of a queue: missions in their turn on a clock that the test drives, calls, messages and tokens."""

import errno
import http.client
import json
import signal
import stat
import subprocess
import sys
import threading
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.app.prepare.from_request import prepare
from executive.app.runs import queue_server as listeners_module
from executive.app.runs.queue import MissionResult
from executive.app.runs.queue_server import CallAddress, CallToken, Listeners, QueueServer, TriggerCalls, call_token
from executive.cli.entry import app
from executive.mission.request import Request
from executive.run.visitor import TickNote
from executive.store.database import STORE_FILE
from executive.store.missions import MissionState, MissionStore
from executive.store.standing_missions import MOST_WAITING, StandingMissions
from executive.store.triggers import Missed, OnCall, OnTopic, trigger_of
from executive.view.serving import CallError
from skills.inputs.errors import InputError
from tests.tables import yaml_beside

TOKEN = "a-token-of-the-test"

REQUEST = Request("go to the kitchen", name="go kitchen", world_name="flat", robot="Alice", commands=("Take",))
ROOT = Path(__file__).parents[4]
START = datetime(2026, 11, 24, 8, 0, tzinfo=UTC)
HOUR = timedelta(hours=1)


class GoneError(BaseException):
    """The process is killed."""


class World:
    """The wall's clock, somebody who waits by it, and a runner whose missions take some time."""

    def __init__(self):
        self.now = START
        self.waits = []
        self.runs = []
        self.takes = timedelta(0)
        self.during = []
        self.meanwhile = []

    def wait(self, until):
        self.waits.append(until)
        if self.meanwhile:
            self.meanwhile.pop(0)()
        else:
            assert until is not None, "it would wait for ever"
            self.now = max(self.now, until)

    def wake(self):
        """The wait is over by itself."""

    def run(self, mission):
        self.runs.append((f"{self.now:%H:%M}", mission.id, mission.why))
        self.store.begin(mission.id)
        self.now += self.takes
        if self.during:
            self.during.pop(0)()
        self.store.finish(mission.id, MissionState.SUCCESS, "done")
        return MissionResult(mission.id, "success", True)

    def cancel(self, reason):
        self.cancelled = reason

    def set_aside(self, mission, cause):
        self.store.finish(mission.id, MissionState.ERROR, cause)
        return MissionResult(mission.id, "error", False)


@pytest.fixture
def world():
    return World()


@pytest.fixture
def lines():
    return []


@pytest.fixture
def path(tmp_path):
    return tmp_path / "missions.sqlite"


@pytest.fixture
def store(path, world):
    with MissionStore(path, now=lambda: world.now) as store:
        world.store = store
        yield store


@pytest.fixture
def standing(store):
    return StandingMissions(store, zone=UTC)


@pytest.fixture
def followed():
    return []


@pytest.fixture
def server(store, standing, world, lines, followed):
    follow = lambda triggers: followed.append([*triggers])  # noqa: E731
    return QueueServer(store, standing, world, world, follow=follow, tell=lines.append)


def queue_two(store):
    for _ in range(2):
        store.add(REQUEST, queued=True)


def states(store):
    return [each.state.value for each in store.missions() if each.state is not MissionState.STANDING]


SERVERS = yaml_beside(__file__, "servers.yaml")


@pytest.mark.parametrize("case", SERVERS, ids=lambda case: case["name"])
def test_the_server_runs_what_is_queued_and_due(server, store, standing, world, lines, case):
    for trigger in case.get("stand", []):
        standing.add(REQUEST, trigger_of(trigger), Missed(case.get("missed", "skip")))
    for _ in range(case.get("queue", 0)):
        store.add(REQUEST, queued=True)
    for number in case.get("interrupted", []):
        store.begin(number)
    world.takes, world.now = timedelta(minutes=case.get("takes", 0)), START + timedelta(minutes=case.get("late", 0))
    end = START + timedelta(minutes=case["minutes"]) if "minutes" in case else None
    results = server.serve(end=end, until_idle=end is None)
    found = {"runs": [list(run) for run in world.runs], "states": states(store), "line": lines[0] if lines else None}
    found |= {"begun": [begun for begun, *_ in world.runs], "ran": [number for _, number, _ in world.runs]}
    found |= {"outcomes": [[each.mission, each.outcome, each.achieved] for each in results]}
    found |= {"waits": [(until - START) / timedelta(minutes=1) for until in world.waits]}
    found |= {"message": store.mission(1).message}
    assert found == found | {key: value for key, value in case.items() if key in found}


def test_the_server_runs_queued_missions_and_later_ones(server, store, world):
    store.add(REQUEST, queued=True)
    world.meanwhile = [lambda: store.add(REQUEST, queued=True), lambda: server.stop("enough")]
    assert [each.mission for each in server.serve()] == [1, 2]


def test_a_server_that_is_killed_between_firing_and_running_runs_it_when_it_is_started_again(
    server, standing, store, world, monkeypatch
):
    standing.add(REQUEST, trigger_of("every day 09:00"))

    def killed(mission):
        raise GoneError

    with monkeypatch.context() as patch, pytest.raises(GoneError):
        patch.setattr(world, "run", killed)
        server.serve()
    world.now += HOUR
    server.serve(until_idle=True)
    assert world.runs == [("10:00", 2, "every day 09:00, due 2026-11-24 09:00")]


def test_an_interrupted_run_is_left_to_the_user(server, store, world):
    store.begin(store.add(REQUEST, queued=False).id)
    with pytest.raises(InputError, match=r"mission 1 \(go kitchen\) was interrupted; `errand resume`"):
        server.serve(until_idle=True)
    assert world.runs == []


def test_stopping_the_server_cancels_the_mission_and_keeps_the_queue(server, store, world):
    queue_two(store)
    world.during = [lambda: server.stop("cancelled by SIGTERM")]
    assert len(server.serve()) == 1
    assert (world.cancelled, states(store)) == ("cancelled by SIGTERM", ["success", "queued"])


def test_a_battery_that_a_mission_has_charged_fires_at_its_end(server, store, standing, world):
    def charge():
        journal = store.journal(2)
        journal.note(TickNote(None, 1.0, (), {"a": 1}, None, {}, 0.2))
        journal.note(TickNote(None, 2.0, (), {"a": 2}, None, {}, 0.96))

    standing.add(REQUEST, trigger_of("battery full"))
    store.add(REQUEST, queued=True)
    world.takes, world.during = timedelta(minutes=1), [charge]
    server.serve(until_idle=True)
    assert [why for *_, why in world.runs] == ["", "battery full"]


def test_the_listeners_follow_the_standing_missions(server, standing, world, store, followed):
    number = standing.add(REQUEST, trigger_of("call a")).id

    def change():
        store.remove(number)
        standing.add(REQUEST, trigger_of("call b"))

    world.meanwhile = [change, lambda: server.stop("enough")]
    server.serve()
    assert followed == [[OnCall("a")], [OnCall("a")], [OnCall("b")]]


def test_a_taken_port_ends_the_server_at_its_start_and_is_reported_once_later(
    store, standing, world, lines, monkeypatch
):
    refused = []

    def follow(triggers):
        if refused:
            raise InputError("the port is taken")

    server = QueueServer(store, standing, world, world, follow=follow, tell=lines.append)
    world.meanwhile = [lambda: refused.append(1), lambda: None, lambda: server.stop("enough")]
    server.serve()
    assert lines == ["errand: the port is taken"]
    with pytest.raises(InputError, match="the port is taken"):
        server.serve()


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
def listeners(path, lines, sources):
    with Listeners(path, CallAddress(port=0, token=TOKEN), lines.append) as listeners:
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


def test_a_token_that_is_made_is_told_once(path, lines, sources):
    for _ in range(2):
        with Listeners(path, CallAddress(port=0), lines.append) as listeners:
            listeners.follow([OnCall("x")])
    token = path.with_name("missions.sqlite-token").read_text().strip()
    assert [token in line for line in lines] == [False, True, False, False]


def test_a_plug_in_hears_the_topics_that_missions_wait_for(listeners, notes, sources, lines):
    listeners.follow([OnTopic("bell", "a"), OnTopic("bell", "b"), OnTopic("bell", "a")])
    listeners.follow([OnTopic("bell", "a"), OnTopic("bell", "b")])
    assert notes == [("start", "a", "b")]
    sources[0].fire("a", b"")
    assert lines[0].startswith("topic bell:a: ")  # there is no store
    listeners.follow([OnTopic("bell", "b")])
    listeners.follow([])
    assert notes == [("start", "a", "b"), ("stop",), ("start", "b"), ("stop",)]


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


def test_a_plug_in_that_hangs_at_its_start_is_named_and_not_asked_again(path, sources, lines, monkeypatch):
    asked, over, stopped = [], threading.Event(), threading.Event()

    def start(self, topics, fire):
        asked.append(topics)
        over.wait(10)
        fire("a", b"")

    monkeypatch.setattr(Source, "start", start)
    monkeypatch.setattr(Source, "stop", lambda self: stopped.set())
    with Listeners(path, CallAddress(port=0), lines.append, limit_s=0.1) as hearing:
        hearing.follow([OnTopic("bell", "a")])
        hearing.follow([OnTopic("bell", "a")])
        assert (len(asked), len(lines)) == (1, 1)
        assert "'bell' does not start (it is not done within 0.1 s)" in lines[0]
        over.set()
        assert stopped.wait(10)
    assert len(lines) == 1


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


UNSERVED = ("192.0.2.1", "no-host-at-all", "::ffff:zz")
BAD_HOSTS = {host: f"cannot serve calls at {host} port 0 .*; name another --host or --port" for host in UNSERVED}
BAD_HOSTS |= dict.fromkeys(("", "a b", "x" * 300, "[::1]", "h\u00f6st", "..", "-"), "--host")


@pytest.mark.parametrize("host", BAD_HOSTS)
def test_an_address_that_cannot_be_served_is_refused_with_its_option(path, lines, host):
    with pytest.raises(InputError, match=BAD_HOSTS[host]):
        Listeners(path, CallAddress(host, 0, TOKEN), lines.append).follow([OnCall("x")])


def test_a_token_of_a_store_is_made_once_and_kept_for_its_owner_only(path):
    made = call_token(None, path)
    assert (made.new, len(made.text) >= 32, stat.S_IMODE(made.file.stat().st_mode)) == (True, True, 0o600)
    assert call_token(None, path) == CallToken(made.text, made.file)
    assert call_token(None, path.with_name("other.sqlite")).text != made.text


def test_a_token_that_is_given_is_kept_nowhere(path):
    assert (call_token("given-by-hand", path), list(path.parent.iterdir())) == (CallToken("given-by-hand"), [])


@pytest.mark.parametrize("given", ["", "short", "two words here", "line\nbreak-in-it", "ümlauts-in-it"])
def test_a_token_that_no_header_bears_is_refused(path, given):
    with pytest.raises(InputError, match="cannot be used; give at least 8 letters"):
        call_token(given, path)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda file: file.chmod(0o640), "other users can read the token; chmod 600"),
        (lambda file: file.write_text(""), "cannot be used"),
    ],
)
def test_a_file_of_a_token_that_others_can_read_or_that_is_empty_is_refused(path, spoil, says):
    spoil(call_token(None, path).file)
    with pytest.raises(InputError, match=says):
        call_token(None, path)


MISSION = """
name: pose
parameters: {x: 5.2, fast: 0.5}
steps:
  - skill: navigate
    with: {x: "${x}", y: 4.5, yaw: 0.0, max_speed: "${fast}"}
"""


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "pose.yaml"
    file.write_text(MISSION)
    return file


@pytest.fixture
def stand(path, file, monkeypatch):
    monkeypatch.setattr("executive.app.prepare.from_request.load_parser", lambda: None)  # no step here is a sentence
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
        (b'{"x": 6.0, "x": 7.0}', "the values have 'x' twice"),
        (b'{"x": {"y": 1, "y": 2}}', "the values have 'y' twice"),
        (b'{"x": null}', "'x' is not a name with a value"),
        (b'{"x": [1]}', "'x' is not a name with a value"),
        (b'{"x": NaN}', "'x' is not a name with a value"),
        (b'{"no name": 1}', "'no name' is not a name with a value"),
        (b'{"z": 1}', "has no parameter 'z'; it has x and fast"),
        (b'{"x": "left"}', "not 'left'; give it a number"),
        (b'{"x": 500.0}', "no|not"),
    ],
)
def test_values_that_do_not_fit_are_refused_and_nothing_is_queued(calls, stand, queued, body, words):
    stand("call a")
    with pytest.raises(CallError, match=words) as refusal:
        calls.called("a", body)
    assert (refusal.value.status_code, queued()) == (400, [])


# The missions that stand by, the call, how often it was made before -> the status and the words of the refusal.
REFUSED_CALLS = [
    ([], "a", 0, 503, "there is no store"),
    (["call a"], "a", MOST_WAITING, 429, "wait already"),
    (["call a"], "b", 0, 404, "no standing mission waits for 'call b'"),
]


@pytest.mark.parametrize(("triggers", "name", "before", "status", "says"), REFUSED_CALLS)
def test_a_call_that_nothing_can_take_is_refused_with_its_status(calls, stand, triggers, name, before, status, says):
    if triggers:
        stand(*triggers)
    for _ in range(before):
        calls.called(name, b"")
    with pytest.raises(CallError, match=says) as refusal:
        calls.called(name, b"")
    assert refusal.value.status_code == status


def test_a_message_queues_what_waits_for_its_topic(calls, stand, queued):
    stand("topic mqtt:home/door", "topic zenoh:home/door")
    calls.heard("mqtt", "home/door", b'{"x": 6.0}')
    assert queued() == [(3, {"fast": 0.3, "x": 6.0}, "topic mqtt:home/door")]


def test_a_message_that_cannot_be_used_is_told_and_raises_nothing(calls, stand, queued, lines, monkeypatch):
    stand("topic mqtt:home/door")
    calls.heard("mqtt", "home/door", b"open!")
    calls.heard("mqtt", "elsewhere", b"")
    monkeypatch.setattr("executive.app.runs.queue_server.parse_json_values", lambda text: 1 / 0)
    calls.heard("mqtt", "home/door", b"")
    assert [line.split(";")[0] for line in lines] == [
        "topic mqtt:home/door: the values are no JSON object",
        "topic mqtt:elsewhere: no standing mission waits for 'topic mqtt:elsewhere'",
        "topic mqtt:home/door: a defect of errand or of a plug-in (ZeroDivisionError: division by zero)",
    ]
    assert queued() == []


@pytest.mark.mission
@contextmanager
def killed_after(time_s, process):
    """Kills a process that would be waited for longer."""
    timer = threading.Timer(time_s, process.kill)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def test_a_server_process_runs_a_called_mission_and_ends_at_sigterm(tmp_path):
    where = ["--out", str(tmp_path), "--store", str(tmp_path / ".errand" / "missions.sqlite")]
    added = CliRunner().invoke(app, ["queue", "add", "go_to_pose", "--on", "call pose", "--no-record", *where])
    assert added.exit_code == 0, added.output
    serve = [sys.executable, "-m", "executive.cli", "queue", "serve", "--quiet", "--json", "--port", "0", *where]
    pipes = {"text": True, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(serve, cwd=ROOT, **pipes) as server, killed_after(120.0, server):
        port = next(int(line.split(":")[3].split("/")[0]) for line in server.stderr if line.startswith("Calls:"))
        token = (tmp_path / ".errand" / "missions.sqlite-token").read_text().strip()
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        bearer = {"Authorization": f"Bearer {token}"}
        connection.request("POST", "/missions/pose", json.dumps({"x": 9.0, "y": 4.05, "yaw": 0.0}), bearer)
        assert connection.getresponse().status == 202
        assert any(line.startswith("Written to") for line in server.stderr)
        server.send_signal(signal.SIGTERM)
        told, _ = server.communicate(timeout=60)
    assert server.returncode == 0
    assert json.loads(told) == {"missions": [{"mission": 2, "outcome": "success", "achieved": True}]}
    with MissionStore(tmp_path / ".errand" / "missions.sqlite") as store:
        (battery,) = store.rows("SELECT lowest_charge, last_charge, ended FROM mission WHERE ended")
        assert 0.9 < battery["lowest_charge"] <= battery["last_charge"] <= 1.0 and battery["ended"]


def test_a_full_disk_makes_the_server_wait(server, store, standing, world, lines, monkeypatch):
    standing.add(REQUEST, trigger_of("every 40m"))
    fire_due, failures = standing.fire_due, [STORE_FILE.failures(store.path) for _ in range(2)]

    def full(**times):
        if not failures:
            return fire_due(**times)
        with failures.pop():
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(standing, "fire_due", full)
    server.serve(end=START + HOUR)
    assert [begun for begun, *_ in world.runs] == ["08:40"]
    assert [line for line in lines if "disk" in line] == [
        f"errand: {STORE_FILE.shortage_error(store.path, 'the disk is full')}"
    ]
