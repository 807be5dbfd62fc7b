"""What every view shows: the tree's nodes with their states, as plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from executive.compiling.plans import NodePlan, Source
from executive.snapshot import NodeState


@dataclass(frozen=True)
class NodeView:
    """One node as shown. A state of INVALID without a cause means: not run yet."""

    path_id: str
    kind: str
    name: str
    state: NodeState = field(default_factory=NodeState)
    source: Source | None = None
    children: tuple[NodeView, ...] = ()

    def walk(self, depth: int = 0) -> Iterator[tuple[int, NodeView]]:
        """Every node with its depth, parents first."""
        yield depth, self
        for child in self.children:
            yield from child.walk(depth + 1)

    def structure(self) -> dict[str, Any]:
        """The tree without states."""
        children = [child.structure() for child in self.children]
        return {"id": self.path_id, "type": self.kind, "name": self.name, "children": children}


def node_view(plan: NodePlan, states: Mapping[str, NodeState] | None = None) -> NodeView:
    """The view of a plan, with the states by path id where there are some."""
    known = states or {}
    return NodeView(
        path_id=plan.path_id,
        kind=plan.kind,
        name=plan.name,
        state=known.get(plan.path_id, NodeState()),
        source=plan.source,
        children=tuple(node_view(child, known) for child in plan.children),
    )


def to_json(node: NodeView) -> dict[str, Any]:
    """The node and all below as `errand tree --format json` prints them."""
    source, state = node.source, node.state
    return {
        "id": node.path_id,
        "type": node.kind,
        "name": node.name,
        "status": state.status.value,
        "cause": None if state.cause is None else state.cause.value,
        "source": None if source is None else {"file": str(source.file), "line": source.line},
        "children": [to_json(child) for child in node.children],
    }
