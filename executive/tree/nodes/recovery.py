"""Recovery by cause: an attempt, and recoveries of which each has its own failures that it is for.

One failure, one recovery, another attempt; all of it bounded, and nothing of one attempt is left for the next but what
the attempts share on purpose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Conditional, Explained, MemoryComposite, cause_of, message_of
from executive.tree.board import Board
from executive.tree.context import RunContext
from executive.tree.nodes.guard import is_known_as
from skills.api import Cause, ObjectObservation


@dataclass(frozen=True)
class Trigger:
    """A kind of failure: of the node `node` (None: of the attempt as a whole), with one of `causes`.

    With `own`, only where the failure is the node's own and not one that a node below it handed up: a guard's. A
    failure of a node that is final fits no trigger for that node.
    """

    causes: frozenset[Cause]
    node: str | None = None
    own: bool = False

    def fits(self, attempt: Behaviour) -> bool:
        """Returns whether an attempt failed so."""
        return any(self._is_it(node, attempt) for node in attempt.iterate())

    def _is_it(self, node: Behaviour, attempt: Behaviour) -> bool:
        if node.status != Status.FAILURE or cause_of(node) not in self.causes:
            return False
        if isinstance(node, Explained) and node.final:
            return False
        if self.own and any(child.status == Status.FAILURE for child in node.children):
            return False
        return node is attempt if self.node is None else isinstance(node, Explained) and node.path_id == self.node


@dataclass(frozen=True)
class Recovery:
    """When a recovery is due: after failures that fit one of the triggers, `uses` times at most.

    With `given`, only while the blackboard holds something under that key. After one that is `final` and failed there
    is no other. One that `completes` brings about what the attempt was for: after its success all is done.
    """

    triggers: tuple[Trigger, ...]
    uses: int = 1
    given: str | None = None
    final: bool = False
    completes: bool = False

    def of(self, paths: Mapping[str, str]) -> Recovery:
        """The same for nodes with these path ids, by the names that stand in its triggers."""
        return replace(self, triggers=tuple(replace(each, node=paths[each.node or ""]) for each in self.triggers))

    def fits(self, attempt: Behaviour, board: Board) -> bool:
        """Returns whether it is for the failure of an attempt."""
        if self.given is not None and not (self.given in board and board.get(self.given)):
            return False
        return any(trigger.fits(attempt) for trigger in self.triggers)


@dataclass(frozen=True)
class _AttemptFailure:
    """How an attempt failed, and how many steps of it had succeeded by then."""

    cause: Cause
    message: str
    steps: int

    @staticmethod
    def of(attempt: Behaviour) -> _AttemptFailure:
        steps = sum(child.status == Status.SUCCESS for child in attempt.children)
        return _AttemptFailure(cause_of(attempt), message_of(attempt), steps)


class Recover(MemoryComposite):
    """An attempt (the first child), with recoveries (the others, each with its `Recovery`) before the next attempt.

    Attempt RUNNING or SUCCESS: the same. Attempt FAILURE: the first recovery that fits and is not used up is run from
    the next tick on; none: FAILURE. A recovery that does not apply (`Conditional`) does not fit. Recovery RUNNING:
    RUNNING. Recovery SUCCESS: RUNNING, and at the next tick the attempt starts anew; SUCCESS after one that completes.
    Recovery FAILURE: the next that fits; none: FAILURE. No attempts left: FAILURE, but one that completes is tried.
    A failure has the cause and the sentence of the attempt that came farthest, the last of those: when a grasp slips
    and the object is then not seen any more, the slip is decisive. An attempt comes as far as children of it succeeded.
    After it stand the last attempt's sentence and a failed recovery's (its cause counts when it is ERROR).
    When it starts anew, recoveries are counted from zero and the blackboard keys in `forgets` are empty.
    """

    kind = "recover"
    recoveries: Sequence[Recovery]
    attempts: int
    board: Board
    forgets: Sequence[str] = ()
    attempt: int = field(default=1, init=False)
    _uses: list[int] = field(default_factory=list, init=False)
    _due: list[int] = field(default_factory=list, init=False)
    _farthest: _AttemptFailure | None = field(default=None, init=False)

    def _restart(self) -> None:
        super()._restart()
        self.attempt, self._uses, self._due, self._farthest = 1, [0] * len(self.recoveries), [], None

    def _forget(self) -> None:
        self.board.forget(self.forgets)

    def _following(self, child: Behaviour) -> int | None:
        return None

    def _take_over(self, child: Behaviour) -> None:
        """Sees what comes of the attempt or the recovery that is under way."""
        if child.status == Status.RUNNING:
            self._go_on(message_of(child))
        elif self._index == 0:
            self._attempt_ended(child)
        else:
            self._recovery_ended(child)

    def _attempt_ended(self, attempt: Behaviour) -> None:
        """Success ends it; after a failure the recoveries that fit are due."""
        if attempt.status == Status.SUCCESS:
            self._end(None, message_of(attempt))
            return
        failure = _AttemptFailure.of(attempt)
        if self._farthest is None or failure.steps >= self._farthest.steps:
            self._farthest = failure
        more = self.attempt < self.attempts
        self._due = [i for i, each in enumerate(self.recoveries) if (more or each.completes) and self._fits(i)]
        if not self._next_recovery():
            tried = f" (after {self.attempt} attempts)" if self.attempt > 1 else ""
            self._fail(tried)

    def _fits(self, number: int) -> bool:
        """Returns whether a recovery is for the failure of the attempt, applies and is not used up."""
        recovery, node = self.recoveries[number], self.children[number + 1]
        applies = not isinstance(node, Conditional) or node.applies()
        return applies and self._uses[number] < recovery.uses and recovery.fits(self.children[0], self.board)

    def _next_recovery(self) -> bool:
        """Turns to the next recovery that is due; False when there is none."""
        if not self._due:
            return False
        chosen = self._due.pop(0)
        self._uses[chosen] += 1
        self._index = chosen + 1
        self._go_on(f"{self.children[self._index].name}, since {message_of(self.children[0])}")
        return True

    def _recovery_ended(self, recovery: Behaviour) -> None:
        rule = self.recoveries[self._index - 1]
        if recovery.status == Status.SUCCESS and rule.completes:
            self._end(None, message_of(recovery))
        elif recovery.status == Status.SUCCESS:
            self.attempt += 1
            self._index = 0
            self._go_on(f"attempt {self.attempt}, since {message_of(self.children[0])}")
        elif rule.final or not self._next_recovery():
            error = Cause.ERROR if cause_of(recovery) is Cause.ERROR else None
            self._fail(f"; {recovery.name}: {message_of(recovery)}", error)

    def _fail(self, addition: str, cause: Cause | None = None) -> None:
        """Ends with what is decisive, and what came last."""
        last = _AttemptFailure.of(self.children[0])
        decisive = self._farthest or last
        then = "" if decisive.message == last.message else f", then {last.message}"
        self._end(cause or decisive.cause, f"{decisive.message}{then}{addition}")


class Afterwards(MemoryComposite):
    """Something to be done (the first child), and what tidies up after it (the second), however it ended.

    First child RUNNING: RUNNING. First child done: on to the second in the same tick, unless it succeeded and the
    second is there `only_after_failure`. Second RUNNING: RUNNING. Second done: the first's status, cause and sentence,
    with the second's failure mentioned.
    """

    kind = "afterwards"
    only_after_failure: bool = False

    def _following(self, child: Behaviour) -> int | None:
        done = child.status == Status.FAILURE or not self.only_after_failure
        return 1 if self._index == 0 and done else None

    def _take_over(self, child: Behaviour) -> None:
        first, then = self.children
        if child.status == Status.RUNNING:
            self._go_on(message_of(child))
            return
        failed = first.status == Status.FAILURE
        self.cause, self.message = (cause_of(first) if failed else None), message_of(first)
        if then.status == Status.FAILURE:
            self.message += f" ({then.name} failed: {message_of(then)})"
        self.stop(first.status)


class OnlyIfKnown(MemoryComposite):
    """As its only child, for selectors that pass it over while the blackboard does not hold `key`."""

    kind = "only if known"
    key: str
    board: Board

    @staticmethod
    def writes(options: Mapping[str, Any]) -> Mapping[str, Any]:
        """The key, again."""
        return {options["key"]: ObjectObservation}

    def applies(self) -> bool:
        """Returns whether the key has been written."""
        return self.key in self.board


class OnlyIfHolding(MemoryComposite):
    """As its only child, for selectors that pass it over while the gripper holds nothing.

    With `known_as`, what is held must have been taken for an object of one of those classes, with all `attributes`.
    """

    kind = "only if holding"
    context: RunContext
    known_as: tuple[str, ...] | None = None
    attributes: tuple[str, ...] = ()

    def applies(self) -> bool:
        """Returns whether something is held, or that object."""
        if not self.context.robot.gripper().holding:
            return False
        return self.known_as is None or is_known_as(self.context.payload.kind, self.known_as, self.attributes)
