"""The policy of a step or of a whole mission: nodes around its subtree, and what becomes of a step that failed.

From the inside: the subtree; its timeout; its retries; its guards; what to do when all that failed (skip it, ask about
it, go back). So each attempt has its own time, and when a guard is violated there are no further attempts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained, message_of
from executive.tree.behaviours.decorators import ExplainedDecorator
from executive.tree.board import FromBoard
from executive.tree.context import RunContext
from executive.tree.node import NodeKind, NodeSpec
from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.guard import BatteryAtLeast, Condition, KnowsPlace, NotAfter
from executive.tree.plan import PlanBuilder
from executive.words.policy import Guards, OnFailure, OperatorQuestion, Policy
from skills.api import Asked, Cause, Failed, Question

FINAL_CAUSES: Final = frozenset({Cause.ERROR, Cause.CANCELLED})
"""A defect and somebody's request to stop are neither skipped, nor asked about, nor tried again."""
RETRY: Final = "retry"
SKIP: Final = "skip"
STOP: Final = "stop"
RETRIED_CAUSES: Final = frozenset(Cause) - FINAL_CAUSES


@dataclass(kw_only=True, eq=False, repr=False)
class Skip(ExplainedDecorator):
    """A step that may fail; `step` is the step in words.

    Child FAILURE: SUCCESS, and `skipped` says why; but FAILURE when its cause is ERROR or CANCELLED. Else as the child.
    """

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


@dataclass(kw_only=True, eq=False, repr=False)
class AskOperator(Skip):
    """A step about which the operator is asked when it fails.

    Child FAILURE: RUNNING until the operator answers or the question's time is over. Answer retry: RUNNING, and the
    child starts anew at the next tick. Answer skip: SUCCESS, and `skipped` says why. Answer stop: FAILURE as the child.
    A failure with cause ERROR or CANCELLED is passed on without a question. Else as the child.
    """

    options: tuple[str, ...]
    default: str
    limit_s: float
    text: str | None
    context: RunContext
    _asked: Asked | None = field(default=None, init=False)

    def tick(self) -> Iterator[Behaviour]:
        """Tick the child, or wait for the answer."""
        if self._asked is None:
            yield from super().tick()
            return
        self._wait(self._asked)
        yield self

    def update(self) -> Status:
        """As the child, until it fails: then the question is put."""
        status = self.pass_on()
        if status != Status.FAILURE or self.cause is None or self.cause in FINAL_CAUSES:
            return status
        self._failure = Failed(self.cause, self.message)
        text = f"{self.text} ({self.message})" if self.text else f"{self.message}. What now?"
        question = Question(self.path_id, text, self.options, self.default, self.limit_s)
        self._asked = self.context.ask(question)
        self.cause, self.message = None, f"asks the operator: {text}"
        return Status.RUNNING

    def stop(self, new_status: Status) -> None:
        """Take an open question back when the tree is stopped."""
        if new_status == Status.INVALID and self._asked is not None:
            self._asked.withdraw()
            self._asked = None
        super().stop(new_status)

    def _wait(self, asked: Asked) -> None:
        """Act on the answer once it is there."""
        if not asked.done():
            return
        answer, self._asked = asked.result(), None
        if answer == RETRY:
            self.message = f"tries again, as the operator said, since {self._failure.message}"
        elif answer == SKIP:
            self.message = self._failure.message
            super().stop(self.skip())
        else:
            super().stop(self.fail(self._failure))


