"""Missions of a store in their turn, on a clock that the test drives and with missions that a stub runs."""

import http.client
import json
import signal
import subprocess
import sys
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.app.mission_run import Finished
from executive.app.queue_server import MOST_STARTS, QueueServer
from executive.app.report import RefereeReport, RunReport
from executive.app.runs import Ended, MissionRuns, Watching
from executive.cli.entry import app
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.visitor import TickNote
from executive.store.database import STORE_FILE
from executive.store.missions import MissionState, MissionStore
from executive.store.standing_missions import StandingMissions
from executive.store.triggers import Missed, OnCall, trigger_of
from executive.tree.node_view import node_view
from skills.files.errors import InputError

REQUEST = Request("go to the kitchen", name="go kitchen", world_name="flat", robot="Alice", commands=("Take",))
ROOT = Path(__file__).parents[3]
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
        return Ended(mission.id, "success", True)

    def cancel(self, reason):
        self.cancelled = reason

    def set_aside(self, mission, cause):
        self.store.finish(mission.id, MissionState.ERROR, cause)
        return Ended(mission.id, "error", False)


@pytest.fixture
def world():
    return World()


@pytest.fixture
def store(tmp_path, world):
    with MissionStore(tmp_path / "missions.sqlite", now=lambda: world.now) as store:
        world.store = store
        yield store


@pytest.fixture
def standing(store):
    return StandingMissions(store, zone=UTC)


@pytest.fixture
def lines():
    return []


@pytest.fixture
def followed():
    return []


@pytest.fixture
def server(store, standing, world, lines, followed):
    follow = lambda triggers: followed.append([*triggers])  # noqa: E731
    return QueueServer(store, standing, world, world, follow=follow, tell=lines.append)


def states(store):
    return [each.state.value for each in store.missions() if each.state is not MissionState.STANDING]


def test_it_waits_until_something_is_due_and_runs_it(server, standing, world, lines):
    standing.add(REQUEST, trigger_of("every day 09:00"))
    standing.add(REQUEST, trigger_of("every 40m"))
    server.serve(end=START + 1.5 * HOUR)
    assert world.runs == [
        ("08:40", 3, "every 40m, due 2026-11-24 08:40"),
        ("09:00", 4, "every day 09:00, due 2026-11-24 09:00"),
        ("09:20", 5, "every 40m, due 2026-11-24 09:20"),
    ]
    assert world.waits == [START + timedelta(minutes=minutes) for minutes in (40, 60, 80, 90)]
    assert lines[0] == "Mission 3 is queued: go kitchen (every 40m, due 2026-11-24 08:40)"


def test_it_runs_what_is_queued_already_and_what_comes_meanwhile(server, store, world):
    store.add(REQUEST, queued=True)
    world.meanwhile = [lambda: store.add(REQUEST, queued=True), lambda: server.stop("enough")]
    assert [each.mission for each in server.serve()] == [1, 2]


def test_until_idle_it_ends_when_nothing_is_queued(server, store, standing, world):
    standing.add(REQUEST, trigger_of("every 1h"))
    store.add(REQUEST, queued=True)
    store.add(REQUEST, queued=True)
    assert server.serve(until_idle=True) == [Ended(2, "success", True), Ended(3, "success", True)]
    assert world.waits == []


@pytest.mark.parametrize(
    ("missed", "expected"),
    [
        (Missed.SKIP, ["08:10", "08:40"]),
        (Missed.ONCE, ["08:10", "08:35"]),
    ],
)
def test_what_is_due_while_a_mission_runs_is_missed(server, standing, world, missed, expected):
    """Missions take 25 minutes: 08:20 and 08:30 pass while that of 08:10 runs."""
    world.takes = timedelta(minutes=25)
    standing.add(REQUEST, trigger_of("every 10m"), missed)
    server.serve(end=START + HOUR)
    assert [begun for begun, *_ in world.runs] == expected


@pytest.mark.parametrize(("missed", "runs"), [(Missed.SKIP, 0), (Missed.ONCE, 1)])
def test_what_was_due_before_it_was_started_again_is_missed(server, standing, world, missed, runs):
    standing.add(REQUEST, trigger_of("every 10m"), missed)
    world.now += 5 * HOUR
    server.serve(until_idle=True)
    assert len(world.runs) == runs


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


def test_a_mission_that_was_broken_off_goes_on_first(server, store, world):
    store.add(REQUEST, queued=True)
    store.begin(store.add(REQUEST, queued=True).id)
    server.serve(until_idle=True)
    assert [number for _, number, _ in world.runs] == [2, 1]


def test_a_mission_that_ends_the_process_each_time_is_set_aside_and_the_next_one_runs(server, store, world):
    store.add(REQUEST, queued=True)
    store.add(REQUEST, queued=True)
    for _ in range(MOST_STARTS):
        store.begin(1)
    assert [each.outcome for each in server.serve(until_idle=True)] == ["error", "success"]
    assert store.mission(1).message == "it was started 3 times and broken off"


