"""The results file."""

from dataclasses import replace

import pytest

from executive.app.evaluate.results import Case, Evaluation, Evidence, ResultsFile, RunSpec
from executive.app.report.run_report import RunReport
from executive.mission.request import Request
from skills.inputs.errors import InputError

RUNS = tuple(RunSpec(Request("go", seed=seed), "go") for seed in range(3))
EVALUATION = Evaluation("scenario.yaml", RUNS)


def case(run, result="success"):
    report = RunReport(result, None, "", None, (), "flat", run.request.seed, 1.0, 1.0, 1.0, 20, "")
    return Case(run, report, {"navigate": 1.0}, Evidence(((0.5, "go", "went"),), (("map", b"jpeg"),)))


def test_results_are_kept_once_and_read_back(tmp_path):
    with ResultsFile(tmp_path / "r.sqlite", create=True) as kept:
        kept.begin(EVALUATION, code="1")
        assert (kept.add(case(RUNS[1])), kept.add(case(RUNS[1], "failure"))) == (True, False)
    with ResultsFile(tmp_path / "r.sqlite") as kept:
        kept.begin(EVALUATION, code="1")
        (found,) = kept.results().cases
        assert (found.run, found.report.achieved, kept.done_ids()) == (RUNS[1], True, {RUNS[1].id})
        assert kept.evidence(RUNS[1].id) == case(RUNS[1]).evidence


def test_results_of_another_evaluation_or_version_are_refused(tmp_path):
    with ResultsFile(tmp_path / "r.sqlite", create=True) as kept:
        kept.begin(EVALUATION, code="1")
        with pytest.raises(InputError, match="results of other runs"):
            kept.begin(replace(EVALUATION, runs=RUNS[:2]), code="1")
        with pytest.raises(InputError, match="another version of Errand"):
            kept.begin(EVALUATION, code="2")


def test_only_one_process_writes(tmp_path):
    path = tmp_path / "r.sqlite"
    own = ResultsFile(path, create=True)
    with own, own.claim(), ResultsFile(path) as other, pytest.raises(InputError, match="just now"):
        other.claim().__enter__()


def test_a_file_that_is_no_results_file_is_refused(tmp_path):
    (tmp_path / "text").write_text("no database, " * 100)
    for name, says in (("text", "the results file is damaged"), ("none", "there is no results file")):
        with pytest.raises(InputError, match=says):
            ResultsFile(tmp_path / name)


def test_wall_times_do_not_change_the_digest():
    slow = case(RUNS[0])
    fast = replace(slow, report=replace(slow.report, wall_time_s=3.0, log="elsewhere"), spent_s=9.0, worker="b")
    assert (slow.digest == fast.digest, slow.digest == case(RUNS[0], "failure").digest) == (True, False)
