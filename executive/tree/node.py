"""The tree as plain data: one spec for every node, whatever its kind, and what is known of each kind.

Specs are compared, shown and checked without a robot; `executive.tree.kinds.build` makes the py_trees nodes of one run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from py_trees.behaviour import Behaviour

from skills.files.errors import SourceLine

__all__ = ["NodeKind", "NodeSpec"]


@dataclass(frozen=True)
class NodeSpec:
    """One node: its kind, its path id, the name shown, the options of its kind, the nodes below, the line behind it."""

    kind: str
    path_id: str
    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    children: tuple[NodeSpec, ...] = ()
    source: SourceLine | None = None

    def walk(self) -> Iterator[NodeSpec]:
        """Itself and all nodes below, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()


def _nothing(options: Mapping[str, Any]) -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True)
class NodeKind:
    """A kind of node. `make` takes path id, name, the spec's options, and what `needs` names of children and run.

    `writes` gives, of the options, the blackboard keys that such a node writes, and the type of each value.
    """

    make: Callable[..., Behaviour]
    needs: tuple[str, ...] = ()
    writes: Callable[[Mapping[str, Any]], Mapping[str, Any]] = _nothing
