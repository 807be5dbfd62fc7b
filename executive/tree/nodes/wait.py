"""Waiting for a time of day, for some time, or until a condition holds: the plan and its nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf
from executive.tree.behaviours.decorators import ExplainedDecorator
from executive.tree.board import Board
from executive.tree.compiling.flow import Assembler, BlockPlans, decision_node
from executive.tree.compiling.part import Assembled
from executive.tree.context import RunContext
from executive.tree.node import NodeKind
from executive.tree.nodes.decisions import DAY_S, Decide
from executive.tree.plan import PlanBuilder
from executive.words import leaf_steps as model
from skills.robot import Clock


@dataclass(kw_only=True, eq=False, repr=False)
class WaitFor(ExplainedDecorator):
    """Waits until its child, a decision, is true; it is asked anew `every_s` after it was false.

    Child RUNNING: RUNNING. Answer true: SUCCESS. Answer false: RUNNING. Child FAILURE: FAILURE with its cause.
    """

    key: str
    words: str
    every_s: float
    board: Board
    clock: Clock

    def initialise(self) -> None:
        """Ask at once; presses of buttons count from now on."""
        self._due_s = self.clock.now()
        if isinstance(self.decorated, Decide):
            self.decorated.view.forget_presses()

    def tick(self) -> Iterator[Behaviour]:
        """Ask, when it is time."""
        if self.status == Status.RUNNING and self.clock.now() < self._due_s - 1e-9:
            yield self
            return
        yield from super().tick()

    def update(self) -> Status:
        """Whether it holds."""
        status = self.pass_on()
        if status != Status.SUCCESS:
            return status
        if self.board.get(self.key):
            return status
        self._due_s = self.clock.now() + self.every_s
        self.message = f"waits until {self.words}"
        return Status.RUNNING


@dataclass(kw_only=True, eq=False, repr=False)
class WaitUntilClock(ExplainedLeaf):
    """RUNNING until a time of day (s after midnight), then SUCCESS; at once when it was up to twelve hours ago."""

    time_s: float
    words: str
    context: RunContext

    def initialise(self) -> None:
        """See how far it is until then."""
        self.clear_explanation()
        now_s = self.context.clock.now()
        ahead_s = (self.time_s - self.context.day_began_s - now_s) % DAY_S
        self._end_s = now_s + ahead_s if ahead_s <= DAY_S / 2 else now_s

    def update(self) -> Status:
        """Wait until the time has come."""
        done = self.context.clock.now() >= self._end_s - 1e-9
        self.message = f"it is {self.words}" if done else f"waits until {self.words}"
        return Status.SUCCESS if done else Status.RUNNING


def _plan(assembler: Assembler, block: model.Wait, builder: PlanBuilder) -> Assembled:
    awaited = block.awaited
    if awaited.seconds is not None:
        return Assembled((builder.pause("wait", f"wait {awaited.seconds:g} s", awaited.seconds),))
    if awaited.until_clock is not None:
        time_s, words = awaited.until_clock_s, awaited.until_clock
        return Assembled((builder.node("wait until", f"wait until {words}", time_s=time_s, words=words),))
    assert awaited.condition is not None
    decide, key, parts = decision_node(assembler, awaited.condition, builder.at("for"))
    words, every_s = str(awaited.condition), awaited.every_s if decide.children else 0.0
    name = f"wait until {words}"
    return Assembled((builder.node("wait for", name, decide, key=key, words=words, every_s=every_s),), parts)


KINDS: Final[Mapping[str, NodeKind]] = {
    "wait for": NodeKind(WaitFor, ("child", "board", "clock")),
    "wait until": NodeKind(WaitUntilClock, ("context",)),
}
PLANS: Final[BlockPlans] = {model.Wait: _plan}
