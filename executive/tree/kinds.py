"""All kinds of nodes and the plans of all steps, as the pages of `executive.tree.nodes` define them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Final

from py_trees.behaviour import Behaviour

from executive.tree import nodes
from executive.tree.assembly import StepPlans
from executive.tree.behaviour import ExplainedNode
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec

__all__ = ["KINDS", "PLANS", "build", "writes"]

_PAGES: Final = tuple(import_module(f"{nodes.__name__}.{page.name}") for page in iter_modules(nodes.__path__))
KINDS: Final[Mapping[str, type[ExplainedNode]]] = {
    node.kind: node
    for page in _PAGES
    for node in vars(page).values()
    if isinstance(node, type) and issubclass(node, ExplainedNode) and "kind" in vars(node)
}
PLANS: Final[StepPlans] = {model: plan for page in _PAGES for model, plan in getattr(page, "PLANS", {}).items()}


def build(spec: NodeSpec, context: RunContext) -> Behaviour:
    """The py_trees node of a spec for one run, with all nodes below it."""
    children = [build(child, context) for child in spec.children]
    lent = {**vars(context), "context": context, "children": children, "child": next(iter(children), None)}
    make: Any = KINDS[spec.kind]
    taken = {each.name: lent[each.name] for each in fields(make) if each.init and each.name in lent}
    node: Behaviour = make(**{**taken, **spec.options, "path_id": spec.path_id, "name": spec.name})
    return node


def writes(spec: NodeSpec) -> Mapping[str, Any]:
    """The blackboard keys that a node writes, and the type of each value."""
    return KINDS[spec.kind].writes(spec.options)
