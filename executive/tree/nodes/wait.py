"""Waits for a duration, for a time of day, or until a condition holds: the plan and its nodes."""

import math
from typing import Final

from py_trees.common import Status

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import ExplainedDecorator, ExplainedLeaf
from executive.tree.board import Board
from executive.tree.context import DAY_S, RunContext, time_ahead_s
from executive.tree.estimate import Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.decision_nodes import Decide, decide_plan
from executive.tree.plan import Assembled, PlanBuilder
from executive.words import leaf_steps as model
from skills.quantities import clock_s
from skills.robot import Clock


class Pause(ExplainedLeaf):
    """Leaf that is RUNNING for `duration_s` on the robot's clock, then SUCCESS."""

    kind = "pause"
    duration_s: float
    clock: Clock

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates the pause."""
        return Estimate(node.options["duration_s"])

    @classmethod
    def waiting_s(cls, node: NodeSpec, now_s: float) -> float:
        """Returns the duration of the pause."""
        return float(node.options["duration_s"])

    def initialise(self) -> None:
        """Starts to count the duration."""
        self._end_s = self.clock.now() + self.duration_s

    def update(self) -> Status:
        """Returns SUCCESS once the duration is over."""
        done = self.clock.now() >= self._end_s
        return self.say(f"waited {self.duration_s:g} s") if done else self.say("waits a moment", Status.RUNNING)


class WaitFor(ExplainedDecorator):
    """Decorator that waits until its child, a decision, answers true.

    | child | status |
    |---|---|
    | RUNNING | RUNNING |
    | SUCCESS, answer true | SUCCESS |
    | SUCCESS, answer false | RUNNING; the child is ticked again after `every_s` |
    | FAILURE | FAILURE with its cause |
    | halted | INVALID with CANCELLED |
    """

    kind = "wait for"
    key: str
    words: str
    every_s: float
    board: Board
    clock: Clock

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates a wait whose length is unknown."""
        return walk.all_of(node, first).up_to(math.inf, f"until {node.options['words']}")

    def initialise(self) -> None:
        """Makes the first decision due at once; counts only presses of buttons from now on."""
        self._due_s = self.clock.now()
        if isinstance(self.decorated, Decide):
            self.decorated.view.forget_presses()

    def waits_for_button(self) -> bool:
        """Returns whether the decision may depend on a button."""
        return isinstance(self.decorated, Decide) and any(self.decorated.decision.buttons)

    def _held_back(self) -> Status | None:
        return Status.RUNNING if self.clock.now() < self._due_s - 1e-9 else None

    def update(self) -> Status:
        """Returns SUCCESS once the answer is true."""
        status = self.pass_on()
        if status != Status.SUCCESS:
            return status
        if self.board.get(self.key):
            return status
        self._due_s = self.clock.now() + self.every_s
        self.message = f"waits until {self.words}"
        return Status.RUNNING


class WaitUntilClock(ExplainedLeaf):
    """Leaf that is RUNNING until a time of day (s after midnight), then SUCCESS.

    SUCCESS at once if that time passed at most twelve hours ago.
    """

    kind = "wait until"
    time_s: float
    words: str
    context: RunContext

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates a wait of at most a day."""
        return Estimate().up_to(DAY_S, f"until {node.options['words']}")

    @classmethod
    def waiting_s(cls, node: NodeSpec, now_s: float) -> float:
        """Returns the time until the time of day."""
        return time_ahead_s(node.options["time_s"], now_s)

    def initialise(self) -> None:
        """Computes when the wait ends."""
        now_s = self.context.clock.now()
        self._end_s = now_s + time_ahead_s(self.time_s, self.context.day_began_s + now_s)

    def update(self) -> Status:
        """Returns SUCCESS once the time has come."""
        done = self.context.clock.now() >= self._end_s - 1e-9
        return self.say(f"it is {self.words}") if done else self.say(f"waits until {self.words}", Status.RUNNING)


def _plan(assembler: Assembler, block: model.Wait, builder: PlanBuilder) -> Assembled:
    awaited = block.awaited
    if awaited.seconds is not None:
        return Assembled((builder.pause("wait", f"wait {awaited.seconds:g} s", awaited.seconds),))
    if awaited.until_clock is not None:
        time_s, words = clock_s(awaited.until_clock), awaited.until_clock
        return Assembled((builder.node("wait until", f"wait until {words}", time_s=time_s, words=words),))
    assert awaited.condition is not None
    decide, key, parts = decide_plan(assembler.flow, awaited.condition, builder.at("for"))
    words, every_s = str(awaited.condition), awaited.every_s if decide.children else 0.0
    name = f"wait until {words}"
    return Assembled((builder.node("wait for", name, decide, key=key, words=words, every_s=every_s),), parts)


PLANS: Final[StepPlans] = {model.Wait: _plan}
