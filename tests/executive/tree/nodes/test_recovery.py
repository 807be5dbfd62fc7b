"""Recovery by cause, tidying up, and ways that do not apply: status tables."""

import pytest

from executive.tree.board import Board
from executive.tree.nodes.composites import MemorySelector, MemorySequence
from executive.tree.nodes.recovery import Afterwards, OnlyIfHolding, OnlyIfKnown, Recover, Recovery, Trigger
from skills.api import Cause, ObjectKind
from tests.executive.tree.scripted import CAUSES, F, Leaf, N, S, play, table

ERROR, EXECUTION, PLANNING, POST = Cause.ERROR, Cause.EXECUTION, Cause.PLANNING, Cause.POSTCONDITION


def recover(attempt, *recoveries, attempts=5, forgets=(), board=None):
    leaves, rules = [leaf for leaf, _ in recoveries], [rule for _, rule in recoveries]
    return Recover(
        path_id="alice/recover", name="recover", children=[attempt, *leaves], recoveries=rules, attempts=attempts,
        forgets=forgets, board=board or Board("alice"),
    )  # fmt: skip


def recovery(leaf, letter, node=None, own=False, uses=1, given=None, final=False, completes=False):
    return leaf, Recovery((Trigger(frozenset({CAUSES[letter]}), node, own),), uses, given, final, completes)


def sequence(name, *children):
    return MemorySequence(path_id=f"alice/{name}", name=name, children=children)


def selector(*children):
    return MemorySelector(path_id="alice/f", name="f", children=children)


def test_the_recovery_for_the_cause_is_chosen_and_the_attempt_starts_again():
    attempt, clear, back_off = Leaf("RPS", "go"), Leaf("F", "clear"), Leaf("RS", "back")
    root = recover(attempt, recovery(clear, "O"), recovery(back_off, "P"))
    # root, go, clear, back; the failure stays in sight for a tick
    assert table(root, 5) == ["RRII", "RFII", "RFIR", "RFIS", "SSIS"]
    assert (attempt.begun, clear.begun, back_off.begun, root.attempt) == (2, 0, 1, 2)


# attempt; recoveries: script, cause, options; attempts at most; status, cause, sentence, how often each begins
RECOVER = [
    ("F", [("S", "F", {"completes": True})], 1, "RS", None, "first S", [1, 1]),
    ("F", [("S", "P", {})], 5, "F", EXECUTION, "go F", [1, 0]),
    ("P", [("E", "P", {})], 5, "RF", ERROR, "go P; first: first E", [1, 1]),
    ("P", [("F", "P", {"final": True}), ("S", "P", {})], 5, "RF", PLANNING, "go P; first: first F", [1, 1, 0]),
    ("P", [("F", "P", {})], 5, "RF", PLANNING, "go P; first: first F", [1, 1]),
    ("P", [("S", "P", {"uses": 2}), ("S", "P", {})], 5, "RRRRRRF", PLANNING, "go P (after 4 attempts)", [4, 2, 1]),
    ("P", [("S", "P", {"uses": 99})], 3, "RRRRF", PLANNING, "go P (after 3 attempts)", [3, 2]),
    ("PS", [("F", "P", {}), ("S", "P", {})], 5, "RRRS", None, "go S", [2, 1, 1]),
]


@pytest.mark.parametrize(("attempt", "recoveries", "attempts", "expected", "cause", "message", "begun"), RECOVER)
def test_recover(attempt, recoveries, attempts, expected, cause, message, begun):
    names = ("first", "second")
    rules = [recovery(Leaf(each, name), on, **more) for name, (each, on, more) in zip(names, recoveries, strict=False)]
    root = recover(Leaf(attempt, "go"), *rules, attempts=attempts)
    assert play(root, expected) == expected
    assert (root.cause, root.message, [child.begun for child in root.children]) == (cause, message, begun)


@pytest.mark.parametrize(("held", "expected"), [(None, "F"), ((), "F"), (("cube",), "R")])
def test_a_recovery_that_needs_something_given_is_due_only_while_the_board_holds_it(held, expected):
    board, clear = Board("alice"), Leaf("S", "clear")
    if held is not None:
        board.put("alice/given", held)
    root = recover(Leaf("PS", "go"), recovery(clear, "P", given="alice/given"), board=board)
    assert play(root, expected) == expected
    root.tick_once()
    assert clear.begun == (expected == "R")


def test_the_attempt_that_came_farthest_is_decisive():
    # attempt   find  take
    # 1         S     POST (the object slips)
    # 2         POST  -    (it is not seen any more)
    attempt = sequence("get", Leaf("SO", "find"), Leaf("O", "take"))
    root = recover(attempt, recovery(Leaf("S", "wait"), "O"), attempts=2)
    assert play(root, "RRF") == "RRF"
    assert root.cause is POST
    assert root.message.index("take") < root.message.index("find")


