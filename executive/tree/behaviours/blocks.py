"""Composites behind the blocks of a mission: choose, repeat, try, together, and what is always done in the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.board import Board
from executive.tree.behaviours.composites import MemoryComposite
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.decisions import Decide
from executive.tree.behaviours.explained import cause_of, message_of
from executive.tree.behaviours.policies import FINAL_CAUSES
from executive.tree.behaviours.recovery import Afterwards
from executive.tree.node import NodeKind
from executive.words.expression import Value
from skills.api import Cause
from skills.files.errors import count_text
from skills.robot import Clock


@dataclass(kw_only=True, eq=False, repr=False)
class Choose(MemoryComposite):
    """What decides (the first child, which leaves its answer under `key`), then the branch that the answer leads to.

    `branches` gives the number of the child for each answer. First child RUNNING: RUNNING; FAILURE: FAILURE with its
    cause. An answer without a branch: SUCCESS. Else as the branch, from the same tick on.
    """

    branches: Mapping[Value, int]
    key: str
    board: Board

    def tick(self) -> Iterator[Behaviour]:
        """Tick what decides; then the branch."""
        if self.status != Status.RUNNING:
            self._restart()
        child = self.current_child = self.children[self._index]
        yield from child.tick()
        if self._index == 0 and child.status == Status.SUCCESS:
            self._index = self.branches.get(self.board.get(self.key), 0)
            if self._index:
                child = self.current_child = self.children[self._index]
                yield from child.tick()
        self._take_over(child)
        yield self


@dataclass(kw_only=True, eq=False, repr=False)
class Repeat(MemoryComposite):
    """Rounds of its last child; before it, where there is one, stands the decision (`key` is where its answer is).

    A round begins in the tick after the one before ended, and not before `every_s` have passed since that one began.
    Body RUNNING: RUNNING. Body FAILURE: FAILURE with its cause. `mode` "until": SUCCESS when the decision is true after
    a round. "while": SUCCESS when it is false before one. After `times` rounds: SUCCESS without a decision, else
    FAILURE with POSTCONDITION. Decision FAILURE: FAILURE with its cause. `count` is the blackboard key of how many
    rounds have begun.
    """

    mode: Literal["until", "while", "times"]
    words: str
    count: str
    key: str = ""
    times: int | None = None
    every_s: float = 0.0
    board: Board
    clock: Clock
    taken_up: bool = field(default=False, init=False)
    """Set before the first tick of a mission that goes on after a restart, in the middle of a round."""
    _phase: Literal["start", "before", "body", "after"] = field(default="start", init=False)
    _due_s: float = field(default=0.0, init=False)

    def tick(self) -> Iterator[Behaviour]:
        """Begin a round, decide, or tick the body."""
        if self.status != Status.RUNNING:
            self._restart()
        if self._phase == "start":
            if self.clock.now() < self._due_s - 1e-9:
                self._goes_on(f"{self._told()}; the next in {self._due_s - self.clock.now():.0f} s")
                yield self
                return
            self._begin_round()
        ended = False
        while not ended and self._phase != "start":
            child = self.current_child = self.children[-1 if self._phase == "body" else 0]
            yield from child.tick()
            ended = self._judged(child)
        yield self

    def _restart(self) -> None:
        taken_up, self.taken_up = self.taken_up and self.count in self.board, False
        if taken_up:
            self._index = 0
            self.clear_explanation()
            self._enter_round()
            return
        super()._restart()
        self.board.put(self.count, 0)
        self._phase, self._due_s = "start", self.clock.now()
        if len(self.children) == 2 and isinstance(self.children[0], Decide):
            self.children[0].view.forget_presses()

    @property
    def rounds(self) -> int:
        """How many rounds have begun."""
        return int(self.board.get(self.count))

    def _begin_round(self) -> None:
        for child in self.children:
            child.stop(Status.INVALID)
        self.board.put(self.count, self.rounds + 1)
        self._enter_round()

    def _enter_round(self) -> None:
        self._phase = "before" if self.mode == "while" else "body"
        self._due_s = self.clock.now() + self.every_s

    def _judged(self, child: Behaviour) -> bool:
        """What the child's status means; False when another child is ticked in the same tick."""
        if child.status == Status.RUNNING:
            self._goes_on(message_of(child))
        elif child.status != Status.SUCCESS:
            self._end(
                cause_of(child),
                f"{message_of(child)} (in round {self.rounds})" if self.rounds > 1 else message_of(child),
            )
        elif self._phase == "body":
            if self.mode == "until":
                self._phase = "after"
                return False
            self._round_done()
        elif bool(self.board.get(self.key)) is (self.mode == "until"):
            self._end(None, self._told())
        elif self._phase == "before" and (self.times is None or self.rounds <= self.times):
            self._phase = "body"
            return False
        else:
            self._round_done()
        return True

    def _round_done(self) -> None:
        if self.times is None or self.rounds < self.times or (self.mode == "while" and self.rounds == self.times):
            self._phase = "start"
            self._goes_on(self._told())
        elif self.mode == "times":
            self._end(None, self._told())
        else:
            still = "still" if self.mode == "while" else "not"
            self._end(Cause.POSTCONDITION, f"it is {still} so after {self.times} rounds that {self.words}")

    def _told(self) -> str:
        done = self.rounds - (1 if self._phase == "before" else 0)
        last = message_of(self.children[-1]) if self.children[-1].status == Status.SUCCESS else ""
        counted = count_text(done, "round")
        return f"{counted}, the last: {last}" if last else counted

    def _goes_on(self, message: str) -> None:
        self.status, self.cause, self.message = Status.RUNNING, None, message

    def _end(self, cause: Cause | None, message: str) -> None:
        self.cause, self.message = cause, message
        self.stop(Status.SUCCESS if cause is None else Status.FAILURE)


