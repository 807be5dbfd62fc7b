"""Recovery by cause, tidying up, and ways that do not apply: status tables."""

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained
from executive.tree.board import Board
from executive.tree.nodes.composites import MemorySelector, MemorySequence
from executive.tree.nodes.recovery import Afterwards, OnlyIfHolding, OnlyIfKnown, Recover, Recovery, Trigger
from skills.api import Cause, ObjectKind

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID
PLANNING, EXECUTION, POST = Cause.PLANNING, Cause.EXECUTION, Cause.POSTCONDITION


class Leaf(Explained, Behaviour):
    """Ends each of its ticks as scripted: a Status, or the Cause of a failure; the last entry is repeated."""

    def __init__(self, name, *script):
        super().__init__(name)
        self.path_id, self.script, self.ticks, self.begun = f"alice/{name}", list(script), 0, 0
        self.clear_explanation()

    def initialise(self):
        self.begun += 1
        self.clear_explanation()

    def update(self):
        entry = self.script[min(self.ticks, len(self.script) - 1)]
        self.ticks += 1
        self.message = f"{self.name} {self.ticks}"
        self.cause = entry if isinstance(entry, Cause) else None
        return F if isinstance(entry, Cause) else entry


def recover(attempt, *recoveries, attempts=5, forgets=(), board=None):
    leaves, rules = [leaf for leaf, _ in recoveries], [rule for _, rule in recoveries]
    return Recover(
        path_id="alice/recover", name="recover", children=[attempt, *leaves], recoveries=rules, attempts=attempts,
        forgets=forgets, board=board or Board("alice"),
    )  # fmt: skip


def recovery(leaf, *causes, node=None, own=False, uses=1, given=None, final=False, completes=False):
    return leaf, Recovery((Trigger(frozenset(causes), node, own),), uses, given, final, completes)


def table(root, ticks):
    """Statuses of the root and its children after each tick."""
    rows = []
    for _ in range(ticks):
        root.tick_once()
        rows.append((root.status, *(child.status for child in root.children)))
    return rows


def test_the_recovery_for_the_cause_is_chosen_and_the_attempt_starts_again():
    attempt, clear, back_off = Leaf("go", R, PLANNING, S), Leaf("clear", EXECUTION), Leaf("back", R, S)
    root = recover(attempt, recovery(clear, POST), recovery(back_off, PLANNING))
    # tick     root go clear back
    assert table(root, 5) == [
        (R, R, N, N),
        (R, F, N, N),  # the failure stays in sight for a tick
        (R, F, N, R),
        (R, F, N, S),
        (S, S, N, S),
    ]
    assert (attempt.begun, clear.begun, back_off.begun, root.attempt) == (2, 0, 1, 2)


def test_without_a_recovery_for_the_cause_it_fails_at_once_with_that_cause():
    root = recover(Leaf("go", EXECUTION), recovery(Leaf("clear", S), PLANNING))
    assert table(root, 1) == [(F, F, N)]
    assert (root.cause, root.message) == (EXECUTION, "go 1")


@pytest.mark.parametrize(("held", "begun"), [(None, 0), ((), 0), (("cube",), 1)])
def test_a_recovery_that_needs_something_given_is_due_only_while_the_board_holds_it(held, begun):
    board, clear = Board("alice"), Leaf("clear", S)
    if held is not None:
        board.put("alice/given", held)
    root = recover(Leaf("go", PLANNING, S), recovery(clear, PLANNING, given="alice/given"), board=board)
    assert table(root, 1)[0][0] == (R if begun else F)
    root.tick_once()
    assert clear.begun == begun


def test_after_a_failed_recovery_that_is_final_there_is_no_other():
    back = Leaf("back", S)
    root = recover(
        Leaf("go", PLANNING), recovery(Leaf("clear", EXECUTION), PLANNING, final=True), recovery(back, PLANNING)
    )
    table(root, 2)
    assert (root.status, root.message, back.begun) == (F, "go 1; clear: clear 1", 0)


