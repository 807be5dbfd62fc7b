"""Computes values of a mission: the plan and its node."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from py_trees.common import Status

from executive.tree.assembly import PYTHON_TYPES, Assembler, Flow, StepPlans
from executive.tree.behaviour import ExplainedLeaf
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.node_view import plain
from executive.tree.nodes.decision_nodes import Keys, Values, View
from executive.tree.plan import Assembled, PlanBuilder
from executive.words import leaf_steps as model
from executive.words.expression import Expression, ExpressionError, Template
from skills.api import Cause, Failed


class SetValues(ExplainedLeaf):
    """Leaf that computes values in order and writes each under its blackboard key; fills in texts with braces.

    SUCCESS when all values are computed; FAILURE with PRECONDITION at the first that cannot be computed.
    """

    kind = "set"
    values: Mapping[str, Expression | Template]
    keys: Keys
    kinds: Mapping[str, type]
    context: RunContext

    def __post_init__(self) -> None:
        super().__post_init__()
        self.view = View(self.context)

    @classmethod
    def writes(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the keys of the values, and their types."""
        kinds: Mapping[str, Any] = options["kinds"]
        return kinds

    def update(self) -> Status:
        """Computes the values."""
        texts = []
        for key, each in self.values.items():
            try:
                known = Values(self.view, self.keys)
                value = each.fill(known) if isinstance(each, Template) else each.value(known)
            except ExpressionError as error:
                return self.fail(Failed(Cause.PRECONDITION, f"{each.text}: {error.message}"))
            self.context.board.put(key, float(value) if self.kinds[key] is float else value)
            texts.append(f"{key.rsplit('/', 1)[-1]} = {plain(value)}")
        return self.say(", ".join(texts))


def set_plan(
    flow: Flow,
    builder: PlanBuilder,
    values: Mapping[str, Expression | Template],
    kinds: Mapping[str, type],
    part: str,
    name: str,
) -> NodeSpec:
    """Builds a leaf that computes values; `values` and `kinds` are keyed by the blackboard keys of the results."""
    keys = flow.keys_of(*values.values())
    options = {"values": MappingProxyType(dict(values)), "keys": MappingProxyType(dict(keys))}
    return builder.node("set", name, part=part, **options, kinds=MappingProxyType(kinds))


def _plan(assembler: Assembler, block: model.Set, builder: PlanBuilder) -> Assembled:
    values, kinds = dict[str, Expression | Template](), dict[str, type]()
    for name, expression in block.values.items():
        kind = PYTHON_TYPES[assembler.flow.kind_of(expression, builder.source)]
        key = assembler.give(name, "", kind, builder)
        values[key], kinds[key] = expression, kind
    words = ", ".join(f"{name} = {expression}" for name, expression in block.values.items())
    return Assembled((set_plan(assembler.flow, builder, values, kinds, "set", f"set {words}"),))


PLANS: Final[StepPlans] = {model.Set: _plan}
