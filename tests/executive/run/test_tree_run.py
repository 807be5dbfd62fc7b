"""Which nodes the run of a tree reads after a tick, and how it holds and restores them by the hook."""

import pytest
from py_trees.common import Status

from executive.run.tree_run import TreeObserver
from executive.tree.behaviour import Hook
from executive.tree.nodes.composites import MemorySequence
from tests.executive.tree.scripted import Leaf


@pytest.fixture
def no_change_is_missed():
    """Here a node is changed by hand, too."""


@pytest.fixture
def walk():
    """A sequence of two leaves, "one" for two ticks and "two" for as long as it is ticked."""
    hook = Hook()
    leaves = Leaf("RS", "one", hook=hook), Leaf("R", "two", hook=hook)
    return MemorySequence(path_id="alice/walk", name="walk", children=leaves, hook=hook)


def changed(observed, **how):
    return {change.path_id: change.after.status for change in observed.changes(**how)}


def test_only_nodes_that_were_ticked_or_stopped_are_read(walk):
    observed = TreeObserver(walk, walk.hook)
    observed.tick(walk)
    assert changed(observed) == {"alice/walk": Status.RUNNING, "alice/one": Status.RUNNING}
    idle = walk.children[1]
    idle.message = "set by hand"
    observed.tick(walk.children[0])
    assert changed(observed) == {"alice/one": Status.SUCCESS}
    assert changed(observed, of_all=True) == {"alice/two": Status.INVALID}
    assert observed.states["alice/two"].message == "set by hand"


def test_nodes_that_are_stopped_from_outside_are_read(walk):
    observed = TreeObserver(walk, walk.hook)
    for _ in range(2):
        observed.tick(walk)
    assert changed(observed)["alice/two"] is Status.RUNNING
    walk.stop(Status.INVALID)
    assert changed(observed) == {"alice/walk": Status.INVALID, "alice/two": Status.INVALID}
    assert changed(observed) == {}


def test_changes_come_in_the_order_of_the_tree(walk):
    observed = TreeObserver(walk, walk.hook)
    observed.tick(walk)
    assert [change.path_id for change in observed.changes()] == ["alice/walk", "alice/one"]


def test_a_node_waits_once_at_a_breakpoint_before_it_begins(walk):
    walk.hook.breakpoints = frozenset({"alice/walk"})
    seen = []
    for _ in range(2):
        walk.tick_once()
        seen.append((walk.message, tuple(walk.hook.waiting), walk.children[0].begun))
    assert seen == [("waits at the breakpoint", ("alice/walk",), 0), ("one R", (), 1)]


def test_a_node_takes_its_restored_state_in_its_first_tick_only(walk):
    walk.hook.restored["alice/walk"] = (Status.SUCCESS, None, "walked")
    seen = []
    for _ in range(2):
        walk.tick_once()
        seen.append((walk.status, walk.message, walk.children[0].begun))
    assert seen == [(Status.SUCCESS, "walked", 0), (Status.RUNNING, "one R", 1)]


def test_a_node_that_an_exception_kept_from_its_end_is_found_among_all(walk):
    observed = TreeObserver(walk, walk.hook)
    walk.children[0].update = lambda: 1 / 0
    with pytest.raises(ZeroDivisionError):
        observed.tick(walk)
    walk.status = Status.RUNNING
    assert changed(observed, of_all=True) == {"alice/walk": Status.RUNNING}
