"""Features whose other tests run on scripted parts: one case each in the plant."""

import json
import math
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace

import pytest
from typer.testing import CliRunner
from websockets.sync.client import connect

from executive import run_mission
from executive.app.prepare.from_request import prepare
from executive.app.runs.backend import LiveLog
from executive.app.runs.one_run import run_request
from executive.cli.entry import app
from executive.mission.request import Request
from executive.record.history import read_events
from executive.run.control import Control
from executive.view.foxglove import LiveServer
from plant.worlds.seeding import add_answers
from plant.worlds.world import load_world
from skills.robot import Pose2D
from tests.benchmarks import errand_process
from tests.executive.view.test_foxglove import PROTOCOL, Client
from tests.visitors import OnTick

pytestmark = [pytest.mark.mission, pytest.mark.nightly]

FULFILLED = ("success", True)


def errand(*arguments):
    """Runs a command; the last line of its output as JSON, and the whole output."""
    done = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout.splitlines()[-1]), done.output


def judged(report):
    return report["outcome"], report["referee"]["success"]


def written(folder, text):
    path = folder / "mission.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def run_file(folder, text, **fields):
    """The report of a mission file."""
    return run_mission(Request(file=written(folder, text), seed=1, out=folder / "out", record=False, **fields))


def test_a_varied_world_with_passers_by_and_random_faults_is_driven_through_and_profiled(tmp_path):
    varied = ("--light", "dim", "--clutter", 3, "--friction", 0.5, "--people", 1, "--random-faults", 3)
    options = ("--seed", 3, "--no-record", "--profile", "--out", tmp_path)
    report, printed = errand("run", "--say", "go to the kitchen", *varied, *options)
    assert judged(report) == FULFILLED
    assert all(name in printed for name in ("plant.robots", "plant.referee", "skills.navigate")), printed
    events = read_events(tmp_path / "log.mcap")
    assert len(next(event.data["scenario"] for event in events if "scenario" in event.data)) == 3


def test_the_log_of_a_recorded_mission_of_two_robots_is_read_in_every_form(tmp_path):
    """Fetch and Spot, each with a place to go to."""
    text = "name: two\nrobots: {alice: spot, bob: fetch}\nparts:\n"
    text += "  alice: {steps: [{to: hall}]}\n  bob: {steps: [{to: office}]}\n"
    report = run_mission(Request(file=written(tmp_path, text), seed=1, out=tmp_path / "out"))
    assert report.achieved and report.referee.collisions == 0, report.message
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {"map.png", "recording.html", "report.html"}
    log = tmp_path / "out" / "log.mcap"
    for arguments in (("ros2", "bag", log, "--out", tmp_path / "ros2.mcap"),
                      ("replay", log, "--out", tmp_path / "replay.html")):  # fmt: skip
        done = CliRunner().invoke(app, [*map(str, arguments)])
        assert done.exit_code == 0, done.output
        assert arguments[-1].stat().st_size > 10_000


def test_a_queue_goes_on_in_the_world_that_the_mission_before_left(tmp_path):
    for place in ("hall", "living room"):
        errand("queue", "add", "--say", f"go to the {place}", "--no-wake", "--no-record", "--store", tmp_path / "q.db")
    where = ["--store", str(tmp_path / "q.db"), "--out", str(tmp_path)]
    done = CliRunner().invoke(app, ["queue", "run", *where, "--quiet"])
    assert done.exit_code == 0, done.output
    logs = [read_events(log) for log in sorted(tmp_path.rglob("log.mcap"))]
    first, second = sorted(logs, key=lambda events: events[0].stamp_s)
    assert second[0].stamp_s >= first[-1].stamp_s > 0.0
    ended, began = (
        [event.data["pose"]["position"] for event in events if event.topic == "pose"] for events in (first, second)
    )
    assert math.dist(ended[-1].values(), began[0].values()) < 0.2


