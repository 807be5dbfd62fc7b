"""`errand runs` lists runs; log, tree, replay and report take a run's folder, or the last run."""

import shutil
import socket
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
    assert second["run"] in (f"{first['run']}-2", second["run"].removesuffix("-2"))  # begun in the same minute or not
    assert second["run"] != first["run"]
    assert second["command"] == "errand run '--say=go to the bedroom' --no-wake --seed=4"
    assert second["run"] in done("runs").stdout


def test_a_folder_without_runs_has_an_empty_list(tmp_path):
    (tmp_path / "out").mkdir()
    assert json_of(errand("runs", "--json")) == {"runs": []}


@pytest.mark.parametrize("command", ["runs", "runs clean --older-than 7d", "runs --json"])
def test_a_missing_folder_of_runs_is_refused(command):
    said = "errand: nowhere: there is no folder of runs; begin a run, or name its folder by --out\n"
    assert refusal(*command.split(), "--out", "nowhere") == said


@pytest.mark.parametrize("command", [("log",), ("log", "out/last"), ("report",), ("report", "out/last")])
def test_a_command_takes_a_runs_folder_or_the_last_run(command):
    done(*ASKED)
    assert done(*command).stdout


@pytest.mark.parametrize("command", ["log", "replay", "tree"])
def test_without_any_run_a_command_says_so(command):
    assert refusal(command).startswith("errand: out/last: there is no run, or it is removed; ")


@pytest.mark.parametrize("command", ["log", "replay", "tree", "report"])
def test_a_run_that_is_removed_is_named_with_the_way_to_the_others(command, tmp_path):
    done(*ASKED)
    shutil.rmtree((tmp_path / "out" / "last").resolve())
    said = "there is no run, or it is removed; name one that `errand runs` lists\n"
    assert refusal(command) == f"errand: out/last: {said}"
    assert refusal(command, "out/gone") == f"errand: out/gone: {said}"


def test_report_takes_the_log_of_a_run_as_the_run():
    done(*ASKED)
    assert done("report", "out/last/log.mcap").stdout == done("report").stdout


def test_report_of_a_page_says_how_to_open_it():
    done(*ASKED)
    said = refusal("report", "out/last/report.html")
    assert said == "errand: out/last/report.html: it is a page; open it in a browser, or name the folder of its run\n"


def test_report_of_another_file_names_no_option_that_it_lacks():
    done(*ASKED)
    assert "--results" not in refusal("report", "out/last/run.json")


@pytest.mark.parametrize("words", ["--view-host 0.0.0.0", "--view-port 8000"])
@pytest.mark.parametrize("command", [ASKED, ("queue", "run"), ("queue", "serve"), ("resume",), ("fleet", "run", ".")])
def test_the_address_of_a_page_without_a_page_is_refused(command, words):
    said = "errand: --view-host and --view-port have no effect without --view; add --view\n"
    assert refusal(*command, *words.split()) == said


def test_a_page_that_cannot_be_served_is_refused_before_a_run_begins(tmp_path):
    done(*ASKED)
    before = (tmp_path / "out" / "last").resolve()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert "name another --view-host or --view-port" in refusal(*ASKED, "--view", "1", "--view-port", port)
    assert "cannot serve the page at nohost.example" in refusal(*ASKED, "--view", "1", "--view-host", "nohost.example")
    assert (tmp_path / "out" / "last").resolve() == before
    assert len(json_of(errand("runs", "--json"))["runs"]) == 1


def test_options_of_evaluations_are_refused_for_a_run():
    done(*ASKED)
    assert "--out and --against are for an evaluation" in refusal("report", "--out", "x.html")


def test_clean_removes_old_runs_only():
    done(*ASKED)
    assert "No run in out is older." in done("runs", "clean", "--older-than", "1d").stdout
    assert "is no period" in refusal("runs", "clean", "--older-than", "long")
    assert "'7' has no unit; write it, as in 7d" in refusal("runs", "clean", "--older-than", "7")
    assert len(json_of(errand("runs", "--json"))["runs"]) == 1