def test_a_recovery_is_used_so_often_and_no_more_then_the_next_one():
    clear, back_off = Leaf("clear", S), Leaf("back", S)
    root = recover(Leaf("go", PLANNING), recovery(clear, PLANNING, uses=2), recovery(back_off, PLANNING))
    while root.status != F:
        root.tick_once()
    assert (clear.begun, back_off.begun) == (2, 1)
    assert (root.cause, root.message) == (PLANNING, "go 4 (after 4 attempts)")


def test_attempts_are_bounded_whatever_the_recoveries_allow():
    attempt = Leaf("go", PLANNING)
    root = recover(attempt, recovery(Leaf("clear", S), PLANNING, uses=99), attempts=3)
    while root.status != F:
        root.tick_once()
    assert attempt.begun == 3


def test_a_failed_recovery_gives_way_to_the_next_that_fits():
    attempt, back_off = Leaf("go", PLANNING, S), Leaf("back", S)
    root = recover(attempt, recovery(Leaf("clear", EXECUTION), PLANNING), recovery(back_off, PLANNING))
    assert [row[0] for row in table(root, 4)] == [R, R, R, S]


@pytest.mark.parametrize(("cause", "expected"), [(EXECUTION, PLANNING), (Cause.ERROR, Cause.ERROR)])
def test_when_all_recoveries_fail_both_messages_are_reported(cause, expected):
    root = recover(Leaf("go", PLANNING), recovery(Leaf("clear", cause), PLANNING))
    assert [row[0] for row in table(root, 2)] == [R, F]
    assert (root.cause, root.message) == (expected, "go 1; clear: clear 1")


def test_the_attempt_that_came_farthest_is_decisive():
    # attempt   find  take
    # 1         S     POST (the object slips)
    # 2         POST  -    (it is not seen any more)
    find, take = Leaf("find", S, POST), Leaf("take", POST)
    attempt = MemorySequence(path_id="alice/get", name="get", children=[find, take])
    root = recover(attempt, recovery(Leaf("wait", S), POST), attempts=2)
    while root.status != F:
        root.tick_once()
    assert root.cause is POST
    assert root.message.index("take") < root.message.index("find")


def test_a_new_start_counts_recoveries_from_zero_and_forgets_what_attempts_shared():
    board, clear = Board("alice"), Leaf("clear", S)
    root = recover(Leaf("go", PLANNING), recovery(clear, PLANNING), forgets=("alice/tried",), board=board)
    for number in (1, 2):
        board.put("alice/tried", number)
        while root.status != F:
            root.tick_once()
            assert ("alice/tried" in board) is False
        assert (clear.begun, root.attempt) == (number, 2)
        root.stop(N)


def test_values_stay_from_one_attempt_to_the_next():
    board = Board("alice")
    root = recover(Leaf("go", PLANNING, S), recovery(Leaf("clear", S), PLANNING), forgets=("alice/tried",), board=board)
    root.tick_once()
    board.put("alice/tried", 1)
    table(root, 2)
    assert root.status == S
    assert board.get("alice/tried") == 1


def test_a_trigger_may_name_the_node_that_failed():
    find, take = Leaf("find", S), Leaf("take", POST, S)
    attempt = MemorySequence(path_id="alice/pick", name="pick", children=[find, take])
    look, other = Leaf("look", S), Leaf("other", S)
    root = recover(attempt, recovery(other, POST, node="alice/find"), recovery(look, POST, node="alice/take"))
    assert [row[0] for row in table(root, 3)] == [R, R, S]
    assert (look.begun, other.begun, find.begun) == (1, 0, 2)


def test_a_trigger_may_want_the_nodes_own_failure():
    below = MemorySequence(path_id="alice/guard", name="guard", children=[Leaf("go", EXECUTION)])
    root = recover(below, recovery(Leaf("pick up", S), EXECUTION, node="alice/guard", own=True))
    assert table(root, 1) == [(F, F, N)]


def test_interrupted_it_says_so_and_begins_again_afterwards():
    attempt = Leaf("go", PLANNING, R)
    root = recover(attempt, recovery(Leaf("clear", R), PLANNING))
    table(root, 2)
    root.stop(N)
    assert (root.cause, [child.status for child in root.children]) == (Cause.CANCELLED, [F, N])
    assert table(root, 1) == [(R, R, N)]
    assert root.attempt == 1


