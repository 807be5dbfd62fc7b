"""What counts as news between two states of a node."""

import pytest
from py_trees.common import Status

from executive.tree.node import Change, NodeState

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
