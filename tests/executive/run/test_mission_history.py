"""What a mission found out: every answer in order, and what its claim tells of them."""

import math
from dataclasses import replace

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.run.mission_history import Findings, achieved, claim, history_keys
from executive.run.outcome import Finding, Outcome, Said
from executive.tree.board import Board
from executive.words.goal import GoalKind
from skills.api import Cause, Failed, Succeeded
from tests.tables import yaml_beside

CLAIMS = yaml_beside(__file__, "claims.yaml")

CHECKS = (
    "Take [Nothing] to [kitchen] and do [find] to [hammer]",
    "Take [Nothing] to [bedroom] and do [find] to [drink]",
    "Take [Nothing] to [start] and do [Nothing] to [Nothing]",
)


@pytest.fixture
def findings(clock):
    return Findings(clock, Board("alice"), "Alice", "patrol")


def answered(node, answer, sentence):
    return {"node": node, "question": "q", "answer": answer, "message": sentence}


def found(*sentences):
    return [Finding("alice/p/1", 1.0, "q", True, sentence) for sentence in sentences]


def test_every_answer_of_a_node_is_stored_in_order_with_its_time(findings, clock):
    for answer in (False, False, True):
        clock.advance(1.0)
        told = findings.message("answer", answered("alice/patrol/1", answer, "told"))
    assert [(one.t_s, one.answer) for one in findings.findings] == [(1.0, False), (2.0, False), (3.0, True)]
    assert told == {**answered("alice/patrol/1", True, "told"), "robot": "Alice", "t": 3.0}


@pytest.mark.parametrize("answer", ["in the shed", 3, 2.5, None])
def test_any_node_adds_a_finding_by_publishing_an_answer(findings, answer):
    findings.message("answer", answered("alice/patrol/ask", answer, "Robin says so"))
    (one,) = findings.findings
    assert (one.answer, one.sentence, one.question) == (answer, "Robin says so", "q")


@pytest.mark.parametrize("at_least", [True, False])
def test_a_finding_says_whether_a_count_is_the_least_number(findings, at_least):
    findings.message("answer", {**answered("alice/patrol/1", 2, "at least two"), "at_least": at_least})
    assert [(one.answer, one.at_least) for one in findings.findings] == [(2, at_least)]


def test_speech_is_stored(findings, clock):
    clock.advance(2.0)
    findings.message("speech", {"robot": "Alice", "text": "Hello", "t": 2.0})
    findings.message("speech", {"robot": "Alice", "text": "Good night", "t": 2.0, "silent": "bedroom"})
    assert findings.said == (Said(2.0, "Hello"), Said(2.0, "Good night", silent="bedroom"))


def test_a_number_that_json_does_not_know_becomes_text(findings):
    findings.message("answer", answered("alice/patrol/1", math.nan, "nobody knows"))
    assert findings.findings[0].answer == "nan"


def findings_after_a_restart(clock):
    """The findings of a mission that had answered its question with no before."""
    board, keys = Board("alice"), history_keys("Alice", "patrol")
    board.put(keys.findings, (Finding("alice/patrol/1", 4.0, "q", False, "none"),))
    board.put(keys.answered_before, frozenset({"alice/patrol/1"}))
    return Findings(clock, board, "Alice", "patrol")


def test_an_answer_given_again_after_a_restart_is_one_finding(clock):
    findings = findings_after_a_restart(clock)
    findings.message("answer", answered("alice/patrol/1", False, "none"))
    assert [one.t_s for one in findings.findings] == [4.0]
    clock.advance(9.0)
    findings.message("answer", answered("alice/patrol/1", False, "none"))
    assert [one.t_s for one in findings.findings] == [4.0, 9.0]


def test_another_answer_after_a_restart_is_a_finding_of_its_own(clock):
    findings = findings_after_a_restart(clock)
    findings.message("answer", answered("alice/patrol/1", True, "there"))
    assert [one.answer for one in findings.findings] == [False, True]


@pytest.mark.parametrize(
    ("message", "sentences", "skipped", "told"),
    CLAIMS,
)
def test_the_claim_lists_the_answers_briefly(message, sentences, skipped, told):
    assert claim(message, found(*sentences), skipped) == told


def test_a_mission_that_only_looked_claims_what_it_found(compiled, run_tree, script):
    script.seen_on = ("counter", "bedside table")
    worst = run_tree(compiled(*CHECKS, name="patrol")).worst
    assert worst.message == "yes: a hammer in the kitchen; yes: a drink in the bedroom"
    sentences = ["yes: a hammer in the kitchen", "yes: a drink in the bedroom"]
    assert [(one.answer, one.sentence) for one in worst.findings] == [(True, each) for each in sentences]
    assert worst.answers == {one.path_id: True for one in worst.findings}
    assert 0.0 < worst.findings[0].t_s < worst.findings[1].t_s