def test_a_new_start_counts_recoveries_from_zero_and_forgets_what_attempts_shared():
    board, clear = Board("alice"), Leaf("S", "clear")
    root = recover(Leaf("P", "go"), recovery(clear, "P"), forgets=("alice/tried",), board=board)
    for number in (1, 2):
        board.put("alice/tried", number)
        for letter in "RRF":
            assert play(root, letter) == letter
            assert "alice/tried" not in board
        assert (clear.begun, root.attempt) == (number, 2)
        root.stop(N)


def test_values_stay_from_one_attempt_to_the_next():
    board = Board("alice")
    root = recover(Leaf("PS", "go"), recovery(Leaf("S", "clear"), "P"), forgets=("alice/tried",), board=board)
    root.tick_once()
    board.put("alice/tried", 1)
    assert play(root, "RS") == "RS"
    assert board.get("alice/tried") == 1


def test_a_trigger_may_name_the_node_that_failed():
    find, look, other = Leaf("S", "find"), Leaf("S", "look"), Leaf("S", "other")
    attempt = sequence("pick", find, Leaf("OS", "take"))
    root = recover(attempt, recovery(other, "O", node="alice/find"), recovery(look, "O", node="alice/take"))
    assert play(root, "RRS") == "RRS"
    assert (look.begun, other.begun, find.begun) == (1, 0, 2)


def test_a_trigger_may_want_the_nodes_own_failure():
    below = sequence("guard", Leaf("F", "go"))
    assert table(recover(below, recovery(Leaf("S", "pick up"), "F", node="alice/guard", own=True)), 1) == ["FFI"]


def test_interrupted_it_says_so_and_begins_again_afterwards():
    root = recover(Leaf("PR", "go"), recovery(Leaf("R", "clear"), "P"))
    assert play(root, "RRI") == "RRI"
    assert (root.cause, [child.status.value[0] for child in root.children]) == (Cause.CANCELLED, ["F", "I"])
    assert table(root, 1) == ["RRI"]
    assert root.attempt == 1


# look, stow, only after a failure; root, look and stow at each tick; cause, sentence
@pytest.mark.parametrize(
    ("look", "stow", "only", "rows", "cause", "message"),
    [
        ("RO", "RS", False, ["RRI", "RFR", "FFS"], POST, "look O"),
        ("RS", "RS", False, ["RRI", "RSR", "SSS"], None, "look S"),
        ("S", "P", False, ["SSF"], None, "look S (stow failed: stow P)"),
        ("S", "S", True, ["SSI"], None, "look S"),
    ],
)
def test_tidying_runs_after_any_result_and_keeps_it(look, stow, only, rows, cause, message):
    children = [Leaf(look, "look"), Leaf(stow, "stow")]
    root = Afterwards(path_id="alice/a", name="a", children=children, only_after_failure=only)
    assert table(root, len(rows)) == rows
    assert (root.cause, root.message) == (cause, message)


def only_if_known(child, board):
    return OnlyIfKnown(path_id="alice/again", name="again", children=[child], key="alice/seen", board=board)


def test_a_child_that_does_not_apply_is_passed_over_and_stays_idle():
    board, again = Board("alice"), Leaf("O", "again")
    root = selector(only_if_known(again, board), Leaf("O", "there"))
    assert table(root, 1) == ["FIF"]
    assert (root.cause, root.message) == (POST, "there O")
    board.put("alice/seen", 1)
    assert table(root, 1) == ["FFF"]
    assert again.begun == 1


def test_a_selector_of_which_nothing_applies_fails():
    root = selector(only_if_known(Leaf("S", "again"), Board("alice")))
    assert table(root, 1) == ["FI"]
    assert (root.cause, root.message) == (Cause.PRECONDITION, "nothing of it applies")


@pytest.fixture
def only_if_holding(context):
    def make(**more):
        return OnlyIfHolding(path_id="alice/h", name="h", children=[Leaf("S", "stow")], context=context, **more)

    return make


@pytest.mark.parametrize(
    ("taken_for", "asked", "status"),
    [
        (ObjectKind("coke"), ("coke", "beer"), S),
        (ObjectKind("hammer"), ("coke", "beer"), F),
        (ObjectKind("hammer"), ("thing",), S),  # any object will do
        (None, ("coke",), F),  # nobody knows what it is
    ],
)
def test_a_branch_may_apply_only_while_a_certain_object_is_held(
    only_if_holding, context, robot, taken_for, asked, status
):
    robot.holding, context.payload.kind = True, taken_for
    root = selector(only_if_holding(known_as=asked), Leaf("P", "search"))
    root.tick_once()
    assert root.status == status


def test_a_recovery_for_what_is_held_is_passed_over_while_nothing_is(only_if_holding):
    assert table(recover(Leaf("F", "grasp"), recovery(only_if_holding(), "F", completes=True)), 1) == ["FFI"]


@pytest.mark.parametrize(("holding", "row", "cause"), [(True, "SFS", None), (False, "FFI", PLANNING)])
def test_a_branch_may_apply_only_while_something_is_held(only_if_holding, robot, holding, row, cause):
    robot.holding = holding
    root = selector(Leaf("P", "grasp"), only_if_holding())
    assert (table(root, 1), root.cause) == ([row], cause)
