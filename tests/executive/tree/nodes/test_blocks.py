"""Choose, repeat, try, together and always: every outcome of their children, cancel and suspension at each of them."""

from dataclasses import replace

import pytest
from py_trees.common import Status

from executive.tree.behaviour import suspend
from executive.tree.context import Endings
from executive.tree.nodes.composites import Choose, MemorySequence, Together, Try
from executive.tree.nodes.group import Always
from executive.tree.nodes.guard import Guard
from executive.tree.nodes.policies import Retry, Skip, Timeout
from executive.tree.nodes.repeat import Repeat
from skills.api import Cause, Failed
from tests.executive.tree.scripted import Leaf, letters, tick

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID
KEY, COUNT = "alice/decided", "alice/rounds"


@pytest.fixture
def log():
    return []


@pytest.fixture
def leaf(log):
    return lambda script, name="leaf", **more: Leaf(script, name, log, **more)


@pytest.fixture
def answers(leaf, context):
    """A leaf that leaves answers under the key, one after the other."""

    def answering(script, *values, name="decide"):
        left = list(values)
        return leaf(script, name, put=lambda: context.board.put(KEY, left.pop(0) if len(left) > 1 else left[0]))

    return answering


# Choose: what decides, then the branch.
#
#   decides  answer   then  else    status           done
#   S        true     RS    -       RUNNING SUCCESS  decide, then
#   S        false    S     S       SUCCESS          decide, else
#   S        true     F     S       FAILURE          decide, then
#   RS       false    S     RS      R R S            decide, else
#   F        -        S     S       FAILURE          decide
#   E        -        S     S       FAILURE (ERROR)  decide
CHOOSE = [
    ("S", True, "RS", "S", "RS", ["+decide", "+then"]),
    ("S", False, "S", "S", "S", ["+decide", "+else"]),
    ("S", True, "F", "S", "F", ["+decide", "+then"]),
    ("RS", False, "S", "RS", "RRS", ["+decide", "+else"]),
    ("F", True, "S", "S", "F", ["+decide"]),
    ("E", True, "S", "S", "F", ["+decide"]),
]


def choose(context, decide, *branches):
    numbers = {True: 1, False: 2} if len(branches) == 2 else {True: 1}
    return Choose(
        path_id="alice/if", name="if", children=[decide, *branches], branches=numbers, key=KEY, board=context.board
    )


@pytest.mark.parametrize(("decides", "answer", "then", "other", "expected", "done"), CHOOSE)
def test_choose(context, answers, leaf, log, decides, answer, then, other, expected, done):
    root = choose(context, answers(decides, answer), leaf(then, "then"), leaf(other, "else"))
    assert letters(root, len(expected)) == expected
    assert log == done
    assert root.cause is {"F": Cause.EXECUTION, "E": Cause.ERROR}.get(decides if expected == "F" else "", root.cause)


def test_choose_without_a_branch_for_the_answer_succeeds(context, answers, leaf, log):
    assert letters(choose(context, answers("S", False), leaf("F", "then")), 1) == "S"
    assert log == ["+decide"]


@pytest.mark.parametrize(("ticks", "stopped"), [(1, "-decide"), (2, "-then")])
def test_choose_cancelled(context, answers, leaf, log, ticks, stopped):
    root = choose(context, answers("RS", True), leaf("RRR", "then"))
    tick(root, ticks)
    root.stop(N)
    assert (root.status, root.cause, log[-1]) == (N, Cause.CANCELLED, stopped)


def test_choose_decides_again_when_it_starts_again(context, answers, leaf, log):
    root = choose(context, answers("S", True, False), leaf("S", "then"), leaf("S", "else"))
    assert letters(root, 2) == "SS"
    assert log == ["+decide", "+then", "+decide", "+else"]


