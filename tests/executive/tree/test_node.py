"""What counts as news between two states of a node."""

import pytest
from py_trees.common import Status

from executive.tree import behaviour
from executive.tree.node import Change, NodeState, node_classes

GOING = NodeState(Status.RUNNING, None, "going, 2.5 m to go")


# state before, state after -> whether the node does something new while it goes on
@pytest.mark.parametrize(
    ("before", "after", "new"),
    [
        (GOING, NodeState(Status.RUNNING, None, "stopping"), True),
        (GOING, NodeState(Status.RUNNING, None, "going, 1 m to go"), False),
        (GOING, GOING, False),
        (GOING, NodeState(Status.SUCCESS, None, "there"), False),
        (NodeState(), GOING, False),
    ],
)
def test_a_new_message_is_an_activity_and_new_numbers_are_not(before, after, new):
    assert Change("alice/go", before, after).is_activity is new


def test_a_page_that_imports_the_base_of_the_nodes_registers_no_node_by_it(monkeypatch):
    monkeypatch.setattr("executive.tree.node.node_pages", lambda: (behaviour,))
    assert dict(node_classes.__wrapped__()) == {}