@pytest.mark.parametrize(("first", "status"), [((R, S), S), ((R, POST), F)])
def test_tidying_runs_after_any_result_and_keeps_it(first, status):
    # tick        root     first    then
    root = Afterwards(path_id="alice/a", name="a", children=[Leaf("look", *first), Leaf("stow", R, S)])
    assert table(root, 3) == [(R, R, N), (R, status, R), (status, status, S)]
    assert root.message == "look 2"
    assert root.cause == (POST if status == F else None)


def test_tidying_up_only_after_a_failure_leaves_a_success_alone():
    stow = Leaf("stow", S)
    root = Afterwards(path_id="alice/a", name="a", children=[Leaf("look", S), stow], only_after_failure=True)
    assert table(root, 1) == [(S, S, N)]


def test_a_failure_to_tidy_up_is_reported_but_changes_nothing():
    root = Afterwards(path_id="alice/a", name="a", children=[Leaf("look", S), Leaf("stow", PLANNING)])
    assert table(root, 1) == [(S, S, F)]
    assert (root.cause, root.message) == (None, "look 1 (stow failed: stow 1)")


def only_if_known(child, board):
    return OnlyIfKnown(path_id="alice/again", name="again", children=[child], key="alice/seen", board=board)


def test_a_child_that_does_not_apply_is_passed_over_and_stays_idle():
    board, again = Board("alice"), Leaf("again", POST)
    root = MemorySelector(path_id="alice/f", name="f", children=[only_if_known(again, board), Leaf("there", POST)])
    assert table(root, 1) == [(F, N, F)]
    assert (root.cause, root.message) == (POST, "there 1")
    board.put("alice/seen", 1)
    assert table(root, 1) == [(F, F, F)]
    assert again.begun == 1


def test_a_selector_of_which_nothing_applies_fails():
    root = MemorySelector(path_id="alice/f", name="f", children=[only_if_known(Leaf("again", S), Board("alice"))])
    assert table(root, 1) == [(F, N)]
    assert (root.cause, root.message) == (Cause.PRECONDITION, "nothing of it applies")


def test_a_recovery_that_completes_ends_it_without_another_attempt():
    attempt, use_it = Leaf("grasp", EXECUTION), Leaf("use it", S)
    root = recover(attempt, recovery(use_it, EXECUTION, completes=True), attempts=1)
    assert table(root, 2)[-1] == (S, F, S)
    assert (attempt.begun, root.message) == (1, "use it 1")


@pytest.mark.parametrize(
    ("taken_for", "asked", "status"),
    [
        (ObjectKind("coke"), ("coke", "beer"), S),
        (ObjectKind("hammer"), ("coke", "beer"), F),
        (ObjectKind("hammer"), ("thing",), S),  # any object will do
        (None, ("coke",), F),  # nobody knows what it is
    ],
)
def test_a_branch_may_apply_only_while_a_certain_object_is_held(context, robot, taken_for, asked, status):
    robot.holding, context.payload.kind = True, taken_for
    held = OnlyIfHolding(path_id="alice/h", name="h", children=[Leaf("stow", S)], context=context, known_as=asked)
    root = MemorySelector(path_id="alice/f", name="f", children=[held, Leaf("search", PLANNING)])
    root.tick_once()
    assert root.status == status


def test_a_recovery_for_what_is_held_is_passed_over_while_nothing_is(context, robot):
    held = OnlyIfHolding(path_id="alice/h", name="h", children=[Leaf("stow", S)], context=context)
    root = recover(Leaf("grasp", EXECUTION), recovery(held, EXECUTION, completes=True))
    assert table(root, 1) == [(F, F, N)]


@pytest.mark.parametrize(("holding", "status"), [(True, S), (False, F)])
def test_a_branch_may_apply_only_while_something_is_held(context, robot, holding, status):
    robot.holding = holding
    anyway = OnlyIfHolding(path_id="alice/h", name="h", children=[Leaf("stow", S)], context=context)
    root = MemorySelector(path_id="alice/f", name="f", children=[Leaf("grasp", PLANNING), anyway])
    root.tick_once()
    assert (root.status, root.cause) == (status, None if holding else PLANNING)
