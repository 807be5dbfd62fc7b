"""`errand log`, `errand replay` and `errand tree` of a log: what scripts rely on, and bad input."""

import json
import re
import threading
import urllib.request
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.cli import entry
from executive.record.event_log import EventLog
from executive.view import server
from skills.api import Cause, Failed


def invoke(*arguments: object):
    return CliRunner().invoke(entry.app, [str(argument) for argument in arguments])


@pytest.fixture
def log_path(tmp_path, compiled, run_tree, make, script, clock) -> Path:
    script.ends["approach"] = lambda skill: Failed(Cause.TIMEOUT, "no room to stand")
    log = EventLog(tmp_path / "log.mcap", clock)
    run_tree(compiled(*make.FETCH), log=log)
    log.close()
    return log.path


def test_log_json_is_a_list_of_transitions_alone_on_standard_output(log_path):
    result = invoke("log", log_path, "--json")
    changes = json.loads(result.stdout)
    assert result.exit_code == 0
    assert all(list(change) == ["t", "node", "from", "to", "cause", "message"] for change in changes)
    assert any(change["cause"] == "TIMEOUT" and change["message"] == "no room to stand" for change in changes)


def test_log_prints_a_timeline(log_path):
    result = invoke("log", log_path)
    assert result.exit_code == 0
    assert "no room to stand" in re.sub(r"\s+", " ", result.stdout)


def test_the_map_of_a_log_without_one_is_refused_in_one_line(log_path, tmp_path):
    result = invoke("log", log_path, "--format", "map", "--out", tmp_path / "map.png")
    assert (result.exit_code, len(result.stderr.splitlines())) == (2, 1)
    assert not (tmp_path / "map.png").exists()


BOX = re.compile("[\u2500-\u257f]")


def test_a_piped_log_has_no_boxes_and_breaks_no_names(log_path):
    lines = invoke("log", log_path).stdout.splitlines()
    assert not [line for line in lines if BOX.search(line)]
    assert [line for line in lines if "approach" in line and "TIMEOUT: no room to stand" in line]


def test_a_piped_error_of_usage_has_no_box():
    result = invoke("run", "--wrold", "flat")
    assert (result.exit_code, "--wrold" in result.stderr) == (2, True)
    assert not BOX.search(result.stderr + invoke("queue", "add", "--nothing").stderr + invoke("nothing").stderr)


def test_log_shows_the_traceback_of_a_defect(tmp_path, compiled, run_tree, make, script, clock):
    def breaks(skill):
        raise ZeroDivisionError("no metres")

    script.ends["approach"] = breaks
    log = EventLog(tmp_path / "log.mcap", clock)
    run_tree(compiled(*make.FETCH), log=log)
    log.close()
    told = invoke("log", log.path).stdout
    assert "Traceback (most recent call last):" in told
    assert 'raise ZeroDivisionError("no metres")' in told


@pytest.mark.parametrize("verb", ["log", "replay", "tree"])
@pytest.mark.parametrize(("name", "words"), [("absent.mcap", "no such file"), ("text.mcap", "no event log")])
def test_a_file_that_is_no_log_is_refused_in_one_line(tmp_path, verb, name, words):
    (tmp_path / "text.mcap").write_text("hello")
    result = invoke(verb, tmp_path / name)
    (line,) = result.stderr.splitlines()
    assert (result.exit_code, result.stdout, words in line, name in line) == (2, "", True, True)


def test_replay_writes_one_html_file(log_path, tmp_path):
    html = tmp_path / "replay.html"
    assert invoke("replay", log_path, "--out", html).exit_code == 0
    page = html.read_text()
    assert "no room to stand" in page
    assert 'src="' not in page.split('id="recorded"')[0]


def test_replay_into_a_folder_that_is_not_there_is_refused(log_path, tmp_path):
    result = invoke("replay", log_path, "--out", tmp_path / "absent" / "x.html")
    assert (result.exit_code, "x.html" in result.stderr) == (2, True)


def test_replay_serves_the_page_and_ends(log_path, monkeypatch):
    seen = []

    def look(limit_s: float | None) -> None:
        seen.append(limit_s)

    monkeypatch.setattr(server, "wait", look)
    result = invoke("replay", log_path, "--view-for", "3")
    assert (result.exit_code, seen) == (0, [3.0])
    assert re.search(r"http://127\.0\.0\.1:\d+/\?token=[\w-]+", result.stdout)


def test_waiting_ends_by_itself():
    before = threading.active_count()
    server.wait(0.01)
    assert threading.active_count() == before


