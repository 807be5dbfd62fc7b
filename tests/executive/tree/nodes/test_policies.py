"""Status tables of the nodes that decide what becomes of a step that failed."""

from dataclasses import replace

import pytest
from py_trees.common import Status

from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.policies import AskOperator, GoBack, RememberPose, Retry, Skip, Summary, Timeout
from skills.api import Cause
from skills.robot import Pose2D
from tests.executive.tree.scripted import F, N, Queue, R, S, tick


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
    assert tick(root, 2) == [R, S]
    assert (root.skipped, root.cause, root.message) == ("slipped", None, "skipped: slipped")


def test_a_skip_forgets_when_it_starts_again():
    root = skip(Queue(F, S))
    assert (tick(root, 2), root.skipped) == ([S, S], None)


@pytest.mark.parametrize("cause", [Cause.ERROR, Cause.CANCELLED])
def test_defects_and_cancels_are_not_skipped(cause):
    root = skip(Queue(F, cause=cause))
    assert (tick(root, 1), root.cause, root.skipped) == ([F], cause, None)


def test_the_answer_retry_starts_the_child_again(ask):
    # child   R   F       S
    # answer          R
    # ask     R   R   R   R   S
    operator = Operator("retry")
    root = ask(Queue(R, F, S), operator)
    assert tick(root, 5) == [R, R, R, R, S]
    assert (root.skipped, operator.asked[0].text) == (None, "slipped. What now?")


@pytest.mark.parametrize(("answer", "end"), [("skip", S), ("stop", F)])
def test_the_answers_skip_and_stop_end_it(ask, answer, end):
    operator = Operator(answer)
    root = ask(Queue(F), operator, text="What now?")
    assert tick(root, 3) == [R, R, end]
    assert operator.asked[0].text == "What now? (slipped)"
    assert (root.skipped, root.cause) == (("slipped", None) if end == S else (None, Cause.EXECUTION))


def test_stopping_takes_the_question_back(ask):
    operator = Operator("skip")
    root = ask(Queue(F), operator)
    tick(root, 1)
    root.stop(N)
    assert (operator.withdrawn, root.status, root.cause) == (1, N, Cause.CANCELLED)


def test_a_defect_is_not_asked_about(ask):
    operator = Operator()
    assert (tick(ask(Queue(F, cause=Cause.ERROR), operator), 1), operator.asked) == ([F], [])


@pytest.mark.parametrize(("back", "says"), [(S, "is back where it started"), (F, "could not go back: slipped")])
def test_a_drive_back_ends_with_the_first_failure(back, says):
    # action  R   F
    # back          R   S or F
    # root  R   R   R   F
    action, way = Queue(R, F, cause=Cause.PLANNING), Queue(R, back, name="back")
    root = GoBack(path_id="a/return", name="return", children=[action, way])
    assert tick(root, 4) == [R, R, R, F]
    assert (root.cause, root.message) == (Cause.PLANNING, f"slipped; the robot {says}")


def test_there_is_no_drive_back_after_success():
    action, way = Queue(R, S), Queue(S, name="back")
    assert tick(GoBack(path_id="a/return", name="return", children=[action, way]), 2) == [R, S]
    assert way.status == N


def test_there_is_no_drive_back_after_a_defect():
    action, way = Queue(F, cause=Cause.ERROR), Queue(S, name="back")
    assert tick(GoBack(path_id="a/return", name="return", children=[action, way]), 1) == [F]
    assert way.status == N


def test_a_new_start_of_go_back_begins_with_its_work():
    action, way = Queue(F, S), Queue(S, name="back")
    assert tick(GoBack(path_id="a/return", name="return", children=[action, way]), 3) == [R, F, S]


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
    assert tick(root, 1) == [status]
    assert says in root.message


