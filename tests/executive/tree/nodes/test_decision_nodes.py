"""What a mission decides by: values, looks, buttons and their combinations; decide, check, wait and set."""

from dataclasses import replace

import pytest

from executive.tree.context import ANSWER_TOPIC
from executive.tree.nodes.decision_nodes import Check, Decide, Decision, MustHold, MustNotBegin, View
from executive.tree.nodes.guard import Waiting
from executive.tree.nodes.values import SetValues
from executive.tree.nodes.wait import Pause, WaitFor, WaitUntilClock
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Look, Not, ValueIs
from executive.words.expression import Expression, Template
from skills.api import Cause, Failed
from tests.executive.tree.scripted import Leaf, R, S, play, tick

KEY, FIRST, SECOND = "alice/decided", "alice/look-1/answer", "alice/look-2/answer"


@pytest.fixture
def pressed():
    """How often each button was pressed."""
    return {}


@pytest.fixture
def run_context(context, pressed):
    return replace(context, presses=lambda: dict(pressed), day_began_s=8 * 3600.0)


@pytest.fixture
def view(run_context):
    return View(run_context)


def value(text, **keys):
    return Decision(ValueIs(expression=text), keys)


def button(name):
    return Decision(ButtonPressed(button=name))


def decision(condition, *answers):
    return Decision(condition, answers=answers)


# Decisions: true, false, or not known yet.


@pytest.fixture
def long_steps(monkeypatch):
    """Advances the clock in steps of a minute, through hours."""
    monkeypatch.setattr("skills.testing.clock.STEP_S", 60.0)


# at (s), when the robot has taken something and lost charge; expression -> whether it holds
@pytest.mark.parametrize(
    ("at_s", "text", "holds"),
    [
        (0.0, "battery > 0.8", True),
        (0.0, "clock == '08:00'", True),
        (0.0, "clock > '08:30'", False),
        (0.0, "elapsed == 0", True),
        (0.0, "localised and not holding", True),
        (1800.0, "elapsed == 1800 and clock == '08:30' and holding and battery < 0.2", True),
        (17 * 3600.0, "clock == '01:00'", True),
    ],
)
@pytest.mark.usefixtures("long_steps")
def test_readings_are_those_of_the_moment(view, clock, robot, at_s, text, holds):
    if at_s:
        clock.advance(at_s)
        robot.holding, robot.charge = True, 0.1
    assert value(text).holds(view) is holds


def test_values_are_read_from_the_blackboard(view, run_context):
    run_context.board.put("alice/n", 3.0)
    assert value("n > 2", n="alice/n").holds(view)


def test_a_button_counts_from_when_the_tree_was_made(run_context, pressed):
    pressed["go"] = 2
    view = View(run_context)
    assert not button("go").holds(view)
    pressed["go"] = 3
    assert button("go").holds(view)
    view.forget_presses()
    assert not button("go").holds(view)
    assert not button("other").holds(view)


LOOK = Look(object="coke")


@pytest.fixture
def answered(run_context):
    """A decision of looks that have given these answers (None: not yet)."""

    def make(condition, *answers):
        keys = tuple(f"alice/look-{number}/answer" for number, _ in enumerate(answers))
        for key, answer in zip(keys, answers, strict=True):
            if answer is not None:
                run_context.board.put(key, answer)
        return decision(condition, *keys)

    return make


# all of      any of      (None: not known yet)
TABLE = [
    ((True, True), True, True),
    ((True, False), False, True),
    ((False, False), False, False),
    ((True, None), None, True),
    ((None, True), None, True),
    ((False, None), False, None),
    ((None, False), False, None),
    ((None, None), None, None),
]


@pytest.mark.parametrize(("parts", "every", "some"), TABLE)
def test_all_and_any_know_an_answer_as_soon_as_one_look_decides_it(view, answered, parts, every, some):
    both, either = answered(AllOf(all=(LOOK, LOOK)), *parts), answered(AnyOf(any=(LOOK, LOOK)), *parts)
    assert (both.holds(view), either.holds(view)) == (every, some)


@pytest.mark.parametrize(("part", "whole"), [(True, False), (False, True), (None, None)])
def test_not_turns_an_answer_and_leaves_an_unknown_one(view, answered, part, whole):
    assert answered(Not(**{"not": LOOK}), part).holds(view) is whole


def test_an_answer_is_not_known_before_the_look(view, run_context):
    assert decision(LOOK, FIRST).holds(view) is None
    run_context.board.put(FIRST, False)
    assert decision(LOOK, FIRST).holds(view) is False


# Decide: takes the looks only as long as it needs them.


@pytest.fixture
def log():
    return []


@pytest.fixture
def decide(run_context, log):
    def make(decision, one=("S", True), two=("S", True)):
        looks = [
            Leaf(script, name, log, put=lambda key=key, answer=answer: run_context.board.put(key, answer))
            for name, key, (script, answer) in (("one", FIRST, one), ("two", SECOND, two))
        ]
        return Decide(
            path_id="alice/decide",
            name="decide",
            decision=decision,
            words="it is so",
            key=KEY,
            context=run_context,
            children=looks[: len(decision.answers)],
        )

    return make


