"""Decorators: a limit on the robot's clock, attempts chosen by cause, and a guard above actions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from executive.tree.behaviours.conditions import Condition, Waiting
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.explained import Explained, cause_of, message_of
from executive.tree.behaviours.requirements import Requirement
from executive.tree.behaviours.suspension import StoppableTime, suspend
from executive.tree.node import NodeKind
from skills.api import Cause, Failed
from skills.robot import Clock


class ExplainedDecorator(Explained, Decorator):
    """A decorator that takes its child's explanation unless it has its own."""

    def __init__(self, *, path_id: str, name: str, child: Behaviour) -> None:
        super().__init__(name, child)
        self.path_id = path_id
        self.clear_explanation()

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


class Timeout(ExplainedDecorator):
    """A limit on the robot's clock.

    Child FAILURE: FAILURE with its cause. Time over: child halted, FAILURE with TIMEOUT, even when it succeeded just
    now. Else as the child. Time in which the tree is suspended does not count.
    """

    def __init__(self, *, path_id: str, name: str, child: Behaviour, limit_s: float, clock: Clock) -> None:
        super().__init__(path_id=path_id, name=name, child=child)
        self._limit_s, self._clock, self._time = limit_s, clock, StoppableTime(clock)

    def initialise(self) -> None:
        """Start the time."""
        self._time = StoppableTime(self._clock)

    def suspend(self) -> None:
        """Stop counting until the next tick."""
        self._time.stop()

    def update(self) -> Status:
        """The child's status, unless the time is over."""
        self._time.go_on()
        late = self._time.elapsed_s() > self._limit_s
        if late and self.decorated.status != Status.FAILURE:
            return self.fail(Failed(Cause.TIMEOUT, f"not done within {self._limit_s:g} s"))
        return self.pass_on()


class Retry(ExplainedDecorator):
    """Tries again, but only after failures of given causes.

    Child RUNNING or SUCCESS: the same. Child FAILURE of another cause, or no attempts left: FAILURE with its cause.
    Else RUNNING, and at the next tick the child starts anew from its first step with nothing remembered.
    """

    def __init__(self, *, path_id: str, name: str, child: Behaviour, attempts: int, causes: frozenset[Cause]) -> None:
        super().__init__(path_id=path_id, name=name, child=child)
        self._attempts, self._causes = attempts, causes
        self.attempt = 1

    def initialise(self) -> None:
        """Count from the first attempt."""
        self.attempt = 1

    def update(self) -> Status:
        """The child's status, unless another attempt is due."""
        status = self.pass_on()
        if status != Status.FAILURE:
            return status
        if self.cause in self._causes and self.attempt < self._attempts:
            self.attempt += 1
            self.cause, self.message = None, f"attempt {self.attempt} of {self._attempts}, since {self.message}"
            return Status.RUNNING
        if self.attempt > 1:
            self.message = f"{self.message} (after {self.attempt} attempts)"
        return Status.FAILURE


class Guard(ExplainedDecorator):
    """A condition above actions, looked at before every tick.

    Condition violated: child halted, FAILURE with the condition's cause. Condition waiting: child suspended, RUNNING.
    Else as the child.
    """

    def __init__(self, *, path_id: str, name: str, child: Behaviour, condition: Condition, context: RunContext) -> None:
        super().__init__(path_id=path_id, name=name, child=child)
        self._condition, self._context = condition, context

    def tick(self) -> Iterator[Behaviour]:
        """Look at the condition, then tick the child."""
        if self.status != Status.RUNNING:
            self._condition.begin(self._context)
        verdict = self._condition.violated(self._context)
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
        """As the child."""
        return self.pass_on()


def _guard(*, requirement: Requirement, context: RunContext, **node: Any) -> Guard:
    return Guard(condition=requirement.condition(context), context=context, **node)


KINDS: Final[Mapping[str, NodeKind]] = MappingProxyType(
    {
        "timeout": NodeKind(Timeout, ("child", "clock")),
        "retry": NodeKind(Retry, ("child",)),
        "guard": NodeKind(_guard, ("child", "context")),
    }
)
