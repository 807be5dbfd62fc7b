"""`report.html` of a run: its steps, what was said and answered; small, and closed to what a text could break."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from py_trees.common import Status

from executive.app.prepare.from_request import prepare
from executive.app.report.artifacts import MOST_BYTES, Artifacts
from executive.app.report.report_page import MissionRow, ReportPage, ReportPart, StepRow, step_rows
from executive.app.report.run_report import ReportedAnswer, ReportedObject, RobotReport, RunReport
from executive.app.runs.backend import LiveLog
from executive.app.runs.one_run import mission_events, run_request
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.record.history import read_events
from executive.run.outcome import Said
from executive.run.visitor import RunEntry
from executive.tree.node import NodeState
from executive.tree.node_view import NodeView
from executive.view.html import render
from executive.view.text import Styles
from executive.words.goal import RefereeReport
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause
from skills.robot import Pose2D
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot
from tests.executive.app.runs.scripted_backend import ScriptedBackend
from tests.visitors import OnMessage

TALK = """
name: talk <b>
steps:
  - {skill: speak, with: {text: "Hello & <i>welcome</i>"}}
  - {skill: navigate, with: {x: 0.5, y: 0.0}}
  - {skill: speak, with: {text: "Here I am"}}
"""


@pytest.fixture
def talk(tmp_path, monkeypatch):
    monkeypatch.setattr("executive.app.prepare.from_request.load_parser", lambda: None)
    path = tmp_path / "talk.yaml"
    path.write_text(TALK)
    return prepare(Request(file=path, out=tmp_path / "out", seed=4, record=False))


def test_speech_is_in_report_and_page(talk):
    heard = []
    speech = OnMessage(lambda topic, message: heard.append(message["text"]) if topic == "speech" else None)
    report = run_request(talk, ScriptedBackend(), visitors=[speech]).report
    assert [one.text for one in report.said] == heard == ["Hello & <i>welcome</i>", "Here I am"]
    page = (talk.request.out / "report.html").read_text(encoding="utf-8")
    assert "Hello &amp; &lt;i&gt;welcome&lt;/i&gt;" in page
    assert "<i>" not in page
    assert page.count("said &#34;") >= 2
    assert "The map, with the path of the robot" in page


def test_messages_of_a_run_are_sent_live_from_its_beginning(talk):
    sent = []
    live = SimpleNamespace(follow=lambda log: log.listen(lambda message: sent.append((message.topic, message.data))))
    run_request(talk, ScriptedBackend(), visitors=[LiveLog(live)])
    events = read_events(talk.request.out / "log.mcap")
    assert [(topic, json.loads(data)) for topic, data in sent] == [(event.topic, event.data) for event in events]
    assert sent[0][0] == "map"


def test_the_report_is_the_same_after_json():
    report = RunReport("success", None, "m", None, ("Take",), "flat", 1, 1.0, 1.0, 1.0, 20, "log")
    answers = (
        ReportedAnswer("q", "in the shed", "Robin: in the shed", 2.5, "hall", 0),
        ReportedAnswer("q", 3, "s", 4.0),
    )
    seen = (ReportedObject("coke", "table", "kitchen", (1.0, 2.0, 0.8), 3.0),)
    told = RunReport(**{**vars(report), "answers": answers, "said": (Said(1.0, "Hello"),), "seen_objects": seen})
    values = json.loads(json.dumps(told.to_json()))
    assert RunReport.from_json(values) == told
    first = {"question": "q", "answer": "in the shed", "sentence": "Robin: in the shed", "t_s": 2.5}
    assert values["answers"][0] == {**first, "place": "hall", "picture": 0, "at_least": False}
    assert values["said"] == [{"t_s": 1.0, "text": "Hello", "asked": False}]


def test_pictures_of_many_answers_are_kept_up_to_a_limit():
    artifacts = Artifacts()
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    for number in range(90):
        artifacts.message("transitions", {"node": "alice/q", "t": float(number), "to": "RUNNING"})
        artifacts.message("detections", {"detections": [], "image": noise})
        artifacts.message(
            "answer", {"node": "alice/q", "t": float(number), "question": "q", "answer": False, "message": "m"}
        )
    assert 1 < len(artifacts.pictures) < 90
    assert sum(map(len, artifacts.pictures)) <= MOST_BYTES
    assert artifacts.numbers["alice/q", 0.0] == 0


def test_an_answer_without_a_view_has_no_picture():
    artifacts = Artifacts()
    artifacts.message("transitions", {"node": "alice/q", "t": 0.5, "to": "RUNNING"})
    artifacts.message("detections", {"detections": [], "image": np.zeros((48, 64, 3), np.uint8)})
    looked = {"node": "alice/q", "t": 1.0, "question": "q", "answer": False, "message": "m"}
    asked = {"node": "alice/ask", "t": 2.0, "question": "q", "answer": "yes", "message": "m"}
    assert ["image" in artifacts.message("answer", message) for message in (looked, asked)] == [True, False]
    assert list(artifacts.numbers) == [("alice/q", 1.0)]


def node(path, kind, name, *children, status=Status.SUCCESS, cause=None, message=""):
    return NodeView(path, kind, name, NodeState(status, cause, message), children=children)


def test_steps_are_the_parts_of_the_mission_below_what_they_belong_to():
    first, second = node("a/m/1/1", "sequence", "go to the hall"), node("a/m/1/2", "answer", "is there a hammer?")
    tidied = node("a/m/1/2/tidy", "afterwards", "stow in the end", second, node("a/m/1/2/stow", "skill", "stow"))
    used = node("a/m/1", "skip", "skip it", node("a/m/1/s", "sequence", "visit hall", first, tidied))
    last = node("a/m/2", "sequence", "go to the start", message="there")
    mission = node("a/m", "sequence", "patrol", node("a/m/r", "remember", "start"), used, last)
    rows = list(step_rows(mission, frozenset({"a/m/1/1", "a/m/1/2", "a/m/2"}), {"a/m/2": (3.0, 4.0)}))
    assert [(row.depth, row.name) for row in rows] == [
        (0, "visit hall"),
        (1, "go to the hall"),
        (1, "is there a hammer?"),
        (0, "go to the start"),
    ]
    assert (rows[-1].span_s, rows[-1].message, rows[-1].word) == ((3.0, 4.0), "there", "success")


def test_a_step_that_was_skipped_or_failed_says_so():
    failed = node("a/m/1/x", "sequence", "go", status=Status.FAILURE, cause=Cause.PLANNING, message="no way")
    skipped = node("a/m/1", "skip", "skip it", failed, message="skipped: no way")
    mission = node("a/m", "sequence", "m", skipped, failed, status=Status.FAILURE)
    rows = list(step_rows(mission, frozenset({"a/m/1/x"}), {}))
    assert [(row.word, row.message) for row in rows] == [
        ("skipped", "skipped: no way"),
        ("failure (PLANNING)", "no way"),
    ]


def write_log(path, commands, topic, message):
    log = EventLog(path, VirtualClock())
    log("run", {"world": "flat", "seed": 1, "commands": commands, "versions": {}})
    log(topic, message)
    log.close()


def test_the_logs_of_all_starts_of_a_mission_are_told_together(tmp_path):
    for name, commands in (("log", ["a"]), ("log-2", ["another"]), ("log-3", ["a"])):
        write_log(tmp_path / f"{name}.mcap", commands, name, {"t": 1.0})
    (tmp_path / "log-4.mcap").write_text("no log")
    write_log(tmp_path / "log-5.mcap", ["a"], "log-5", {"t": 1.0})
    topics = [event.topic for event in mission_events(tmp_path / "log-5.mcap") if event.topic != "run"]
    assert topics == ["log", "log-3", "log-5"]
    assert [event.topic for event in mission_events(tmp_path / "log.mcap")] == ["run", "log"]


def test_pictures_of_answers_from_before_a_restart_are_found_in_the_log(tmp_path):
    picture = np.full((48, 64, 3), 90, np.uint8)
    told = {"node": "alice/q", "t": 4.0, "question": "q", "answer": False, "message": "m"}
    write_log(tmp_path / "log.mcap", ["a"], "answer", {**told, "image": picture})
    artifacts = Artifacts()
    for _ in range(2):
        artifacts.recall(mission_events(tmp_path / "log.mcap"))
    assert (artifacts.numbers, len(artifacts.pictures)) == ({("alice/q", 4.0): 0}, 1)


class TwoRobots(ScriptedBackend):
    """Two scripted robots, 3 m apart."""

    def entry(self, tree, durable):
        robot = ScriptedRobot(self.clock, name=tree.robot_name, capabilities=spot_capabilities())
        place = Pose2D(0.0, 3.0 if tree.robot_name == "Bob" else 0.0, 0.0)
        return RunEntry(tree, robot, KnownPlace(place), BlockCostmap())


def test_a_run_with_two_robots_leaves_the_tree_and_the_steps_of_each(talk):
    def named(name):
        mission = talk.mission.model_copy(update={"robot": name})
        return replace(talk.with_mission(mission), robots=robots)

    robots = dict.fromkeys(("Alice", "Bob"), SimpleNamespace(kind="spot"))
    run_request(replace(named("Alice"), others=(named("Bob"),)), TwoRobots())
    out = talk.request.out
    assert sorted(path.name for path in out.glob("*.svg")) == ["tree_alice.svg", "tree_bob.svg"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert (page.count('class="part"'), page.partition("Over time")[0].count("<svg")) == (2, 2)
    assert ("Alice (spot)" in page, "Bob (spot)" in page) == (True, True)
    told = [event.data["robots"] for event in mission_events(out / "log.mcap") if event.topic == "run"]
    assert told == [{"Alice": "spot", "Bob": "spot"}] * 2


NASTY = "<script>alert(\"1\")</script> & 'x' \x1b[31m"
JPEG = b"\xff\xd8 a picture"


def part(title="Alice (spot)", colour="#0072b2", *, cause=None, message="done", referee=None, commands=(), **changes):
    report = RobotReport("success", cause, message, referee, commands, "spot")
    return ReportPart(title, colour, report, **changes)


def page(**changes):
    facts = {"title": "patrol", "request": "patrol and tell me what you saw", "facts": (("world", "flat"),)}
    return render("run.html", page=ReportPage(**{**facts, "alone": part(), **changes}))


class Reader(HTMLParser):
    """Notes tags and texts, and that every tag is closed in its turn."""

    VOID = frozenset({"meta", "link", "img", "br"})

    def __init__(self, html):
        super().__init__()
        self.tags, self.texts, self.open = [], [], []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.texts).split())


def test_answers_stand_in_order_with_time_place_and_picture():
    answers = (
        ReportedAnswer("hammer in the office", False, "no: no hammer in the office", 26.95, "office"),
        ReportedAnswer("hammer in the workshop", True, "yes: hammer in the workshop", 127.3, "workshop", 0),
        ReportedAnswer("Where is Robin?", "in the shed", "Robin is in the shed", 130.0),
    )
    read = Reader(page(answers=answers, answer_pictures=(JPEG,)))
    parts = ("0:26.9", "office", "hammer in the office?", "no", "2:07.3", "workshop", "yes", "Where is Robin?", "shed")
    places = [read.text.index(part, read.text.index("Answers")) for part in parts]
    assert places == sorted(places)
    (image,) = [attrs for tag, attrs in read.tags if tag == "img"]
    assert image["src"].startswith("data:image/jpeg;base64,")
    assert read.open == []


@pytest.mark.parametrize(
    "changes",
    [
        {"title": NASTY, "request": NASTY, "facts": ((NASTY, NASTY),)},
        {"alone": part(cause=NASTY, message=NASTY, commands=(NASTY,), referee=RefereeReport(None, NASTY, 0, 0))},
        {"parts": (part(NASTY, message=NASTY, commands=(NASTY,)),)},
        {"answers": (ReportedAnswer(NASTY, NASTY, NASTY, 0.0, NASTY, 0),), "answer_pictures": (JPEG,)},
        {
            "said": (Said(1.0, NASTY),),
            "seen": (ReportedObject(NASTY, NASTY, NASTY, (0.0, 0.0, 0.0), 1.0),),
            "events": (NASTY,),
        },
        {"alone": part(steps=(StepRow(NASTY, Styles.FAILURE.value, NASTY, 2, (0.0, 1.0), NASTY),))},
        {"map": (NASTY, JPEG), "alone": part(pictures=((NASTY, JPEG),))},
        {"missions": (MissionRow(1, NASTY, NASTY, True, NASTY, 1, NASTY),)},
    ],
)
def test_every_text_is_escaped(changes):
    html = page(**changes)
    read = Reader(html)
    assert not any(tag == "script" for tag, _ in read.tags)
    assert "\x1b" not in html
    assert "alert" in html


def test_it_needs_no_script_and_nothing_from_elsewhere():
    html = page(map=("map", JPEG), alone=part(tree_svg="<svg></svg>"))
    assert "<script" not in html
    assert not re.search(r'(src|href)="(?!data:)|url\(|@import', html)


def test_an_empty_section_has_no_heading():
    text = Reader(page()).text
    assert not any(name in text for name in ("Answers", "Speech", "Seen objects", "Pictures", "Behaviour tree"))


def test_a_step_tells_status_cause_and_time():
    steps = (StepRow("go to the hall", Styles.FAILURE.value, "failure (PLANNING)", 1, (61.0, 75.5), "no way"),)
    text = Reader(page(alone=part(steps=steps))).text
    assert "go to the hall failure (PLANNING) 1:01.0–1:15.5 no way" in text


def test_each_of_several_robots_has_a_part_with_its_verdicts_steps_pictures_and_tree():
    parts = [
        part(
            f"{name} (spot)",
            colour,
            message=f"{name} is there",
            steps=(StepRow(f"go as {name}", Styles.SUCCESS.value, "success"),),
            pictures=((f"the grasp of {name}", JPEG),),
            tree_svg=f"<svg><title>{name}</title></svg>",
        )
        for name, colour in (("Alice", "#0072b2"), ("Bob", "#e69f00"))
    ]
    read = Reader(page(alone=None, parts=parts))
    assert [dict(attrs)["style"] for tag, attrs in read.tags if attrs.get("class") == "part"] == [
        "border-color:#0072b2",
        "border-color:#e69f00",
    ]
    for name in ("Alice", "Bob"):
        for text in (f"{name} (spot)", f"{name} is there", f"go as {name}", f"the grasp of {name}"):
            assert text in read.text
    assert [tag for tag, _ in read.tags].count("svg") == 2
    assert "script" not in {tag for tag, _ in read.tags}


def test_the_missions_of_a_fleet_stand_in_a_table():
    rows = (
        MissionRow(1, "go <b>", "Bob", True, "success, fulfilled", 1, "there"),
        MissionRow(2, "wait", "", None, "queued", 0, ""),
    )
    read = Reader(page(alone=None, missions=rows))
    assert "1 go <b> Bob success, fulfilled 1 there" in read.text
    assert [attrs["class"] for tag, attrs in read.tags if attrs.get("class", "").startswith("pill")] == [
        "pill success",
        "pill open",
    ]