def test_choose_keeps_its_branch_over_a_suspension_whatever_would_be_decided_now(context, answers, leaf, log):
    then = leaf("RRS", "then")
    root = choose(context, answers("S", True), then, leaf("S", "else"))
    tick(root)
    suspend(root)
    context.board.put(KEY, False)
    assert letters(root, 2) == "RS"
    assert (then.suspended, log) == (1, ["+decide", "+then"])


# Repeat.
#
#   mode    times  body    decision          status   rounds  cause
#   times   3      S       -                 R R S    3
#   times   2      RS      -                 R R R S  2
#   times   3      SF      -                 R F      2       EXECUTION
#   until   -      S       F F T             R R S    3
#   until   2      S       F F               R F      2       POSTCONDITION
#   until   -      E       -                 F        1       ERROR
#   while   -      S       T T F             R R S    2 done
#   while   -      S       F                 S        0 done
#   while   2      S       T T T             R R F    2 done  POSTCONDITION
REPEAT = [
    ("times", 3, "S", [], "RRS", 3, None),
    ("times", 2, "RS", [], "RRRS", 2, None),
    ("times", 1, "S", [], "S", 1, None),
    ("times", 3, "SF", [], "RF", 2, Cause.EXECUTION),
    ("until", None, "S", [False, False, True], "RRS", 3, None),
    ("until", None, "S", [True], "S", 1, None),
    ("until", 2, "S", [False, False], "RF", 2, Cause.POSTCONDITION),
    ("until", None, "E", [True], "F", 1, Cause.ERROR),
    ("while", None, "S", [True, True, False], "RRS", 3, None),
    ("while", None, "S", [False], "S", 1, None),
    ("while", 2, "S", [True, True, True], "RRF", 3, Cause.POSTCONDITION),
    ("while", 2, "S", [True, True, False], "RRS", 3, None),
    ("while", 2, "F", [True], "F", 1, Cause.EXECUTION),
]


def repeat(context, mode, body, decide=None, times=None, every_s=0.0):
    return Repeat(
        path_id="alice/repeat",
        name="repeat",
        children=[body] if decide is None else [decide, body],
        mode=mode,
        words="it is so",
        count=COUNT,
        key="" if decide is None else KEY,
        times=times,
        every_s=every_s,
        board=context.board,
        clock=context.clock,
    )


@pytest.mark.parametrize(("mode", "times", "body", "decisions", "expected", "rounds", "cause"), REPEAT)
def test_repeat(context, answers, leaf, mode, times, body, decisions, expected, rounds, cause):
    script = body if body != "RS" else "RSRS"
    root = repeat(context, mode, leaf(script, "body"), answers("S", *decisions) if decisions else None, times)
    assert letters(root, len(expected)) == expected
    assert (context.board.get(COUNT), root.cause) == (rounds, cause)
    assert root.message


@pytest.mark.parametrize("mode", ["until", "while"])
def test_repeat_fails_with_its_decision(context, answers, leaf, mode):
    root = repeat(context, mode, leaf("S", "body"), answers("F", True))
    assert letters(root, 1) == "F"
    assert root.cause is Cause.EXECUTION


def test_repeat_counts_from_zero_when_it_starts_again(context, leaf):
    root = repeat(context, "times", leaf("S", "body"), times=2)
    assert letters(root, 4) == "RSRS"
    assert context.board.get(COUNT) == 2


def test_a_round_begins_so_long_after_the_one_before_began(context, clock, leaf, log):
    # at (s)   0      1      2      5           10
    # body     R      S      waits  R S at once  S
    root = repeat(context, "times", leaf("RSS", "body"), times=3, every_s=5.0)
    begun = []
    while root.status != S:
        root.tick_once()
        if log:
            begun.append((clock.now(), log.pop()))
        clock.advance(1.0)
    assert begun == [(0.0, "+body"), (5.0, "+body"), (10.0, "+body")]


def test_a_round_that_takes_longer_than_the_period_is_followed_at_once(context, clock, leaf, log):
    root = repeat(context, "times", leaf("RRRSS", "body"), times=2, every_s=2.0)
    for _ in range(5):
        root.tick_once()
        clock.advance(1.0)
    assert (log, root.status) == (["+body", "+body"], S)


