"""`errand evaluate` of a mission at many seeds: what runs, what is shown, and where files land."""

import json
from pathlib import Path

import pytest

from executive.words.goal import RefereeReport
from tests.executive.cli.calls import done, errand, json_of

FETCH = "Hey Alice, can you fetch me a drink from the kitchen"
AMBIGUOUS = "Hey Alice, put the cube on the table"
FAULT = "camera.hand: dropout 5 s at 20 s"


@pytest.fixture
def evaluate(tmp_path):
    def call(*words):
        result = errand("evaluate", *words, "--json", "--out", str(tmp_path))
        told = result.stdout.strip().splitlines()
        return result, json.loads(told[-1]) if told else None

    return call


def test_the_runs_come_in_the_order_of_the_seeds_with_claims_and_verdicts_counted(plant, evaluate):
    no = RefereeReport(False, "no", 1, 0)
    ends = {1: ("success", RefereeReport(True, "it is so", 0, 0)), 2: ("success", no), 3: ("failure", no)}
    plant.ends = lambda request: ends[request.seed]
    result, values = evaluate("--say", FETCH, "--seeds", "1-3")
    assert [run["seed"] for run in values["runs"]] == [1, 2, 3]
    assert (values["successes"], values["referee_successes"], values["false_claims"]) == (2, 1, 1)
    rows = [line.split() for line in result.stderr.splitlines() if line[:1].isdigit()]
    told = [line for line in result.stderr.splitlines() if " of 3 runs: " in line]  # as they end: the last first
    assert [line.partition(", ")[0] for line in told] == [f"{n} of 3 runs: seed {4 - n}" for n in (1, 2, 3)]
    assert [row[:5] for row in rows[3:6]] == [
        ["1", "success", "fulfilled", "0", "0"],
        ["2", "success", "not", "fulfilled", "1"],
        ["3", "failure", "not", "fulfilled", "1"],
    ]
    assert result.exit_code == 1
    assert "3 runs: 2 successes, 1 referee successes, 1 false claims" in result.stderr.splitlines()


def test_a_run_that_was_not_judged_is_neither_a_success_by_the_referee_nor_a_false_claim(plant, evaluate):
    plant.ends = lambda request: ("success", RefereeReport(None, "nobody looked", 0, 0))
    result, values = evaluate("--say", FETCH, "--seeds", "1")
    assert [values[key] for key in ("successes", "referee_successes", "false_claims")] == [1, 0, 0]
    assert result.exit_code == 0


def test_each_seed_leaves_its_log_in_a_folder_of_its_own(plant, evaluate, tmp_path):
    _, values = evaluate("--say", FETCH, "--seeds", "1,12")
    logs = [tmp_path / name / "log.mcap" for name in ("seed-001", "seed-012")]
    assert [run["log"] for run in values["runs"]] == list(map(str, logs))
    assert all(log.is_file() for log in logs)


def report_of(file):
    result = done("report", str(file), "--json")
    return json_of(result)["runs"]


def test_the_seeds_of_a_mission_leave_a_results_file_that_report_reads(plant, evaluate, tmp_path):
    evaluate("--say", FETCH, "--seeds", "1-2")
    assert report_of(tmp_path / "results.sqlite") == 2


def test_finished_results_of_a_folder_get_another_name_when_seeds_run_again(plant, evaluate, tmp_path):
    for seeds in ("1-2", "1-2", "1-3"):
        evaluate("--say", FETCH, "--seeds", seeds)
    files = [tmp_path / name for name in ("results-1.sqlite", "results-2.sqlite", "results.sqlite")]
    assert ([report_of(file) for file in files], len(plant.asked)) == ([2, 2, 3], 7)


def test_an_interrupted_evaluation_of_seeds_goes_on_in_its_results_file(plant, evaluate, tmp_path):
    plant.ends = lambda request: ("cancelled" if request.seed == 2 else "success", None)
    evaluate("--say", FETCH, "--seeds", "1-2")
    plant.ends = lambda request: ("success", None)
    evaluate("--say", FETCH, "--seeds", "1-2")
    assert [request.seed for request in plant.asked] == [2, 1, 2]
    assert (report_of(tmp_path / "results.sqlite"), [*tmp_path.glob("results-*")]) == (2, [])


def test_results_are_kept_in_the_file_that_is_named_and_the_same_command_goes_on(plant, evaluate, tmp_path):
    words = ("--say", FETCH, "--seeds", "1-2", "--results", str(tmp_path / "own.sqlite"))
    first, again = evaluate(*words)[1], evaluate(*words)[1]
    assert (len(plant.asked), first) == (2, again)


@pytest.mark.parametrize(
    ("flags", "table"), [(("--answer", "the coffee table"), "coffee"), (("--questions", "first"), "kitchen")]
)
def test_a_question_is_answered_once_for_all_seeds(plant, evaluate, flags, table):
    evaluate("--say", AMBIGUOUS, *flags, "--seeds", "1-2")
    assert [each.sentence for each in plant.asked] == [f"Hey Alice, put the cube on the {table} table"] * 2


def test_the_answers_for_a_file_go_to_every_run(plant, evaluate, tmp_path):
    file = tmp_path / "mission.yaml"
    file.write_text("name: tidy\nworld: flat\nsteps:\n  - say: put the cube on the table\n")
    evaluate(str(file), "--answer", "the coffee table", "--seeds", "1-2")
    assert [(each.file, each.answers) for each in plant.asked] == [(file, ("the coffee table",))] * 2


def test_a_question_that_nobody_answers_is_refused(plant, evaluate):
    result, _ = evaluate("--say", AMBIGUOUS, "--questions", "refuse")
    assert (result.exit_code, "Which table" in result.output, plant.asked) == (2, True, [])


def test_each_fault_is_tried_alone_after_none(plant, evaluate, tmp_path):
    plant.ends = lambda request: (
        "failure" if request.scenario else "success",
        RefereeReport(not request.scenario, "it is so", 0, 0),
    )
    file = tmp_path / "busy.yaml"
    file.write_text("faults: [drive refuses]\n")
    faults = ("--fault", FAULT, "--fault", FAULT, "--scenario", str(file), "--random-faults", "1")
    _, values = evaluate("--say", FETCH, *faults, "--each-fault", "--seeds", "1")
    told = [(each["condition"], each["runs"], each["successes"]) for each in values["conditions"]]
    assert told == [("no fault", 1, 1), (FAULT, 1, 0), (str(file), 1, 0), ("1 random faults", 1, 0)]
    assert [Path(run["log"]).parts[-3] for run in values["runs"]][:2] == [
        "0-no-fault",
        "1-camera-hand-dropout-5-s-at-20-s",
    ]
    assert sorted(len(each.scenario.faults) for each in plant.asked) == [0, 1, 1, 1]


def test_without_each_fault_all_are_in_every_run(plant, evaluate):
    _, values = evaluate("--say", FETCH, "--fault", FAULT, "--fault", "drive refuses", "--seeds", "1-2")
    assert [each.scenario.faults for each in plant.asked] == [(FAULT, "drive refuses")] * 2
    assert "conditions" not in values


def test_nothing_to_try_alone_is_refused(plant, evaluate):
    result, _ = evaluate("--say", FETCH, "--each-fault")
    assert (result.exit_code, "no fault to try alone; give some by --fault" in result.output) == (2, True)
