"""Steps, and others when they fail: the plan and its node."""

from __future__ import annotations

from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.gripper import either
from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import MemoryComposite, cause_of, message_of
from executive.tree.nodes.policies import FINAL_CAUSES
from executive.tree.plan import Assembled, PlanBuilder
from executive.words import steps as model


class Try(MemoryComposite):
    """The first child, or when it fails the second.

    First child RUNNING or SUCCESS: the same. First child FAILURE with ERROR or CANCELLED: FAILURE with it. Else on to
    the second in the same tick; its status, and the sentences of both.
    """

    kind = "try"

    def _following(self, child: Behaviour) -> int | None:
        failed = child.status == Status.FAILURE and cause_of(child) not in FINAL_CAUSES
        return 1 if self._index == 0 and failed else None

    def _take_over(self, child: Behaviour) -> None:
        super()._take_over(child)
        if self._index == 1:
            self.message = f"{self.message}, since {message_of(self.children[0])}"


def _plan(assembler: Assembler, block: model.Try, builder: PlanBuilder) -> Assembled:
    flow = assembler.flow
    tried, after_tried = assembler.branch(block.steps, builder.at("try"), "try", flow)
    midway = flow.copy()
    if after_tried.held != flow.held:
        midway.held, midway.opening = either(flow.held, after_tried.held), False
    other, after_other = assembler.branch(block.otherwise, builder.at("else"), "else", midway)
    flow.join([after_tried, after_other])
    return Assembled((builder.node("try", "else the other", *tried.nodes, *other.nodes),), (*tried.parts, *other.parts))


PLANS: Final[StepPlans] = {model.Try: _plan}
