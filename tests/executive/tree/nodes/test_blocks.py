"""Choose, repeat, try, together and always: every outcome of their children, cancel and suspension at each of them."""

from dataclasses import replace

import pytest

from executive.tree.behaviour import suspend
from executive.tree.context import Endings
from executive.tree.nodes.composites import Choose, MemorySequence, Together, Try
from executive.tree.nodes.group import Always
from executive.tree.nodes.guard import Guard
from executive.tree.nodes.policies import Retry, Skip, Timeout
from executive.tree.nodes.repeat import Repeat
from skills.api import Cause, Failed
from tests.executive.tree.scripted import F, Leaf, N, R, S, Switch, play, tick

KEY, COUNT = "alice/decided", "alice/rounds"
CANCELLED, ERROR, EXECUTION, POSTCONDITION = Cause.CANCELLED, Cause.ERROR, Cause.EXECUTION, Cause.POSTCONDITION
TIMEOUT, PRECONDITION = Cause.TIMEOUT, Cause.PRECONDITION

# The tables have scripts of the children, the root's status ("|": it is suspended, "I": it is stopped), its cause, and
# what is done to the children: begun (+), suspended (~), stopped (-).


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


def choose(context, decide, *branches):
    numbers = dict(zip((True, False), range(1, len(branches) + 1), strict=False))
    return Choose(
        path_id="alice/if", name="if", children=[decide, *branches], branches=numbers, key=KEY, board=context.board
    )


# decides  answers        then   else   status   cause       done
CHOOSE = [
    ("E", [True], "S", "S", "F", ERROR, "+decide"),
    ("F", [True], "S", "S", "F", EXECUTION, "+decide"),
    ("RS", [False], "S", "RS", "RRS", None, "+decide +else"),
    ("RS", [True], "RRR", "S", "RI", CANCELLED, "+decide -decide"),
    ("RS", [True], "RRR", "S", "RRI", CANCELLED, "+decide +then -then"),
    ("S", [False], "F", None, "S", None, "+decide"),
    ("S", [False], "S", "S", "S", None, "+decide +else"),
    ("S", [True, False], "S", "S", "SS", None, "+decide +then +decide +else"),
    ("S", [True], "F", "S", "F", EXECUTION, "+decide +then"),
    ("S", [True], "RS", "S", "RS", None, "+decide +then"),
]


@pytest.mark.parametrize(("decides", "given", "then", "other", "expected", "cause", "done"), CHOOSE)
def test_choose(context, answers, leaf, log, decides, given, then, other, expected, cause, done):
    branches = [leaf(script, name) for script, name in ((then, "then"), (other, "else")) if script]
    root = choose(context, answers(decides, *given), *branches)
    assert play(root, expected) == expected
    assert (root.cause, " ".join(log)) == (cause, done)


def test_choose_keeps_its_branch_over_a_suspension_whatever_would_be_decided_now(context, answers, leaf, log):
    root = choose(context, answers("S", True), leaf("RRS", "then"), leaf("S", "else"))
    assert play(root, "R|") == "R|"
    context.board.put(KEY, False)
    assert play(root, "RS") == "RS"
    assert log == ["+decide", "+then", "~then"]


def repeat(context, mode, body, decide=None, times=None, every_s=0.0, until_clock_s=None):
    return Repeat(
        path_id="alice/repeat",
        name="repeat",
        children=[body] if decide is None else [decide, body],
        mode=mode,
        words="it is so" if until_clock_s is None else "the hour",
        count=COUNT,
        key="" if decide is None else KEY,
        times=times,
        every_s=every_s,
        until_clock_s=until_clock_s,
        board=context.board,
        context=context,
    )


# mode  times  body  decides  answers  status  rounds  cause  last done
REPEAT = [
    ("times", 1, "S", "", [], "S", 1, None, "+body"),
    ("times", 2, "RSRS", "", [], "RRRS", 2, None, "+body"),
    ("times", 2, "S", "", [], "RSRS", 2, None, "+body"),
    ("times", 2, "SRRS", "", [], "RR|RS", 2, None, "~body"),
    ("times", 3, "S", "", [], "RRS", 3, None, "+body"),
    ("times", 3, "SF", "", [], "RF", 2, EXECUTION, "+body"),
    ("times", 9, "RRSRRS", "", [], "RI", 1, CANCELLED, "-body"),
    ("until", 2, "S", "S", [False, False], "RF", 2, POSTCONDITION, "+decide"),
    ("until", 9, "RRSRRS", "RSRS", [False], "RI", 1, CANCELLED, "-body"),
    ("until", 9, "RRSRRS", "RSRS", [False], "RRRI", 1, CANCELLED, "-decide"),
    ("until", None, "E", "S", [True], "F", 1, ERROR, "+body"),
    ("until", None, "S", "F", [True], "F", 1, EXECUTION, "+decide"),
    ("until", None, "S", "S", [False, False, True], "RRS", 3, None, "+decide"),
    ("until", None, "S", "S", [True], "S", 1, None, "+decide"),
    ("while", 2, "F", "S", [True], "F", 1, EXECUTION, "+body"),
    ("while", 2, "S", "S", [True, True, False], "RRS", 3, None, "+decide"),
    ("while", 2, "S", "S", [True, True, True], "RRF", 3, POSTCONDITION, "+decide"),
    ("while", 9, "RRSRRS", "RSRS", [True], "RI", 1, CANCELLED, "-decide"),
    ("while", 9, "RRSRRS", "RSRS", [True], "RRI", 1, CANCELLED, "-body"),
    ("while", None, "S", "F", [True], "F", 1, EXECUTION, "+decide"),
    ("while", None, "S", "S", [False], "S", 1, None, "+decide"),
    ("while", None, "S", "S", [True, True, False], "RRS", 3, None, "+decide"),
]


