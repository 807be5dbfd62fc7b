"""`errand log`, `errand replay` and `errand tree` of a log: what scripts rely on, and bad input."""

import json
import re
import threading
import urllib.request
import xml.etree.ElementTree as ElementTree

import pytest

from executive.view import server
from skills.api import Cause, Failed
from tests.executive.cli.calls import done, errand, json_of


@pytest.fixture
def log_path(compiled, make, script, log_run):
    script.ends["approach"] = lambda skill: Failed(Cause.TIMEOUT, "no room to stand")
    return log_run(compiled(*make.FETCH))[0]


def test_log_json_is_a_list_of_transitions_alone_on_standard_output(log_path):
    result = errand("log", log_path, "--json")
    changes = json_of(result)
    assert result.exit_code == 0
    assert all(list(change) == ["t", "node", "from", "to", "cause", "message"] for change in changes)
    assert any(change["cause"] == "TIMEOUT" and change["message"] == "no room to stand" for change in changes)


def test_log_prints_a_timeline(log_path):
    result = done("log", log_path)
    assert "no room to stand" in re.sub(r"\s+", " ", result.stdout)


BOX = re.compile("[\u2500-\u257f]")


def test_a_piped_log_has_no_boxes_and_breaks_no_names(log_path):
    lines = errand("log", log_path).stdout.splitlines()
    assert not [line for line in lines if BOX.search(line)]
    assert [line for line in lines if "approach" in line and "TIMEOUT: no room to stand" in line]


def test_a_piped_error_of_usage_has_no_box():
    result = errand("run", "--wrold", "flat")
    assert (result.exit_code, "--wrold" in result.stderr) == (2, True)
    assert not BOX.search(result.stderr + errand("queue", "add", "--nothing").stderr + errand("nothing").stderr)


def test_log_shows_the_traceback_of_a_defect(compiled, make, script, log_run):
    def breaks(skill):
        raise ZeroDivisionError("no metres")

    script.ends["approach"] = breaks
    path, _ = log_run(compiled(*make.FETCH))
    told = errand("log", path).stdout
    assert "Traceback (most recent call last):" in told
    assert 'raise ZeroDivisionError("no metres")' in told


def test_replay_writes_one_html_file(log_path, tmp_path):
    html = tmp_path / "replay.html"
    done("replay", log_path, "--out", html)
    page = html.read_text()
    assert "no room to stand" in page
    assert 'src="' not in page.split('id="recorded"')[0]


def test_waiting_ends_by_itself():
    before = threading.active_count()
    server.wait(0.01)
    assert threading.active_count() == before


@pytest.mark.parametrize(("words", "limit_s"), [((), None), (("--view-for", "3"), 3.0)])
def test_a_served_replay_answers_and_ends(log_path, monkeypatch, words, limit_s):
    answers, serve = [], server.serve

    def noted(content, address):
        server = serve(content, address)
        with urllib.request.urlopen(server.url) as answer:
            answers.append(answer.status)
        return server

    monkeypatch.setattr(server, "wait", answers.append)
    monkeypatch.setattr(server, "serve", noted)
    result = done("replay", log_path, *words)
    assert re.search(r"http://127\.0\.0\.1:\d+/\?token=[\w-]+", result.stdout)
    assert answers == [200, limit_s]


def test_tree_of_a_log_is_its_last_state(log_path):
    root = json_of(errand("tree", log_path, "--format", "json"))
    assert (root["status"], root["cause"]) == ("FAILURE", "TIMEOUT")


def test_tree_of_a_log_at_a_time(log_path):
    root = json_of(errand("tree", log_path, "--format", "json", "--at", "0.1"))
    assert root["status"] == "RUNNING"


@pytest.mark.parametrize("source", ["log", "sentence"])
def test_every_format_of_a_tree(log_path, source):
    named = log_path if source == "log" else "is there a hammer in the workshop"
    texts = {form: errand("tree", named, "--format", form).stdout for form in ("text", "svg", "mermaid", "xml", "json")}
    assert texts["mermaid"].startswith("flowchart LR\n")
    assert ElementTree.fromstring(texts["xml"]).get("BTCPP_format") == "4"
    assert ElementTree.fromstring(texts["svg"]).tag.endswith("svg")
    assert json.loads(texts["json"])["id"].startswith("alice/")
    assert len(texts["text"].splitlines()) > 3


def test_depth_cuts_every_format():
    sentence = "is there a hammer in the workshop"
    assert len(errand("tree", sentence, "--depth", "0").stdout.splitlines()) == 1
    assert json_of(errand("tree", sentence, "--depth", "0", "--format", "json"))["children"] == []


def test_a_large_tree_is_folded_unless_told_otherwise():
    sentence = "fetch me a drink from the kitchen"
    few = errand("tree", sentence, "--most", "30").stdout.splitlines()
    many = errand("tree", sentence, "--most", "10000").stdout.splitlines()
    assert len(few) <= 30 < len(many)
    assert not [line for line in many if "nodes)" in line]


def test_the_timeline_of_several_robots_says_whose_each_line_is(two_robots):
    lines = [line.split() for line in errand("log", two_robots).stdout.splitlines()]
    assert lines[0][:3] == ["robot", "t", "(s)"]
    assert {"Alice", "Bob"} <= {line[0] for line in lines if line}


def test_the_timeline_of_one_of_several_robots(two_robots):
    told = errand("log", two_robots, "--robot", "bob").stdout
    assert ("Bob is there" in told, "Alice is there" in told, "let me look" in told) == (True, False, True)
    assert [each["node"] for each in json_of(errand("log", two_robots, "--robot", "bob", "--json"))] == ["bob/go"]


def test_the_tree_of_one_of_several_robots(two_robots):
    assert json_of(errand("tree", two_robots, "--robot", "Alice", "--format", "json"))["id"] == "alice/go"


def test_a_replay_of_several_robots_holds_the_messages_of_each(two_robots, tmp_path):
    html = tmp_path / "replay.html"
    done("replay", two_robots, "--out", html)
    page = html.read_text()
    assert "Alice is there" in page
    assert "Bob is there" in page


def test_the_trees_of_several_robots_stand_side_by_side():
    root = json.loads(errand("tree", "two_robots", "--format", "json").stdout)
    robots = [child["id"].partition("/")[0] for child in root["children"]]
    assert (root["type"], robots) == ("together", ["alice", "bob"])
