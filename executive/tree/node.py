"""Nodes as plain data: the spec of each node, and the state of a running node.

Specs are compared, shown and checked without a robot; `executive.tree.compiler.build` makes their py_trees nodes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import Any, NamedTuple

from py_trees.common import Status

from executive.tree.behaviour import ExplainedNode
from skills.api import Cause, Skill
from skills.inputs.errors import SourceLine
from skills.inputs.plugins import NODES, PluginDefect, installed_plugins, run_plugin


@cache
def node_pages() -> tuple[ModuleType, ...]:
    """Imports the pages of `executive.tree.nodes`, and those of plug-ins that can be imported."""
    package = import_module("executive.tree.nodes")
    pages = [import_module(f"{package.__name__}.{page.name}") for page in iter_modules(package.__path__)]
    for entry in installed_plugins(NODES):
        with suppress(PluginDefect):
            pages.append(run_plugin(entry, entry.load))
    return tuple(pages)


@cache
def node_classes() -> Mapping[str, type[ExplainedNode]]:
    """Returns the classes of nodes by the kind that each class defines."""
    found = (node for page in node_pages() for node in vars(page).values() if isinstance(node, type))
    return {node.kind: node for node in found if issubclass(node, ExplainedNode) and vars(node).get("kind")}


@dataclass(frozen=True)
class NodeSpec:
    """A node's kind, path id, displayed name, options, children, and the line of the mission file that it comes from.

    `step` is True for nodes that the mission file contains: the mission itself and its steps.
    """

    kind: str
    path_id: str
    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    children: tuple[NodeSpec, ...] = ()
    source: SourceLine | None = None
    step: bool = False

    @property
    def behaviour(self) -> type[ExplainedNode]:
        """Class of the node, which has the properties of its kind."""
        return node_classes()[self.kind]

    @property
    def skill(self) -> type[Skill[Any]] | None:
        """Skill that the node runs."""
        return self.options["skill"] if self.behaviour.runs_skill else None

    def walk(self) -> Iterator[NodeSpec]:
        """Iterates over the node and all its descendants, parents first."""
        left = [self]
        while left:
            node = left.pop()
            yield node
            left += reversed(node.children)

    def with_options(self, **options: Any) -> NodeSpec:
        """Returns a copy of the node with some options changed."""
        return replace(self, options={**self.options, **options})


class NodeState(NamedTuple):
    """Status, cause, message and, for a skill that reports it, progress from 0 to 1.

    `expected` marks a failure that is normal (`executive.tree.node_view.node_view`).
    """

    status: Status = Status.INVALID
    cause: Cause | None = None
    message: str = ""
    progress: float | None = None
    expected: bool = False

    @property
    def cause_text(self) -> str:
        """Cause to display: empty for an expected failure."""
        return "" if self.cause is None or self.expected else self.cause.value


class Change(NamedTuple):
    """Change of one node's state."""

    path_id: str
    before: NodeState
    after: NodeState

    @property
    def is_transition(self) -> bool:
        """Returns whether the status or the cause changed."""
        return self.before.status is not self.after.status or self.before.cause is not self.after.cause

    @property
    def is_activity(self) -> bool:
        """Returns whether a running node reports a new action; a message with merely new numbers does not count."""
        if self.is_transition or self.after.status is not Status.RUNNING:
            return False
        return _NUMBER.sub("", self.before.message) != _NUMBER.sub("", self.after.message)


Snapshot = Mapping[str, NodeState]
"""States of nodes by path id."""
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