@pytest.mark.parametrize(
    ("mode", "ticks", "stopped"),
    [
        ("times", 1, "-body"),
        ("while", 1, "-decide"),
        ("while", 2, "-body"),
        ("until", 1, "-body"),
        ("until", 3, "-decide"),
    ],
)
def test_repeat_cancelled(context, answers, leaf, log, mode, ticks, stopped):
    decide = None if mode == "times" else answers("RSRS", mode == "while")
    root = repeat(context, mode, leaf("RRSRRS", "body"), decide, times=9)
    tick(root, ticks)
    root.stop(N)
    assert (root.status, root.cause, log[-1]) == (N, Cause.CANCELLED, stopped)


def test_repeat_cancelled_between_two_rounds(context, clock, leaf, log):
    root = repeat(context, "times", leaf("S", "body"), times=2, every_s=5.0)
    tick(root, 2)
    root.stop(N)
    assert (root.status, log) == (N, ["+body"])


def test_repeat_keeps_its_round_over_a_suspension(context, leaf, log):
    body = leaf("SRRS", "body")
    root = repeat(context, "times", body, times=2)
    tick(root, 2)
    suspend(root)
    assert letters(root, 2) == "RS"
    assert (body.suspended, log, context.board.get(COUNT)) == (1, ["+body", "+body"], 2)


# Try: the first, or when it fails the second.
#
#   first  second  status  cause      done
#   RS     S       R S     -          first
#   F      RS      R S     -          first, second
#   RF     F       R F     EXECUTION  first, second
#   E      S       F       ERROR      first
#   C      S       F       CANCELLED  first
TRY = [
    ("RS", "S", "RS", None, ["+first"]),
    ("F", "RS", "RS", None, ["+first", "+second"]),
    ("RF", "F", "RF", Cause.EXECUTION, ["+first", "+second"]),
    ("F", "E", "F", Cause.ERROR, ["+first", "+second"]),
    ("E", "S", "F", Cause.ERROR, ["+first"]),
    ("C", "S", "F", Cause.CANCELLED, ["+first"]),
]


def try_(*children):
    return Try(path_id="alice/try", name="try", children=list(children))


@pytest.mark.parametrize(("first", "second", "expected", "cause", "done"), TRY)
def test_try(leaf, log, first, second, expected, cause, done):
    root = try_(leaf(first, "first"), leaf(second, "second"))
    assert letters(root, len(expected)) == expected
    assert (root.cause, log) == (cause, done)


def test_try_tells_both_sentences(leaf):
    root = try_(leaf("F", "first"), leaf("F", "second"))
    tick(root)
    assert root.message == "second F, since first F"


@pytest.mark.parametrize(("first", "stopped"), [("RR", "-first"), ("FR", "-second")])
def test_try_cancelled(leaf, log, first, stopped):
    root = try_(leaf(first, "first"), leaf("RRR", "second"))
    tick(root)
    root.stop(N)
    assert (root.status, root.cause, log[-1]) == (N, Cause.CANCELLED, stopped)


def test_try_stays_with_the_second_over_a_suspension(leaf, log):
    root = try_(leaf("FS", "first"), leaf("RS", "second"))
    tick(root)
    suspend(root)
    assert letters(root, 1) == "S"
    assert log == ["+first", "+second"]


