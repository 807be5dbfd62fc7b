"""What a tree's nodes say at one moment, by path id."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.explained import Explained
from skills.api import Cause


@dataclass(frozen=True)
class NodeState:
    """Status, cause, sentence and, for a skill, progress from 0 to 1 where known."""

    status: Status = Status.INVALID
    cause: Cause | None = None
    message: str = ""
    progress: float | None = None


@dataclass(frozen=True)
class Change:
    """A node that says something else than before."""

    path_id: str
    before: NodeState
    after: NodeState

    @property
    def is_transition(self) -> bool:
        """Whether its status or cause changed."""
        return self.before.status is not self.after.status or self.before.cause is not self.after.cause

    @property
    def is_activity(self) -> bool:
        """Whether it goes on and does something new; mere new numbers do not count."""
        if self.is_transition or self.after.status is not Status.RUNNING:
            return False
        return _NUMBER.sub("", self.before.message) != _NUMBER.sub("", self.after.message)


Snapshot = Mapping[str, NodeState]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Observed:
    """A built tree that is read after every tick. `states` gives what every explained node said last, parents first."""

    def __init__(self, root: Behaviour) -> None:
        self.nodes: tuple[Behaviour, ...] = tuple(_walk(root))
        self._explained = tuple(node for node in self.nodes if isinstance(node, Explained))
        self._last = [_state(node) for node in self._explained]
        named = zip(self._explained, self._last, strict=True)
        self.states: Snapshot = {node.path_id: state for node, state in named}

    def changes(self) -> Sequence[Change]:
        """What changed since the last time, in the order of the tree; brings `states` up to date."""
        found = []
        for index, (node, last) in enumerate(zip(self._explained, self._last, strict=True)):
            if (
                node.status is last.status
                and node.cause is last.cause
                and node.message == last.message
                and node.progress == last.progress
            ):
                continue
            self._last[index] = _state(node)
            found.append(Change(node.path_id, last, self._last[index]))
        if found:
            self.states = {**self.states, **{change.path_id: change.after for change in found}}
        return found


def _walk(root: Behaviour) -> Iterator[Behaviour]:
    """The node and all below, parents first."""
    yield root
    for child in root.children:
        yield from _walk(child)


def _state(node: Explained) -> NodeState:
    return NodeState(node.status, node.cause, node.message, node.progress)