@pytest.mark.parametrize(("mode", "times", "body", "decides", "given", "expected", "rounds", "cause", "last"), REPEAT)
def test_repeat(context, answers, leaf, log, mode, times, body, decides, given, expected, rounds, cause, last):
    root = repeat(context, mode, leaf(body, "body"), answers(decides, *given) if decides else None, times)
    assert play(root, expected) == expected
    assert (context.board.get(COUNT), root.cause, log[-1]) == (rounds, cause, last)
    assert root.message


# period  body     rounds  rounds begin at (s): a round that is late is followed at once
@pytest.mark.parametrize(
    ("every_s", "body", "times", "begins_s"), [(5.0, "RSS", 3, [0.0, 5.0, 10.0]), (2.0, "RRRSS", 2, [0.0, 4.0])]
)
def test_a_round_begins_so_long_after_the_one_before_began(context, clock, leaf, log, every_s, body, times, begins_s):
    root = repeat(context, "times", leaf(body, "body"), times=times, every_s=every_s)
    begun = []
    while root.status != S:
        root.tick_once()
        begun += [(clock.now(), log.pop())] if log else []
        clock.advance(1.0)
    assert begun == [(begin_s, "+body") for begin_s in begins_s]


# now (h)  until (h)  rounds begin at (s)             end (s)  status
UNTIL_CLOCK = [
    (17.5, 18.0, [0.0, 600.0, 1200.0], 1800.0, S),  # none begins at 18:00
    (17.9, 18.0, [0.0], 360.0, S),  # the pause ends at 18:00
    (18.0, 18.0, [], 0.0, F),
    (19.0, 18.0, [], 0.0, F),
    (23.9, 0.1, [0.0, 600.0], 720.0, S),  # over midnight
]


@pytest.mark.parametrize(("now_h", "until_h", "begins_s", "end_s", "status"), UNTIL_CLOCK)
def test_rounds_begin_until_a_time_of_day(context, clock, leaf, log, now_h, until_h, begins_s, end_s, status):
    context = replace(context, day_began_s=now_h * 3600.0 - clock.now())
    root = repeat(context, "times", leaf("RS" * 9, "body"), every_s=600.0, until_clock_s=until_h * 3600.0)
    begun, start_s = [], clock.now()
    root.tick_once()
    while root.status == R:
        begun += [clock.now() - start_s] if log else []
        log.clear()
        clock.advance(60.0)
        root.tick_once()
    assert (begun, clock.now() - start_s, root.status) == (begins_s, end_s, status)
    assert "it is past the hour" in root.message if status == F else f"{len(begun)} round" in root.message


def test_repeat_cancelled_between_two_rounds(context, leaf, log):
    assert play(repeat(context, "times", leaf("S", "body"), times=2, every_s=5.0), "RRI") == "RRI"
    assert log == ["+body"]


# first  second  status  cause    done
TRY = [
    ("C", "S", "F", CANCELLED, "+first"),
    ("E", "S", "F", ERROR, "+first"),
    ("F", "E", "F", ERROR, "+first +second"),
    ("F", "RS", "RS", None, "+first +second"),
    ("FR", "RRR", "RI", CANCELLED, "+first +second -second"),
    ("FS", "RS", "R|S", None, "+first +second ~second"),
    ("RF", "F", "RF", EXECUTION, "+first +second"),
    ("RR", "RRR", "RI", CANCELLED, "+first -first"),
    ("RS", "S", "RS", None, "+first"),
]


@pytest.mark.parametrize(("first", "second", "expected", "cause", "done"), TRY)
def test_try(leaf, log, first, second, expected, cause, done):
    root = Try(path_id="alice/try", name="try", children=[leaf(first, "first"), leaf(second, "second")])
    assert play(root, expected) == expected
    assert (root.cause, " ".join(log)) == (cause, done)


