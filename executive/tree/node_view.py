"""Views of nodes: the tree's nodes with their ports and states, as plain data that every display uses."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

from executive.tree.board import Constant, FromBoard
from executive.tree.node import NodeSpec, NodeState
from executive.tree.types import describe_type, field_types
from skills.files.errors import SourceLine


@dataclass(frozen=True)
class Port:
    """Input or output of a node with its value as text, which is a blackboard key if `on_board` is set."""

    name: str
    value: str
    type: str = ""
    output: bool = False
    on_board: bool = False


def _ports_of(spec: NodeSpec) -> Iterator[Port]:
    """Iterates over the ports of a skill, or the options of any other node."""
    options = spec.options
    if spec.kind != "skill":
        yield from (Port(name, plain(value)) for name, value in options.items())
        return
    skill, bound = options["skill"], options.get("inputs", {})
    types = field_types(skill.Inputs)
    for port in fields(skill.Inputs):
        kind = describe_type(types[port.name])
        match bound.get(port.name):
            case FromBoard(key):
                yield Port(port.name, key, kind, on_board=True)
            case Constant(value):
                yield Port(port.name, plain(value), kind)
            case _:
                yield Port(port.name, "" if port.default is MISSING else plain(port.default), kind)
    for name, key in options.get("outputs", {}).items():
        yield Port(name, key, describe_type(skill.outputs.get(name, Any)), output=True, on_board=True)


def plain(value: Any) -> str:
    """Formats a value as short text: enum members by value, objects and surfaces by their own text or name."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, enum.Enum):
        return str(value.value)
    if isinstance(value, frozenset | set):
        return ", ".join(sorted(map(plain, value)))
    if isinstance(value, Mapping):
        return ", ".join(f"{plain(key)}: {plain(item)}" for key, item in value.items())
    if isinstance(value, tuple | list):
        return ", ".join(map(plain, value))
    if is_dataclass(value) and not isinstance(value, type):
        return _record(value)
    return "" if value is None else str(value)


def _record(value: Any) -> str:
    names = [each.name for each in fields(value) if each.repr]
    if any("__str__" in vars(kind) for kind in type(value).__mro__[:-1]):
        return str(value)
    if "name" in names:
        return str(value.name)
    return " ".join(f"{name}={plain(getattr(value, name))}" for name in names)


@dataclass(frozen=True)
class NodeView:
    """View of one node. INVALID without a cause means that it has not run yet; `hidden` counts omitted descendants."""

    path_id: str
    kind: str
    name: str
    state: NodeState = field(default_factory=NodeState)
    source: SourceLine | None = None
    children: tuple[NodeView, ...] = ()
    ports: tuple[Port, ...] = ()
    hidden: int = 0

    @property
    def below(self) -> int:
        """Number of descendants, including hidden ones."""
        return self.hidden + sum(1 + child.below for child in self.children)

    def walk(self, depth: int = 0) -> Iterator[tuple[int, NodeView]]:
        """Iterates over the node and its descendants with their depths, parents first."""
        yield depth, self
        for child in self.children:
            yield from child.walk(depth + 1)

    def title(self, above: NodeView | None = None) -> str:
        """Title of the node: its name, with a skill's texts and surfaces, or with the goal of a drive.

        `above` is its parent, whose name has the goal of a drive.
        """
        if self.kind != "skill":
            return self.name
        if self.name == "navigate" and above is not None and above.name.startswith("go "):
            return above.name
        given = (port for port in self.ports if not (port.output or port.on_board) and port.value)
        texts = [port.value for port in given if _is_telling(port)]
        return self.name.replace("_", " ") + (f" ({'; '.join(texts)})" if texts else "")

    def structure(self, above: NodeView | None = None) -> dict[str, Any]:
        """Returns the tree without states, as it is logged; `above` is its parent."""
        return {
            "id": self.path_id,
            "type": self.kind,
            "name": self.name,
            "title": self.title(above),
            "source": _place(self.source),
            "ports": [asdict(port) for port in self.ports],
            "children": [child.structure(self) for child in self.children],
        }


def _is_telling(port: Port) -> bool:
    """Returns whether a port holds texts, or the name of one surface; older logs have "str" as the type of a text."""
    return "text" in port.type or "str" in port.type or ("Surface" in port.type and "," not in port.value)


def node_view(spec: NodeSpec, states: Mapping[str, NodeState] | None = None) -> NodeView:
    """Returns the view of a spec, with states by path id."""
    known = states or {}
    return NodeView(
        path_id=spec.path_id,
        kind=spec.kind,
        name=spec.name,
        state=known.get(spec.path_id, NodeState()),
        source=spec.source,
        children=tuple(node_view(child, known) for child in spec.children),
        ports=tuple(_ports_of(spec)),
    )


def logged_view(structure: Mapping[str, Any], states: Mapping[str, NodeState]) -> NodeView:
    """Returns the view of a logged structure. Raises KeyError or TypeError for values of another form."""
    source = structure.get("source")
    return NodeView(
        path_id=structure["id"],
        kind=structure["type"],
        name=structure["name"],
        state=states.get(structure["id"], NodeState()),
        source=None if source is None else SourceLine(Path(source["file"]), int(source["line"])),
        children=tuple(logged_view(child, states) for child in structure["children"]),
        ports=tuple(Port(**port) for port in structure.get("ports", ())),
    )


def to_json(node: NodeView) -> dict[str, Any]:
    """Converts the node and its descendants to JSON, as `errand tree --format json` prints them."""
    state = node.state
    return {
        "id": node.path_id,
        "type": node.kind,
        "name": node.name,
        "status": state.status.value,
        "cause": None if state.cause is None else state.cause.value,
        "source": _place(node.source),
        "children": [to_json(child) for child in node.children],
    }


def _place(source: SourceLine | None) -> dict[str, Any] | None:
    return None if source is None else {"file": str(source.file), "line": source.line}
