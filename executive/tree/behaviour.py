"""What all nodes of ours are made of: a stable path id, a cause and one sentence; leaves, decorators and composites.

A page of `executive.tree.nodes` defines a kind of node as a class with a `kind`; being there registers it. Its fields
are the options of its specs, and what the run lends: `child` or `children`, `context`, and any field of the context.

Suspending a tree touches no status and no memory: a composite stays at its child, a retry at its attempt. Only the
running nodes that are `Suspendable` are told; each goes on by itself when it is ticked the next time. Time that passes
while a node is suspended does not count against its limit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, dataclass_transform, runtime_checkable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from skills.api import Cause, Failed
from skills.robot import Clock


class Explained:
    """Mixin for behaviours, which have the `status`.

    `cause` is None unless the node failed or was cancelled; `message` is one sentence, `progress` from 0 to 1 or None.
    A failure is `final` where another attempt would end the same way.
    """

    path_id: str
    cause: Cause | None
    message: str
    status: Status
    progress: float | None = None
    final: bool = False

    def clear_explanation(self) -> None:
        """Forgets cause and message."""
        self.cause, self.message, self.final = None, "", False

    def explain_cancelled(self) -> None:
        """Says that the node was stopped from outside, and while doing what."""
        self.cause = Cause.CANCELLED
        self.message = f"stopped while: {self.message}" if self.message else "stopped"


@dataclass_transform(kw_only_default=True, eq_default=False, field_specifiers=(field,))
class _TakesKeywords:
    """Makes each class below a dataclass of keywords."""

    def __init_subclass__(cls) -> None:
        dataclass(kw_only=True, eq=False, repr=False)(cls)


class ExplainedNode(_TakesKeywords, Explained):
    """An explained node of ours; `kind` is what its specs call it."""

    kind: ClassVar[str] = ""
    settled: ClassVar[bool] = False
    """Whether its success stands after a restart, and nothing below is done once more."""
    afresh: ClassVar[bool] = False
    """Whether nothing of it is taken up after a restart: it is called for again where need be."""
    path_id: str
    name: str
    cause: Cause | None = field(default=None, init=False)
    message: str = field(default="", init=False)

    @staticmethod
    def writes(options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Of the options, the blackboard keys that such a node writes, and the type of each value."""
        return {}

    def restore(self, status: Status, cause: Cause | None, message: str) -> None:
        """Takes over the status, cause and message that the node had before a restart."""
        self.status, self.cause, self.message = status, cause, message

    def fail(self, failure: Failed) -> Status:
        """FAILURE for a reason of one's own."""
        self.cause, self.message = failure.cause, failure.message
        return Status.FAILURE

    def say(self, message: str, status: Status = Status.SUCCESS) -> Status:
        """The status with a sentence and no cause."""
        self.cause, self.message = None, message
        return status


class ExplainedLeaf(ExplainedNode, Behaviour):
    """One without children."""

    def __post_init__(self) -> None:
        Behaviour.__init__(self, self.name)

    def tick(self) -> Iterator[Behaviour]:
        """Does the work of a tick. As the library's, which also writes debug texts and checks the status' type."""
        if self.status != Status.RUNNING:
            self.initialise()
        status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self


class ExplainedDecorator(ExplainedNode, Decorator):
    """A decorator that takes its child's explanation unless it has its own."""

    child: Behaviour
    before: Status | None = field(default=None, init=False)
    """How it ended before a restart, where its child gives its result of then once more."""

    def __post_init__(self) -> None:
        Decorator.__init__(self, self.name, self.child)

    def tick(self) -> Iterator[Behaviour]:
        """Ticks the child unless something holds it back, then judge. As the library's, which also checks types."""
        if self.status != Status.RUNNING:
            self.initialise()
        status = self._held_back()
        if status is None:
            yield from self.decorated.tick()
            status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def _held_back(self) -> Status | None:
        """The status in a tick in which the child is left alone; None where it is ticked."""
        return None

    def stop(self, new_status: Status) -> None:
        """Interrupted while running: stop the child and say so. Reset: reset the child too."""
        interrupted = new_status == Status.INVALID and self.status == Status.RUNNING
        super().stop(new_status)
        if interrupted:
            self.explain_cancelled()
        elif new_status == Status.INVALID:
            self.clear_explanation()

    def pass_on(self) -> Status:
        """The child's status and explanation as they are."""
        failed = self.decorated.status == Status.FAILURE
        self.cause, self.message = (cause_of(self.decorated) if failed else None), message_of(self.decorated)
        return self.decorated.status