def test_try_tells_both_sentences(leaf):
    root = Try(path_id="alice/try", name="try", children=[leaf("F", "first"), leaf("F", "second")])
    assert (tick(root), root.message) == ([root.status], "second F, since first F")


def together(needed, *children):
    return Together(path_id="alice/together", name="together", children=list(children), needed=needed)


# needed  a  b  c  status  cause  done  children in the end
TOGETHER = [
    (1, "F", "F", "RE", "RF", EXECUTION, "+a +b +c", "FFF"),
    (1, "F", "RF", "RRS", "RRS", None, "+a +b +c", "FFS"),
    (1, "RRR", "RS", "RRR", "RS", None, "+a +b +c -a -c", "ISI"),
    (2, "RRR", "F", "RF", "RF", EXECUTION, "+a +b +c -a", "IFF"),
    (2, "S", "F", "RRS", "RRS", None, "+a +b +c", "SFS"),
    (3, "E", "RRR", "RRR", "F", ERROR, "+a", "FII"),
    (3, "RRR", "RF", "RRR", "RF", EXECUTION, "+a +b +c -a -c", "IFI"),
    (3, "S", "RR", "RR", "RI", CANCELLED, "+a +b +c -b -c", "SII"),
    (3, "S", "RRS", "S", "R|RS", None, "+a +b +c ~b", "SSS"),
    (3, "S", "RS", "RRS", "RRS", None, "+a +b +c", "SSS"),
    (3, "S", "S", "S", "SS", None, "+a +b +c +a +b +c", "SSS"),
]


@pytest.mark.parametrize(("needed", "a", "b", "c", "expected", "cause", "done", "ends"), TOGETHER)
def test_together(leaf, log, needed, a, b, c, expected, cause, done, ends):
    root = together(needed, leaf(a, "a"), leaf(b, "b"), leaf(c, "c"))
    assert play(root, expected) == expected
    assert (root.cause, " ".join(log)) == (cause, done)
    assert "".join(child.status.value[0] for child in root.children) == ends


def test_together_does_not_tick_again_what_is_done(leaf):
    done = leaf("S", "a")
    tick(together(2, done, leaf("RRS", "b")), 3)
    assert done.ticks == 1


# Always: first, and what is done in the end.


def done(log):
    """What was done, without suspensions."""
    return " ".join(each for each in log if each[0] != "~")


@pytest.fixture
def run_context(context):
    return replace(context, endings=Endings())


@pytest.fixture
def always(run_context):
    def make(first, last, name="always"):
        return Always(path_id=f"alice/{name}", name=name, children=[first, last], context=run_context)

    return make


# first  last  status  cause  sentence  done
ALWAYS = [
    ("C", "RS", "RF", CANCELLED, "first C", "+first +last"),
    ("E", "S", "F", ERROR, "first E", "+first +last"),
    ("F", "E", "F", EXECUTION, "first F (last failed: last E)", "+first +last"),
    ("F", "S", "F", EXECUTION, "first F", "+first +last"),
    ("RRS", "RRS", "R|RR|RS", None, "first S", "+first ~first +last ~last"),
    ("RS", "RS", "RRS", None, "first S", "+first +last"),
    ("S", "E", "F", ERROR, "first S, but then: last E", "+first +last"),
    ("S", "F", "F", EXECUTION, "first S, but then: last F", "+first +last"),
]


@pytest.mark.parametrize(("first", "last", "expected", "cause", "message", "done"), ALWAYS)
def test_always(always, leaf, log, first, last, expected, cause, message, done):
    root = always(leaf(first, "first"), leaf(last, "last"))
    assert play(root, expected) == expected
    assert (root.cause, root.message, " ".join(log)) == (cause, message, done)


@pytest.fixture
def run(run_context, clock):
    """Ticks as a run does, each second: what is due in the end before anything else; the root until it is over."""
    begun = set()

    def ticks(root, times=1):
        for _ in range(times):
            due = run_context.endings.due
            if due is not None:
                suspend(root)
                list(due.tick())
                if due.status != R:
                    run_context.endings.pop()
            elif root.status == R or root.id not in begun:
                begun.add(root.id)
                root.tick_once()
            clock.advance(1.0)

    return ticks


@pytest.mark.parametrize(
    ("first", "last", "ticks", "then"),
    [
        ("RRR", "RS", 1, "-first +last"),  # cancelled while the first runs
        ("RS", "RRS", 2, ""),  # cancelled while the last runs: it goes on
        ("F", "RRS", 1, ""),
    ],
)
def test_always_cancelled_does_the_last_to_its_end(always, run, run_context, leaf, log, first, last, ticks, then):
    root = always(leaf(first, "first"), leaf(last, "last"))
    run(root, ticks)
    log.clear()
    root.stop(N)
    assert (root.status, root.cause) == (N, CANCELLED)
    assert run_context.endings.due is root.children[1]
    run(root, 3)
    assert done(log) == then
    assert (run_context.endings.due, root.children[1].status) == (None, S)