class Try(MemoryComposite):
    """The first child, or when it fails the second.

    First child RUNNING or SUCCESS: the same. First child FAILURE with ERROR or CANCELLED: FAILURE with it. Else on to
    the second in the same tick; its status, and the sentences of both.
    """

    def tick(self) -> Iterator[Behaviour]:
        """Tick the first child; when it has failed, the second."""
        if self.status != Status.RUNNING:
            self._restart()
        first, instead = self.children
        if self._index == 0:
            self.current_child = first
            yield from first.tick()
            if first.status == Status.FAILURE and cause_of(first) not in FINAL_CAUSES:
                self._index = 1
        if self._index == 1:
            self.current_child = instead
            yield from instead.tick()
        self._take_over(self.children[self._index])
        if self._index == 1:
            self.message = f"{self.message}, since {message_of(first)}"
        yield self


@dataclass(kw_only=True, eq=False, repr=False)
class Together(MemoryComposite):
    """All children side by side: each is ticked until it is done.

    SUCCESS when `needed` of them succeeded, FAILURE with the first failure's cause when as many cannot succeed any
    more; then the others are stopped. Else RUNNING.
    """

    needed: int
    _failed: list[Behaviour] = field(default_factory=list, init=False)
    _done: list[Behaviour] = field(default_factory=list, init=False)

    def tick(self) -> Iterator[Behaviour]:
        """Tick all that are not done."""
        if self.status != Status.RUNNING:
            self._restart()
            self._failed, self._done = [], []
        for child in self.children:
            if child in self._done or child in self._failed:
                continue
            yield from child.tick()
            if child.status == Status.SUCCESS:
                self._done.append(child)
            elif child.status != Status.RUNNING:
                self._failed.append(child)
            if len(self._done) == self.needed or len(self.children) - len(self._failed) < self.needed:
                break
        self._judge()
        yield self

    def _judge(self) -> None:
        if len(self._done) == self.needed:
            self._finish(None, "; ".join(map(message_of, self._done)), Status.SUCCESS)
        elif len(self.children) - len(self._failed) < self.needed:
            self._finish(cause_of(self._failed[0]), "; ".join(map(message_of, self._failed)), Status.FAILURE)
        else:
            running = [child for child in self.children if child.status == Status.RUNNING]
            self.status, self.cause = Status.RUNNING, None
            self.message = "; ".join(map(message_of, running))

    def _finish(self, cause: Cause | None, message: str, status: Status) -> None:
        for child in self.children:
            if child.status == Status.RUNNING:
                child.stop(Status.INVALID)
        self.cause, self.message = cause, message
        self.stop(status)


@dataclass(kw_only=True, eq=False, repr=False)
class Always(Afterwards):
    """Something to be done (the first child), and what is done in the end (the second), however it ended.

    First child RUNNING: RUNNING. First child done: on to the second in the same tick. Second RUNNING: RUNNING. Second
    FAILURE after the first's SUCCESS: FAILURE with its cause. Else the first's status, cause and sentence.
    Stopped from outside once it has begun: the run still does the second, before anything else (`RunContext.endings`).
    """

    context: RunContext

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stop; what is to be done in the end is handed to the run when it is stopped from outside."""
        first, last = self.children
        endings = self.context.endings
        interrupted = new_status == Status.INVALID and self.status == Status.RUNNING
        if not interrupted and not endings.has(last):
            super().stop(new_status)
            return
        if not interrupted or first.status == Status.RUNNING:
            first.stop(Status.INVALID)
        if interrupted and not endings.take(last):
            last.stop(Status.INVALID)
        if interrupted:
            self.explain_cancelled()
        self.status = new_status
        self.iterator = self.tick()

    def _sum_up(self, first: Behaviour, then: Behaviour) -> None:
        super()._sum_up(first, then)
        if first.status == Status.SUCCESS and then.status == Status.FAILURE:
            self.cause, self.message = cause_of(then), f"{message_of(first)}, but then: {message_of(then)}"
            self.stop(Status.FAILURE)


KINDS: Final[Mapping[str, NodeKind]] = {
    "choose": NodeKind(Choose, ("children", "board")),
    "repeat": NodeKind(Repeat, ("children", "board", "clock"), writes=lambda options: {options["count"]: int}),
    "try": NodeKind(Try, ("children",)),
    "together": NodeKind(Together, ("children",)),
    "always": NodeKind(Always, ("children", "context")),
}
