"""Suspending a tree: the robot may do something else in between, and the tree goes on from where it was.

Suspending touches no status and no memory: a composite stays at its child, a retry at its attempt. Only the running
nodes that are `Suspendable` are told; each goes on by itself when it is ticked the next time. Time that passes while
a node is suspended does not count against its limit.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from skills.robot import Clock


@runtime_checkable
class Suspendable(Protocol):
    """A node that must be told when it will not be ticked for a while."""

    def suspend(self) -> None:
        """Let go of the robot and stop counting time until the next tick. Idempotent; never raises."""


def suspend(root: Behaviour, *, sparing: Behaviour | None = None) -> None:
    """Suspend all running nodes of a tree: motion that its leaves began is stopped, their place is kept.

    The node `sparing` and those below it are let go on.

    Tick the tree again to go on: each suspended skill is told to `resume`, which begins it anew unless it knows
    better. Stop it (`root.stop(Status.INVALID)`) to give it up. Call it again freely; what is suspended stays so.
    """
    spared = set() if sparing is None else set(sparing.iterate())
    for node in root.iterate():
        if node not in spared and node.status == Status.RUNNING and isinstance(node, Suspendable):
            node.suspend()


class StoppableTime:
    """Seconds of the robot's clock since a start, without those in which it was stopped."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._start_s = clock.now()
        self._stopped_s: float | None = None

    @property
    def stopped(self) -> bool:
        """True between `stop` and `go_on`."""
        return self._stopped_s is not None

    def elapsed_s(self) -> float:
        """Seconds that counted so far."""
        until_s = self._clock.now() if self._stopped_s is None else self._stopped_s
        return until_s - self._start_s

    def stop(self) -> None:
        """Count no more; idempotent."""
        if self._stopped_s is None:
            self._stopped_s = self._clock.now()

    def go_on(self) -> None:
        """Count again from here; does nothing unless stopped."""
        if self._stopped_s is not None:
            self._start_s += self._clock.now() - self._stopped_s
            self._stopped_s = None