def test_a_second_cancel_while_the_last_runs_stops_it(always, run, run_context, leaf, log):
    root = always(leaf("RR", "first"), leaf("RRR", "last"))
    run(root)
    root.stop(N)
    run(root)
    for node in run_context.endings.close():
        node.stop(N)
    assert done(log) == "+first -first +last -last"


def test_cancelled_after_the_endings_were_closed_it_does_no_more(always, run, run_context, leaf, log):
    root = always(leaf("RR", "first"), leaf("S", "last"))
    run(root)
    run_context.endings.close()
    root.stop(N)
    assert done(log) == "+first -first"


class Around:
    """Nodes around `always`, with children a and z, and a switch that breaks the guard."""

    def __init__(self, always, leaf, context):
        self.nest, self.leaf, self.context, self.switch = always, leaf, context, Switch()

    def always(self, first, last, name="z"):
        return self.nest(self.leaf(first, "a"), self.leaf(last, name))

    def timeout(self, child, limit_s=1.5):
        return Timeout(path_id="alice/timeout", name="timeout", child=child, limit_s=limit_s, clock=self.context.clock)

    def guard(self, child):
        return Guard(path_id="alice/g", name="g", child=child, condition=self.switch, context=self.context)

    def retry(self, child):
        return Retry(path_id="alice/retry", name="retry", child=child, attempts=3, causes=frozenset(Cause))

    def skip(self, child):
        return Skip(path_id="alice/skip", name="skip", child=child, step="it")


@pytest.fixture
def around(always, leaf, run_context):
    return Around(always, leaf, run_context)


# the tree; events (".": a tick, "x": a stop, "!": the guard's condition breaks); status, cause, what is done
@pytest.mark.parametrize(
    ("tree", "events", "status", "cause", "done_"),
    [
        (lambda n: n.always("RS", "S"), "x", "I", None, ""),
        (lambda n: n.always("S", "S"), ".x", "I", None, "+a +z"),
        (lambda n: n.nest(n.always("F", "RF"), n.leaf("S", "y"), "out"), "..", "F", EXECUTION, "+a +z +y"),
        (lambda n: n.nest(n.always("RR", "RS"), n.leaf("S", "y"), "out"), ".x...", "I", CANCELLED, "+a -a +z +y"),
        (lambda n: n.nest(n.leaf("RR", "b"), n.always("RRRS", "S"), "out"), ".x......", "I", CANCELLED, "+b -b +a +z"),
        (lambda n: n.timeout(n.always("RRRR", "RS")), ".....", "F", TIMEOUT, "+a -a +z"),
        (lambda n: n.timeout(n.always("S", "RRRRS")), "......", "F", TIMEOUT, "+a +z"),
        (lambda n: n.guard(n.always("RRRR", "RS")), ".!...", "F", PRECONDITION, "+a -a +z"),
        (lambda n: n.retry(n.always("FS", "RSRS")), "....", "S", None, "+a +z +a +z"),
        (lambda n: n.retry(n.timeout(n.always("RRRS", "RSS"))), ".........", "S", None, "+a -a +z +a +z"),
        (lambda n: together(1, n.always("RRR", "RS"), n.leaf("RS", "b")), "....", "S", None, "+a +b -a +z"),
        (lambda n: n.skip(n.always("RR", "RS")), ".xx..", "I", None, "+a -a +z"),
    ],
)
def test_the_last_is_done_once_whatever_is_around_it(around, run, run_context, log, tree, events, status, cause, done_):
    root = tree(around)
    for event in events:
        if event == "x":
            root.stop(N)
        elif event == "!":
            around.switch.verdict = Failed(PRECONDITION, "no more")
        else:
            run(root)
    assert (root.status.value[0], root.cause, done(log)) == (status, cause, done_)
    assert run_context.endings.due is None


def test_cancel_while_the_last_of_a_failed_attempt_is_done_lets_it_go_on_where_it_was(around, run, run_context, log):
    # the timeout has handed the last part to the run, and a retry above still runs when it is cancelled
    steps = [around.leaf("S", "one"), around.leaf("RRS", "two")]
    last = MemorySequence(path_id="alice/last", name="last", children=steps)
    root = around.retry(around.timeout(around.nest(around.leaf("RRRR", "first"), last), 0.5))
    run(root, 3)
    assert done(log) == "+first -first +one +two"
    root.stop(N)
    run(root, 3)
    assert done(log) == "+first -first +one +two"
    assert (last.status, run_context.endings.due) == (S, None)
