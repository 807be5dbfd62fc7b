"""Status tables of the nodes that decide what becomes of a step that failed."""

from dataclasses import replace

import pytest

from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.policies import AskOperator, GoBack, RememberPose, Retry, Skip, Summary, Timeout
from skills.api import Cause, Part
from skills.robot import Pose2D
from tests.executive.tree.scripted import F, Leaf, N, R, S, play, tick

CANCELLED, ERROR, EXECUTION, TIMEOUT = Cause.CANCELLED, Cause.ERROR, Cause.EXECUTION, Cause.TIMEOUT


class Operator:
    """Gives answers, each at the second look."""

    def __init__(self, *answers):
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


# child  status  cause  sentence  skipped
@pytest.mark.parametrize(
    ("script", "expected", "cause", "message", "skipped"),
    [
        ("C", "F", CANCELLED, "leaf C", None),
        ("E", "F", ERROR, "leaf E", None),
        ("FS", "SS", None, "leaf S", None),  # it forgets when it starts again
        ("RF", "RS", None, "skipped: leaf F", "leaf F"),
    ],
)
def test_a_skip_turns_failure_into_success_and_keeps_the_reason(script, expected, cause, message, skipped):
    root = skip(Leaf(script))
    assert play(root, expected) == expected
    assert (root.cause, root.message, root.skipped) == (cause, message, skipped)


@pytest.fixture
def ask(context):
    def build(script, operator, text=None):
        return AskOperator(
            path_id="a/ask",
            name="ask",
            child=Leaf(script),
            step="step 1",
            options=("retry", "skip", "stop"),
            default="stop",
            limit_s=9.0,
            text=text,
            context=replace(context, ask=operator),
        )

    return build


# child   R   F       S
# answer          R
# ask     R   R   R   R   S
#
# child  answer  text  status  cause  skipped  question
@pytest.mark.parametrize(
    ("script", "answer", "text", "expected", "cause", "skipped", "question"),
    [
        ("F", "skip", "What now?", "RRS", None, "leaf F", "What now? (leaf F)"),
        ("F", "stop", "What now?", "RRF", EXECUTION, None, "What now? (leaf F)"),
        ("RFS", "retry", None, "RRRRS", None, None, "leaf F. What now?"),
    ],
)
def test_the_operators_answer_decides(ask, script, answer, text, expected, cause, skipped, question):
    operator = Operator(answer)
    root = ask(script, operator, text)
    assert play(root, expected) == expected
    assert (root.cause, root.skipped, operator.asked[0].text) == (cause, skipped, question)


def test_stopping_takes_the_question_back(ask):
    operator = Operator("skip")
    root = ask("F", operator)
    assert play(root, "RI") == "RI"
    assert (operator.withdrawn, root.cause) == (1, CANCELLED)


def test_a_defect_is_not_asked_about(ask):
    operator = Operator()
    assert (play(ask("E", operator), "F"), operator.asked) == ("F", [])


# action  back  status  cause  sentence  back in the end
@pytest.mark.parametrize(
    ("action", "back", "expected", "cause", "message", "end"),
    [
        ("E", "S", "F", ERROR, "action E", N),
        ("FS", "S", "RFS", None, "action S", N),  # a new start begins with the action
        ("RP", "RF", "RRRF", Cause.PLANNING, "action P; the robot could not go back: back F", F),
        ("RP", "RS", "RRRF", Cause.PLANNING, "action P; the robot is back where it started", S),
        ("RS", "S", "RS", None, "action S", N),
    ],
)
def test_a_drive_back_ends_with_the_first_failure(action, back, expected, cause, message, end):
    root = GoBack(path_id="a/return", name="return", children=[Leaf(action, "action"), Leaf(back, "back")])
    assert play(root, expected) == expected
    assert (root.cause, root.message, root.children[1].status) == (cause, message, end)


class Drive:
    """A skill that moves the base."""

    uses = frozenset({Part.BASE})


class Speak:
    """A skill that only speaks."""

    uses = frozenset({Part.VOICE})


def work(script, skill=Drive):
    leaf = Leaf(script)
    leaf.skill = skill
    return leaf


def row(*children):
    return MemorySequence(path_id="a/row", name="row", children=[*children])