def test_a_run_is_stopped_stepped_broken_off_at_a_node_and_cancelled(tmp_path):
    """2 s: stop button; 3 s: released, a step of one tick; then on to the breakpoint; then cancelled."""
    text = "name: round\nsteps: [{to: hall}, {to: kitchen}]\nalways: [{speak: Bye}]\n"
    prepared = prepare(Request(file=written(tmp_path, text), seed=1, out=tmp_path / "out", record=False))
    control, cancelled, places = Control(pace=None), [], {}
    second = next(path for path in prepared.tree.path_ids if "2-kitchen" in path and path.endswith("navigate"))
    control.set_breakpoint(second)

    def observe(progress):
        status = progress.robots["Alice"]
        places[round(progress.now_s, 2)] = status.pose
        match round(progress.now_s, 2):
            case 2.0:
                control.stop_button()
            case 3.0:
                control.release_stop_button()
                control.step(1)
            case 3.5:
                control.resume()
        if control.state.at == second and not cancelled:
            cancelled.append(progress.now_s)
            control.cancel()

    finished = run_request(prepared, visitors=[OnTick(observe)], control=control)
    at = {now_s: (places[now_s].x_m, places[now_s].y_m) for now_s in (2.5, 3.0, 3.2, 3.5)}
    assert max(math.dist(at[2.5], at[3.0]), math.dist(at[3.2], at[3.5])) < 0.02
    assert finished.report.outcome == "cancelled"
    spoken = [event.data for event in read_events(tmp_path / "out" / "log.mcap") if event.topic == "speech"]
    assert [each["text"] for each in spoken] == ["Bye"]


def test_a_person_is_asked_and_answers(tmp_path):
    text = "name: ask\nsteps:\n  - {to: Robin}\n  - ask: Do you want a drink?\n    choices: {'yes': null, 'no': null}\n"
    prepared = prepare(Request(file=written(tmp_path, text), seed=1, out=tmp_path / "out", record=False))
    world = add_answers(prepared.world, {"Robin": {"drink": "yes"}})
    report = run_request(replace(prepared, world=world)).report
    assert report.achieved, report.message
    assert "yes" in str(report.answers)


def test_zones_of_a_sentence_hold_while_it_is_done(tmp_path):
    text = "name: quiet\nzones: [{keep_out: kitchen}, {silent: hall}]\n"
    report = run_file(tmp_path, text + "steps: [{to: hall}, {speak: Hello}]\n")
    assert report.achieved, report.message
    assert len(report.zones) == 2
    spoken = [event.data for event in read_events(tmp_path / "out" / "log.mcap") if event.data.get("text") == "Hello"]
    assert spoken and all(each["silent"] for each in spoken)


def test_a_fleet_goes_on_when_a_robot_dies(tmp_path):
    for place in ("hall", "kitchen"):
        errand("queue", "add", "--say", f"Go to the {place}", "--no-wake", "--no-record", "--store", tmp_path / "q.db")
    robots = "alice=spot@8.7,4.0,1.57,bob=spot@8.4,6.5,1.57"
    options = ("--robots", robots, "--seed", 2, "--no-record", "--fault", "alice: robot dies at 1 s")
    missions = errand("fleet", "run", tmp_path / "q.db", *options)[0]["missions"]
    assert [(each["robot"], each["outcome"]) for each in missions] == [("Bob", "success")] * 2
    assert all(each["referee"]["success"] for each in missions)


