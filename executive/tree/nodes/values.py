"""Working values out: the plan and its node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from py_trees.common import Status

from executive.tree.behaviour import ExplainedLeaf
from executive.tree.compiling.decisions import kind_in
from executive.tree.compiling.flow import PYTHON_TYPES, Assembler, BlockPlans, give_key, set_plan
from executive.tree.compiling.part import Assembled
from executive.tree.context import RunContext
from executive.tree.node import NodeKind
from executive.tree.nodes.decisions import Keys, View
from executive.tree.plan import PlanBuilder
from executive.words import leaf_steps as model
from executive.words.expression import Expression, ExpressionError, Template
from skills.api import Cause


@dataclass(kw_only=True, eq=False, repr=False)
class SetValues(ExplainedLeaf):
    """Works values out in order, each under its blackboard key; a text with braces is filled.

    SUCCESS when all have a value; FAILURE with PRECONDITION at the first that has none.
    """

    values: Mapping[str, Expression | Template]
    keys: Keys
    kinds: Mapping[str, type]
    context: RunContext

    def __post_init__(self) -> None:
        super().__post_init__()
        self.view = View(self.context)

    def update(self) -> Status:
        """Work them out."""
        self.clear_explanation()
        told = []
        for key, each in self.values.items():
            try:
                known = self.view.values(self.keys)
                value = each.filled(known) if isinstance(each, Template) else each.value(known)
            except ExpressionError as error:
                self.cause, self.message = Cause.PRECONDITION, f"{each.text}: {error.message}"
                return Status.FAILURE
            self.context.board.put(key, float(value) if self.kinds[key] is float else value)
            told.append(f"{key.rsplit('/', 1)[-1]} = {value}")
        self.message = ", ".join(told)
        return Status.SUCCESS


def _kinds(options: Mapping[str, Any]) -> Mapping[str, Any]:
    kinds: Mapping[str, Any] = options["kinds"]
    return kinds


def _plan(assembler: Assembler, block: model.Set, builder: PlanBuilder) -> Assembled:
    values: dict[str, Expression | Template] = {}
    for name, expression in block.values.items():
        kind = kind_in(expression, builder, assembler.flow.names)
        key = give_key(assembler, name, "", PYTHON_TYPES[kind], builder)
        values[key] = expression
    words = ", ".join(f"{name} = {expression}" for name, expression in block.values.items())
    return Assembled((set_plan(builder, values, assembler.flow.names, "set", f"set {words}"),))


KINDS: Final[Mapping[str, NodeKind]] = {"set": NodeKind(SetValues, ("context",), writes=_kinds)}
PLANS: Final[BlockPlans] = {model.Set: _plan}
