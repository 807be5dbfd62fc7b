"""`errand runs` lists runs; log, tree, replay and report take a run's folder, or the last run."""

from contextlib import closing

import pytest

from executive.app.report.run_report import RunReport
from executive.app.runs.one_run import FinishedRun
from executive.record.event_log import EventLog
from executive.tree.node_view import node_view
from executive.words.goal import RefereeReport
from skills.testing.clock import VirtualClock
from tests.executive.cli.calls import done, errand, json_of, refusal

ASKED = ("run", "--say", "go to the bedroom", "--quiet")


def run_request(prepared, **_):
    """Ends at once, with a log and a report."""
    out = prepared.request.out
    with closing(EventLog(out / "log.mcap", VirtualClock())) as log:
        log("speech", {"robot": "Alice", "text": "Hello"})
    (out / "report.html").write_text("<h1>done</h1>")
    facts = ("flat", prepared.request.seed, 9.0, 1.0, 9.0, 90, str(out / "log.mcap"))
    report = RunReport("success", None, "done", RefereeReport(True, "it is so", 0, 0), (), *facts)
    return FinishedRun(report, node_view(prepared.tree.root))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the calls; no plant is built."""
    monkeypatch.setattr("executive.app.runs.queue.run_request", run_request)
    monkeypatch.chdir(tmp_path)


def test_runs_are_listed_with_outcome_verdict_and_command():
    done(*ASKED)
    done(*ASKED, "--seed", "4")
    first, second = json_of(errand("runs", "--json"))["runs"]
    assert (first["mission"], first["outcome"], first["verdict"]) == ("go bedroom", "success", "fulfilled")
    assert second["run"] == f"{first['run']}-2"
    assert second["command"] == "errand run '--say=go to the bedroom' --no-wake --seed=4"
    assert second["run"] in done("runs").stdout


def test_a_folder_without_runs_has_an_empty_list():
    assert json_of(errand("runs", "--json")) == {"runs": []}


@pytest.mark.parametrize("command", [("log",), ("log", "out/last"), ("report",), ("report", "out/last")])
def test_a_command_takes_a_runs_folder_or_the_last_run(command):
    done(*ASKED)
    assert done(*command).stdout


@pytest.mark.parametrize("command", ["log", "replay", "tree"])
def test_without_any_run_a_command_says_so(command):
    assert refusal(command).startswith("errand: out/last: no run has written there yet; ")


def test_options_of_evaluations_are_refused_for_a_run():
    done(*ASKED)
    assert "--out and --against are for an evaluation" in refusal("report", "--out", "x.html")


def test_clean_removes_old_runs_only():
    done(*ASKED)
    assert "No run in out is older." in done("runs", "clean", "--older-than", "1d").stdout
    assert "is no period" in refusal("runs", "clean", "--older-than", "long")
    assert len(json_of(errand("runs", "--json"))["runs"]) == 1
