"""The tree as plain data: one spec for every node, whatever its kind.

Specs are compared, shown and checked without a robot; `executive.tree.kinds.build` makes the py_trees nodes of one run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from skills.files.errors import SourceLine

__all__ = ["NodeSpec"]


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

    def with_options(self, **options: Any) -> NodeSpec:
        """The same with some options changed."""
        return replace(self, options={**self.options, **options})
