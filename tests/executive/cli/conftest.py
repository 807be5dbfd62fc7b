"""Lets the tests here import the skills' small detector, the made speech of the speech's tests, and a backend."""

import sys
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

from executive.app.evaluate import evaluation
from executive.app.evaluate.workers import Pool
from executive.app.evaluate.workers import WorkResult as Done
from executive.app.report.run_report import RunReport
from executive.app.runs.one_run import FinishedRun
from executive.cli import entry, listen_command
from executive.language.parser import DependencyParser
from executive.record.event_log import EventLog
from executive.tree.node_view import node_view
from executive.words.goal import RefereeReport
from skills.testing.clock import VirtualClock
from tests.plant.imported_box import write_box

sys.path[:0] = [str(Path(__file__).parents[2] / "skills"), str(Path(__file__).parents[1] / "speech")]
sys.path.append(str(Path(__file__).parent))


@pytest.fixture(autouse=True, scope="session")
def commands_are_built_once():
    """A process calls one command; the tests call each of them many times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(entry, "shipped_command", cache(entry.shipped_command))
        yield


@pytest.fixture(autouse=True)
def language_model_stays(monkeypatch):
    """A run releases the model that its sentence needed; here the next call needs it again."""
    monkeypatch.setattr(DependencyParser, "release", lambda _: None)


@pytest.fixture
def drill(tmp_path):
    """The folder of an imported drill, of the class wrench."""
    return write_box(tmp_path / "drill", "drill", "wrench")


@pytest.fixture
def two_robots(tmp_path, clock):
    """The log of Alice and Bob, each with a tree of one node."""
    log = EventLog(tmp_path / "log.mcap", clock, apart=True)
    for name in ("Alice", "Bob"):
        node = {"id": f"{name.lower()}/go", "type": "skill", "name": f"go as {name}", "children": []}
        log("tree", {"robot": name, "root": node})
        done = {"t": 1.0, "robot": name, "node": node["id"], "from": "RUNNING", "to": "SUCCESS", "cause": None}
        log("transitions", {**done, "message": f"{name} is there"})
    log("control", {"t": 1.0, "what": "pause", "message": "Bob: let me look"})
    log.close()
    return log.path


@pytest.fixture
def says(monkeypatch):
    """Makes the recogniser hear the given texts one after another."""
    from made_speech import LoudIsSpeech, ScriptedRecogniser

    def script(*texts):
        monkeypatch.setattr(listen_command, "load_whisper", lambda: ScriptedRecogniser(list(texts)))
        monkeypatch.setattr(listen_command, "load_detector", LoudIsSpeech)

    return script


@pytest.fixture
def wav(tmp_path, says):
    """A recording in which the recogniser hears a request."""
    from made_speech import speech_like, write_wav

    says("Hey Alice, go to the kitchen.")
    return write_wav(tmp_path / "a.wav", speech_like(0.5, 2.0, 0.5))


class Here:
    """Does the work in this process; the last run first."""

    count = 1

    def map_items(self, function, items):
        return (Done(item, function(item)) for item in reversed(items))


class Plant:
    """Stands in for the plant: what was asked for, and how a run of a seed ends."""

    def __init__(self):
        self.asked = []
        self.ends = lambda request: ("success", RefereeReport(True, "it is so", 0, 0))

    def __call__(self, prepared):
        request = prepared.request
        self.asked.append(request)
        EventLog(request.out / "log.mcap", VirtualClock()).close()
        outcome, referee = self.ends(request)
        facts = (prepared.world.name, request.seed, 9.0, 1.0, 9.0, 90, "log.mcap")
        return FinishedRun(RunReport(outcome, None, "done", referee, (), *facts), node_view(prepared.tree.root))


@pytest.fixture
def plant(monkeypatch):
    stand_in = Plant()

    @contextmanager
    def opened(_):
        yield Here()

    monkeypatch.setattr(evaluation, "run_request", stand_in)
    monkeypatch.setattr(Pool, "opened", opened)
    return stand_in
