"""Retries an attempt after recoveries that depend on the cause of its failure.

After a failure one recovery runs, then the next attempt. All counts are bounded; attempts share only intended data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained, ExplainedLeaf, MemoryComposite, applies, cause_of, message_of
from executive.tree.board import Board
from executive.tree.context import RunContext
from executive.tree.estimate import CannotError, Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.guard import is_known_as
from skills.api import Cause, Failed, ObjectObservation


@dataclass(frozen=True)
class Trigger:
    """Failure that triggers a recovery: the node `node` (None: the whole attempt) failed with one of `causes`.

    With `own`, the node itself must have caused the failure, as a guard does. A final failure fits no trigger.
    """

    causes: frozenset[Cause]
    node: str | None = None
    own: bool = False

    def __str__(self) -> str:
        causes = " or ".join(sorted(cause.value for cause in self.causes))
        return f"{causes} of {self.node}" if self.node else causes

    def fits(self, attempt: Behaviour) -> bool:
        """Returns whether a node in the attempt has failed in this way."""
        return any(self._fits(node, attempt) for node in attempt.iterate())

    def _fits(self, node: Behaviour, attempt: Behaviour) -> bool:
        if node.status != Status.FAILURE or cause_of(node) not in self.causes:
            return False
        if isinstance(node, Explained) and node.final:
            return False
        if self.own and any(child.status == Status.FAILURE for child in node.children):
            return False
        return node is attempt if self.node is None else isinstance(node, Explained) and node.path_id == self.node


@dataclass(frozen=True)
class Recovery:
    """Rule for a recovery, which runs after failures that fit one of the triggers, at most `uses` times.

    With `given` it runs only while the blackboard has a value under this key. If a `final` recovery fails, no other
    recovery runs. If a recovery that `completes` succeeds, the whole node succeeds without another attempt.
    """

    triggers: tuple[Trigger, ...]
    uses: int = 1
    given: str | None = None
    final: bool = False
    completes: bool = False

    def __str__(self) -> str:
        times = f", at most {self.uses} times" if self.uses > 1 else ""
        return f"after {' or '.join(map(str, self.triggers))}{times}"

    def bind(self, paths: Mapping[str, str]) -> Recovery:
        """Replaces the names of steps in the triggers by the path ids of their nodes."""
        return replace(self, triggers=tuple(replace(each, node=paths[each.node or ""]) for each in self.triggers))

    def fits(self, attempt: Behaviour, board: Board) -> bool:
        """Returns whether the rule's triggers fit the failure of an attempt."""
        if self.given is not None and not board.get(self.given, None):
            return False
        return any(trigger.fits(attempt) for trigger in self.triggers)


@dataclass(frozen=True)
class _AttemptFailure:
    """Failure of an attempt, and how many of its steps had succeeded."""

    cause: Cause
    message: str
    steps: int

    @staticmethod
    def from_attempt(attempt: Behaviour) -> _AttemptFailure:
        steps = sum(child.status == Status.SUCCESS for child in attempt.children)
        return _AttemptFailure(cause_of(attempt), message_of(attempt), steps)


