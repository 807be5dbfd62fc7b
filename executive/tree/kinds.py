"""All kinds of nodes by name, as the behaviours register them, and the one function that builds a tree of specs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from py_trees.behaviour import Behaviour

from executive.tree.behaviours import (
    answer,
    ask,
    blocks,
    composites,
    decisions,
    decorators,
    leaves,
    policies,
    recovery,
    skill_leaf,
)
from executive.tree.behaviours.context import RunContext
from executive.tree.node import NodeKind, NodeSpec
from executive.tree.nodes import aside, fallen, interrupts
from executive.tree.nodes import clearing as rounds

__all__ = ["KINDS", "Changes", "build", "writes"]

Changes = Mapping[str, Callable[[Any], object]]
"""By path id, what is done to a node once it is built."""

_HOMES: Final = (
    answer,
    aside,
    ask,
    blocks,
    composites,
    decisions,
    decorators,
    fallen,
    interrupts,
    leaves,
    policies,
    recovery,
    rounds,
    skill_leaf,
)
KINDS: Final[Mapping[str, NodeKind]] = {name: k for home in _HOMES for name, k in home.KINDS.items()}
_NO_CHANGES: Final[Changes] = MappingProxyType({})


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
