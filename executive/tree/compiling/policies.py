"""The policy of a step or of a whole mission as nodes around its subtree.

From the inside: the subtree; its timeout; its retries; its guards; what to do when all that failed. So each attempt has
its own time, and when a guard is violated there are no further attempts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from executive.tree.behaviours.board import FromBoard
from executive.tree.behaviours.conditions import BatteryAtLeast, Condition, KnowsPlace, NotAfter
from executive.tree.compiling.builder import PlanBuilder
from executive.tree.node import NodeSpec
from executive.tree.nodes.policies import FINAL_CAUSES, RETRY, SKIP, STOP
from executive.words.policy import Guards, OnFailure, OperatorQuestion, Policy
from skills.api import Cause

__all__ = ["PolicyFrame", "needs_way_back", "under_policy"]

RETRIED_CAUSES: Final = frozenset(Cause) - FINAL_CAUSES


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
