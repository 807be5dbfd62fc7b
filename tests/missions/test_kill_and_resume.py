"""A process is killed in the middle of a mission; another takes the mission up and does nothing twice."""

import json
import signal
import subprocess
import sys
import time

import pytest
from typer.testing import CliRunner

from executive.cli.entry import app
from executive.record.history import read_events
from plant.diagram import TIME_STEP_S
from plant.snapshot_file import SnapshotError, read_snapshot

ERRAND = (sys.executable, "-m", "executive.cli")
FETCH = "Hey Alice, can you fetch me a drink from the kitchen"
TIDY = "Hey Alice, take a drink from the kitchen to the sideboard"
TELL = "Hey Alice, go to the living room, say hello, then go to the kitchen"
CARRIED, TOLD = {"detect": 1, "grasp": 1}, {"speak": 1, "navigate": 2}


def kill_in(leaf, after_s, process, out):
    """Kill the process when its robot has worked at a leaf of this name for so long."""
    begun_s = None
    while begun_s is None or clock_s(out) < begun_s + after_s:
        assert process.poll() is None, "it ended before it was killed"
        begun_s = begun_s or began_s(leaf, out)
        time.sleep(0.3)
    process.send_signal(signal.SIGKILL)
    process.wait()


def clock_s(out):
    try:
        return read_snapshot(out / ".errand" / "missions.plant").values["engine"]["steps"] * TIME_STEP_S
    except SnapshotError:
        return 0.0


def began_s(leaf, out):
    log = out / "last" / "log.mcap"
    events = read_events(log) if log.is_file() and log.stat().st_size > 2000 else ()
    for event in events:
        if event.topic == "transitions" and event.data["node"].endswith(f"/{leaf}") and event.data["to"] == "RUNNING":
            return float(event.data["t"])
    return None


def events_of(out):
    """Events of both lives, in order."""
    return [event for log in sorted((out / "last").glob("log*.mcap")) for event in read_events(log)]


def done_leaves(out):
    """The leaves that came to a good end by their own work, in both lives."""
    events = [event.data for event in events_of(out) if "node" in event.data]
    good = [event for event in events if event.get("to") == "SUCCESS" and not event.get("restored", False)]
    return [event["node"].rsplit("/", 1)[-1] for event in good]


def killed_and_resumed(sentence, leaf, after_s, done, out, *more):
    """Kills a run in a leaf and takes it up; checks that it ends right and that each leaf was done as often as said."""
    options = ("--seed", "1", "--out", str(out), "--no-record", "--quiet", *more)
    with (out / "told.txt").open("wb") as told:
        process = subprocess.Popen((*ERRAND, "run", "--say", sentence, *options), stdout=told, stderr=told)
        kill_in(leaf, after_s, process, out)
    ended = CliRunner().invoke(app, ["resume", "--out", str(out), "--quiet", "--json"])
    assert ended.exit_code == 0, ended.stderr
    report = json.loads(ended.stdout.splitlines()[-1])
    assert (report["outcome"], report["referee"]["success"], report["referee"]["drops"]) == ("success", True, 0)
    assert any(" success before the restart: " in told for told in report["resumed"])
    lifted = sum(" lifted the " in line for line in ended.stderr.splitlines() if line.startswith("  Alice"))
    assert lifted == done.get("grasp", 0)
    leaves = done_leaves(out)
    assert {name: leaves.count(name) for name in done} == done
    return report


@pytest.mark.mission
@pytest.mark.nightly
@pytest.mark.parametrize(("sentence", "leaf", "after_s"), [(FETCH, "grasp", 7.0), (TIDY, "place", 6.0)])
def test_a_killed_mission_is_taken_up_and_ends_right(sentence, leaf, after_s, tmp_path):
    killed_and_resumed(sentence, leaf, after_s, CARRIED, tmp_path)


@pytest.mark.mission
def test_a_killed_mission_is_taken_up_on_the_way_and_takes_another_door_when_one_has_closed(tmp_path):
    file = tmp_path / "door.yaml"
    file.write_text("events:\n  - {door: [kitchen, living room], closes: 1 s}\n", encoding="utf-8")
    report = killed_and_resumed(TELL, "speak", 2.5, TOLD, tmp_path, "--scenario", str(file))
    assert report["referee"]["collisions"] == 0
    events = events_of(tmp_path)
    told = [event.data["message"] for event in events if event.topic == "control"]
    assert "the door between kitchen and living room closes" in told
    assert min(event.data["pose"]["position"]["x"] for event in events if event.topic == "pose") < 7.4  # by the hall
