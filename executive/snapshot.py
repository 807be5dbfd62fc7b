"""What a tree's nodes say at one moment, by path id."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.behaviours.explained import Explained
from executive.behaviours.skill_leaf import SkillLeaf
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


def snapshot(root: Behaviour) -> Snapshot:
    """The present state of every explained node, parents first."""
    return {node.path_id: _state(node) for node in walk(root) if isinstance(node, Explained)}


def transitions(before: Snapshot, after: Snapshot) -> Iterator[Transition]:
    """What changed between two snapshots of one tree, in the order of the tree; mere new messages do not count."""
    for path_id, state in after.items():
        old = before.get(path_id, NodeState())
        if (old.status, old.cause) != (state.status, state.cause):
            yield Transition(path_id, old, state)


def walk(root: Behaviour) -> Iterator[Behaviour]:
    """The node and all below, parents first."""
    yield root
    for child in root.children:
        yield from walk(child)


def running_message(root: Behaviour) -> tuple[str, str, float | None]:
    """Path id, sentence and progress of the deepest running node; empty when none runs."""
    running = [node for node in walk(root) if node.status == Status.RUNNING and isinstance(node, Explained)]
    if not running:
        return "", "", None
    state = _state(running[-1])
    return running[-1].path_id, state.message, state.progress


def _state(node: Behaviour) -> NodeState:
    assert isinstance(node, Explained)
    progress = node.progress if isinstance(node, SkillLeaf) else None
    return NodeState(node.status, node.cause, node.message, progress)
