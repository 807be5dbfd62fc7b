"""Steps under what is watched meanwhile, and with what is always done in the end: the plan and its node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import cause_of, message_of
from executive.tree.compiling.decisions import instant_decision
from executive.tree.compiling.flow import Assembler, BlockPlans, Flow, row
from executive.tree.compiling.part import Assembled, StepPart
from executive.tree.context import RunContext
from executive.tree.goals import held_goal
from executive.tree.node import NodeKind
from executive.tree.nodes.decisions import MustHold, MustNotBegin
from executive.tree.nodes.interrupts import HANDLING
from executive.tree.nodes.recovery import Afterwards
from executive.tree.plan import PlanBuilder
from executive.words import steps as model
from executive.words.condition import AllOf, Condition, ValueIs
from executive.words.mission import Mission


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


def _plan(assembler: Assembler, block: model.Group, builder: PlanBuilder) -> Assembled:
    before = assembler.flow.copy()
    body = row(assembler, block.steps, builder, block.name or "group")
    return framed(assembler, body, block, builder, before)


def framed(
    assembler: Assembler, body: Assembled, group: model.Group | Mission, builder: PlanBuilder, before: Flow
) -> Assembled:
    """Steps under what is watched meanwhile, and with what is always done in the end; `before` is their flow."""
    (node,), parts = body.nodes, body.parts
    if group.when:
        after, calls = assembler.flow, []
        for number, handler in enumerate(group.when, start=1):
            below = builder.at(f"when-{number}")
            decision = instant_decision(handler.condition, below, before.names)
            assembler.flow = before.copy()
            work = row(assembler, handler.steps, below, f"when {handler.condition}")
            parts += work.parts
            calls.append(
                below.node(
                    "interrupt",
                    f"when {handler.condition}",
                    *work.nodes,
                    condition=MustNotBegin(decision, str(handler.condition)),
                    spares=HANDLING,
                    uses=handler.times,
                )
            )
        assembler.flow = after
        node = builder.node("interrupts", f"{node.name}, watched", *calls, node, part="watched")
    if group.while_ is not None:
        holds = group.while_.holds
        decision = instant_decision(holds, builder.at("while"), before.names)
        condition = MustHold(decision, str(holds))
        node = builder.node("guard", f"while {holds}", node, part="while", condition=condition)
        if _is_holding(holds):
            parts = (StepPart(node.path_id, goal=held_goal()), *parts)
    if group.always:
        assembler.flow.join([before.copy(), assembler.flow.copy()])
        last = row(assembler, group.always, builder.at("always"), "in the end")
        parts += last.parts
        node = builder.node("always", "in the end, whatever happens", node, *last.nodes, part="whatever-happens")
    return Assembled((node,), parts)


def _is_holding(condition: Condition) -> bool:
    """Whether a condition says that the gripper holds something, alone or together with others."""
    match condition:
        case ValueIs(text=text):
            return text.strip() == "holding"
        case AllOf(parts=parts):
            return any(map(_is_holding, parts))
    return False


KINDS: Final[Mapping[str, NodeKind]] = {"always": NodeKind(Always, ("children", "context"))}
PLANS: Final[BlockPlans] = {model.Group: _plan}
