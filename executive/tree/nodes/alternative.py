"""Steps, and others when they fail: the plan and its node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.gripper import either
from executive.tree.behaviour import cause_of, message_of
from executive.tree.compiling.flow import Assembler, BlockPlans, branch_of
from executive.tree.compiling.part import Assembled
from executive.tree.node import NodeKind
from executive.tree.nodes.composites import MemoryComposite
from executive.tree.nodes.policies import FINAL_CAUSES
from executive.tree.plan import PlanBuilder
from executive.words import steps as model


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


def _plan(assembler: Assembler, block: model.Try, builder: PlanBuilder) -> Assembled:
    flow = assembler.flow
    tried, after_tried = branch_of(assembler, block.steps, builder.at("try"), "try", flow)
    midway = flow.copy()
    if after_tried.held != flow.held:
        midway.held, midway.opening = either(flow.held, after_tried.held), False
    other, after_other = branch_of(assembler, block.otherwise, builder.at("else"), "else", midway)
    flow.join([after_tried, after_other])
    return Assembled((builder.node("try", "else the other", *tried.nodes, *other.nodes),), (*tried.parts, *other.parts))


KINDS: Final[Mapping[str, NodeKind]] = {"try": NodeKind(Try, ("children",))}
PLANS: Final[BlockPlans] = {model.Try: _plan}
