"""`errand evaluate --random-missions`: drawn, refused or run, kept, and reported."""

import json
from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

from executive.app.checker import prepare_checked
from executive.app.evaluate import evaluation
from executive.app.evaluate.random_missions import random_missions
from executive.app.evaluate.workers import Pool
from executive.app.evaluate.workers import WorkResult as Done
from executive.app.mission_run import FinishedRun
from executive.app.report import RunReport
from executive.cli import entry
from executive.record.event_log import EventLog
from executive.tree.node_view import node_view
from executive.words.goal import RefereeReport
from skills.files.errors import InputError
from tests.executive.conftest import ManualClock

ASKED = ("evaluate", "--random-missions", "6", "--worlds", "flat,lab", "--seeds", "8001-", "--jobs", "1")


class Here:
    """Does the work in this process."""

    count = 1

    def map_items(self, function, items):
        return (Done(item, function(item)) for item in items)


@pytest.fixture
def ran(monkeypatch):
    """The prepared missions that were run, with what becomes of them; no plant is built."""
    seen = []

    def run_request(prepared):
        request = prepared.request
        seen.append(request)
        EventLog(request.out / "log.mcap", ManualClock()).close()
        held = request.seed != 8002
        referee = RefereeReport(held, "it is so" if held else "the cube is on the floor", 0, 0)
        facts = (prepared.world.name, request.seed, 9.0, 1.0, 9.0, 90, "log.mcap")
        return FinishedRun(RunReport("success", None, "done", referee, (), *facts), node_view(prepared.tree.root))

    @contextmanager
    def opened(_):
        yield Here()

    monkeypatch.setattr(evaluation, "run_request", run_request)
    monkeypatch.setattr(Pool, "opened", opened)
    return seen


def evaluate(*more):
    result = CliRunner().invoke(entry.app, [*ASKED, "--json", *more])
    return result, json.loads(result.stdout.splitlines()[-1])


def test_the_table_names_each_run_that_is_not_claimed_and_fulfilled_with_the_folder_of_its_log(ran, tmp_path):
    result, values = evaluate("--out", str(tmp_path))
    assert values["standings"]["claimed and fulfilled"]["runs"] == 5
    assert values["standings"]["claimed, not fulfilled: FALSE CLAIM"]["runs"] == 1
    (found,) = values["to_look_at"]
    assert (found["seed"], found["world"], found["why"]) == (8002, "flat", "the cube is on the floor")
    assert (tmp_path / "logs" / found["id"] / "log.mcap").is_file()
    assert found["log"] == str(tmp_path / "logs" / found["id"])
    assert found["asked"] in result.stderr
    assert result.exit_code == 1


def test_the_same_command_runs_only_what_is_missing(ran, tmp_path):
    first = evaluate("--out", str(tmp_path))[1]
    again = evaluate("--out", str(tmp_path))[1]
    assert len(ran) == 6
    assert first["standings"] == again["standings"]


def test_an_impossible_random_mission_counts_as_refused(ran, tmp_path, monkeypatch):
    def refuse(request, *, anyway):
        if not anyway:
            raise InputError("there is no way into the hall")
        return prepare_checked(request, anyway=True)

    monkeypatch.setattr(evaluation, "prepare_checked", refuse)
    _, values = evaluate("--out", str(tmp_path / "checked"))
    assert values["standings"]["refused"]["runs"] == 6
    assert {each["why"] for each in values["to_look_at"]} == {"there is no way into the hall"}
    _, values = evaluate("--out", str(tmp_path / "anyway"), "--anyway")
    assert values["standings"]["refused"]["runs"] == 0


def test_the_report_shows_the_same_table(ran, tmp_path):
    values = evaluate("--out", str(tmp_path))[1]
    page = tmp_path / "report.html"
    command = ["report", str(tmp_path / "results.sqlite"), "--out", str(page), "--json"]
    told = json.loads(CliRunner().invoke(entry.app, command).stdout.splitlines()[-1])
    assert (told["standings"], told["to_look_at"]) == (values["standings"], values["to_look_at"])
    assert "Claims against verdicts" in page.read_text()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--say", "go to the hall"), "--random-missions chooses the runs itself"),
        (("--seeds", "1-3"), "'1-3' holds 3 seeds, fewer than 6"),
        (("--seeds", "1,1-"), "names a seed twice"),
        (("--worlds", "flat,flat"), "names a world twice"),
        (("--worlds", "falt"), "unknown world 'falt'"),
    ],
)
def test_errors_name_the_words_that_were_typed(options, says, tmp_path):
    result = CliRunner().invoke(entry.app, [*ASKED, *options, "--out", str(tmp_path)])
    assert (result.exit_code, says in result.output) == (2, True), result.output


def test_only_random_missions_take_worlds(tmp_path):
    result = CliRunner().invoke(entry.app, ["evaluate", "--say", "go to the hall", "--worlds", "flat"])
    assert (result.exit_code, "--worlds is for --random-missions" in result.output) == (2, True), result.output


def test_all_that_the_robot_lifts_is_drawn():
    texts = " ".join(run.request.sentence for run in random_missions(400, "flat", "1-").runs)
    assert all(name in texts for name in ("extinguisher", "hammer", "cylinder", "screwdriver"))