def test_a_skill_adds_a_finding_by_publishing_an_answer(compiled, run_tree, script):
    def navigate(skill):
        skill.context.publish("answer", {"question": "the number", "answer": 42, "message": "the display shows 42"})
        return Succeeded("there")

    script.ends["navigate"] = navigate
    worst = run_tree(compiled(CHECKS[2])).worst
    (found,) = worst.findings
    assert (found.answer, worst.message) == (42, "the display shows 42")
    assert found.path_id.endswith("/navigate")


def test_a_mission_that_also_brought_something_claims_both(compiled, run_tree, make):
    worst = run_tree(compiled(CHECKS[0], *make.FETCH)).worst
    assert (worst.outcome, worst.message) == (Outcome.SUCCESS, "yes: a hammer in the kitchen; hand_over done")


def test_a_mission_that_failed_says_what_it_found_before(compiled, run_tree, script):
    def navigate(skill):
        return Failed(Cause.PLANNING, "no way") if skill.inputs.goal.y_m > 3.0 else Succeeded("there")

    script.ends["navigate"] = navigate
    there = "Take [Nothing] to [bathroom] and do [Nothing] to [Nothing]"
    worst = run_tree(compiled(CHECKS[0], there)).worst
    assert worst.outcome is Outcome.FAILURE
    assert worst.message.endswith("(found out: yes: a hammer in the kitchen)")


def test_a_pure_drive_says_where_the_robot_went(compiled, run_tree):
    worst = run_tree(compiled(CHECKS[2])).worst
    assert (worst.message, worst.findings) == ("went to the start", ())


GOT = (GoalKind.GRASPED, "get the beer", "the object is held near the body")
GAVE = (GoalKind.HANDED_OVER, "bring it to Robin", "gave the beer to Robin")
HALL, OFFICE = ((GoalKind.WENT, f"go to the {name}", "standing 0.00 m off the goal") for name in ("hall", "office"))


@pytest.mark.parametrize(
    ("reached", "last", "told"),
    [
        ([], "waited 1 s", "waited 1 s"),
        ([GOT, GAVE], "waited 1 s", "gave the beer to Robin"),
        ([GAVE, HALL], "standing 0.00 m off the goal", "gave the beer to Robin"),
        ([GAVE, GOT], "waited 1 s", "gave the beer to Robin; the object is held near the body"),
        ([GAVE, GAVE], "waited 1 s", "gave the beer to Robin (2 times)"),
        ([HALL], "standing 0.00 m off the goal", "went to the hall"),
        ([HALL, OFFICE, HALL], "said hello", "went to the hall and the office"),
        ([HALL], "", ""),
    ],
)
def test_a_claim_sums_the_mission_up_and_does_not_repeat_its_last_step(reached, last, told):
    assert achieved(reached, last) == told


def test_a_decision_does_not_say_again_what_its_only_look_has_found():
    look = Finding("alice/p/1/check/look-1", 5.0, "somebody in the office", False, "no: nobody in the office")
    one = Finding("alice/p/1", 5.0, "person at office", False, "no: person at office")
    denied = replace(one, question="no person at office", answer=True, sentence="yes: nobody in the office")
    both = replace(one, question="no person at office and battery over 50 %", sentence="yes: it is")
    assert claim("", [look, one]) == "no: nobody in the office"
    assert claim("", [look, denied]) == "yes: nobody in the office"
    later = replace(one, t_s=9.0)  # by the answer of an earlier look
    assert claim("", [look, one, later]) == "nobody in the office; no: person at office"
    assert claim("", [look, both]) == "nobody in the office; yes: it is"


class Repeated(Behaviour):
    """Answers at three ticks, as a node in a loop does."""

    def __init__(self, context):
        super().__init__("repeated")
        self.context, self.count, self.path_id = context, 0, "alice/loop/1"

    def update(self):
        self.count += 1
        self.context.publish("answer", answered(self.path_id, self.count, f"{self.count} so far"))
        return Status.SUCCESS if self.count == 3 else Status.RUNNING


def test_answers_of_a_node_in_a_loop_are_all_in_the_result(compiled, run_tree, monkeypatch):
    tree = compiled(CHECKS[2])
    monkeypatch.setattr(type(tree), "build", lambda self, context: Repeated(context))
    worst = run_tree(tree).worst
    assert [one.answer for one in worst.findings] == [1, 2, 3]
    assert worst.message == "1 so far; 2 so far; 3 so far"
