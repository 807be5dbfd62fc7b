"""Sequence, selector and round with memory that keep the results of finished children in sight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Final, Protocol, runtime_checkable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from executive.tree.behaviour import ExplainedNode, cause_of, failed_for_good, message_of
from executive.tree.node import NodeKind
from skills.api import Cause

_MERELY_NOT_SO = frozenset({Cause.PRECONDITION, Cause.POSTCONDITION})


@runtime_checkable
class Conditional(Protocol):
    """A child that a selector passes over untouched when it does not apply: that is no failure."""

    def applies(self) -> bool:
        """Whether there is any sense in ticking it now."""


@dataclass(kw_only=True, eq=False, repr=False)
class MemoryComposite(ExplainedNode, Composite):
    """Ticks its children one after the other and never goes back to one that is done."""

    goes_on_after: ClassVar[tuple[Status, ...]] = (Status.SUCCESS,)
    children: list[Behaviour]
    _index: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if not self.children:
            raise ValueError(f"{self.path_id}: a {type(self).__name__} needs at least one child")
        Composite.__init__(self, self.name, list(self.children))

    def tick(self) -> Iterator[Behaviour]:
        """Tick the present child, and the next ones while they allow it."""
        if self.status != Status.RUNNING:
            self._restart()
        while True:
            child = self.current_child = self.children[self._index]
            passed_over = self._passes_over(child)
            if not passed_over:
                yield from child.tick()
            goes_on = passed_over or child.status in self.goes_on_after
            if not goes_on or self._index + 1 == len(self.children):
                break
            self._index += 1
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

    def _restart(self) -> None:
        self._index = 0
        self.clear_explanation()
        for child in self.children:
            child.stop(Status.INVALID)

    def _take_over(self, child: Behaviour) -> None:
        """Take the child's status, and its explanation where there is something to explain."""
        status = child.status if child.status != Status.INVALID else Status.FAILURE
        self.cause, self.message = self._explanation(child) if status == Status.FAILURE else (None, message_of(child))
        if status == Status.RUNNING:
            self.status = status
        else:
            self.stop(status)

    def _explanation(self, child: Behaviour) -> tuple[Cause, str]:
        return cause_of(child), message_of(child)


class MemorySequence(MemoryComposite):
    """One after the other.

    Child RUNNING: RUNNING. Child FAILURE: FAILURE with its cause; later children stay untouched. Child SUCCESS: on to
    the next in the same tick; after the last: SUCCESS.
    """


@dataclass(kw_only=True, eq=False, repr=False)
class MemorySelector(MemoryComposite):
    """One child after the other until one works.

    Child that does not apply (`Conditional`): passed over, it stays idle. Child RUNNING: RUNNING. Child SUCCESS:
    SUCCESS. Child FAILURE: on to the next in the same tick; after the last: FAILURE with the sentences of all that
    could begin, the decisive ones first. Its cause is ERROR when one child had that, else the first that is neither
    PRECONDITION nor POSTCONDITION, else `exhausted_cause` where given, else the last child's. With `one_goal` the
    children lead to the same goal: after a failure that is final for one, the others are passed over.
    """

    goes_on_after: ClassVar[tuple[Status, ...]] = (Status.FAILURE,)
    exhausted_cause: Cause | None = None
    exhausted_message: str = ""
    one_goal: bool = False

    def _passes_over(self, child: Behaviour) -> bool:
        if self.one_goal and child.status != Status.RUNNING and any(map(failed_for_good, self.children)):
            return True
        return child.status != Status.RUNNING and isinstance(child, Conditional) and not child.applies()

    def _explanation(self, child: Behaviour) -> tuple[Cause, str]:
        failed = [one for one in self.children if one.status == Status.FAILURE]
        if not failed:
            return self.exhausted_cause or Cause.PRECONDITION, self.exhausted_message or "nothing of it applies"
        cause = self._decisive_cause([cause_of(one) for one in failed])
        tried = [one for one in failed if cause_of(one) is not Cause.PRECONDITION] or failed
        tried.sort(key=lambda one: cause_of(one) is not cause)
        sentences = list(dict.fromkeys(map(message_of, tried)))
        more = f"; and {len(sentences) - 4} more" if len(sentences) > 4 else ""
        shown = f"{'; '.join(sentences[:4])}{more}"
        return cause, f"{self.exhausted_message}: {shown}" if self.exhausted_message else shown

    def _decisive_cause(self, causes: Sequence[Cause]) -> Cause:
        obstacles = [cause for cause in causes if cause not in _MERELY_NOT_SO]
        if Cause.ERROR in obstacles:
            return Cause.ERROR
        return obstacles[0] if obstacles else self.exhausted_cause or causes[-1]


class MemoryRound(MemorySelector):
    """All children, one after the other, whatever becomes of each.

    Child that does not apply: passed over. Child RUNNING: RUNNING. Child SUCCESS or FAILURE: on to the next in the same
    tick. After the last: SUCCESS with the sentences of those that worked when any did, else FAILURE as a selector.
    """

    goes_on_after = (Status.SUCCESS, Status.FAILURE)

    def _take_over(self, child: Behaviour) -> None:
        done = [one for one in self.children if one.status == Status.SUCCESS]
        if child.status == Status.RUNNING or not done:
            super()._take_over(child)
            return
        super()._take_over(done[-1])
        self.message = "; ".join(dict.fromkeys(map(message_of, done)))


KINDS: Final[Mapping[str, NodeKind]] = {
    "sequence": NodeKind(MemorySequence, ("children",)),
    "selector": NodeKind(MemorySelector, ("children",)),
    "round": NodeKind(MemoryRound, ("children",)),
}