#   the mission                                           status  a part of the message
@pytest.mark.parametrize(
    ("mission", "status", "says"),
    [
        (lambda: row(skip(work("F")), work("S")), S, "done, but skipped: step 1 (leaf F)"),
        (lambda: row(skip(work("F")), skip(work("S"))), S, "done, but skipped: step 1 (leaf F)"),
        (lambda: skip(work("S")), S, "leaf S"),
        (lambda: skip(work("F")), F, "all steps were skipped: step 1 (leaf F)"),
        (lambda: row(row(skip(work("F")), skip(work("F")))), F, "all steps were skipped: step 1 (leaf F); step 1"),
        (lambda: row(skip(work("F")), work("S", Speak)), F, "all steps were skipped: step 1 (leaf F)"),
        (lambda: skip(row(work("S"), work("F"))), F, "all steps were skipped"),
        (lambda: skip(row(skip(work("F")))), F, "all steps were skipped"),
    ],
)
def test_a_mission_that_may_skip_fails_when_nothing_but_speech_is_done(mission, status, says):
    root = Summary(path_id="a/summary", name="summary", child=mission())
    assert tick(root, 4)[-1] == status
    assert says in root.message


@pytest.mark.parametrize("rounds", ["SF", "FS"])
def test_work_of_any_round_counts(rounds):
    step = skip(work(rounds))
    assert (tick(step, 2), step.achieved) == ([S, S], True)


def remember(context, patience_s=1.0):
    return RememberPose(path_id="a/m/start", name="start", key="alice/m/pose", context=context, patience_s=patience_s)


def test_remember_pose_writes_the_pose(context):
    assert tick(remember(context)) == [S]
    assert context.board.get("alice/m/pose") == Pose2D(0.0, 0.0, 0.0)


def test_remember_pose_waits_until_localised_and_gives_up(context, clock):
    context.localiser.localised = False
    leaf = remember(context)
    assert tick(leaf, 2, clock, dt_s=1.1) == [R, F]
    assert leaf.cause is Cause.PRECONDITION


# child  status at each second, with a limit of 1.5 s  cause  how often the child is stopped
@pytest.mark.parametrize(
    ("script", "expected", "cause", "stopped"),
    [
        ("RRF", "RRF", EXECUTION, 0),
        ("RRR", "RRF", TIMEOUT, 1),
        ("RRRRS", "RRFRS", None, 1),  # it starts again
        ("RRRR", "RI", CANCELLED, 1),
        ("RRS", "RRF", TIMEOUT, 0),  # even when success comes late
        ("RS", "RS", None, 0),
    ],
)
def test_a_timeout_fails_on_the_robots_clock(clock, script, expected, cause, stopped):
    child = Leaf(script)
    root = Timeout(path_id="a/t", name="t", child=child, limit_s=1.5, clock=clock)
    assert play(root, expected, clock) == expected
    assert (root.cause, child.log.count("-leaf"), child.status == R) == (cause, stopped, False)


def retry(child):
    return Retry(path_id="a/r", name="r", child=child, attempts=3, causes=frozenset({EXECUTION}))


# child  status of three attempts  cause  sentence
@pytest.mark.parametrize(
    ("script", "expected", "cause", "message"),
    [
        ("BS", "F", Cause.PRECONDITION, "leaf B"),
        ("ES", "F", ERROR, "leaf E"),
        ("FFF", "RR", None, "attempt 3 of 3, since leaf F"),
        ("FFF", "RRF", EXECUTION, "leaf F (after 3 attempts)"),
        ("FFFFFS", "RRFRRS", None, "leaf S"),  # it counts from one after an end
        ("FFS", "RRS", None, "leaf S"),
        ("RR", "RI", CANCELLED, None),
        ("TS", "F", TIMEOUT, "leaf T"),
    ],
)
def test_a_retry_tries_again_one_tick_later_and_is_bounded(script, expected, cause, message):
    root = retry(Leaf(script))
    assert play(root, expected) == expected
    assert root.cause is cause
    assert message is None or root.message == message


def test_retry_begins_a_sequence_at_its_first_step():
    first, second = Leaf("SRS", "first"), Leaf("FS", "second")
    root = retry(MemorySequence(path_id="a/s", name="s", children=[first, second]))
    assert play(root, "RRS") == "RRS"
    assert (first.begun, second.begun, first.status) == (2, 2, S)