# Together.
#
#   needed  first  second  third  status  cause      stopped
#   3       S      RS      RRS    R R S   -          -
#   3       R      RF      R      R F     EXECUTION  first, third
#   1       RRR    RS      RRR    R S     -          first, third
#   1       F      RF      RRS    R R S   -          -
#   1       F      F       RE     R F     EXECUTION  -
#   2       S      F       RRS    R R S   -          -
#   2       RRR    F       RF     R F     EXECUTION  first
TOGETHER = [
    (3, "S", "RS", "RRS", "RRS", None, []),
    (3, "RRR", "RF", "RRR", "RF", Cause.EXECUTION, ["-a", "-c"]),
    (1, "RRR", "RS", "RRR", "RS", None, ["-a", "-c"]),
    (1, "F", "RF", "RRS", "RRS", None, []),
    (1, "F", "F", "RE", "RF", Cause.EXECUTION, []),
    (2, "S", "F", "RRS", "RRS", None, []),
    (2, "RRR", "F", "RF", "RF", Cause.EXECUTION, ["-a"]),
    (3, "E", "RRR", "RRR", "F", Cause.ERROR, []),
]


def together(needed, *children):
    return Together(path_id="alice/together", name="together", children=list(children), needed=needed)


@pytest.mark.parametrize(("needed", "a", "b", "c", "expected", "cause", "stopped"), TOGETHER)
def test_together(leaf, log, needed, a, b, c, expected, cause, stopped):
    root = together(needed, leaf(a, "a"), leaf(b, "b"), leaf(c, "c"))
    assert letters(root, len(expected)) == expected
    assert (root.cause, [each for each in log if each[0] == "-"]) == (cause, stopped)
    assert not any(child.status == R for child in root.children)


def test_together_does_not_tick_again_what_is_done(leaf):
    done = leaf("S", "a")
    tick(together(2, done, leaf("RRS", "b")), 3)
    assert done.ticks == 1


def test_together_begins_all_again_when_it_starts_again(leaf, log):
    root = together(2, leaf("S", "a"), leaf("S", "b"))
    assert letters(root, 2) == "SS"
    assert log == ["+a", "+b", "+a", "+b"]


def test_together_cancelled_stops_all_that_runs_and_keeps_what_is_done(leaf, log):
    root = together(3, leaf("S", "a"), leaf("RR", "b"), leaf("RR", "c"))
    tick(root)
    root.stop(N)
    assert ([child.status for child in root.children], root.cause) == ([S, N, N], Cause.CANCELLED)
    assert log[-2:] == ["-b", "-c"]


def test_together_goes_on_after_a_suspension(leaf):
    running = leaf("RRS", "b")
    root = together(2, leaf("S", "a"), running)
    tick(root)
    suspend(root)
    assert letters(root, 2) == "RS"
    assert running.suspended == 1


# Always: first, and what is done in the end.
#
#   first  last  status  cause
#   RS     RS    R R S   -
#   F      S     F       EXECUTION of the first
#   S      F     F       EXECUTION of the last
#   F      E     F       EXECUTION of the first, the last's failure in the sentence
#   E      S     F       ERROR
#   C      S     F       CANCELLED
ALWAYS = [
    ("RS", "RS", "RRS", None, "first S"),
    ("F", "S", "F", Cause.EXECUTION, "first F"),
    ("S", "F", "F", Cause.EXECUTION, "first S, but then: last F"),
    ("S", "E", "F", Cause.ERROR, "first S, but then: last E"),
    ("F", "E", "F", Cause.EXECUTION, "first F (last failed: last E)"),
    ("E", "S", "F", Cause.ERROR, "first E"),
    ("C", "RS", "RF", Cause.CANCELLED, "first C"),
]


@pytest.fixture
def run_context(context):
    return replace(context, endings=Endings())


@pytest.fixture
def always(run_context):
    def make(first, last, name="always"):
        return Always(path_id=f"alice/{name}", name=name, children=[first, last], context=run_context)

    return make


@pytest.fixture
def run(run_context):
    """Tick as a run does: what is due in the end before anything else; the root until it is over."""
    begun = set()

    def ticks(root, times=1):
        for _ in range(times):
            due = run_context.endings.due
            if due is None:
                if root.status == R or root.id not in begun:
                    begun.add(root.id)
                    root.tick_once()
                continue
            suspend(root)
            list(due.tick())
            if due.status != R:
                run_context.endings.pop()

    return ticks