class GoBack(MemorySequence):
    """A route back after a failure: two children, the first what is to be done, the second the route back.

    First child RUNNING or SUCCESS: the same. First child FAILURE: the second is ticked, RUNNING while it runs; at its
    end FAILURE with the first's cause and sentence, and whether the robot is back.
    """

    def tick(self) -> Iterator[Behaviour]:
        """Tick what is to be done, or the route back."""
        if self.status != Status.RUNNING:
            self._restart()
        action, way_back = self.children
        child = action if self._index == 0 else way_back
        self.current_child = child
        yield from child.tick()
        if child is action and action.status == Status.FAILURE and self._may_go_back(action):
            self._index, self.status = 1, Status.RUNNING
            self.message = f"goes back, since {message_of(action)}"
        elif child is action:
            self._take_over(action)
        elif way_back.status == Status.RUNNING:
            self.message = f"goes back ({message_of(way_back)})"
        else:
            self._end(action, way_back)
        yield self

    def _may_go_back(self, action: Behaviour) -> bool:
        return not (isinstance(action, Explained) and action.cause in FINAL_CAUSES)

    def _end(self, action: Behaviour, way_back: Behaviour) -> None:
        back = way_back.status == Status.SUCCESS
        told = "is back where it started" if back else f"could not go back: {message_of(way_back)}"
        self.cause, self.message = self._explanation(action)
        self.message = f"{self.message}; the robot {told}"
        self.stop(Status.FAILURE)


@dataclass(kw_only=True, eq=False, repr=False)
class Summary(ExplainedDecorator):
    """The end of a mission in which steps may be skipped; `steps` are the path ids of its steps' outermost nodes.

    As the child, but a SUCCESS names what was skipped, and it is FAILURE when every one of the steps was skipped.
    """

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


@dataclass(frozen=True)
class PolicyFrame:
    """Where a policy's nodes belong: the builder at the first part of their path ids, the step in words."""

    builder: PlanBuilder
    words: str
    may_skip: bool = True


def under_policy(body: NodeSpec, policy: Policy, frame: PolicyFrame) -> NodeSpec:
    """The subtree under its policy; the subtree itself when the policy asks for nothing."""
    node, below = frame.builder.node, body
    if policy.timeout_s is not None:
        below = node("timeout", f"within {policy.timeout_s:g} s", below, part="timeout", limit_s=policy.timeout_s)
    if policy.further_attempts:
        attempts = policy.further_attempts + 1
        name = f"up to {attempts} attempts"
        below = node("retry", name, below, part="retries", attempts=attempts, causes=RETRIED_CAUSES)
    for part, name, condition in _conditions(policy.guards or Guards()):
        below = node("guard", name, below, part=part, condition=condition)
    return _ON_FAILURE[policy.on_failure or OnFailure.STOP](below, policy, frame)


def needs_way_back(policy: Policy) -> bool:
    """True when the policy leads back to where the mission began."""
    return policy.on_failure is OnFailure.RETURN


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


def _skip(below: NodeSpec, policy: Policy, frame: PolicyFrame) -> NodeSpec:
    return frame.builder.node("skip", "skip it if it fails", below, part="skip", step=frame.words)


def _ask(below: NodeSpec, policy: Policy, frame: PolicyFrame) -> NodeSpec:
    question = policy.question or OperatorQuestion()
    return frame.builder.node(
        "ask",
        "ask if it fails",
        below,
        part="ask",
        step=frame.words,
        options=(RETRY, SKIP, STOP) if frame.may_skip else (RETRY, STOP),
        default=question.default,
        limit_s=question.limit_s,
        text=question.text,
    )


def _go_back(below: NodeSpec, policy: Policy, frame: PolicyFrame) -> NodeSpec:
    builder = frame.builder.at("return")
    return builder.node(
        "go back", "go back if it fails", below, builder.navigate(FromBoard(builder.start_key), "the start")
    )


def _stop(below: NodeSpec, policy: Policy, frame: PolicyFrame) -> NodeSpec:
    return below


_ON_FAILURE: Final[Mapping[OnFailure, Callable[[NodeSpec, Policy, PolicyFrame], NodeSpec]]] = {
    OnFailure.STOP: _stop,
    OnFailure.RETRY: _stop,
    OnFailure.SKIP: _skip,
    OnFailure.ASK: _ask,
    OnFailure.RETURN: _go_back,
}


KINDS: Final[Mapping[str, NodeKind]] = {
    "skip": NodeKind(Skip, ("child",)),
    "ask": NodeKind(AskOperator, ("child", "context")),
    "go back": NodeKind(GoBack, ("children",)),
    "summary": NodeKind(Summary, ("child",)),
}