class Recover(MemoryComposite):
    """Composite of an attempt (first child) and recoveries (other children, each with its `Recovery` rule).

    | attempt | recovery | status |
    |---|---|---|
    | RUNNING, SUCCESS | idle | as the attempt |
    | FAILURE | the first that fits and is not used up runs from the next tick on | RUNNING |
    | FAILURE | none fits | FAILURE |
    | FAILURE, no attempts left | only one that `completes` may still run | RUNNING, or FAILURE |
    | FAILURE | RUNNING | RUNNING |
    | FAILURE | SUCCESS | RUNNING; the next tick starts the attempt again |
    | FAILURE | SUCCESS of one that `completes` | SUCCESS |
    | FAILURE | FAILURE | RUNNING with the next that fits; FAILURE if there is none, or it was `final` |
    | halted | halted | INVALID with CANCELLED |

    A recovery that does not apply (`Conditional`) does not fit. The failure has the cause and the message of the
    attempt in which most children succeeded (of several, the last): if a grasp slips and the next search finds nothing,
    the slip is decisive. The messages of the last attempt and of a failed recovery are appended; if a recovery failed
    with ERROR, this is the cause. A new start counts recoveries from zero and clears the blackboard keys in `forgets`.
    """

    kind = "recover"
    usual = slice(1)
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
        """Handles the status of the attempt or of the recovery."""
        if child.status == Status.RUNNING:
            self._go_on(message_of(child))
        elif self._index == 0:
            self._attempt_ended(child)
        else:
            self._recovery_ended(child)

    def _attempt_ended(self, attempt: Behaviour) -> None:
        """Ends after a successful attempt; after a failure, queues the recoveries that fit."""
        if attempt.status == Status.SUCCESS:
            self._end(None, message_of(attempt))
            return
        failure = _AttemptFailure.from_attempt(attempt)
        if self._farthest is None or failure.steps >= self._farthest.steps:
            self._farthest = failure
        more = self.attempt < self.attempts
        self._due = [i for i, each in enumerate(self.recoveries) if (more or each.completes) and self._fits(i)]
        if not self._next_recovery():
            tried = f" (after {self.attempt} attempts)" if self.attempt > 1 else ""
            self._fail(tried)

    def _fits(self, number: int) -> bool:
        """Returns whether a recovery fits the failure of the attempt, applies and is not used up."""
        recovery, node = self.recoveries[number], self.children[number + 1]
        return applies(node) and self._uses[number] < recovery.uses and recovery.fits(self.children[0], self.board)

    def _next_recovery(self) -> bool:
        """Begins the next queued recovery; returns False when there is none."""
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
        """Ends with the decisive failure, and the message of the last attempt."""
        last = _AttemptFailure.from_attempt(self.children[0])
        decisive = self._farthest or last
        then = "" if decisive.message == last.message else f", then {last.message}"
        self._end(cause or decisive.cause, f"{decisive.message}{then}{addition}")


class Afterwards(MemoryComposite):
    """Composite of work (first child) and of a step that tidies up after any result of the work (second child).

    | work | tidying | status |
    |---|---|---|
    | RUNNING | idle | RUNNING |
    | SUCCESS, with `only_after_failure` | idle | SUCCESS |
    | SUCCESS, FAILURE | ticked in the same tick, RUNNING | RUNNING |
    | SUCCESS, FAILURE | SUCCESS, FAILURE | as the work; the message mentions a failure of the tidying |
    | halted | halted | INVALID with CANCELLED |
    """

    kind = "afterwards"
    only_after_failure: bool = False

    @classmethod
    def usual_children(cls, node: NodeSpec) -> tuple[NodeSpec, ...]:
        """Returns the work, and the tidying step if it follows every result."""
        return node.children[:1] if node.options.get("only_after_failure") else node.children

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
    """Composite that applies only while the blackboard has a value under `key`; has the status of its only child."""

    kind = "only if known"
    output_types: ClassVar = {"key": ObjectObservation}
    key: str
    board: Board

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates a branch that is possible only after an earlier node has written its key."""
        if node.options["key"] not in walk.written:
            raise CannotError(None)
        return walk.follow(node.children[0], first=first)

    def applies(self) -> bool:
        """Returns whether the key has a value."""
        return self.key in self.board


class LastSeen(ExplainedLeaf):
    """Leaf that says where the person detected under `key` was last seen.

    FAILURE with POSTCONDITION if the person was seen before, else with PRECONDITION.
    """

    kind = "last seen"
    person: str
    key: str
    board: Board

    def update(self) -> Status:
        """Fails with the place in its message."""
        seen: ObjectObservation | None = self.board.get(self.key, None)
        if seen is None:
            return self.fail(Failed(Cause.PRECONDITION, f"{self.person} was not seen before"))
        (x_m, y_m, _), room = seen.position_W, f" in the {seen.surface}" if seen.surface else ""
        return self.fail(Failed(Cause.POSTCONDITION, f"{self.person} was last seen at ({x_m:.2f}, {y_m:.2f}){room}"))


class OnlyIfHolding(MemoryComposite):
    """Composite that applies only while the gripper holds an object; has the status of its only child.

    With `known_as`, the object must have been recognised as one of these classes with all `attributes`.
    """

    kind = "only if holding"
    usual = slice(0)
    context: RunContext
    known_as: tuple[str, ...] | None = None
    attributes: tuple[str, ...] = ()

    def applies(self) -> bool:
        """Returns whether the gripper holds an object, and one of the classes `known_as` if given."""
        if not self.context.robot.gripper().holding:
            return False
        return self.known_as is None or is_known_as(self.context.payload.kind, self.known_as, self.attributes)
