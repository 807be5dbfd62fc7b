"""Recovery by cause: an attempt, and remedies of which each has its own failures that it is for.

One failure, one remedy, another attempt; all of it bounded, and nothing of one attempt is left for the next but what
the attempts share on purpose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.board import Board
from executive.tree.behaviours.composites import MemoryComposite
from executive.tree.behaviours.explained import Explained, cause_of, message_of
from skills.api import Cause
from skills.robot import Robot


@dataclass(frozen=True)
class Trigger:
    """A kind of failure: of the node `node` (None: of the attempt as a whole), with one of `causes`.

    With `own`, only where the failure is the node's own and not one that a node below it handed up: a guard's.
    """

    causes: frozenset[Cause]
    node: str | None = None
    own: bool = False

    def fits(self, attempt: Behaviour) -> bool:
        """Whether an attempt failed so."""
        return any(self._is_it(node, attempt) for node in attempt.iterate())

    def _is_it(self, node: Behaviour, attempt: Behaviour) -> bool:
        if node.status != Status.FAILURE or cause_of(node) not in self.causes:
            return False
        if self.own and any(child.status == Status.FAILURE for child in node.children):
            return False
        return node is attempt if self.node is None else isinstance(node, Explained) and node.path_id == self.node


@dataclass(frozen=True)
class Remedy:
    """What may be done after failures that fit one of the triggers, `uses` times at most; `node` does it."""

    node: Behaviour
    triggers: tuple[Trigger, ...]
    uses: int = 1

    def fits(self, attempt: Behaviour) -> bool:
        """Whether it is for the failure of an attempt."""
        return any(trigger.fits(attempt) for trigger in self.triggers)


class Recover(MemoryComposite):
    """An attempt (the first child), with remedies (the others) between it and the next attempt.

    Attempt RUNNING or SUCCESS: the same. Attempt FAILURE: the first remedy that fits and is not used up is run from the
    next tick on; none: FAILURE with the attempt's cause. Remedy RUNNING: RUNNING. Remedy SUCCESS: RUNNING, and at the
    next tick the attempt starts anew. Remedy FAILURE: the next that fits; none: FAILURE with the attempt's cause (ERROR
    when the remedy had that) and both sentences. No attempts left: FAILURE with the attempt's cause.
    When it starts anew, remedies are counted from zero and the blackboard keys in `forgets` are empty.
    """

    goes_on_after = frozenset({Status.SUCCESS})

    def __init__(
        self,
        *,
        path_id: str,
        name: str,
        attempt: Behaviour,
        remedies: Sequence[Remedy],
        attempts: int,
        forgets: Sequence[str],
        board: Board,
    ) -> None:
        super().__init__(path_id=path_id, name=name, children=[attempt, *(remedy.node for remedy in remedies)])
        self._remedies, self._attempts = tuple(remedies), attempts
        self._forgets, self._board = tuple(forgets), board
        self.attempt = 1
        self._uses = [0] * len(remedies)
        self._due: list[int] = []

    def tick(self) -> Iterator[Behaviour]:
        """Tick the attempt or the remedy that is under way, and see what comes of it."""
        if self.status != Status.RUNNING:
            self._restart()
        child = self.current_child = self.children[self._index]
        yield from child.tick()
        if child.status == Status.RUNNING:
            self.status, self.cause, self.message = Status.RUNNING, None, message_of(child)
        elif self._index == 0:
            self._attempt_ended()
        else:
            self._remedy_ended(child)
        yield self

    def _restart(self) -> None:
        super()._restart()
        self.attempt, self._uses, self._due = 1, [0] * len(self._remedies), []
        self._board.forget(self._forgets)

    def _attempt_ended(self) -> None:
        """Success ends it; after a failure the remedies that fit are due."""
        attempt = self.children[0]
        if attempt.status == Status.SUCCESS:
            self._end(Status.SUCCESS, None, message_of(attempt))
            return
        fitting = [i for i, r in enumerate(self._remedies) if self._uses[i] < r.uses and r.fits(attempt)]
        self._due = fitting if self.attempt < self._attempts else []
        if not self._next_remedy():
            tried = f" (after {self.attempt} attempts)" if self.attempt > 1 else ""
            self._end(Status.FAILURE, cause_of(attempt), f"{message_of(attempt)}{tried}")

    def _next_remedy(self) -> bool:
        """Turn to the next remedy that is due; False when there is none."""
        if not self._due:
            return False
        chosen = self._due.pop(0)
        self._uses[chosen] += 1
        self._index = chosen + 1
        why = message_of(self.children[0])
        self.status, self.cause, self.message = Status.RUNNING, None, f"{self.children[self._index].name}, since {why}"
        return True

    def _remedy_ended(self, remedy: Behaviour) -> None:
        if remedy.status == Status.SUCCESS:
            self.attempt += 1
            self._index = 0
            said = f"attempt {self.attempt}, since {message_of(self.children[0])}"
            self.status, self.cause, self.message = Status.RUNNING, None, said
        elif not self._next_remedy():
            failed = Cause.ERROR if cause_of(remedy) is Cause.ERROR else cause_of(self.children[0])
            said = f"{message_of(self.children[0])}; {remedy.name}: {message_of(remedy)}"
            self._end(Status.FAILURE, failed, said)

    def _end(self, status: Status, cause: Cause | None, message: str) -> None:
        self.cause, self.message = cause, message
        self.stop(status)


class Afterwards(MemoryComposite):
    """Something to be done (the first child), and what tidies up after it (the second), however it ended.

    First child RUNNING: RUNNING. First child done: on to the second in the same tick, unless `after` does not hold the
    first's status. Second RUNNING: RUNNING. Second done: the first's status, cause and sentence, with the second's
    failure mentioned.
    """

    goes_on_after = frozenset({Status.SUCCESS})

    def __init__(
        self,
        *,
        path_id: str,
        name: str,
        first: Behaviour,
        then: Behaviour,
        after: frozenset[Status] = frozenset({Status.SUCCESS, Status.FAILURE}),
    ) -> None:
        super().__init__(path_id=path_id, name=name, children=[first, then])
        self._after = after

    def tick(self) -> Iterator[Behaviour]:
        """Tick the first child; when it is done, the second."""
        if self.status != Status.RUNNING:
            self._restart()
        first, then = self.children
        if self._index == 0:
            self.current_child = first
            yield from first.tick()
            self._index = int(first.status in self._after)
        if self._index == 1:
            self.current_child = then
            yield from then.tick()
        self._sum_up(first, then)
        yield self

    def _sum_up(self, first: Behaviour, then: Behaviour) -> None:
        if Status.RUNNING in (first.status, then.status):
            self.status, self.cause, self.message = Status.RUNNING, None, message_of(self.children[self._index])
            return
        failed = first.status == Status.FAILURE
        self.cause, self.message = (cause_of(first) if failed else None), message_of(first)
        if then.status == Status.FAILURE:
            self.message += f" ({then.name} failed: {message_of(then)})"
        self.stop(first.status)


class OnlyIfKnown(MemoryComposite):
    """As its only child, for selectors that pass it over while the blackboard does not hold `key`."""

    goes_on_after = frozenset({Status.SUCCESS})

    def __init__(self, *, path_id: str, name: str, child: Behaviour, key: str, board: Board) -> None:
        super().__init__(path_id=path_id, name=name, children=[child])
        self._key, self._board = key, board

    def applies(self) -> bool:
        """Whether the key has been written."""
        return self._key in self._board


class OnlyIfHolding(MemoryComposite):
    """As its only child, for selectors that pass it over while the gripper holds nothing."""

    goes_on_after = frozenset({Status.SUCCESS})

    def __init__(self, *, path_id: str, name: str, child: Behaviour, robot: Robot) -> None:
        super().__init__(path_id=path_id, name=name, children=[child])
        self._robot = robot

    def applies(self) -> bool:
        """Whether something is held."""
        return self._robot.gripper().holding
