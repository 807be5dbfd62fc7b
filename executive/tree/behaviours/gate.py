"""A breakpoint at a node: the node waits, RUNNING, before it begins."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.explained import Explained


class Gate:
    """Stands before one node. While `closed()`, a tick that would begin the node makes it wait instead, once.

    The next tick lets it pass; so whoever watches `waiting` must see to it that there is none too soon.
    """

    def __init__(self, node: Behaviour, closed: Callable[[], bool]) -> None:
        """Stand before `node` from now on."""
        self._node, self._closed = node, closed
        self._pass_on: Callable[[], Iterator[Behaviour]] = node.tick
        self.waiting = False
        vars(node)["tick"] = self._tick

    def _tick(self) -> Iterator[Behaviour]:
        node, waited = self._node, self.waiting and self._node.status == Status.RUNNING
        self.waiting = False
        if waited:
            node.status = Status.INVALID
        elif node.status != Status.RUNNING and self._closed():
            self._wait()
            yield node
            return
        yield from self._pass_on()

    def _wait(self) -> None:
        self.waiting = True
        self._node.status = Status.RUNNING
        if isinstance(self._node, Explained):
            self._node.cause, self._node.message = None, "waits at the breakpoint"
