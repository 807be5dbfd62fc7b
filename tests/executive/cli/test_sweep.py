"""Many seeds in processes of their own."""

import json
import subprocess
from pathlib import Path

import pytest

from executive.app.report import RefereeReport, RunReport
from executive.cli import sweep as module
from executive.cli.sweep import condition_rows, conditions, folders, rows, sweep, totals
from executive.mission.request import Request
from executive.mission.scenario import Scenario
from skills.files.errors import InputError


def report(seed: int, outcome: str = "success") -> RunReport:
    referee = RefereeReport(outcome == "success", "so it is", 0, 0)
    return RunReport(outcome, None, "done", referee, ("Take",), "flat", seed, 1.0, 1.0, 1.0, 20, "log")


def test_reports_survive_the_way_through_json():
    assert RunReport.from_json(json.loads(json.dumps(report(3).to_json()))) == report(3)


def test_reports_come_in_the_order_of_the_seeds_and_a_crash_takes_no_other_along(monkeypatch, tmp_path):
    def fake_run(command, **_options):
        seed = int(command[command.index("--seed") + 1])
        told = "" if seed == 2 else "noise\n" + json.dumps(report(seed).to_json()) + "\n"
        return subprocess.CompletedProcess(command, -11 if seed == 2 else 0, told, "Segmentation fault\n")

    monkeypatch.setattr(module.subprocess, "run", fake_run)
    done: list[int] = []
    reports = sweep(["--say", "x"], (3, 2, 1), jobs=2, out=tmp_path, done=lambda each: done.append(each.seed))
    assert [each.seed for each in reports] == [3, 2, 1]
    assert sorted(done) == [1, 2, 3]
    assert (reports[1].outcome, "Segmentation fault" in reports[1].message) == ("error", True)


def test_totals_count_claims_that_the_referee_denies():
    denied = RunReport.from_json({**report(2).to_json(), "referee": vars(RefereeReport(False, "no", 0, 0))})
    result = totals([report(1), denied, report(3, "failure")])
    assert [result[key] for key in ("successes", "referee_successes", "false_claims")] == [2, 1, 1]
    assert [row[:3] for row in rows([report(1), denied])] == [
        ("1", "success", "fulfilled"),
        ("2", "success", "not fulfilled"),
    ]


def test_each_fault_and_scenario_is_tried_alone_after_none():
    asked = Request("go", scenario=Scenario(("arm refuses", "drive refuses"), 2), scenario_files=(Path("doors.yaml"),))
    tried = conditions(asked, each=True)
    assert [name for name, _ in tried] == [
        "no fault", "arm refuses", "drive refuses", "doors.yaml", "2 random faults"
    ]  # fmt: skip
    assert [(each.scenario.faults, each.scenario.random, len(each.scenario_files)) for _, each in tried] == [
        ((), 0, 0), (("arm refuses",), 0, 0), (("drive refuses",), 0, 0), ((), 0, 1), ((), 2, 0)
    ]  # fmt: skip


def test_without_each_all_faults_are_in_all_runs():
    asked = Request("go", scenario=Scenario(("arm refuses",)))
    assert conditions(asked, each=False) == [("", asked)]


def test_nothing_to_try_alone_is_refused():
    with pytest.raises(InputError, match="no fault to try alone; give some by --fault"):
        conditions(Request("go"), each=True)


def test_several_conditions_have_folders_of_their_own():
    assert folders(Path("out"), [""]) == [Path("out")]
    names = folders(Path("out"), ["no fault", "camera.hand: dropout 5 s at 20 s"])
    assert [name.name for name in names] == ["0-no-fault", "1-camera-hand-dropout-5-s-at-20-s"]


def test_counts_are_given_for_each_condition():
    found = [("no fault", [report(1), report(2)]), ("arm refuses", [report(1, "failure"), report(2)])]
    assert list(condition_rows(found)) == [("no fault", "2", "2", "2", "0"), ("arm refuses", "2", "1", "1", "0")]


def test_a_run_that_was_not_judged_is_neither_a_success_by_the_referee_nor_a_false_claim():
    unjudged = RunReport.from_json({**report(2).to_json(), "referee": vars(RefereeReport(None, "no", 0, 0))})
    result = totals([unjudged])
    assert [result[key] for key in ("successes", "referee_successes", "false_claims")] == [1, 0, 0]
    assert unjudged.achieved