def test_a_moved_dock_is_found_by_its_tag(tmp_path):
    world = tmp_path / "world"
    shutil.copytree(load_world("flat").folder, world)
    made = CliRunner().invoke(app, ["object", "tag", "520", "--size", "0.146", "--out", str(world / "tag_520")])
    assert made.exit_code == 0, made.output
    with (world / "world.dmd.yaml").open("a") as file:
        file.write(
            "- add_model: {name: dock_tag, file: package://world/tag_520/tag_520.sdf}\n"
            "- add_weld:\n    parent: world\n    child: dock_tag::tag_520\n"
            "    X_PC: {translation: [11.8, 4.95, 0.4], rotation: !Rpy {deg: [90, 0, 270]}}\n"
        )
    with (world / "knowledge.yaml").open("a") as file:
        file.write("tags:\n  - {id: 520, size: 0.146, on: dock, at: [11.8, 4.95, 0.4], yaw: 3.1416}\n")
    here = {"world": str(world), "start": Pose2D(9.2, 4.0, 3.1416)}
    report = run_file(tmp_path, "name: dock\nsteps: [{say: charge}]\n", **here)
    assert report.achieved, report.message
    events = [event.data for event in read_events(tmp_path / "out" / "log.mcap") if event.topic == "transitions"]
    located = [each["message"] for each in events if "locate" in each["node"] and each["to"] == "SUCCESS"]
    assert any("tag shows the dock" in message for message in located)


def test_the_arm_is_posed_as_a_file_says(tmp_path):
    posture = "{joints: [0.0, -1.6, 1.8, 0.0, 0.4, 0.0], opening: 0.5}"
    report = run_file(tmp_path, f"name: pose\nsteps:\n  - skill: pose_arm\n    with: {posture}\n")
    assert report.achieved, report.message


def test_a_robot_backs_off_forgets_its_obstacles_and_goes_on(tmp_path):
    back_off = "{skill: back_off, with: {distance_m: 0.5}}"
    file = written(tmp_path, f"name: back\nsteps:\n  - {back_off}\n  - {{skill: clear_costmap}}\n  - {{to: hall}}\n")
    report = run_request(prepare(Request(file=file, seed=1, out=tmp_path / "out", record=False))).report
    assert (report.achieved, report.seen.collisions) == (True, 0), report.message
    events = read_events(tmp_path / "out" / "log.mcap")
    changes = [each.data for each in events if each.topic == "transitions" and each.data["to"] == "SUCCESS"]
    done_s = {each["node"].rsplit("/", 1)[-1]: each["t"] for each in changes}
    assert done_s["1-back-off"] < done_s["2-clear-costmap"] < done_s["3-hall"]
    places = [(each.stamp_s, each.data["pose"]["position"].values()) for each in events if each.topic == "pose"]
    _, there = min(places, key=lambda place: abs(place[0] - done_s["1-back-off"]))
    assert math.dist(places[0][1], there) == pytest.approx(0.5, abs=0.15)


def test_a_viewer_follows_a_mission_in_the_plant(tmp_path):
    prepared, reading = prepare(Request(sentence="go to the hall", seed=1, out=tmp_path, record=False)), []
    with (
        closing(LiveServer("127.0.0.1:0")) as server,
        ThreadPoolExecutor(1) as thread,
        connect(server.url, subprotocols=[PROTOCOL], max_size=None) as socket,
    ):
        view = OnTick(lambda progress: reading or reading.append(thread.submit(Client(socket).messages, 100)))
        assert run_request(prepared, visitors=[view, LiveLog(server)]).report.achieved
        topics = {topic for topic, *_ in reading[0].result(timeout=10.0)}
    assert topics >= {"map", "pose", "tree", "transitions"}, topics


def test_a_run_with_faults_and_a_recording_is_killed_and_goes_on(tmp_path):
    asked = ("--say", "Hey Alice, fetch me a drink from the kitchen", "--seed", 2, "--random-faults", 2)
    with (tmp_path / "told.txt").open("wb") as told:
        process = subprocess.Popen(
            errand_process.errand("run", *asked, "--out", tmp_path, "--quiet"), stdout=told, stderr=told
        )
        assert errand_process.kill_at(process, tmp_path, 20.0)
    ended = errand_process.run_errand("resume", "--out", tmp_path, "--quiet", "--json")
    report = errand_process.report_of(ended.stdout)
    assert (report["outcome"], report["referee"]["success"]) == ("success", True), ended.stderr
    assert (tmp_path / "recording.html").stat().st_size > 10_000
