"""Sequence, selector and round: composites with memory; the results of their children stay visible."""

from __future__ import annotations

from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Conditional, MemoryComposite, cause_of, failed_for_good, message_of
from skills.api import Cause

_MERELY_NOT_SO = frozenset({Cause.PRECONDITION, Cause.POSTCONDITION})


class MemorySequence(MemoryComposite):
    """Sequence with memory.

    | child | status |
    |---|---|
    | RUNNING | RUNNING |
    | SUCCESS | ticks the next child in the same tick; SUCCESS after the last |
    | FAILURE | FAILURE with its cause; later children stay idle |
    | halted | INVALID with CANCELLED |
    """

    kind = "sequence"


class MemorySelector(MemoryComposite):
    """Selector with memory.

    | child | status |
    |---|---|
    | does not apply (`Conditional`) | passed over: the child stays idle, the next one is ticked |
    | RUNNING | RUNNING |
    | SUCCESS | SUCCESS |
    | FAILURE | ticks the next child in the same tick; FAILURE after the last |
    | halted | INVALID with CANCELLED |

    The failure has the messages of all children that could begin, the decisive ones first. Its cause is ERROR if one
    child had that, else the first that is neither PRECONDITION nor POSTCONDITION, else `exhausted_cause` if given, else
    that of the last child, or PRECONDITION if no child applied. With `one_goal` all children lead to the same goal:
    after a final failure of one, the others are passed over.
    """

    kind = "selector"
    goes_on_after: ClassVar[tuple[Status, ...]] = (Status.FAILURE, Status.INVALID)
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
        causes = [cause_of(one) for one in failed]
        obstacles = [each for each in causes if each not in _MERELY_NOT_SO]
        cause = Cause.ERROR if Cause.ERROR in obstacles else next(iter(obstacles), self.exhausted_cause or causes[-1])
        tried = [one for one in failed if cause_of(one) is not Cause.PRECONDITION] or failed
        tried.sort(key=lambda one: cause_of(one) is not cause)
        sentences = list(dict.fromkeys(map(message_of, tried)))
        more = f"; and {len(sentences) - 4} more" if len(sentences) > 4 else ""
        shown = f"{'; '.join(sentences[:4])}{more}"
        return cause, f"{self.exhausted_message}: {shown}" if self.exhausted_message else shown


class MemoryRound(MemorySelector):
    """Composite that ticks all children, one after the other, whatever their results.

    | child | status |
    |---|---|
    | does not apply (`Conditional`) | passed over |
    | RUNNING | RUNNING |
    | SUCCESS, FAILURE | ticks the next child in the same tick |
    | after the last, with any SUCCESS | SUCCESS with the messages of all that succeeded |
    | after the last, without | FAILURE like a selector |
    | halted | INVALID with CANCELLED |
    """

    kind = "round"
    goes_on_after = (Status.SUCCESS, Status.FAILURE, Status.INVALID)

    def _take_over(self, child: Behaviour) -> None:
        done = [one for one in self.children if one.status == Status.SUCCESS]
        if child.status == Status.RUNNING or not done:
            super()._take_over(child)
            return
        super()._take_over(done[-1])
        self.message = "; ".join(dict.fromkeys(map(message_of, done)))
