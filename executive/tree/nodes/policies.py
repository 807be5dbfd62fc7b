"""The policy of a step or of a whole mission: nodes around its subtree, and what becomes of a step that failed.

From the inside: the subtree; its timeout; its retries; its guards; what to do when all that failed (skip it, ask about
it, go back). So each attempt has its own time, and when a guard is violated there are no further attempts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import (
    ExplainedDecorator,
    ExplainedLeaf,
    MemoryComposite,
    StoppableTime,
    cause_of,
    message_of,
)
from executive.tree.board import FromBoard
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.guard import BatteryAtLeast, Condition, KnowsPlace, NotAfter
from executive.tree.plan import PlanBuilder
from executive.words.policy import Guards, OnFailure, OperatorQuestion, Policy
from skills.api import Asked, Cause, Failed, Question
from skills.robot import Clock, Pose2D

FINAL_CAUSES: Final = frozenset({Cause.ERROR, Cause.CANCELLED})
"""A defect and somebody's request to stop are neither skipped, nor asked about, nor tried again."""
RETRY: Final = "retry"
SKIP: Final = "skip"
STOP: Final = "stop"


class Timeout(ExplainedDecorator):
    """A limit on the robot's clock.

    Child FAILURE: FAILURE with its cause. Time over: child halted, FAILURE with TIMEOUT, even when it succeeded just
    now. Else as the child. Time in which the tree is suspended does not count.
    """

    kind = "timeout"
    limit_s: float
    clock: Clock

    def initialise(self) -> None:
        """Starts the time."""
        self._time = StoppableTime(self.clock)

    def suspend(self) -> None:
        """Stops counting until the next tick."""
        self._time.stop()

    def update(self) -> Status:
        """The child's status, unless the time is over."""
        self._time.go_on()
        late = self._time.elapsed_s() > self.limit_s
        if late and self.decorated.status != Status.FAILURE:
            return self.fail(Failed(Cause.TIMEOUT, f"not done within {self.limit_s:g} s"))
        return self.pass_on()


class Retry(ExplainedDecorator):
    """Tries again, but only after failures of given causes.

    Child RUNNING or SUCCESS: the same. Child FAILURE of another cause, or no attempts left: FAILURE with its cause.
    Else RUNNING, and at the next tick the child starts anew from its first step with nothing remembered.
    """

    kind = "retry"
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


class Skip(ExplainedDecorator):
    """A step that may fail; `step` is the step in words.

    Child FAILURE: SUCCESS, and `skipped` says why; but FAILURE when its cause is ERROR or CANCELLED. Else as the child.
    """

    kind = "skip"
    step: str
    skipped: str | None = field(default=None, init=False)

    def initialise(self) -> None:
        """Nothing is skipped yet."""
        self.skipped = None

    def update(self) -> Status:
        """The child's status, a failure turned into a success that is noted."""
        status = self.pass_on()
        if status != Status.FAILURE or self.cause in FINAL_CAUSES:
            return status
        return self.skip()

    def skip(self) -> Status:
        """SUCCESS without the child's."""
        self.skipped, self.cause = self.message, None
        self.message = f"skipped: {self.skipped}"
        return Status.SUCCESS


class AskOperator(Skip):
    """A step about which the operator is asked when it fails.

    Child FAILURE: RUNNING until the operator answers or the question's time is over. Answer retry: RUNNING, and the
    child starts anew at the next tick. Answer skip: SUCCESS, and `skipped` says why. Answer stop: FAILURE as the child.
    A failure with cause ERROR or CANCELLED is passed on without a question. Else as the child.
    """

    kind = "ask"
    options: tuple[str, ...]
    default: str
    limit_s: float
    text: str | None
    context: RunContext
    _asked: Asked | None = field(default=None, init=False)

    def update(self) -> Status:
        """As the child, until it fails: then the question is put."""
        status = self.pass_on()
        if status != Status.FAILURE or self.cause is None or self.cause in FINAL_CAUSES:
            return status
        before, self.before = self.before, None
        if before is Status.SUCCESS:
            return self.skip()
        self._failure = Failed(self.cause, self.message)
        text = f"{self.text} ({self.message})" if self.text else f"{self.message}. What now?"
        question = Question(self.path_id, text, self.options, self.default, self.limit_s)
        self._asked = self.context.ask(question)
        return self.say(f"asks the operator: {text}", Status.RUNNING)

    def stop(self, new_status: Status) -> None:
        """Takes an open question back when the tree is stopped."""
        if new_status == Status.INVALID and self._asked is not None:
            self._asked.withdraw()
            self._asked = None
        super().stop(new_status)

    def _held_back(self) -> Status | None:
        """Act on the answer once it is there."""
        if self._asked is None or not self._asked.done():
            return None if self._asked is None else Status.RUNNING
        answer, self._asked, failure = self._asked.result(), None, self._failure
        if answer == RETRY:
            return self.say(f"tries again, as the operator said, since {failure.message}", Status.RUNNING)
        if answer != SKIP:
            return self.fail(failure)
        self.message = failure.message
        return self.skip()


