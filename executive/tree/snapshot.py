"""What a tree's nodes say at one moment, by path id."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.explained import Explained
from executive.tree.behaviours.skill_leaf import SkillLeaf
from skills.api import Cause


@dataclass(frozen=True)
class NodeState:
    """Status, cause, sentence and, for a skill, progress from 0 to 1 where known."""

    status: Status = Status.INVALID
    cause: Cause | None = None
    message: str = ""
    progress: float | None = None


@dataclass(frozen=True)
class Transition:
    """A node that changed its status or cause."""

    path_id: str
    before: NodeState
    after: NodeState


Snapshot = Mapping[str, NodeState]
_IDLE = NodeState()
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Observed:
    """A built tree whose states are read again and again; what did not change is the same object as before."""

    def __init__(self, root: Behaviour) -> None:
        self.nodes: tuple[Behaviour, ...] = tuple(walk(root))
        self._explained = tuple(node for node in self.nodes if isinstance(node, Explained))
        self._last: dict[str, NodeState] = {}

    def snapshot(self) -> Snapshot:
        """The present state of every explained node, parents first."""
        last = self._last
        self._last = {node.path_id: _renewed(last.get(node.path_id), node) for node in self._explained}
        return self._last


def snapshot(root: Behaviour) -> Snapshot:
    """The present state of every explained node, parents first."""
    return {node.path_id: _state(node) for node in walk(root) if isinstance(node, Explained)}


def transitions(before: Snapshot, after: Snapshot) -> Iterator[Transition]:
    """What changed between two snapshots of one tree, in the order of the tree; mere new messages do not count."""
    for path_id, state in after.items():
        old = before.get(path_id, _IDLE)
        if old is not state and (old.status, old.cause) != (state.status, state.cause):
            yield Transition(path_id, old, state)


def activities(before: Snapshot, after: Snapshot) -> Iterator[tuple[str, NodeState]]:
    """The nodes that go on and say something new, in the order of the tree; mere new numbers do not count."""
    for path_id, state in after.items():
        old = before.get(path_id, _IDLE)
        if old is state or not old.status is state.status is Status.RUNNING or old.cause is not state.cause:
            continue
        if _NUMBER.sub("", old.message) != _NUMBER.sub("", state.message):
            yield path_id, state


def walk(root: Behaviour) -> Iterator[Behaviour]:
    """The node and all below, parents first."""
    yield root
    for child in root.children:
        yield from walk(child)


def _renewed(last: NodeState | None, node: Explained) -> NodeState:
    """The last state where it still holds, else a new one."""
    assert isinstance(node, Behaviour)
    if (
        last is not None
        and last.status is node.status
        and last.message == node.message
        and last.cause is node.cause
        and last.progress == (node.progress if isinstance(node, SkillLeaf) else None)
    ):
        return last
    return _state(node)


def _state(node: Behaviour) -> NodeState:
    assert isinstance(node, Explained)
    progress = node.progress if isinstance(node, SkillLeaf) else None
    return NodeState(node.status, node.cause, node.message, progress)