BOTH = decision(AllOf(all=(LOOK, LOOK)), FIRST, SECOND)
EITHER = decision(AnyOf(any=(LOOK, LOOK)), FIRST, SECOND)
CHARGED = value("battery > 0.1")
OR_CHARGED = decision(AnyOf(any=(AnyOf(any=(LOOK, LOOK)), ValueIs(expression="battery > 0.1"))), FIRST, SECOND)
ERROR, EXECUTION, PRECONDITION = Cause.ERROR, Cause.EXECUTION, Cause.PRECONDITION
YES, NO, UNKNOWN = "yes: it is so", "no: it is so", "cannot tell whether it is so"
NO_VALUE = "it is so: 'n' has no value yet"
# decision  look 1  look 2  status  cause  answer  sentence  looks taken  children in the end
DECIDE = [
    (BOTH, ("F", True), ("S", True), "F", EXECUTION, None, UNKNOWN, "+one", "FI"),
    (BOTH, ("RRS", True), ("S", True), "R|RS", None, True, YES, "+one ~one +two", "SS"),
    (BOTH, ("S", False), ("S", True), "S", None, False, NO, "+one", "SI"),
    (BOTH, ("S", True), ("E", True), "F", ERROR, None, UNKNOWN, "+one +two", "SF"),
    (BOTH, ("S", True), ("RR", True), "RI", Cause.CANCELLED, None, "", "+one +two -two", "SI"),
    (BOTH, ("S", True), ("RS", True), "RS", None, True, YES, "+one +two", "SS"),
    (BOTH, ("S", True), ("S", True), "SS", None, True, YES, "+one +two +one +two", "SS"),
    (CHARGED, ("S", True), ("S", True), "S", None, True, YES, "", ""),
    (EITHER, ("RS", False), ("S", False), "RS", None, False, NO, "+one +two", "SS"),
    (EITHER, ("S", True), ("S", True), "S", None, True, YES, "+one", "SI"),
    (OR_CHARGED, ("S", True), ("S", True), "S", None, True, YES, "", "II"),
    (decision(LOOK, "alice/never"), ("S", True), ("S", True), "F", ERROR, None, "", "+one", "S"),
    (
        value("n > 2", n="alice/n"),
        ("S", True),
        ("S", True),
        "F",
        Cause.PRECONDITION,
        None,
        "it is so: 'n' has no value yet",
        "",
        "",
    ),
]


@pytest.mark.parametrize(("decision", "one", "two", "expected", "cause", "answer", "says", "taken", "ends"), DECIDE)
def test_decide(decide, run_context, log, decision, one, two, expected, cause, answer, says, taken, ends):
    root = decide(decision, one, two)
    assert play(root, expected) == expected
    assert (run_context.board.values().get(KEY), root.cause, " ".join(log)) == (answer, cause, taken)
    assert "".join(child.status.value[0] for child in root.children) == ends
    assert root.message.startswith(says)
    assert says in ("", UNKNOWN) or root.message == says


def test_decide_lets_a_look_end_that_has_left_its_answer(decide, run_context, log):
    root = decide(decision(LOOK, FIRST), one=("RRS", True))
    tick(root)
    run_context.board.put(FIRST, True)
    assert play(root, "RS") == "RS"
    assert (log, root.children[0].status) == (["+one"], S)


# Check: the decision is an answer of the mission.


@pytest.mark.parametrize(("script", "answer", "expected"), [("RS", True, "RS"), ("S", False, "S"), ("F", None, "F")])
def test_check(run_context, published, script, answer, expected):
    child = Leaf(script, put=lambda: run_context.board.put(KEY, answer))
    root = Check(path_id="alice/check", name="so?", child=child, key=KEY, context=run_context)
    assert play(root, expected) == expected
    told = [(message["question"], message["answer"]) for topic, message in published if topic == ANSWER_TOPIC]
    assert told == ([] if expected == "F" else [("so", answer)])
    assert root.cause is (Cause.EXECUTION if expected == "F" else None)


# Wait: for a decision, asked again `every_s` after it was false.


@pytest.fixture
def wait(run_context):
    def make(child, every_s=0.0):
        return WaitFor(
            path_id="alice/wait",
            name="wait",
            child=child,
            key=KEY,
            words="it is so",
            every_s=every_s,
            board=run_context.board,
            clock=run_context.clock,
        )

    return make


# decision  answers  asked again after (s)  status at each second  cause  ticks of the decision  last done to it
@pytest.mark.parametrize(
    ("script", "answers", "every_s", "expected", "cause", "ticks", "last"),
    [
        ("RE", [], 0.0, "RF", ERROR, 2, "+decide"),
        ("RR", [], 0.0, "RI", Cause.CANCELLED, 1, "-decide"),
        ("RSS", [False, True], 3.0, "RRRRS", None, 3, "+decide"),
        ("S", [False, False, True], 0.0, "RRS", None, 3, "+decide"),
    ],
)
def test_wait_until_the_answer_is_true(
    wait, run_context, clock, script, answers, every_s, expected, cause, ticks, last
):
    left = list(answers)
    child = Leaf(script, "decide", put=lambda: run_context.board.put(KEY, left.pop(0)))
    root = wait(child, every_s)
    assert play(root, expected, clock) == expected
    assert (root.cause, child.ticks, child.log[-1]) == (cause, ticks, last)


