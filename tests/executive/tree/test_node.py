"""What counts as news between two states of a node."""

import pytest
from py_trees.common import Status

from executive.tree import behaviour
from executive.tree.node import Change, NodeState, node_classes, node_pages
from tests.executive.distribution import module_of_a_plug_in

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


PAGE = """
from executive.tree.behaviour import ExplainedLeaf

class Hum(ExplainedLeaf):
    kind = "hum"
"""


# an entry point, and whether its kind of node is known
@pytest.mark.parametrize(("line", "known"), [("hum = hummers", True), ("hum = hummers.nothing", False)])
def test_a_plug_in_brings_nodes_and_harms_no_others_where_it_cannot(tmp_path, monkeypatch, line, known):
    with module_of_a_plug_in(tmp_path, monkeypatch, "hummers", "errand.nodes", PAGE) as registered:
        registered(line)
        pages = node_pages.__wrapped__()
        monkeypatch.setattr("executive.tree.node.node_pages", lambda: pages)
        assert ("hum" in node_classes.__wrapped__(), "skill" in node_classes.__wrapped__()) == (known, True)
