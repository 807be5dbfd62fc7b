"""The table of kinds: every kind has one home, and a spec becomes its node with what is lent to it."""

from py_trees.common import Status

from executive.tree import kinds
from executive.tree.behaviour import ExplainedNode
from executive.tree.node import NodeSpec
from executive.tree.nodes.policies import Timeout
from skills.robot import Pose2D

PAUSE = NodeSpec("pause", "alice/limit/wait", "wait", {"duration_s": 9.0})
LIMIT = NodeSpec("timeout", "alice/limit", "in time", {"limit_s": 5.0}, (PAUSE,))


def below(node):
    """All classes that derive from one, as often as they do."""
    return [each for child in node.__subclasses__() for each in (child, *below(child))]


def test_each_kind_of_node_has_exactly_one_class():
    named = [
        node.kind for node in below(ExplainedNode) if node.__module__.startswith(kinds.nodes.__name__) and node.kind
    ]
    assert sorted(named) == sorted(kinds.KINDS)


def test_a_spec_becomes_its_node_on_the_runs_clock(context, clock):
    root = kinds.build(LIMIT, context)
    assert isinstance(root, Timeout)
    assert [node.path_id for node in root.iterate()] == ["alice/limit/wait", "alice/limit"]
    root.tick_once()
    assert root.status is Status.RUNNING
    clock.advance(6.0)
    root.tick_once()
    assert (root.status, root.children[0].status) == (Status.FAILURE, Status.INVALID)


def test_what_a_node_writes_follows_from_its_options():
    assert kinds.writes(NodeSpec("remember", "alice/r", "r", {"key": "alice/pose"})) == {"alice/pose": Pose2D}
    assert kinds.writes(LIMIT) == {}
