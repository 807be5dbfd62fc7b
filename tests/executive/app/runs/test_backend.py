"""A run on a backend without plant, referee and recorder: nothing but the backend knows that it is not simulated."""

import json
import signal
import socket
import sys
from dataclasses import replace
from importlib.metadata import entry_points

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.report.run_report import RunReport
from executive.app.runs.backend import LiveLog, observer
from executive.app.runs.backend import observers as opened_observers
from executive.app.runs.one_run import entry_for, run_request
from executive.app.runs.profile import Profile
from executive.mission.request import Request
from executive.mission.scenario import Scenario
from executive.record.history import read_events
from executive.run.outcome import Outcome
from executive.run.worker import ThreadWorker
from executive.words.zone import ZoneFacts
from skills.api import ZoneKind
from skills.inputs.errors import InputError
from tests.executive.app.runs.scripted_backend import ScriptedBackend
from tests.executive.cli.calls import refusal
from tests.executive.distribution import write_distribution
from tests.visitors import OnTick


@pytest.fixture
def prepared(tmp_path, monkeypatch):
    monkeypatch.setattr("executive.app.prepare.from_request.load_parser", lambda: None)  # no step here is a sentence
    path = tmp_path / "drive.yaml"
    path.write_text("name: drive\nsteps:\n  - {skill: navigate, with: {x: 1.0, y: 0.5}}\n")
    return prepare(Request(file=path, out=tmp_path / "out", seed=4))


def test_a_run_without_a_referee_is_achieved_when_the_tree_says_so(prepared):
    backend = ScriptedBackend()
    report = run_request(prepared, backend).report
    assert (report.outcome, report.referee, report.achieved, report.false_claim) == ("success", None, True, False)
    assert backend.asked == [("drive", Outcome.SUCCESS)]
    x_m, y_m, _ = backend.robot.odometry().X_OB.translation()
    assert (x_m, y_m) == (pytest.approx(1.0, abs=0.2), pytest.approx(0.5, abs=0.2))


def test_a_run_uses_the_worker_that_it_is_given_and_closes_it(prepared):
    class Counting(ThreadWorker):
        """One that counts its jobs."""

        jobs, closed = 0, False

        def submit(self, work, *, latency_s, name):
            self.jobs += 1
            return super().submit(work, latency_s=latency_s, name=name)

        def close(self):
            self.closed = True
            super().close()

    worker = Counting()
    assert run_request(prepared, ScriptedBackend(), worker=worker).report.outcome == "success"
    assert (worker.jobs > 0, worker.closed) == (True, True)


def test_the_report_names_the_zones_that_the_robot_minds(prepared):
    quiet = {"hall": ZoneFacts(kind=ZoneKind.SILENT, place="hall")}
    zoned = prepared.with_mission(prepared.mission.model_copy(update={"zones": quiet}))
    report = run_request(zoned, ScriptedBackend()).report
    assert report.to_json()["zones"] == ["silent in: hall"]
    assert "  silent in: hall" in report.lines()
    assert "silent in: hall" in (zoned.request.out / "report.html").read_text(encoding="utf-8")
    assert "zones" not in run_request(prepared, ScriptedBackend()).report.to_json()


def test_the_report_of_a_run_without_a_referee_says_so(prepared):
    report = run_request(prepared, ScriptedBackend()).report
    told = json.loads(json.dumps(report.to_json()))
    assert told["referee"] is None
    assert RunReport.from_json(told) == report
    lines = list(report.lines())
    assert lines[1] == (
        "[bold]No referee:[/bold] [yellow]?[/yellow] not judged: nobody saw the truth, so only the tree's claim counts"
    )
    assert lines[2] == f"{report.sim_time_s:.1f} s, {report.ticks} ticks"
    page = (prepared.request.out / "report.html").read_text(encoding="utf-8")
    assert "nobody saw the truth" in page
    assert not any(word in text for word in ("collisions", "simulated") for text in (page, *lines))


