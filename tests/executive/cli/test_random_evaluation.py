"""`errand evaluate --random-missions`: drawn, refused or run, kept, and reported."""

import pytest

from executive.app.evaluate import evaluation
from executive.app.evaluate.random_missions import random_missions
from executive.app.prepare.from_request import prepare_checked
from executive.words.goal import RefereeReport
from skills.inputs.errors import InputError
from tests.executive.cli.calls import errand, json_of

ASKED = ("evaluate", "--random-missions", "6", "--worlds", "flat,lab", "--seeds", "8001-", "--jobs", "1")


@pytest.fixture
def ran(plant):
    """The requests that were run; that of seed 8002 is a false claim."""
    right, wrong = RefereeReport(True, "it is so", 0, 0), RefereeReport(False, "the cube is on the floor", 0, 0)
    plant.ends = lambda request: ("success", wrong if request.seed == 8002 else right)
    return plant.asked


def evaluate(*more):
    result = errand(*ASKED, "--json", *more)
    return result, json_of(result)


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
    assert (len(ran), first["standings"]) == (6, again["standings"])


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
    told = json_of(errand(*command))
    assert (told["standings"], told["to_look_at"]) == (values["standings"], values["to_look_at"])
    assert "Claims against verdicts" in page.read_text()


def test_all_that_the_robot_lifts_is_drawn():
    texts = " ".join(run.request.sentence for run in random_missions(400, "flat", "1-").runs)
    assert all(name in texts for name in ("extinguisher", "hammer", "cylinder", "screwdriver"))