def test_a_served_replay_answers(log_path, monkeypatch):
    answers = []

    def look(limit_s: float | None) -> None:
        answers.append(limit_s)

    serve = server.serve

    def noted(content, port):
        server = serve(content, port)
        with urllib.request.urlopen(server.url) as answer:
            answers.append(answer.status)
        return server

    monkeypatch.setattr(server, "wait", look)
    monkeypatch.setattr(server, "serve", noted)
    assert invoke("replay", log_path).exit_code == 0
    assert answers == [200, None]


def test_tree_of_a_log_is_its_last_state(log_path):
    root = json.loads(invoke("tree", log_path, "--format", "json").stdout)
    assert (root["status"], root["cause"]) == ("FAILURE", "TIMEOUT")


def test_tree_of_a_log_at_a_time(log_path):
    root = json.loads(invoke("tree", log_path, "--format", "json", "--at", "0.1").stdout)
    assert root["status"] == "RUNNING"


def test_at_is_for_logs_only():
    result = invoke("tree", "go to the kitchen", "--at", "3")
    assert (result.exit_code, "--at is for logs" in result.stderr) == (2, True)


@pytest.mark.parametrize("source", ["log", "sentence"])
def test_every_format_of_a_tree(log_path, source):
    named = log_path if source == "log" else "is there a hammer in the workshop"
    texts = {form: invoke("tree", named, "--format", form).stdout for form in ("text", "svg", "mermaid", "xml", "json")}
    assert texts["mermaid"].startswith("flowchart LR\n")
    assert ElementTree.fromstring(texts["xml"]).get("BTCPP_format") == "4"
    assert ElementTree.fromstring(texts["svg"]).tag.endswith("svg")
    assert json.loads(texts["json"])["id"].startswith("alice/")
    assert len(texts["text"].splitlines()) > 3


def test_depth_cuts_every_format():
    sentence = "is there a hammer in the workshop"
    assert len(invoke("tree", sentence, "--depth", "0").stdout.splitlines()) == 1
    assert json.loads(invoke("tree", sentence, "--depth", "0", "--format", "json").stdout)["children"] == []


def test_a_large_tree_is_folded_unless_told_otherwise():
    sentence = "fetch me a drink from the kitchen"
    few = invoke("tree", sentence, "--most", "30").stdout.splitlines()
    many = invoke("tree", sentence, "--most", "10000").stdout.splitlines()
    assert len(few) <= 30 < len(many)
    assert not [line for line in many if "nodes)" in line]


@pytest.fixture
def two_robots(tmp_path, clock) -> Path:
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


def test_the_timeline_of_several_robots_says_whose_each_line_is(two_robots):
    lines = [line.split() for line in invoke("log", two_robots).stdout.splitlines()]
    assert lines[0][:3] == ["robot", "t", "(s)"]
    assert {"Alice", "Bob"} <= {line[0] for line in lines if line}


def test_the_timeline_of_one_of_several_robots(two_robots):
    told = invoke("log", two_robots, "--robot", "bob").stdout
    assert ("Bob is there" in told, "Alice is there" in told, "let me look" in told) == (True, False, True)
    assert [each["node"] for each in json.loads(invoke("log", two_robots, "--robot", "bob", "--json").stdout)] == [
        "bob/go"
    ]


def test_the_tree_of_one_of_several_robots(two_robots):
    assert json.loads(invoke("tree", two_robots, "--robot", "Alice", "--format", "json").stdout)["id"] == "alice/go"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("log", "--robot", "carl"), "has no robot 'carl'; there are: Alice, Bob"),
        (("tree", "--robot", "carl"), "has no robot 'carl'"),
        (("tree",), "add --robot with one of: Alice, Bob"),
    ],
)
def test_a_robot_that_is_not_in_the_log_or_not_said_is_refused_in_one_line(two_robots, arguments, words):
    result = invoke(arguments[0], two_robots, *arguments[1:])
    (line,) = result.stderr.splitlines()
    assert (result.exit_code, words in line) == (2, True), line


def test_a_replay_of_several_robots_holds_the_messages_of_each(two_robots, tmp_path):
    html = tmp_path / "replay.html"
    assert invoke("replay", two_robots, "--out", html).exit_code == 0
    page = html.read_text()
    assert "Alice is there" in page
    assert "Bob is there" in page


def test_the_trees_of_several_robots_stand_side_by_side():
    root = json.loads(invoke("tree", "two_robots", "--format", "json").stdout)
    assert (root["type"], [child["id"].partition("/")[0] for child in root["children"]]) == (
        "together",
        ["alice", "bob"],
    )