def test_the_report_says_how_a_real_robot_sensed(prepared):
    class Blind(ScriptedBackend):
        """One without a LiDAR."""

        notes = ("There is no LiDAR.",)

    report = run_request(prepared, Blind()).report
    assert RunReport.from_json(json.loads(json.dumps(report.to_json()))).notes == ("There is no LiDAR.",)
    assert "  There is no LiDAR." in list(report.lines())
    assert "There is no LiDAR." in (prepared.request.out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(("number", "hurries"), [(signal.SIGTERM, True), (signal.SIGINT, False)])
def test_sigterm_shortens_what_a_run_leaves(prepared, number, hurries):
    backend, coming = ScriptedBackend(), [number]
    ended = run_request(
        prepared, backend, visitors=[OnTick(lambda progress: coming and signal.raise_signal(coming.pop()))]
    )
    assert (ended.report.outcome, "hurry" in backend.asked) == ("cancelled", hurries)


def test_faults_and_events_are_at_work_logged_and_in_the_report(prepared):
    class Busy(ScriptedBackend):
        """One in whose world something happens."""

        def happened(self):
            return [(0.5, "a door closes")] if self.clock.now() > 0.5 else []

    scenario = Scenario(("lidar: dropout 0.5 s at 1 s", "drive is stopped after 3 calls"))
    disturbed = replace(prepared, request=replace(prepared.request, scenario=scenario))
    report = run_request(disturbed, Busy()).report
    assert (report.outcome, report.scenario) == ("failure", tuple(f"fault: {words}" for words in scenario.faults))
    assert RunReport.from_json(json.loads(json.dumps(report.to_json()))) == report
    events = read_events(prepared.request.out / "log.mcap")
    told = [(event.data["what"], event.data["message"]) for event in events if event.topic == "control"]
    assert ("event", "a door closes") in told
    assert ("fault", "drive is stopped after 3 calls: begins") in told
    assert next(event.data["scenario"] for event in events if event.topic == "run") == list(report.scenario)


def test_a_fault_that_ends_is_logged_and_the_robot_goes_on(prepared):
    scenario = Scenario(("lidar: dropout 0.5 s at 1 s",))
    report = run_request(replace(prepared, request=replace(prepared.request, scenario=scenario)), ScriptedBackend())
    assert report.report.outcome == "success"
    events = read_events(prepared.request.out / "log.mcap")
    told = [(round(event.stamp_s, 2), event.data["message"]) for event in events if event.topic == "control"]
    assert told == [(1.0, "lidar: dropout 0.5 s at 1 s: begins"), (1.5, "lidar: dropout 0.5 s at 1 s: is over")]


@pytest.mark.parametrize(
    ("fault", "charge"), [("alice: battery falls to 5 %", 0.05), ("bob: battery falls to 5 %", None)]
)
def test_a_fault_that_names_a_robot_is_at_work_in_this_robot_alone(prepared, fault, charge):
    backend, robots = ScriptedBackend(), {**prepared.robots, "Bob": prepared.robots["Alice"]}
    request = replace(prepared.request, scenario=Scenario((fault,)))
    robot = entry_for(replace(prepared, request=request, robots=robots), backend, None).robot
    assert robot.battery().charge == (charge or backend.robot.battery().charge)
    assert fault in getattr(robot, "faults_at_work", lambda: fault)()


def test_its_work_is_in_report_and_log_and_its_parts_are_timed(prepared):
    profile = Profile()
    report = run_request(prepared, ScriptedBackend(), visitors=[profile]).report
    logged = [event.data for event in read_events(prepared.request.out / "log.mcap") if event.topic == "work"]
    assert logged == [dict(report.work)]
    assert (report.work["calls"] > 10, report.work["planner_expansions"] > 0) == (True, True)
    assert {"skills.navigate", "skills.testing", "executive.run", "executive.tree"} <= set(profile.table())


def test_log_and_tree_are_left_as_after_a_simulated_run(prepared):
    run_request(prepared, ScriptedBackend())
    out = prepared.request.out
    assert sorted(path.name for path in out.iterdir()) == ["log.mcap", "report.html", "tree.svg"]
    topics = {event.topic for event in read_events(out / "log.mcap")}
    assert {"map", "run", "tree", "transitions", "pose", "state", "outcome"} <= topics


def test_a_run_whose_tree_fails_is_not_achieved(prepared):
    root, mission = prepared.tree.root, prepared.tree.mission
    (drive,) = mission.children
    short = replace(mission, children=(replace(drive, options={**drive.options, "limit_s": 0.01}),))
    tree = replace(prepared.tree, root=replace(root, children=(*root.children[:-1], short)))
    report = run_request(replace(prepared, tree=tree), ScriptedBackend()).report
    assert (report.outcome, report.cause, report.achieved) == ("failure", "TIMEOUT", False)


OBSERVERS = """
from executive.run.visitor import RunVisitor
from skills.inputs.errors import InputError

class Watcher(RunVisitor):
    def __init__(self, path):
        self.path = path
    def end(self, result):
        self.path.write_text(f"{result.worst.outcome.value} after {result.ticks} ticks")

def watch(value):
    if not value:
        raise InputError("a watcher needs a name")
    return lambda prepared, control: Watcher(prepared.request.out.with_name(value))
"""


@pytest.fixture
def observers(tmp_path, monkeypatch):
    """A distribution that registers an observer that works, and one that cannot be loaded."""
    (tmp_path / "watchers.py").write_text(OBSERVERS)
    lines = ("watch = watchers:watch", "gone = watchers:Gone")
    write_distribution(tmp_path, "watchers", "errand.observers", *lines)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("skills.inputs.plugins._all_installed", entry_points)
    yield
    sys.modules.pop("watchers", None)


def test_an_observer_of_a_plug_in_joins_a_run(prepared, observers):
    seen = observer("watch=seen")(prepared, None)
    run_request(prepared, ScriptedBackend(), visitors=[seen])
    assert seen.path.read_text().startswith("success after")


# what is asked for -> why it is refused
@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("absent", "there is no observer 'absent'"),
        ("", "there is no observer ''"),
        ("gone", "cannot observe"),
        ("gone=3", "cannot observe"),
    ],
)
def test_an_observer_that_cannot_be_loaded_is_refused(observers, text, why):
    with pytest.raises(InputError, match=why):
        observer(text)


def test_an_observer_that_takes_no_such_value_says_why(observers):
    with pytest.raises(InputError, match="needs a name"):
        observer("watch")
    assert "a watcher needs a name" in refusal("run", "patrol", "--observe", "watch")


def test_the_observer_foxglove_names_its_address_and_ends_with_the_block(caplog):
    with opened_observers(["foxglove=127.0.0.1:0"]) as (foxglove,):
        (line,) = caplog.messages
        assert line.startswith("Foxglove: ws://127.0.0.1:")
        port = int(line.rpartition(":")[2])
        socket.create_connection(("127.0.0.1", port)).close()
        assert isinstance(foxglove(None, None), LiveLog)
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))


def test_an_address_that_cannot_be_served_is_refused():
    with pytest.raises(InputError, match="no address with a port"), opened_observers(["foxglove=nowhere"]):
        pass