class GoBack(MemoryComposite):
    """A route back after a failure: two children, the first what is to be done, the second the route back.

    First child RUNNING or SUCCESS: the same. First child FAILURE: the second is ticked, RUNNING while it runs; at its
    end FAILURE with the first's cause and sentence, and whether the robot is back.
    """

    kind = "go back"

    def _following(self, child: Behaviour) -> int | None:
        return None

    def _take_over(self, child: Behaviour) -> None:
        action, way_back = self.children
        if child is action and action.status == Status.FAILURE and cause_of(action) not in FINAL_CAUSES:
            self._index = 1
            self._go_on(f"goes back, since {message_of(action)}")
        elif child is action:
            super()._take_over(action)
        elif way_back.status == Status.RUNNING:
            self.message = f"goes back ({message_of(way_back)})"
        else:
            back = way_back.status == Status.SUCCESS
            told = "is back where it started" if back else f"could not go back: {message_of(way_back)}"
            self._end(cause_of(action), f"{message_of(action)}; the robot {told}")


class Summary(ExplainedDecorator):
    """The end of a mission in which steps may be skipped; `steps` are the path ids of its steps' outermost nodes.

    As the child, but a SUCCESS names what was skipped, and it is FAILURE when every one of the steps was skipped.
    """

    kind = "summary"
    steps: Sequence[str]

    def update(self) -> Status:
        """The child's status, and what was skipped."""
        status = self.pass_on()
        nodes = [node for node in self.iterate() if isinstance(node, Skip) and node.status == Status.SUCCESS]
        skipped = {node.path_id: f"{node.step} ({node.skipped})" for node in nodes if node.skipped is not None}
        if status != Status.SUCCESS or not skipped:
            return status
        told = "; ".join(skipped.values())
        if skipped.keys() >= set(self.steps):
            return self.fail(Failed(Cause.EXECUTION, f"all steps were skipped: {told}"))
        self.message = f"done, but skipped: {told}"
        return status


class RememberPose(ExplainedLeaf):
    """Writes the robot's present pose in the world to the blackboard. Always SUCCESS once the robot is localised.

    FAILURE with PRECONDITION when the robot does not know where it is for longer than `patience_s`. With `keep`, a pose
    that is there already stays: the mission was asked for where another one began.
    """

    kind = "remember"
    key: str
    context: RunContext
    patience_s: float = 5.0
    keep: bool = False

    @staticmethod
    def writes(options: Mapping[str, Any]) -> Mapping[str, Any]:
        """The key of the pose."""
        return {options["key"]: Pose2D}

    def initialise(self) -> None:
        """Starts the patience."""
        self.clear_explanation()
        self._started_s = self.context.clock.now()

    def update(self) -> Status:
        """Writes the pose, or waits for one."""
        if self.keep and self.key in self.context.board:
            return self.say("began before")
        if self.context.localiser.estimate().localised:
            self.context.board.put(self.key, self.context.pose())
            return self.say("knows where it stands")
        if self.context.clock.now() - self._started_s <= self.patience_s:
            return self.say("waits until it knows where it is", Status.RUNNING)
        return self.fail(Failed(Cause.PRECONDITION, "the robot does not know where it is"))


def under_policy(
    body: NodeSpec, policy: Policy, builder: PlanBuilder, words: str, *, may_skip: bool = True
) -> NodeSpec:
    """The subtree under its policy, where that asks for anything; `words` is what is done, in words."""
    below = body
    if policy.timeout_s is not None:
        name = f"within {policy.timeout_s:g} s"
        below = builder.node("timeout", name, below, part="timeout", limit_s=policy.timeout_s)
    if policy.further_attempts:
        most = {"attempts": policy.further_attempts + 1, "causes": frozenset(Cause) - FINAL_CAUSES}
        below = builder.node("retry", f"up to {most['attempts']} attempts", below, part="retries", **most)
    for part, name, condition in _conditions(policy.guards or Guards()):
        below = builder.node("guard", name, below, part=part, condition=condition)
    match policy.on_failure:
        case OnFailure.SKIP:
            return builder.node("skip", "skip it if it fails", below, part="skip", step=words)
        case OnFailure.ASK:
            question = policy.question or OperatorQuestion()
            asked = {"default": question.default, "limit_s": question.limit_s, "text": question.text}
            options = (RETRY, SKIP, STOP) if may_skip else (RETRY, STOP)
            return builder.node("ask", "ask if it fails", below, part="ask", step=words, options=options, **asked)
        case OnFailure.RETURN:
            back = builder.at("return")
            return back.node(
                "go back", "go back if it fails", below, back.navigate(FromBoard(back.start_key), "the start")
            )
    return below


def _conditions(guards: Guards) -> Iterator[tuple[str, str, Condition]]:
    """Part of the path id, name and condition of each guard; the outermost last."""
    if guards.localised:
        yield "guard-localised", "knows where it is", KnowsPlace(stale=guards.stale)
    if guards.time_s is not None:
        yield "guard-time", f"not after {guards.time_s:g} s", NotAfter(guards.time_s)
    if guards.battery is not None:
        yield (
            "guard-battery",
            f"battery at {guards.battery:.0%} or more",
            BatteryAtLeast(guards.battery, stale=guards.stale),
        )
