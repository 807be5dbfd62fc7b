"""What results say: claims against verdicts, groups, and the page that shows them."""

from collections import Counter

import pytest

from executive.app.evaluate import summary
from executive.app.evaluate.results import Case, Evidence, Results, RunSpec, Standing
from executive.app.evaluate.summary import Rate, cases_to_inspect, comparisons_of, fisher, groups_of, mcnemar
from executive.app.report.run_report import RunReport
from executive.mission.request import Request
from executive.words.goal import RefereeReport


def case(seed, outcome, success=None, *, cause=None, holds=None, kind="fetch", world="flat"):
    referee = RefereeReport(success, "the hammer is on the floor", 0, 0, holds=holds)
    report = RunReport(outcome, cause, "no path", referee, (), world, seed, 9.0, 1.0, 9.0, 90, "")
    run = RunSpec(Request(f"fetch me the hammer {seed}", world=world, seed=seed), kind)
    return Case(run, report)


CASES = (
    case(1, "success", True),
    case(2, "success", True, kind="go", world="lab"),
    case(3, "success", False),
    case(4, "success", None),
    case(5, "failure", False, cause="PLANNING", holds=False),
    case(6, "failure", False, cause="PLANNING"),
    case(7, "failure", False, cause="TIMEOUT", holds=True),
    case(8, "refused", False, cause="REFUSED"),
    case(9, "error", False, cause="ERROR"),
)


STANDINGS = (
    *("FULFILLED", "FULFILLED", "FALSE_CLAIM", "NOT_JUDGED", "FAILED", "FAILED"),
    *("FULFILLED_YET_FAILED", "REFUSED", "BROKEN"),
)


def test_a_run_stands_where_its_claim_meets_its_verdict():
    assert tuple(case.standing.name for case in CASES) == STANDINGS


def test_claims_are_counted_against_verdicts_with_intervals_and_causes():
    rows = {row.standing: row for row in summary.standing_rows(CASES)}
    assert {standing.name: row.rate.successes for standing, row in rows.items()} == Counter(STANDINGS)
    assert rows[Standing.FAILED].causes == {"PLANNING": 2}
    # 2 of 9: Wilson's interval by hand
    assert rows[Standing.FULFILLED].rate.interval_text == "6.3% to 54.7%"


def test_cases_to_inspect_begin_with_false_claims():
    assert [each.run.request.seed for each in cases_to_inspect(CASES)] == [3, 4, 5, 6, 7, 8, 9]


def test_the_referee_explains_a_false_claim_and_the_robot_a_failure():
    assert (CASES[2].why, CASES[4].why) == ("the hammer is on the floor", "no path")


def test_runs_are_grouped_by_kind_and_by_world_with_the_counts_of_each_standing():
    groups = {group.label: group for group in groups_of(CASES)}
    assert groups["mission: go"].rate == (1, 1)
    assert [groups["world: flat"].standings[standing] for standing in Standing] == [1, 1, 1, 2, 1, 1, 1]


def test_the_page_lists_each_run_to_inspect_with_its_sentence_and_the_commands(tmp_path):
    log = tmp_path / CASES[2].run.id
    log.mkdir()
    found = Results(CASES, {"scenario": "random.yaml", "code": "1", "logs": str(tmp_path)})
    page = summary.to_page(found, lambda _: Evidence())
    assert "claimed, not fulfilled: FALSE CLAIM</b> fetch me the hammer 3, flat, seed 3" in page
    assert page.count("errand run &#39;--say=fetch me the hammer") == 7
    assert page.count(f"--seed=3\nerrand log {log}/log.mcap\n") == 1
    assert "fetch me the hammer 1," not in page


# 81 of 263 is that of Newcombe, 1998.
@pytest.mark.parametrize(("rate", "interval"), [(Rate(81, 263), (0.2553, 0.3662)), (Rate(10, 10), (0.7225, 1.0))])
def test_the_interval_of_a_rate_is_that_of_wilson(rate, interval):
    assert rate.interval() == pytest.approx(interval, abs=5e-5)


def test_mcnemar_counts_only_pairs_that_differ():
    # 8 to 1: 2 * (1 + 9) / 2**9
    assert (mcnemar(8, 1), mcnemar(0, 0)) == (pytest.approx(20 / 512), 1.0)


def test_fisher_of_the_lady_tasting_tea():
    assert fisher(Rate(3, 4), Rate(1, 4)) == pytest.approx(0.4857, abs=1e-4)


def test_two_results_are_compared_by_the_runs_that_both_have():
    other = tuple(case(number, "failure", cause="TIMEOUT", kind=kind) for number, kind in ((1, "fetch"), (5, "fetch")))
    both = next(iter(comparisons_of(CASES, other)))
    assert (both.paired, both.here, both.there, both.only_here, both.only_there) == (True, (1, 2), (0, 2), 1, 0)


def test_results_without_a_run_in_common_are_compared_as_a_whole():
    other = (case(91, "success", True), case(92, "success", True))
    found = {each.name: each for each in comparisons_of(CASES, other)}
    assert (found["all runs"].paired, found["all runs"].here, found["all runs"].there) == (False, (3, 9), (2, 2))
    assert set(found) == {"all runs", "fetch", "flat"}
