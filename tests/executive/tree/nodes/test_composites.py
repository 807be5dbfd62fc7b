"""Memory sequence, selector and round: status tables, interruption, reset, explanations."""

import pytest

from executive.tree.nodes.composites import MemoryRound, MemorySelector, MemorySequence
from skills.api import Cause
from tests.executive.tree.scripted import CAUSES, Leaf, N, table

KINDS = {"round": MemoryRound, "selector": MemorySelector, "sequence": MemorySequence}


def composite(kind, *scripts, **more):
    children = [Leaf(script, name) for script, name in zip(scripts, "abcd", strict=False)]
    return KINDS[kind](path_id=f"a/{kind}", name=kind, children=children, **more)


# children's scripts; the node and its children at each tick; cause and sentence
@pytest.mark.parametrize(
    ("kind", "scripts", "rows", "cause", "message"),
    [
        ("round", ("O", "P", "O"), ["FFFF"], Cause.PLANNING, "b P; a O; c O"),
        ("round", ("S", "RF", "P"), ["RSRI", "SSFF"], None, "a S"),  # whatever the results
        ("selector", ("P", "RS"), ["RFR", "SFS"], None, "b S"),
        ("sequence", ("RSF", "RS"), ["RRI", "RSR", "SSS"], None, "b S"),  # in the same tick, and never back
        ("sequence", ("S", "FS"), ["FSF", "SSS"], None, "b S"),  # a new start begins at the first
        ("sequence", ("S", "P", "S"), ["FSFI"], Cause.PLANNING, "b P"),
    ],
)
def test_a_composite_follows_the_results_of_its_children(kind, scripts, rows, cause, message):
    root = composite(kind, *scripts)
    assert table(root, len(rows)) == rows
    assert (root.cause, root.message) == (cause, message)


def test_a_selector_keeps_failures_in_sight():
    root = composite("selector", "P", "RS")
    table(root, 2)
    assert (root.children[0].cause, root.children[0].message) == (Cause.PLANNING, "a P")


# causes of the children's failures, what is said when nothing is left; cause and sentence
@pytest.mark.parametrize(
    ("scripts", "more", "cause", "message"),
    [
        ("OB", {}, "B", "a O"),
        ("OO", {"exhausted_cause": Cause.PRECONDITION}, "B", "a O; b O"),
        ("OPO", {"exhausted_cause": Cause.PRECONDITION}, "P", "b P; a O; c O"),
        ("PE", {}, "E", "b E; a P"),
        ("OP", {"needed": 1, "exhausted_cause": Cause.PRECONDITION}, "B", "a O; b P"),
        ("OE", {"needed": 1}, "E", "b E; a O"),
        ("BOP", {"exhausted_message": "found nothing"}, "P", "found nothing: c P; b O"),
    ],
)
def test_an_exhausted_selector_has_the_decisive_cause_and_reports_all_that_began(scripts, more, cause, message):
    root = composite("selector", *scripts, **more)
    assert table(root, 1) == ["F" * (len(scripts) + 1)]
    assert (root.cause, root.message) == (CAUSES[cause], message)


# looks on the table (a, b), on the shelf (c) and in the hall (d)
@pytest.mark.parametrize(
    ("scripts", "message"),
    [
        ("OOOO", "found no cup anywhere: a O; b O; c O; d O"),
        ("OPOO", "found no cup anywhere: b P; a O; c O; d O"),  # one view of the table is enough
        ("PPOO", "found no cup on the shelf, nor in the hall; could not look on the table: a P; b P; c O; d O"),
        ("PTOF", "found no cup on the shelf; could not look on the table, nor in the hall: a P; b T; c O; d F"),
        ("PPPP", "could not look for the cup on the table, nor on the shelf, nor in the hall: a P; b P; c P; d P"),
    ],
)
def test_an_exhausted_search_names_where_it_looked_and_where_it_could_not(scripts, message):
    looks = {"on the table": ("alice/a", "alice/b"), "on the shelf": ("alice/c",), "in the hall": ("alice/d",)}
    told = {"exhausted_message": "found no cup anywhere", "missed": "found no cup", "sought": "the cup"}
    root = composite("selector", *scripts, looks=looks, **told)
    table(root, 1)
    assert root.message == message


@pytest.mark.parametrize(("kind", "first"), [("sequence", "S"), ("selector", "F")])
def test_interruption_stops_what_runs_and_keeps_what_is_done(kind, first):
    root = composite(kind, first, "RR", "S")
    root.tick_once()
    root.stop(N)
    assert (root.status, root.cause) == (N, Cause.CANCELLED)
    assert "".join(child.status.value[0] for child in root.children) == f"{first}II"


def test_reset_of_a_finished_composite_resets_all():
    root = composite("sequence", "S", "S")
    root.tick_once()
    root.stop(N)
    assert [node.status for node in root.iterate()] == [N, N, N]
    assert root.cause is None


def test_running_composite_tells_its_childs_sentence():
    root = MemorySequence(path_id="a/outer", name="outer", children=[composite("sequence", "P")])
    root.tick_once()
    assert root.message == "a P"


@pytest.mark.parametrize("kind", ["selector", "sequence"])
def test_empty_composites_are_refused(kind):
    with pytest.raises(ValueError, match="at least one child"):
        composite(kind)