@pytest.mark.parametrize(("first", "last", "expected", "cause", "message"), ALWAYS)
def test_always(always, leaf, log, first, last, expected, cause, message):
    root = always(leaf(first, "first"), leaf(last, "last"))
    assert letters(root, len(expected)) == expected
    assert (root.cause, root.message, log) == (cause, message, ["+first", "+last"])


@pytest.mark.parametrize(
    ("first", "last", "ticks", "then"),
    [
        ("RRR", "RS", 1, ["-first", "+last"]),  # cancelled while the first runs
        ("RS", "RRS", 2, []),  # cancelled while the last runs: it goes on
        ("F", "RRS", 1, []),
    ],
)
def test_always_cancelled_does_the_last_to_its_end(always, run, run_context, leaf, log, first, last, ticks, then):
    root = always(leaf(first, "first"), leaf(last, "last"))
    run(root, ticks)
    before = len(log)
    root.stop(N)
    assert (root.status, root.cause) == (N, Cause.CANCELLED)
    assert run_context.endings.due is root.children[1]
    run(root, 3)
    assert run_context.endings.due is None
    assert log[before:] == then
    assert root.children[1].status == S


def test_always_that_has_not_begun_does_nothing_when_cancelled(always, run_context, leaf, log):
    root = always(leaf("RS", "first"), leaf("S", "last"))
    root.stop(N)
    assert (run_context.endings.due, log) == (None, [])


def test_always_that_is_over_does_nothing_when_cancelled(always, run_context, leaf, log):
    root = always(leaf("S", "first"), leaf("S", "last"))
    tick(root)
    root.stop(N)
    assert (run_context.endings.due, log) == (None, ["+first", "+last"])


def test_a_second_cancel_while_the_last_runs_stops_it(always, run, run_context, leaf, log):
    root = always(leaf("RR", "first"), leaf("RRR", "last"))
    run(root)
    root.stop(N)
    run(root)
    for node in run_context.endings.close():
        node.stop(N)
    assert log == ["+first", "-first", "+last", "-last"]


def test_cancelled_after_the_endings_were_closed_it_does_no_more(always, run, run_context, leaf, log):
    root = always(leaf("RR", "first"), leaf("S", "last"))
    run(root)
    run_context.endings.close()
    root.stop(N)
    assert log == ["+first", "-first"]


def test_nested_always_cancelled_inner_first(always, run, leaf, log):
    root = always(always(leaf("RR", "first"), leaf("RS", "inner"), "in"), leaf("S", "outer"))
    run(root)
    root.stop(N)
    run(root, 3)
    assert log == ["+first", "-first", "+inner", "+outer"]


def test_nested_always_fails_inner_first(always, leaf, log):
    root = always(always(leaf("F", "first"), leaf("RF", "inner"), "in"), leaf("S", "outer"))
    assert letters(root, 2) == "RF"
    assert log == ["+first", "+inner", "+outer"]
    assert root.cause is Cause.EXECUTION


def test_nested_always_within_the_last_part(always, run, leaf, log):
    # cancelled while the last part runs one of its own: both are done, the inner one first
    last = always(leaf("RRRS", "end"), leaf("S", "end of end"), "in")
    root = always(leaf("RR", "first"), last)
    run(root)
    root.stop(N)
    run(root, 6)
    assert log == ["+first", "-first", "+end", "+end of end"]


def timeout(child, limit_s, context):
    return Timeout(path_id="alice/timeout", name="timeout", child=child, limit_s=limit_s, clock=context.clock)


def test_timeout_around_it(always, run, run_context, clock, leaf, log):
    root = timeout(always(leaf("RRRR", "first"), leaf("RS", "last")), 1.5, run_context)
    for _ in range(5):
        run(root)
        clock.advance(1.0)
    assert (root.status, root.cause, log) == (F, Cause.TIMEOUT, ["+first", "-first", "+last"])
    assert run_context.endings.due is None


