"""Status tables of the nodes that decide what becomes of a step that failed."""

from dataclasses import replace

import pytest
from py_trees.behaviours import StatusQueue
from py_trees.common import Status

from executive.tree.behaviour import Explained
from executive.tree.nodes.policies import AskOperator, GoBack, Skip, Summary
from skills.api import Cause

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Queue(Explained, StatusQueue):
    """A scripted leaf that says why it fails."""

    def __init__(self, *statuses: Status, name: str = "action", cause: Cause = Cause.EXECUTION) -> None:
        super().__init__(name=name, queue=list(statuses), eventually=S)
        self.path_id, self.fails_with = f"a/{name}", cause
        self.clear_explanation()

    def update(self) -> Status:
        status = super().update()
        self.cause, self.message = (self.fails_with, "slipped") if status == F else (None, "goes on")
        return status


class Operator:
    """Gives answers, each at the second look."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.asked, self.looks, self.withdrawn = list(answers), [], 0, 0

    def __call__(self, question):
        self.asked.append(question)
        self.looks = 0
        return self

    def done(self):
        self.looks += 1
        return self.looks >= 2

    def result(self):
        return self.answers.pop(0)

    def withdraw(self):
        self.withdrawn += 1


def ticked(root, times: int) -> list[Status]:
    statuses = []
    for _ in range(times):
        root.tick_once()
        statuses.append(root.status)
    return statuses


def skip(child):
    return Skip(path_id="a/skip", name="skip", child=child, step="step 1")


@pytest.fixture
def ask(context):
    def build(child, operator, text=None):
        return AskOperator(
            path_id="a/ask",
            name="ask",
            child=child,
            step="step 1",
            options=("retry", "skip", "stop"),
            default="stop",
            limit_s=9.0,
            text=text,
            context=replace(context, ask=operator),
        )

    return build


def test_a_skip_turns_failure_into_success_and_keeps_the_reason():
    # child  R   F
    # skip   R   S
    root = skip(Queue(R, F))
    assert ticked(root, 2) == [R, S]
    assert (root.skipped, root.cause, root.message) == ("slipped", None, "skipped: slipped")


def test_a_skip_forgets_when_it_starts_anew():
    root = skip(Queue(F, S))
    assert (ticked(root, 2), root.skipped) == ([S, S], None)


@pytest.mark.parametrize("cause", [Cause.ERROR, Cause.CANCELLED])
def test_defects_and_cancels_are_not_skipped(cause):
    root = skip(Queue(F, cause=cause))
    assert (ticked(root, 1), root.cause, root.skipped) == ([F], cause, None)


def test_the_answer_retry_starts_the_child_anew(ask):
    # child   R   F       S
    # answer          R
    # ask     R   R   R   R   S
    operator = Operator("retry")
    root = ask(Queue(R, F, S), operator)
    assert ticked(root, 5) == [R, R, R, R, S]
    assert (root.skipped, operator.asked[0].text) == (None, "slipped. What now?")


@pytest.mark.parametrize(("answer", "end"), [("skip", S), ("stop", F)])
def test_the_answers_skip_and_stop_end_it(ask, answer, end):
    operator = Operator(answer)
    root = ask(Queue(F), operator, text="What now?")
    assert ticked(root, 3) == [R, R, end]
    assert operator.asked[0].text == "What now? (slipped)"
    assert (root.skipped, root.cause) == (("slipped", None) if end == S else (None, Cause.EXECUTION))


def test_stopping_takes_the_question_back(ask):
    operator = Operator("skip")
    root = ask(Queue(F), operator)
    ticked(root, 1)
    root.stop(N)
    assert (operator.withdrawn, root.status, root.cause) == (1, N, Cause.CANCELLED)


def test_a_defect_is_not_asked_about(ask):
    operator = Operator()
    assert (ticked(ask(Queue(F, cause=Cause.ERROR), operator), 1), operator.asked) == ([F], [])


@pytest.mark.parametrize(("back", "says"), [(S, "is back where it started"), (F, "could not go back: slipped")])
def test_the_way_back_ends_in_the_first_failure(back, says):
    # action  R   F
    # back          R   S or F
    # root  R   R   R   F
    action, way = Queue(R, F, cause=Cause.PLANNING), Queue(R, back, name="back")
    root = GoBack(path_id="a/return", name="return", children=[action, way])
    assert ticked(root, 4) == [R, R, R, F]
    assert (root.cause, root.message) == (Cause.PLANNING, f"slipped; the robot {says}")


def test_there_is_no_way_back_after_success():
    action, way = Queue(R, S), Queue(S, name="back")
    assert ticked(GoBack(path_id="a/return", name="return", children=[action, way]), 2) == [R, S]
    assert way.status == N


def test_there_is_no_way_back_after_a_defect():
    action, way = Queue(F, cause=Cause.ERROR), Queue(S, name="back")
    assert ticked(GoBack(path_id="a/return", name="return", children=[action, way]), 1) == [F]
    assert way.status == N


def test_the_way_back_begins_with_the_deed_when_it_starts_anew():
    action, way = Queue(F, S), Queue(S, name="back")
    assert ticked(GoBack(path_id="a/return", name="return", children=[action, way]), 3) == [R, F, S]


@pytest.mark.parametrize(
    ("first", "steps", "status", "says"),
    [
        (F, ("a/skip", "a/other"), S, "done, but skipped: step 1 (slipped)"),
        (F, ("a/skip",), F, "all steps were skipped: step 1 (slipped)"),
        (S, ("a/skip",), S, "goes on"),
    ],
)
def test_the_summary_names_what_was_skipped(first, steps, status, says):
    root = Summary(path_id="a/summary", name="summary", child=skip(Queue(first)), steps=steps)
    assert ticked(root, 1) == [status]
    assert says in root.message
