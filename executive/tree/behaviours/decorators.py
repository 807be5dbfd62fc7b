"""Decorators: a limit on the robot's clock, attempts chosen by cause, and a guard above actions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from executive.tree.behaviour import ExplainedNode, cause_of, message_of
from executive.tree.behaviours.suspension import StoppableTime, suspend
from executive.tree.context import RunContext
from executive.tree.node import NodeKind
from executive.tree.nodes.guard import Condition, Waiting
from skills.api import Cause, Failed
from skills.robot import Clock


@dataclass(kw_only=True, eq=False, repr=False)
class ExplainedDecorator(ExplainedNode, Decorator):
    """A decorator that takes its child's explanation unless it has its own."""

    child: Behaviour

    def __post_init__(self) -> None:
        Decorator.__init__(self, self.name, self.child)

    def tick(self) -> Iterator[Behaviour]:
        """Tick the child, then judge. As the library's, which also writes debug texts and checks the status' type."""
        if self.status != Status.RUNNING:
            self.initialise()
        yield from self.decorated.tick()
        status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

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

    def fail(self, failure: Failed) -> Status:
        """FAILURE for a reason of one's own."""
        self.cause, self.message = failure.cause, failure.message
        return Status.FAILURE


@dataclass(kw_only=True, eq=False, repr=False)
class Timeout(ExplainedDecorator):
    """A limit on the robot's clock.

    Child FAILURE: FAILURE with its cause. Time over: child halted, FAILURE with TIMEOUT, even when it succeeded just
    now. Else as the child. Time in which the tree is suspended does not count.
    """

    limit_s: float
    clock: Clock

    def initialise(self) -> None:
        """Start the time."""
        self._time = StoppableTime(self.clock)

    def suspend(self) -> None:
        """Stop counting until the next tick."""
        self._time.stop()

    def update(self) -> Status:
        """The child's status, unless the time is over."""
        self._time.go_on()
        late = self._time.elapsed_s() > self.limit_s
        if late and self.decorated.status != Status.FAILURE:
            return self.fail(Failed(Cause.TIMEOUT, f"not done within {self.limit_s:g} s"))
        return self.pass_on()


@dataclass(kw_only=True, eq=False, repr=False)
class Retry(ExplainedDecorator):
    """Tries again, but only after failures of given causes.

    Child RUNNING or SUCCESS: the same. Child FAILURE of another cause, or no attempts left: FAILURE with its cause.
    Else RUNNING, and at the next tick the child starts anew from its first step with nothing remembered.
    """

    attempts: int
    causes: frozenset[Cause]
    attempt: int = field(default=1, init=False)

    def initialise(self) -> None:
        """Count from the first attempt."""
        self.attempt = 1

    def update(self) -> Status:
        """The child's status, unless another attempt is due."""
        status = self.pass_on()
        if status != Status.FAILURE:
            return status
        if self.cause in self.causes and self.attempt < self.attempts:
            self.attempt += 1
            self.cause, self.message = None, f"attempt {self.attempt} of {self.attempts}, since {self.message}"
            return Status.RUNNING
        if self.attempt > 1:
            self.message = f"{self.message} (after {self.attempt} attempts)"
        return Status.FAILURE


@dataclass(kw_only=True, eq=False, repr=False)
class Guard(ExplainedDecorator):
    """A condition above actions, looked at before every tick.

    Condition violated: child halted, FAILURE with the condition's cause. Condition waiting: child suspended, RUNNING.
    Child SUCCESS that the condition contradicts (`violated_at_end`): FAILURE with its cause. Else as the child.
    """

    condition: Condition
    context: RunContext
    _looked: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.condition = self.condition.for_run(self.context)

    def tick(self) -> Iterator[Behaviour]:
        """Look at the condition, then tick the child."""
        if self.status != Status.RUNNING:
            self.condition.begin(self.context)
        self._looked = True
        verdict = self.condition.violated(self.context)
        if verdict is None:
            yield from super().tick()
            return
        if isinstance(verdict, Waiting):
            suspend(self.decorated)
            self.status, self.cause, self.message = Status.RUNNING, None, verdict.message
        else:
            self.stop(self.fail(verdict))
        yield self

    def update(self) -> Status:
        """As the child, unless the condition contradicts its success."""
        status = self.pass_on()
        done, self._looked = self._looked and status == Status.SUCCESS, False
        contradicts = self.condition.violated_at_end(self.context) if done else None
        return status if contradicts is None else self.fail(contradicts)


KINDS: Final[Mapping[str, NodeKind]] = {
    "timeout": NodeKind(Timeout, ("child", "clock")),
    "retry": NodeKind(Retry, ("child",)),
    "guard": NodeKind(Guard, ("child", "context")),
}
