"""The tree as plain data: one spec for every node, whatever its kind.

Specs are compared, shown and checked without a robot; `executive.tree.compiler.build` makes the py_trees nodes of one run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained
from skills.api import Cause
from skills.files.errors import SourceLine

__all__ = ["NodeSpec"]


@dataclass(frozen=True)
class NodeSpec:
    """One node: its kind, its path id, the name shown, the options of its kind, the nodes below, the line behind it."""

    kind: str
    path_id: str
    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    children: tuple[NodeSpec, ...] = ()
    source: SourceLine | None = None

    def walk(self) -> Iterator[NodeSpec]:
        """Itself and all nodes below, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()

    def with_options(self, **options: Any) -> NodeSpec:
        """The same with some options changed."""
        return replace(self, options={**self.options, **options})


class NodeState(NamedTuple):
    """Status, cause, sentence and, for a skill, progress from 0 to 1 where known."""

    status: Status = Status.INVALID
    cause: Cause | None = None
    message: str = ""
    progress: float | None = None


class Change(NamedTuple):
    """A node that says something else than before."""

    path_id: str
    before: NodeState
    after: NodeState

    @property
    def is_transition(self) -> bool:
        """Returns whether its status or cause changed."""
        return self.before.status is not self.after.status or self.before.cause is not self.after.cause

    @property
    def is_activity(self) -> bool:
        """Returns whether it goes on and does something new; mere new numbers do not count."""
        if self.is_transition or self.after.status is not Status.RUNNING:
            return False
        return _NUMBER.sub("", self.before.message) != _NUMBER.sub("", self.after.message)


Snapshot = Mapping[str, NodeState]
Visited = Callable[[Behaviour, bool], None]
"""Is told of a node that a tick has visited, and whether it was stopped from outside since its last visit."""
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Observed:
    """A built tree that is read after every tick. `states` gives what every explained node said last, parents first.

    A node says something else only when it is ticked, here by `tick`, or stopped: only those are looked at. So a tick
    costs nothing for the nodes that it leaves alone.
    """

    def __init__(self, root: Behaviour) -> None:
        self.nodes: tuple[Behaviour, ...] = tuple(_walk(root))
        self._explained = tuple(node for node in self.nodes if isinstance(node, Explained))
        self._last = [_state(node) for node in self._explained]
        named = zip(self._explained, self._last, strict=True)
        self.states: Snapshot = {node.path_id: state for node, state in named}
        self._index: Mapping[Behaviour, int] = {node: index for index, node in enumerate(self._explained)}
        self._touched: set[Behaviour] = set()
        self._stopped: set[Behaviour] = set()
        for node in self._index:
            vars(node)["stop"] = _noted(node, self._touched, self._stopped)

    def tick(self, node: Behaviour, visited: Visited = lambda node, stopped: None) -> None:
        """Ticks the tree, or a part of it; `visited` is told of each node, after those below it."""
        for each in node.tick():
            self._touched.add(each)
            visited(each, each in self._stopped)
            self._stopped.discard(each)

    def changes(self, *, of_all: bool = False) -> Sequence[Change]:
        """What changed since the last time, in the order of the tree; brings `states` up to date.

        After an exception in a tick, or where a node was changed by hand, it has to look at all nodes (`of_all`).
        """
        touched = sorted(self._index[node] for node in self._touched if node in self._index)
        self._touched.clear()
        found = list(self._changed(range(len(self._explained)) if of_all else touched))
        if found:
            self.states = {**self.states, **{change.path_id: change.after for change in found}}
        return found

    def _changed(self, indices: Iterable[int]) -> Iterator[Change]:
        for index in indices:
            node, last = self._explained[index], self._last[index]
            state = _state(node)
            if state != last:
                self._last[index] = state
                yield Change(node.path_id, last, state)


def _noted(node: Behaviour, touched: set[Behaviour], stopped: set[Behaviour]) -> Callable[[Status], None]:
    """The node's `stop`, which adds it to `touched`, and to `stopped` where it is stopped from outside."""
    stop = node.stop

    def noted_stop(new_status: Status = Status.INVALID) -> None:
        """As the node's own."""
        touched.add(node)
        if new_status == Status.INVALID:
            stopped.add(node)
        stop(new_status)

    return noted_stop


def _walk(root: Behaviour) -> Iterator[Behaviour]:
    """The node and all below, parents first."""
    yield root
    for child in root.children:
        yield from _walk(child)


def _state(node: Explained) -> NodeState:
    return NodeState(node.status, node.cause, node.message, node.progress)