def test_a_run_that_was_broken_off_is_left_to_the_user(server, store, world):
    store.begin(store.add(REQUEST, queued=False).id)
    with pytest.raises(InputError, match=r"mission 1 \(go kitchen\) was broken off; `errand resume`"):
        server.serve(until_idle=True)
    assert world.runs == []


def test_when_it_is_stopped_the_mission_is_cancelled_and_the_queue_stays(server, store, world):
    store.add(REQUEST, queued=True), store.add(REQUEST, queued=True)
    world.during = [lambda: server.stop("cancelled by SIGTERM")]
    assert len(server.serve()) == 1
    assert (world.cancelled, states(store)) == ("cancelled by SIGTERM", ["success", "queued"])


def test_after_its_time_no_mission_begins(server, store, world):
    world.takes = HOUR
    store.add(REQUEST, queued=True), store.add(REQUEST, queued=True)
    server.serve(end=START + timedelta(minutes=1))
    assert states(store) == ["success", "queued"]


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


def test_what_cannot_be_listened_to_ends_it_at_the_beginning_and_is_told_once_later(
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


GO = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"


class Screen:
    """Remembers what it is told, and shows nothing."""

    def __init__(self):
        self.lines = []

    def tell(self, line, *, title=False):
        self.lines.append(line)

    @contextmanager
    def watching(self, prepared):
        yield Watching(Control(pace=None))

    def conclude(self, finished):
        self.lines.append(finished.report.message)

    def name_files(self, out):
        self.lines.append(f"files in {out.name}")


class TestMissionRuns:
    """Missions of a store, run by what stands in for the simulated world."""

    @pytest.fixture
    def mission(self, store, tmp_path):
        return store.add(
            Request(commands=(GO,), name="go", world_name="flat", robot="Alice", out=tmp_path), queued=True
        )

    @pytest.fixture
    def runs(self, store):
        def of(run):
            return MissionRuns(store, Screen(), run=run)

        return of

    def test_a_mission_that_cannot_begin_ends_with_an_error_and_the_queue_goes_on(self, runs, store, mission):
        def refuse(prepared, **_):
            raise InputError("the world is full", hint="take another")

        ended = runs(refuse).run(mission)
        assert (ended.outcome, ended.achieved, ended.report) == ("error", False, None)
        assert store.mission(1).message == "the world is full; take another"
        assert store.mission(1).state is MissionState.ERROR

    def test_a_full_disk_ends_the_queue(self, runs, store, mission):
        def fill(prepared, **_):
            raise STORE_FILE.full_disk(store.path)

        with pytest.raises(InputError, match="the disk is full"):
            runs(fill).run(mission)

    def test_what_is_cancelled_before_it_begins_begins_cancelled(self, runs, mission):
        begun = runs(cancelled_by_control)
        begun.cancel("cancelled by SIGTERM")
        assert begun.run(mission).message == "cancelled by SIGTERM"

    def test_a_mission_under_way_is_cancelled(self, runs, mission):
        def start(prepared, *, control, **_):
            begun.cancel("cancelled by SIGINT")
            return cancelled_by_control(prepared, control=control)

        begun = runs(start)
        assert begun.run(mission).message == "cancelled by SIGINT"


def cancelled_by_control(prepared, *, control, **_):
    """The end of a run that somebody has cancelled."""
    report = RunReport(
        "cancelled", None, control.poll().cancel, RefereeReport(False, "", 0, 0), (), "flat", 1, 1.0, 1.0, 1.0, 1, "log"
    )
    return Finished(report, node_view(prepared.tree.root))


@pytest.mark.mission
def test_a_server_of_its_own_runs_what_is_called_and_ends_at_a_polite_kill(tmp_path):
    where = ["--out", str(tmp_path)]
    added = CliRunner().invoke(app, ["queue", "add", "go_to_pose", "--on", "call pose", "--no-record", *where])
    assert added.exit_code == 0, added.output
    serve = [sys.executable, "-m", "executive.cli", "queue", "serve", "--quiet", "--json", "--port", "0", *where]
    with subprocess.Popen(serve, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as server:
        port = next(int(line.split(":")[3].split("/")[0]) for line in server.stderr if line.startswith("Calls:"))
        token = (tmp_path / "missions.sqlite-token").read_text().strip()
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        bearer = {"Authorization": f"Bearer {token}"}
        connection.request("POST", "/missions/pose", json.dumps({"x": 6.0}), bearer)
        assert connection.getresponse().status == 202
        assert any(line.startswith("Written to") for line in server.stderr)
        server.send_signal(signal.SIGTERM)
        told, _ = server.communicate(timeout=60)
    assert server.returncode == 0
    assert json.loads(told) == {"missions": [{"mission": 2, "outcome": "success", "achieved": True}]}
    with MissionStore(tmp_path / "missions.sqlite") as store:
        (battery,) = store.rows("SELECT lowest_charge, last_charge, ended FROM mission WHERE ended")
        assert 0.9 < battery["lowest_charge"] <= battery["last_charge"] <= 1.0 and battery["ended"]
