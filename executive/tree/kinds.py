"""All kinds of nodes by name and the plans of all blocks, as their modules register them; how a tree is built."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any, Final

from py_trees.behaviour import Behaviour

from executive.tree import nodes
from executive.tree.behaviours import answer, decorators, leaves
from executive.tree.compiling.flow import Assembler, BlockPlans
from executive.tree.compiling.part import Assembled
from executive.tree.context import RunContext
from executive.tree.node import NodeKind, NodeSpec
from executive.tree.plan import PlanBuilder
from executive.words.step import Step

__all__ = ["KINDS", "Changes", "block_plan", "build", "writes"]

Changes = Mapping[str, Callable[[Any], object]]
"""By path id, what is done to a node once it is built."""

_PAGES: Final = tuple(import_module(f"{nodes.__name__}.{page.name}") for page in iter_modules(nodes.__path__))
"""Each page of `executive.tree.nodes`: what it defines of `KINDS` and `PLANS` is registered by being there."""
_HOMES: Final = (answer, decorators, leaves, *_PAGES)
KINDS: Final[Mapping[str, NodeKind]] = {n: kind for home in _HOMES for n, kind in getattr(home, "KINDS", {}).items()}
PLANS: Final[BlockPlans] = {model: plan for page in _PAGES for model, plan in getattr(page, "PLANS", {}).items()}
_NO_CHANGES: Final[Changes] = MappingProxyType({})


def block_plan(assembler: Assembler, block: Step, builder: PlanBuilder) -> Assembled:
    """The one subtree of a block, and what its parts are to bring about. Raises InputError."""
    return PLANS[type(block)](assembler, block, builder)


def build(spec: NodeSpec, context: RunContext, changes: Changes = _NO_CHANGES) -> Behaviour:
    """The py_trees node of a spec for one run, with all nodes below it."""
    kind = KINDS[spec.kind]
    children = [build(child, context, changes) for child in spec.children]
    lent = {**vars(context), "context": context, "children": children, "child": next(iter(children), None)}
    needed = {need: lent[need] for need in kind.needs}
    node = kind.make(path_id=spec.path_id, name=spec.name, **needed, **spec.options)
    if spec.path_id in changes:
        changes[spec.path_id](node)
    return node


def writes(spec: NodeSpec) -> Mapping[str, Any]:
    """The blackboard keys that a node writes, and the type of each value."""
    return KINDS[spec.kind].writes(spec.options)
