"""The policy of a step or of a whole mission as nodes around its subtree.

From the inside: the subtree; its timeout; its retries; its guards; what to do when all that failed. So each attempt has
its own time, and when a guard is violated there are no further attempts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Final

from py_trees.behaviour import Behaviour

from executive.mission.file.model import OnFailure, OperatorQuestion, StepGuards, StepPolicy
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.decorators import Guard
from executive.tree.behaviours.policies import FINAL_CAUSES, RETRY, SKIP, STOP, AskOperator, GoBack, Skip, Summary
from executive.tree.behaviours.step_guards import BatteryAtLeast, KnowsPlace, NotAfter, Requirement
from executive.tree.compiling.plans import DecoratorPlan, NodePlan, RetryPlan, Source, TimeoutPlan
from skills.api import Cause

__all__ = ["AskPlan", "GoBackPlan", "SkipPlan", "StepGuardPlan", "SummaryPlan", "needs_way_back", "under_policy"]

RETRIED_CAUSES: Final = frozenset(Cause) - FINAL_CAUSES


@dataclass(frozen=True, kw_only=True)
class StepGuardPlan(DecoratorPlan):
    """A guard that the mission file sets."""

    kind: ClassVar[str] = "guard"
    requirement: Requirement

    def build(self, context: RunContext) -> Behaviour:
        """A Guard with the requirement's condition."""
        condition = self.requirement.condition(context)
        child = self.child.build(context)
        return Guard(path_id=self.path_id, name=self.name, child=child, condition=condition, context=context)


@dataclass(frozen=True, kw_only=True)
class SkipPlan(DecoratorPlan):
    """A step that may fail; `step` is the step in words."""

    kind: ClassVar[str] = "skip"
    step: str

    def build(self, context: RunContext) -> Behaviour:
        """A Skip decorator."""
        return Skip(path_id=self.path_id, name=self.name, child=self.child.build(context), step=self.step)


@dataclass(frozen=True, kw_only=True)
class AskPlan(DecoratorPlan):
    """A step about which the operator is asked when it fails."""

    kind: ClassVar[str] = "ask"
    step: str
    question: OperatorQuestion
    options: tuple[str, ...]

    def build(self, context: RunContext) -> Behaviour:
        """An AskOperator decorator."""
        return AskOperator(
            path_id=self.path_id,
            name=self.name,
            child=self.child.build(context),
            step=self.step,
            options=self.options,
            default=self.question.default,
            limit_s=self.question.limit_s,
            text=self.question.text,
            context=context,
        )


@dataclass(frozen=True, kw_only=True)
class GoBackPlan(DecoratorPlan):
    """What is to be done, and the way back when it failed."""

    kind: ClassVar[str] = "go back"
    way_back: NodePlan

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """What is to be done, then the way back."""
        return (self.child, self.way_back)

    @property
    def expected(self) -> tuple[NodePlan, ...]:
        """What is to be done."""
        return (self.child,)

    def build(self, context: RunContext) -> Behaviour:
        """A GoBack composite."""
        children = [child.build(context) for child in self.children]
        return GoBack(path_id=self.path_id, name=self.name, children=children)


@dataclass(frozen=True, kw_only=True)
class SummaryPlan(DecoratorPlan):
    """The whole mission, whose result names the steps that were skipped; `steps` are the path ids of all steps."""

    kind: ClassVar[str] = "summary"
    steps: tuple[str, ...]

    def build(self, context: RunContext) -> Behaviour:
        """A Summary decorator."""
        return Summary(path_id=self.path_id, name=self.name, child=self.child.build(context), steps=self.steps)


@dataclass(frozen=True)
class PolicyFrame:
    """Where a policy's nodes belong: first part of their path ids, the step in words, its line, the way back."""

    path_id: str
    words: str
    source: Source | None
    way_back: Callable[[str, Source | None], NodePlan]
    may_skip: bool = True


def under_policy(body: NodePlan, policy: StepPolicy, frame: PolicyFrame) -> NodePlan:
    """The subtree under its policy; the subtree itself when the policy asks for nothing."""
    plan = body
    if policy.timeout_s is not None:
        name = f"within {policy.timeout_s:g} s"
        plan = TimeoutPlan(
            path_id=f"{frame.path_id}/timeout", name=name, source=frame.source, child=plan, limit_s=policy.timeout_s
        )
    if policy.retries:
        plan = RetryPlan(
            path_id=f"{frame.path_id}/retries",
            name=f"up to {policy.retries + 1} attempts",
            source=frame.source,
            child=plan,
            attempts=policy.retries + 1,
            causes=RETRIED_CAUSES,
        )
    for part, name, requirement in _requirements(policy.guards):
        plan = StepGuardPlan(
            path_id=f"{frame.path_id}/{part}", name=name, source=frame.source, child=plan, requirement=requirement
        )
    return _ON_FAILURE[policy.on_failure](plan, policy, frame)


def needs_way_back(policy: StepPolicy) -> bool:
    """True when the policy leads back to where the mission began."""
    return policy.on_failure is OnFailure.RETURN


def _requirements(guards: StepGuards) -> Iterator[tuple[str, str, Requirement]]:
    """Part of the path id, name and requirement of each guard; the outermost last."""
    if guards.localised:
        yield "guard-localised", "knows where it is", KnowsPlace(guards.stale)
    if guards.time_s is not None:
        yield "guard-time", f"not after {guards.time_s:g} s", NotAfter(guards.time_s)
    if guards.battery is not None:
        yield "guard-battery", f"battery at {guards.battery:.0%} or more", BatteryAtLeast(guards.battery, guards.stale)


def _skip(plan: NodePlan, policy: StepPolicy, frame: PolicyFrame) -> NodePlan:
    path_id, name = f"{frame.path_id}/skip", "skip it if it fails"
    return SkipPlan(path_id=path_id, name=name, source=frame.source, child=plan, step=frame.words)


def _ask(plan: NodePlan, policy: StepPolicy, frame: PolicyFrame) -> NodePlan:
    return AskPlan(
        path_id=f"{frame.path_id}/ask",
        name="ask if it fails",
        source=frame.source,
        child=plan,
        step=frame.words,
        question=policy.question,
        options=(RETRY, SKIP, STOP) if frame.may_skip else (RETRY, STOP),
    )


def _go_back(plan: NodePlan, policy: StepPolicy, frame: PolicyFrame) -> NodePlan:
    return GoBackPlan(
        path_id=f"{frame.path_id}/return",
        name="go back if it fails",
        source=frame.source,
        child=plan,
        way_back=frame.way_back(f"{frame.path_id}/return", frame.source),
    )


def _stop(plan: NodePlan, policy: StepPolicy, frame: PolicyFrame) -> NodePlan:
    return plan


_ON_FAILURE: Final[Mapping[OnFailure, Callable[[NodePlan, StepPolicy, PolicyFrame], NodePlan]]] = MappingProxyType(
    {
        OnFailure.STOP: _stop,
        OnFailure.RETRY: _stop,
        OnFailure.SKIP: _skip,
        OnFailure.ASK: _ask,
        OnFailure.RETURN: _go_back,
    }
)
