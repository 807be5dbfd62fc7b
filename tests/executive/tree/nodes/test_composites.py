"""Memory sequence and selector: status tables, interruption, reset, explanations."""

import py_trees
import pytest
from py_trees.behaviours import StatusQueue, TickCounter
from py_trees.common import Status

from executive.tree.behaviour import Explained
from executive.tree.nodes.composites import MemoryRound, MemorySelector, MemorySequence
from skills.api import Cause

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Fails(Explained, py_trees.behaviour.Behaviour):
    def __init__(self, cause: Cause, message: str) -> None:
        super().__init__(message)
        self.path_id, self.cause, self.message = message, cause, message

    def update(self) -> Status:
        return F


def queue(*statuses: Status) -> StatusQueue:
    return StatusQueue(name="queue", queue=list(statuses), eventually=S)


def sequence(*children):
    return MemorySequence(path_id="a/seq", name="seq", children=children)


def selector(*children, **more):
    return MemorySelector(path_id="a/sel", name="sel", children=children, **more)


def round_of(*children):
    return MemoryRound(path_id="a/round", name="round", children=children)


def table(root, ticks: int) -> list[tuple[Status, ...]]:
    rows = []
    for _ in range(ticks):
        root.tick_once()
        rows.append((root.status, *(child.status for child in root.children)))
    return rows


def test_sequence_goes_on_in_the_same_tick_and_never_back():
    # tick   sequence  first  second
    # 1      RUNNING   R      -
    # 2      RUNNING   S      R
    # 3      SUCCESS   S      S
    assert table(sequence(queue(R, S, F), queue(R, S)), 3) == [(R, R, N), (R, S, R), (S, S, S)]


def test_sequence_fails_with_its_child_and_leaves_later_ones_alone():
    root = sequence(queue(S), Fails(Cause.PLANNING, "no way"), queue(S))
    assert table(root, 1) == [(F, S, F, N)]
    assert (root.cause, root.message) == (Cause.PLANNING, "no way")


def test_selector_goes_on_after_failures_and_keeps_them_in_sight():
    # tick   selector  first  second
    # 1      RUNNING   F      R
    # 2      SUCCESS   F      S
    root = selector(Fails(Cause.PLANNING, "no"), queue(R, S))
    assert table(root, 2) == [(R, F, R), (S, F, S)]
    assert (root.cause, root.children[0].message) == (None, "no")


@pytest.mark.parametrize(
    ("causes", "exhausted", "expected"),
    [
        ((Cause.POSTCONDITION, Cause.PRECONDITION), None, Cause.PRECONDITION),
        ((Cause.POSTCONDITION, Cause.POSTCONDITION), Cause.PRECONDITION, Cause.PRECONDITION),
        ((Cause.POSTCONDITION, Cause.PLANNING, Cause.POSTCONDITION), Cause.PRECONDITION, Cause.PLANNING),
        ((Cause.PLANNING, Cause.ERROR), None, Cause.ERROR),
    ],
)
def test_exhausted_selector_has_the_decisive_cause(causes, exhausted, expected):
    root = selector(*(Fails(cause, f"m{n}") for n, cause in enumerate(causes)), exhausted_cause=exhausted)
    root.tick_once()
    assert (root.status, root.cause) == (F, expected)


def test_an_exhausted_selector_reports_the_messages_of_all_that_began_the_decisive_first():
    children = (Fails(Cause.PRECONDITION, "not begun"), Fails(Cause.POSTCONDITION, "a"), Fails(Cause.PLANNING, "b"))
    root = selector(*children, exhausted_message="found nothing")
    root.tick_once()
    assert root.message == "found nothing: b; a"


def test_a_round_continues_whatever_the_results():
    # tick   round     first  second  third
    # 1      RUNNING   S      R       -
    # 2      SUCCESS   S      F       F
    root = round_of(queue(S), queue(R, F), Fails(Cause.PLANNING, "no"))
    assert table(root, 2) == [(R, S, R, N), (S, S, F, F)]
    assert root.cause is None


def test_round_of_which_nothing_works_fails_with_the_decisive_cause():
    root = round_of(Fails(Cause.POSTCONDITION, "a"), Fails(Cause.PLANNING, "b"), Fails(Cause.POSTCONDITION, "c"))
    assert table(root, 1) == [(F, F, F, F)]
    assert (root.cause, root.message) == (Cause.PLANNING, "b; a; c")


@pytest.mark.parametrize("kind", [sequence, selector])
def test_interruption_stops_what_runs_and_keeps_what_is_done(kind):
    first = queue(S) if kind is sequence else queue(F)
    root = kind(first, queue(R, R), queue(S))
    root.tick_once()
    root.stop(N)
    assert (root.status, root.cause) == (N, Cause.CANCELLED)
    assert [child.status for child in root.children] == [S if kind is sequence else F, N, N]


def test_reset_of_a_finished_composite_resets_all():
    root = sequence(queue(S), queue(S))
    root.tick_once()
    root.stop(N)
    assert [node.status for node in root.iterate()] == [N, N, N]
    assert root.cause is None


def test_a_new_start_begins_at_the_first_child():
    counter = TickCounter(name="counter", duration=0, completion_status=S)
    root = sequence(counter, queue(F, S))
    assert table(root, 2) == [(F, S, F), (S, S, S)]


def test_running_composite_tells_its_childs_sentence():
    inner = sequence(Fails(Cause.PLANNING, "deep"))
    root = sequence(inner)
    root.tick_once()
    assert root.message == "deep"


@pytest.mark.parametrize("kind", [sequence, selector])
def test_empty_composites_are_refused(kind):
    with pytest.raises(ValueError, match="at least one child"):
        kind()