class MemoryComposite(ExplainedNode, Composite):
    """Ticks its children one after the other, as `_following` says, and never goes back to one that is done."""

    goes_on_after: ClassVar[tuple[Status, ...]] = (Status.SUCCESS,)
    least: ClassVar[int] = 1
    children: list[Behaviour]
    resumed: bool = field(default=False, init=False)
    """Whether the mission goes on after a restart; then the first tick forgets nothing."""
    _index: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if len(self.children) < self.least:
            raise ValueError(f"{self.path_id}: a {type(self).__name__} needs at least one child")
        Composite.__init__(self, self.name, list(self.children))

    def tick(self) -> Iterator[Behaviour]:
        """Ticks the present child, and those that follow it in the same tick."""
        if self.status != Status.RUNNING:
            self._restart()
        while True:
            child = self.current_child = self.children[self._index]
            if not self._passes_over(child):
                yield from child.tick()
            following = None if child.status == Status.RUNNING else self._following(child)
            if following is None:
                break
            self._index = following
        self._take_over(child)
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Interrupted while running: stop what runs and keep the rest in sight. Else: reset all children."""
        if new_status == Status.INVALID:
            interrupted = self.status == Status.RUNNING
            for child in self.children:
                if not interrupted or child.status == Status.RUNNING:
                    child.stop(Status.INVALID)
            if interrupted:
                self.explain_cancelled()
            else:
                self.clear_explanation()
        self.status = new_status
        self.iterator = self.tick()

    def _passes_over(self, child: Behaviour) -> bool:
        return False

    def _following(self, child: Behaviour) -> int | None:
        """The number of the child that is ticked next in the same tick, once the present one is done; None: none."""
        goes_on = child.status in self.goes_on_after and self._index + 1 < len(self.children)
        return self._index + 1 if goes_on else None

    def _restart(self) -> None:
        resumed, self.resumed, self._index = self.resumed, False, 0
        self.clear_explanation()
        self._reset_children()
        if not resumed:
            self._forget()

    def _forget(self) -> None:
        """Leaves nothing on the blackboard of the time before it began."""

    def _reset_children(self) -> None:
        for child in self.children:
            child.stop(Status.INVALID)

    def _take_over(self, child: Behaviour) -> None:
        """Takes the child's status, and its explanation where there is something to explain."""
        status = child.status if child.status != Status.INVALID else Status.FAILURE
        self.cause, self.message = self._explanation(child) if status == Status.FAILURE else (None, message_of(child))
        if status == Status.RUNNING:
            self.status = status
        else:
            self.stop(status)

    def _explanation(self, child: Behaviour) -> tuple[Cause, str]:
        return cause_of(child), message_of(child)

    def _go_on(self, message: str) -> None:
        """RUNNING with this sentence."""
        self.status, self.cause, self.message = Status.RUNNING, None, message

    def _end(self, cause: Cause | None, message: str) -> None:
        """SUCCESS, or FAILURE with a cause."""
        self.cause, self.message = cause, message
        self.stop(Status.SUCCESS if cause is None else Status.FAILURE)


def cause_of(node: Behaviour) -> Cause:
    """The node's cause; EXECUTION for a foreign node that carries none."""
    cause = node.cause if isinstance(node, Explained) else None
    return cause or Cause.EXECUTION


def failed_for_good(node: Behaviour) -> bool:
    """Returns whether the node, or one below it, failed and another attempt would end the same way."""
    return any(isinstance(one, Explained) and one.status == Status.FAILURE and one.final for one in node.iterate())


def message_of(node: Behaviour) -> str:
    """The node's sentence; for a foreign node its feedback message, else its name and status."""
    message = node.message if isinstance(node, Explained) else node.feedback_message
    return message or f"{node.name} {'failed' if node.status == Status.FAILURE else 'goes on'}"


@runtime_checkable
class Conditional(Protocol):
    """A child that a selector passes over untouched when it does not apply: that is no failure."""

    def applies(self) -> bool:
        """Returns whether there is any sense in ticking it now."""


@runtime_checkable
class Suspendable(Protocol):
    """A node that must be told when it will not be ticked for a while."""

    def suspend(self) -> None:
        """Lets go of the robot and stops counting time until the next tick. Idempotent; never raises."""


def suspend(root: Behaviour, *, sparing: Behaviour | None = None) -> None:
    """Suspend all running nodes of a tree: motion that its leaves began is stopped, their place is kept.

    The node `sparing` and those below it are let go on. Tick the tree again to go on: each suspended skill is told to
    `resume`, which begins it anew unless it knows better. Stop it to give it up. Call it again freely.
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