def test_wait_for_a_button_counts_presses_from_when_it_begins(wait, run_context, pressed):
    decide = Decide(
        path_id="alice/d", name="d", decision=button("go"), words="go", key=KEY, context=run_context, children=[]
    )
    root = wait(decide)
    pressed["go"] = 1
    assert play(root, "RR") == "RR"
    pressed["go"] = 2
    assert play(root, "SR") == "SR"


@pytest.mark.parametrize(
    ("until_s", "after_s"),
    [(8.5 * 3600, 1800.0), (8 * 3600, 0.0), (7 * 3600, 0.0), (20 * 3600, 12 * 3600.0), (20.1 * 3600, 0.0)],
)
@pytest.mark.usefixtures("long_steps")
def test_wait_until_a_time_of_day(run_context, clock, until_s, after_s):
    root = WaitUntilClock(path_id="alice/w", name="w", time_s=until_s, words="then", context=run_context)
    tick(root)
    waited = 0.0
    while root.status == R:
        clock.advance(600.0)
        waited += 600.0
        tick(root)
    assert (root.status, waited) == (S, after_s)


# Set.


def set_values(run_context, values, kinds, **keys):
    return SetValues(path_id="alice/set", name="set", values=values, kinds=kinds, keys=keys, context=run_context)


def test_set_works_values_out_in_order(run_context):
    values = {"alice/a": Expression("1 + 1"), "alice/b": Expression("a * 2"), "alice/t": Template("{a} of {b}")}
    kinds = {"alice/a": float, "alice/b": float, "alice/t": str}
    assert play(set_values(run_context, values, kinds, a="alice/a", b="alice/b"), "S") == "S"
    assert run_context.board.values() == {"alice/a": 2.0, "alice/b": 4.0, "alice/t": "2 of 4"}
    assert isinstance(run_context.board.get("alice/a"), float)


def test_set_fails_at_the_first_without_a_value_and_keeps_those_before(run_context):
    values = {"alice/a": Expression("1"), "alice/b": Expression("1 / (a - 1)"), "alice/c": Expression("3")}
    root = set_values(run_context, values, dict.fromkeys(values, float), a="alice/a")
    assert play(root, "F") == "F"
    assert (root.cause, "divides by zero" in root.message) == (Cause.PRECONDITION, True)
    assert run_context.board.values() == {"alice/a": 1.0}


# Watches.


def test_must_hold(run_context, robot):
    watch = MustHold(value("battery > 0.5"), "it is full").for_run(run_context)
    watch.begin(run_context)
    assert watch.check(run_context) is None
    robot.charge = 0.4
    verdict = watch.check(run_context)
    assert isinstance(verdict, Failed)
    assert (verdict.cause, verdict.message) == (Cause.PRECONDITION, "it is no longer true that it is full")


def test_must_hold_without_a_value(run_context):
    verdict = MustHold(value("n > 1", n="alice/n"), "n").for_run(run_context).check(run_context)
    assert isinstance(verdict, Failed)
    assert verdict.cause is Cause.ERROR


def test_must_hold_waits_for_what_is_not_known_yet(run_context):
    assert isinstance(MustHold(decision(LOOK, FIRST), "so").for_run(run_context).check(run_context), Waiting)


@pytest.fixture
def calls(run_context):
    """Whether a watch calls at each value that is set."""

    def watched(decision, set_value, values):
        watch, found = MustNotBegin(decision, "so").for_run(run_context), []
        watch.begin(run_context)
        for each in values:
            set_value(each)
            found.append(isinstance(watch.check(run_context), Failed))
            if found[-1]:
                watch.note_call()
        return found

    return watched


def test_must_not_begin_calls_once_until_it_was_false_in_between(calls, robot):
    holding = (False, True, True, False, True)
    found = calls(value("holding"), lambda holds: setattr(robot, "holding", holds), holding)
    assert found == [False, True, False, False, True]


def test_must_not_begin_is_called_once_by_each_press(calls, pressed):
    found = calls(button("go"), lambda presses: pressed.update(go=presses), (0, 1, 1, 2, 2))
    assert found == [False, True, False, True, False]


def test_a_pause_lasts_on_the_robots_clock(context, clock):
    # time  0.0 RUNNING   0.4 RUNNING   0.5 SUCCESS
    leaf = Pause(path_id="alice/p", name="p", duration_s=0.5, clock=context.clock)
    said = []
    for step_s in (0.4, 0.1, 0.0):
        said += tick(leaf)
        clock.advance(step_s)
    assert said == [R, R, S]
