"""`errand run --view`: sentences from the page are done first or queued; a whole mission is told while it runs."""

import json
import re
import subprocess
import sys
from contextlib import closing, suppress
from functools import partial
from types import SimpleNamespace

import pytest
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from executive.app.prepare.from_request import prepare
from executive.app.runs.backend import OpenRun
from executive.app.runs.page_view import PageView, add_to, queue_function, sentence_action
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.run.control_state import Mode
from executive.store.missions import MissionState, MissionStore
from executive.view.page_control import RefusedError
from skills.inputs.errors import InputError


@pytest.fixture(scope="module")
def prepared():
    return prepare(Request("go to the kitchen", seed=5))


@pytest.fixture
def page(prepared):
    page = PageView(prepared, lambda line: None)
    page.control.begin({"Alice": prepared.tree})
    page.conversations.set_missions()
    yield page
    page.close()


def test_a_sentence_becomes_a_mission_that_is_done_first(page):
    say = sentence_action(page.hear)
    assert "[bathroom]" in say({"text": "go to the bathroom"})
    (tree,) = (request.tree for request in page.control.poll().missions)
    assert [command.goal for command in tree.commands] == ["bathroom"]


@pytest.mark.parametrize(
    ("text", "words"),
    [("go to the moon", "moon"), ("what time is it", "understand"), ("  ", "needs a text"), (3, "needs a text")],
)
def test_a_sentence_that_is_not_understood_is_refused_with_the_reason(page, text, words):
    with pytest.raises(RefusedError, match=words):
        sentence_action(page.hear)({"text": text})
    assert page.control.poll().missions == ()


def test_remarks_act_at_once_and_are_answered(page):
    say = sentence_action(page.hear)
    assert say({"text": "wait"}).startswith("I wait")
    assert page.control.state.mode is Mode.PAUSED
    assert say({"text": "go on"}) == "I go on"
    assert page.control.state.mode is Mode.RUNNING
    assert "not begun" in say({"text": "where are you"})


def test_a_question_is_asked_on_the_page_and_answered_there(page):
    say = sentence_action(page.hear)
    assert say({"text": "put the cube on the table"}) == "Which table: kitchen table or coffee table?"
    assert "[coffee table]" in say({"text": "the coffee table"})
    (tree,) = (request.tree for request in page.control.poll().missions)
    assert tree.commands[-1].goal == "coffee table"


def test_a_correction_takes_the_place_of_the_mission(page):
    assert sentence_action(page.hear)({"text": "no, to the bathroom"}).startswith("instead: ")
    (request,) = page.control.poll().missions
    assert (request.tree.commands[0].goal, request.instead_of) == ("bathroom", "go kitchen")


def queue_in(store, prepared):
    return queue_function(prepared.request, partial(add_to, store))


def test_a_sentence_is_queued_for_later(prepared, tmp_path):
    later = queue_in(tmp_path / "missions.sqlite", prepared)
    assert later("go to the bathroom").startswith("queued as mission 1")
    with MissionStore(tmp_path / "missions.sqlite", create=False) as missions:
        (mission,) = missions.missions(MissionState.QUEUED)
    asked = mission.request
    assert (asked.sentence, asked.seed, asked.world_name) == ("go to the bathroom", 5, "flat")


def test_a_shipped_mission_is_queued_for_later_with_its_parameters(prepared, tmp_path):
    later = queue_in(tmp_path / "missions.sqlite", prepared)
    assert later("visit_room room=office thing=hammer").startswith("queued as mission 1")
    with pytest.raises(InputError, match="has no parameter 'rom'; did you mean 'room'"):
        later("visit_room rom=office")
    with MissionStore(tmp_path / "missions.sqlite", create=False) as missions:
        (mission,) = missions.missions(MissionState.QUEUED)
    assert mission.request.given == {"room": "office", "thing": "hammer"}


@pytest.mark.mission
def test_a_mission_is_told_to_the_page_while_it_runs_and_after(tmp_path):
    said = ["--say", "go to the living room", "--no-wake", "--quiet", "--no-record", "--json"]
    command = [sys.executable, "-m", "executive.cli", "run", *said, "--view", "0.5", "--out", str(tmp_path)]
    told: list[dict] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None and process.stdout is not None
        lines = iter(process.stderr.readline, "")
        address = next(match for line in lines if (match := re.search(r"http://([\d.:]+)/\?(token=[\w-]+)", line)))
        with connect(f"ws://{address[1]}/feed?{address[2]}", proxy=None) as socket, suppress(WebSocketException):
            while True:
                told.extend(json.loads(socket.recv(timeout=60)))
        process.stderr.read()
        report = json.loads(process.stdout.read().splitlines()[-1])
    topics = {message.get("topic") or message.get("live") for message in told}
    assert report["outcome"] == "success"
    assert {"hello", "map", "run", "tree", "transitions", "pose", "state", "path", "progress"} <= topics
    assert {"control", "outcome"} <= topics
    assert next(message["data"]["outcome"] for message in told if message.get("topic") == "outcome") == "success"


class CountedScene:
    """A scene that counts its refreshes."""

    refreshes = 0

    def page(self):
        return b""

    def send(self, tell, wanted):
        self.tell = tell

    def publish(self):
        self.refreshes += 1
        self.tell({"poses": {}})


def test_a_page_opened_after_the_run_gets_the_last_poses(page, tmp_path, clock):
    scene = CountedScene()
    with closing(EventLog(tmp_path / "log.mcap", clock)) as log:
        page.opened(OpenRun(log, SimpleNamespace(show_live=lambda: scene)))
    page.stay(0.1)
    assert scene.refreshes == 1
    assert [json.loads(text)["data"] for text in page._feed.since((0, 0))[1] if '"scene"' in text] == [{"poses": {}}]