def test_timeout_around_it_while_the_last_runs(always, run, run_context, clock, leaf, log):
    root = timeout(always(leaf("S", "first"), leaf("RRRRS", "last")), 1.5, run_context)
    for _ in range(3):
        run(root)
        clock.advance(1.0)
    assert (root.status, root.cause) == (F, Cause.TIMEOUT)
    run(root, 3)
    assert (log, run_context.endings.due) == (["+first", "+last"], None)


class Switch:
    """A condition whose verdict is set by hand."""

    verdict = None

    def for_run(self, context):
        return self

    def begin(self, context):
        pass

    def check(self, context):
        return self.verdict


def test_guard_around_it(always, run, run_context, leaf, log):
    switch = Switch()
    inner = always(leaf("RRRR", "first"), leaf("RS", "last"))
    root = Guard(path_id="alice/guard", name="guard", child=inner, condition=switch, context=run_context)
    run(root)
    switch.verdict = Failed(Cause.PRECONDITION, "no more")
    run(root, 3)
    assert (root.status, root.cause) == (F, Cause.PRECONDITION)
    assert (log, run_context.endings.due) == (["+first", "-first", "+last"], None)


def retry(child, attempts=3):
    causes = frozenset(Cause)
    return Retry(path_id="alice/retry", name="retry", child=child, attempts=attempts, causes=causes)


def test_retry_around_it_does_the_last_before_the_next_attempt(always, run, leaf, log):
    root = retry(always(leaf("FS", "first"), leaf("RSRS", "last")))
    run(root, 4)
    assert (root.status, log) == (S, ["+first", "+last", "+first", "+last"])


def test_retry_around_a_timeout_around_it_does_the_last_before_the_next_attempt(
    always, run, run_context, clock, leaf, log
):
    root = retry(timeout(always(leaf("RRRS", "first"), leaf("RSS", "last")), 1.5, run_context))
    for _ in range(9):
        run(root)
        clock.advance(1.0)
        if root.status == S and run_context.endings.due is None:
            break
    assert log == ["+first", "-first", "+last", "+first", "+last"]
    assert root.status == S


def test_cancel_while_the_last_of_a_failed_attempt_is_done_lets_it_go_on_where_it_was(
    always, run, run_context, clock, leaf, log
):
    # the timeout has handed the last part to the run, and a retry above still runs when it is cancelled
    last = MemorySequence(path_id="alice/last", name="last", children=[leaf("S", "one"), leaf("RRS", "two")])
    root = retry(timeout(always(leaf("RRRR", "first"), last), 0.5, run_context))
    run(root)
    clock.advance(1.0)
    run(root, 2)
    assert log == ["+first", "-first", "+one", "+two"]
    root.stop(N)
    run(root, 3)
    assert log == ["+first", "-first", "+one", "+two"]
    assert (last.status, run_context.endings.due) == (S, None)


def test_always_beside_another_that_ends_it(always, run, run_context, leaf, log):
    root = together(1, always(leaf("RRR", "first"), leaf("RS", "last")), leaf("RS", "other"))
    run(root, 4)
    assert (root.status, run_context.endings.due) == (S, None)
    assert log == ["+first", "+other", "-first", "+last"]


def test_a_cancelled_step_that_is_done_in_the_end_is_not_done_twice(always, run, run_context, leaf, log):
    inner = always(leaf("RR", "first"), leaf("RS", "last"))
    root = Skip(path_id="alice/skip", name="skip", child=inner, step="it")
    run(root)
    root.stop(N)
    root.stop(N)
    run(root, 2)
    assert (log, run_context.endings.due) == (["+first", "-first", "+last"], None)


def test_always_goes_on_after_a_suspension_in_either_part(always, leaf, log):
    first, last = leaf("RRS", "first"), leaf("RRS", "last")
    root = always(first, last)
    tick(root)
    suspend(root)
    tick(root, 2)
    suspend(root)
    assert letters(root, 2) == "RS"
    assert (first.suspended, last.suspended, log) == (1, 1, ["+first", "+last"])
