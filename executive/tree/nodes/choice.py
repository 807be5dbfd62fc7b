"""Deciding between two branches: the plan and its node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.board import Board
from executive.tree.compiling.flow import Assembler, BlockPlans, branch_of, decision_node
from executive.tree.compiling.part import Assembled
from executive.tree.node import NodeKind
from executive.tree.nodes.composites import MemoryComposite
from executive.tree.plan import PlanBuilder
from executive.words import steps as model
from executive.words.expression import Value


@dataclass(kw_only=True, eq=False, repr=False)
class Choose(MemoryComposite):
    """What decides (the first child, which leaves its answer under `key`), then the branch that the answer leads to.

    `branches` gives the number of the child for each answer. First child RUNNING: RUNNING; FAILURE: FAILURE with its
    cause. An answer without a branch: SUCCESS. Else as the branch, from the same tick on.
    """

    branches: Mapping[Value, int]
    key: str
    board: Board

    def tick(self) -> Iterator[Behaviour]:
        """Tick what decides; then the branch."""
        if self.status != Status.RUNNING:
            self._restart()
        child = self.current_child = self.children[self._index]
        yield from child.tick()
        if self._index == 0 and child.status == Status.SUCCESS:
            self._index = self.branches.get(self.board.get(self.key), 0)
            if self._index:
                child = self.current_child = self.children[self._index]
                yield from child.tick()
        self._take_over(child)
        yield self


def _plan(assembler: Assembler, block: model.Choose, builder: PlanBuilder) -> Assembled:
    decide, key, parts = decision_node(assembler, block.condition, builder.at("if"))
    flow = assembler.flow
    then, after_then = branch_of(assembler, block.then, builder.at("then"), "then", flow)
    other, after_other = branch_of(assembler, block.otherwise, builder.at("else"), "else", flow)
    flow.join([after_then, after_other])
    branches = {True: 1, False: 2} if block.otherwise else {True: 1}
    nodes = (decide, *then.nodes, *other.nodes)
    node = builder.node("choose", f"{block.condition}?", *nodes, branches=MappingProxyType(branches), key=key)
    return Assembled((node,), (*parts, *then.parts, *other.parts))


KINDS: Final[Mapping[str, NodeKind]] = {"choose": NodeKind(Choose, ("children", "board"))}
PLANS: Final[BlockPlans] = {model.Choose: _plan}
