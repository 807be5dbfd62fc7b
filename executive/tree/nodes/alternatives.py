"""Alternative branches: one that a decision chooses, and one for the failure of another; plans and nodes."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.gripper import held_after_either
from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import MemoryComposite, cause_of, message_of
from executive.tree.board import Board
from executive.tree.nodes.decision_nodes import decide_plan
from executive.tree.nodes.policies import FINAL_CAUSES
from executive.tree.plan import Assembled, PlanBuilder
from executive.words import steps as model
from executive.words.expression import Value


class Choose(MemoryComposite):
    """Composite of a decision (the first child, which writes its answer under `key`) and one branch for each answer.

    `branches` has the index of the child for each answer.

    | decision | branch | status |
    |---|---|---|
    | RUNNING | idle | RUNNING |
    | FAILURE | idle | FAILURE with its cause |
    | SUCCESS, answer without a branch | - | SUCCESS |
    | SUCCESS, answer with a branch | ticked in the same tick | as the branch |
    | halted, or its branch is halted | halted | INVALID with CANCELLED |
    """

    kind = "choose"
    branches: Mapping[Value, int]
    key: str
    board: Board

    def _following(self, child: Behaviour) -> int | None:
        decided = self._index == 0 and child.status == Status.SUCCESS
        return self.branches.get(self.board.get(self.key)) if decided else None


def _choose_plan(assembler: Assembler, block: model.Choose, builder: PlanBuilder) -> Assembled:
    decide, key, parts = decide_plan(assembler.flow, block.condition, builder.at("if"))
    flow = assembler.flow
    then, after_then = assembler.branch(block.then, builder.at("then"), "then", flow)
    other, after_other = assembler.branch(block.otherwise, builder.at("else"), "else", flow)
    flow.join([after_then, after_other])
    branches = {True: 1, False: 2} if block.otherwise else {True: 1}
    nodes = (decide, *then.nodes, *other.nodes)
    node = builder.node("choose", f"{block.condition}?", *nodes, branches=MappingProxyType(branches), key=key)
    return Assembled((node,), (*parts, *then.parts, *other.parts))


class Try(MemoryComposite):
    """Composite that runs its second child when the first fails.

    | first child | second child | status |
    |---|---|---|
    | RUNNING, SUCCESS | idle | as the first |
    | FAILURE with ERROR or CANCELLED | idle | FAILURE with its cause |
    | FAILURE with another cause | ticked in the same tick | as the second, with the messages of both |
    | halted | halted | INVALID with CANCELLED |
    """

    kind = "try"

    def _following(self, child: Behaviour) -> int | None:
        failed = child.status == Status.FAILURE and cause_of(child) not in FINAL_CAUSES
        return 1 if self._index == 0 and failed else None

    def _take_over(self, child: Behaviour) -> None:
        super()._take_over(child)
        if self._index == 1:
            self.message = f"{self.message}, since {message_of(self.children[0])}"


def _try_plan(assembler: Assembler, block: model.Try, builder: PlanBuilder) -> Assembled:
    flow = assembler.flow
    tried, after_tried = assembler.branch(block.steps, builder.at("try"), "try", flow)
    midway = flow.copy()
    if after_tried.held != flow.held:
        midway.held, midway.opening = held_after_either(flow.held, after_tried.held), False
    other, after_other = assembler.branch(block.otherwise, builder.at("else"), "else", midway)
    flow.join([after_tried, after_other])
    return Assembled((builder.node("try", "else the other", *tried.nodes, *other.nodes),), (*tried.parts, *other.parts))


PLANS: Final[StepPlans] = {model.Choose: _choose_plan, model.Try: _try_plan}