def test_remember_pose_writes_the_pose(context):
    leaf = RememberPose(path_id="alice/m/start", name="start", key="alice/m/pose", context=context)
    leaf.tick_once()
    assert leaf.status == Status.SUCCESS
    assert context.board.get("alice/m/pose") == Pose2D(0.0, 0.0, 0.0)


def test_remember_pose_waits_until_localised_and_gives_up(context, clock):
    context.localiser.localised = False
    leaf = RememberPose(path_id="alice/m/start", name="start", key="alice/m/pose", context=context, patience_s=1.0)
    leaf.tick_once()
    assert leaf.status == Status.RUNNING
    clock.advance(1.1)
    leaf.tick_once()
    assert (leaf.status, leaf.cause) == (Status.FAILURE, Cause.PRECONDITION)


def timeout(child, clock, limit_s=1.5):
    return Timeout(path_id="a/t", name="t", child=child, limit_s=limit_s, clock=clock)


def retry(child, attempts=3, causes=frozenset({Cause.EXECUTION})):
    return Retry(path_id="a/r", name="r", child=child, attempts=attempts, causes=causes)


@pytest.mark.parametrize("last", [R, S])
def test_timeout_fails_on_the_robots_clock_even_when_success_comes_late(clock, last):
    # time     1   2   3      limit 1.5 s after 1 s
    # child    R   R   R or S
    # timeout  R   R   F
    child = Queue(R, R, last, R)
    root = timeout(child, clock)
    assert tick(root, 3, clock) == [R, R, F]
    assert root.cause is Cause.TIMEOUT
    assert child.status != R


def test_timeout_stops_a_running_child(clock):
    child = Queue(R, R, R, R)
    tick(timeout(child, clock), 3, clock)
    assert child.stopped == 1


def test_timeout_lets_success_in_time_and_failure_pass(clock):
    assert tick(timeout(Queue(R, S), clock), 2, clock) == [R, S]
    root = timeout(Queue(R, R, F), clock)
    assert tick(root, 3, clock) == [R, R, F]
    assert root.cause is Cause.EXECUTION


def test_timeout_starts_again_after_an_end(clock):
    root = timeout(Queue(R, R, R, R, S), clock)
    assert tick(root, 3, clock) == [R, R, F]
    assert tick(root, 2, clock) == [R, S]


def test_retry_tries_again_one_tick_later_until_it_works(clock):
    # child  F  F  S
    # retry  R  R  S
    root = retry(Queue(F, F, S))
    assert tick(root, 2, clock) == [R, R]
    assert "attempt 3 of 3, since slipped" in root.message
    assert tick(root, 1, clock) == [S]


def test_retry_is_bounded_and_says_how_often(clock):
    root = retry(Queue(F, F, F))
    assert tick(root, 3, clock) == [R, R, F]
    assert (root.cause, root.message) == (Cause.EXECUTION, "slipped (after 3 attempts)")


@pytest.mark.parametrize("cause", [Cause.TIMEOUT, Cause.ERROR, Cause.PRECONDITION])
def test_retry_leaves_other_causes_alone(clock, cause):
    root = retry(Queue(F, S, cause=cause))
    assert tick(root, 1, clock) == [F]
    assert root.cause is cause


def test_retry_begins_a_sequence_at_its_first_step(clock):
    first, second = Queue(S, R, S), Queue(F, S)
    root = retry(MemorySequence(path_id="a/s", name="s", children=[first, second]))
    assert tick(root, 3, clock) == [R, R, S]
    assert first.status == S


def test_retry_counts_from_one_after_an_end(clock):
    root = retry(Queue(F, F, F, F, F, S))
    assert tick(root, 3, clock) == [R, R, F]
    assert tick(root, 3, clock) == [R, R, S]


def test_interrupted_decorators_say_so(context, clock):
    for root in (timeout(Queue(R, R), clock), retry(Queue(R, R))):
        tick(root, 1, clock)
        root.stop(N)
        assert (root.cause, root.children[0].status) == (Cause.CANCELLED, N)
