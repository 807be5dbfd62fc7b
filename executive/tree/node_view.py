"""Views of nodes: the nodes in a tree with their ports and states, as plain data for every display."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from functools import partial, reduce
from pathlib import Path
from typing import Any, Final

from py_trees.common import Status

from executive.tree.behaviour import ExplainedNode
from executive.tree.board import Constant, FromBoard
from executive.tree.node import NodeSpec, NodeState, node_classes
from executive.tree.port_values import describe_type, field_types
from skills.api import Cause
from skills.inputs.errors import SourceLine


@dataclass(frozen=True)
class Port:
    """Input or output of a node, with its value as text; with `on_board`, the text is a blackboard key."""

    name: str
    value: str
    type: str = ""
    output: bool = False
    on_board: bool = False


_ROWS: Final = ("mission", "step")
"""Kinds of rows that are no nodes."""
_UNNAMED: Final = frozenset({"round", "steps", "group"})
_LOOKS: Final = frozenset({"detect", "find_people"})


def _ports_of(spec: NodeSpec) -> Iterator[Port]:
    """Yields the ports of a skill, or the options of any other node."""
    options = spec.options
    if spec.skill is None:
        parts = spec.path_id.split("/")
        bases = ["/".join(parts[:n]) + "/" for n in (len(parts), len(parts) - 1, 2) if n > 1]  # of ids near it
        for name, value in options.items():
            yield Port(name, reduce(lambda text, base: text.replace(base, ""), bases, plain(value)))
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


_UNITS: Final = {"m_s": "m/s", "rad_s": "rad/s", "m": "m", "s": "s", "kg": "kg", "rad": "°"}


def plain(value: Any) -> str:
    """Formats a value as a person would write it: enum members by value, objects and surfaces by their own text or
    name, other records by their fields with units, and angles in degrees."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, enum.Enum):
        return str(value.value)
    if isinstance(value, frozenset | set):
        return ", ".join(sorted(map(plain, value)))
    if isinstance(value, Mapping):
        return ", ".join(f"{plain(key)}: {_item(item)}" for key, item in value.items())
    if isinstance(value, tuple | list):
        return ", ".join(map(_item, value))
    if is_dataclass(value) and not isinstance(value, type):
        return _record(value)
    return "" if value is None else str(value)


def _item(value: Any) -> str:
    return f"({plain(value)})" if isinstance(value, tuple | list) and value else plain(value)


def _record(value: Any) -> str:
    names = [each.name for each in fields(value) if each.repr]
    if any("__str__" in vars(kind) for kind in type(value).__mro__[:-1]):
        return str(value)
    if "name" in names:
        return str(value.name)
    return ", ".join(filter(None, (_fact(name, getattr(value, name)) for name in names)))


def _fact(name: str, value: Any) -> str:
    """Formats a field with its unit: "x 5.5 m"; empty for a field without a value."""
    if value is None or value is False or (text := plain(value)) == "":
        return ""
    unit = next((unit for unit in _UNITS if name.endswith(f"_{unit}")), "")
    words = name.removesuffix(f"_{unit}").replace("_", " ")
    if unit == "rad":
        return f"{words} {math.degrees(value):.0f}°"
    return words if value is True else f"{words} {text} {_UNITS[unit]}" if unit else f"{words} {text}"


@dataclass(frozen=True)
class NodeView:
    """View of one node. INVALID without a cause means that it has not run yet; `hidden` counts omitted descendants.

    `step` is taken from the node's spec. In an outline, a view is one row: `policy` describes the policy of the row's
    step, and `hidden` counts all omitted nodes.
    """

    path_id: str
    kind: str
    name: str
    state: NodeState = field(default_factory=NodeState)
    source: SourceLine | None = None
    children: tuple[NodeView, ...] = ()
    ports: tuple[Port, ...] = ()
    hidden: int = 0
    step: bool = False
    policy: str = ""

    @property
    def behaviour(self) -> type[ExplainedNode]:
        """Class of the node; the base class for a row, and for a kind that only another version's log knows."""
        return node_classes().get(self.kind, ExplainedNode)

    @property
    def label(self) -> str:
        """Kind and name; only the name for a skill or a row of steps. A row's policy is appended in brackets."""
        policy = f" ({self.policy})" if self.policy else ""
        alone = self.behaviour.runs_skill or self.kind in _ROWS
        return f"{'' if alone else f'{self.kind} '}{self.name}{policy}"

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

        `above` is the parent, whose name contains the goal of a drive.
        """
        if not self.behaviour.runs_skill:
            return self.name
        if self.name == "navigate" and above is not None and above.name.startswith("go "):
            return above.name
        given = (port for port in self.ports if not (port.output or port.on_board) and port.value)
        texts = [port.value for port in given if _is_telling(port)]
        return self.name.replace("_", " ") + (f" ({'; '.join(texts)})" if texts else "")

    def structure(self) -> dict[str, Any]:
        """Returns the tree without states, as it is logged.

        In the first node of each row of the outline, `row` is the row's text; other nodes of the row have none.
        """
        return _structure(self, None, {row.path_id: row for _, row in outline(self).walk()})


def _structure(node: NodeView, above: NodeView | None, rows: Mapping[str, NodeView]) -> dict[str, Any]:
    row = rows.get(node.path_id)
    return {
        "id": node.path_id,
        "type": node.kind,
        "name": node.name,
        "title": node.title(above),
        "source": _place(node.source),
        "ports": [{**vars(port)} for port in node.ports],
        **({"step": True} if node.step else {}),
        "row": None if row is None else {"kind": row.kind, "name": row.name, "policy": row.policy, "step": row.step},
        "children": [_structure(child, node, rows) for child in node.children],
    }


def outline(root: NodeView) -> NodeView:
    """Returns the mission as its author wrote it: each step is one row with its policy, and so is each chain of nodes
    with a single child. A row has the path id and state of its first node, and the name of its step.
    """
    return _outline_row(root, _authored(root))


def _authored(node: NodeView) -> set[str]:
    """Path ids of the steps, and of the nodes above steps."""
    below = set[str]().union(*map(_authored, node.children))
    return below | {node.path_id} if below or node.step else below


def _outline_row(node: NodeView, authored: set[str]) -> NodeView:
    chain = [node]
    while (following := _same_row(chain, authored)) is not None:
        chain.append(following)
    within = {each.path_id for each in chain}
    below = tuple(child for each in chain for child in each.children if child.path_id not in within)
    main = next((each for each in chain if each.step), next(filter(_is_sequence, chain), chain[-1]))
    row = partial(replace, main, path_id=node.path_id, state=node.state, hidden=sum(each.hidden for each in chain))
    row = partial(row, children=tuple(_outline_row(child, authored) for child in below), step=node.path_id in authored)
    if node.path_id not in authored:
        names = " › ".join((*(each.label for each in chain[:-1]), chain[-1].title()))
        return row(kind=chain[0].kind, name=names.removeprefix(f"{chain[0].kind} "))
    before = [each.name for each in chain[: chain.index(main)] if _is_sequence(each)]
    parts = [name for name in before if not (name in _UNNAMED or name.startswith("branch "))]
    others = [each for each in chain if each is not main and each.path_id in authored]
    policy = [each.name for each in others if not each.behaviour.container and each.name not in parts]
    name = ": ".join((*parts, f"{main.kind} {main.name}" if main.behaviour.spoken else main.title()))
    return row(kind=_ROWS[0 if main.path_id.count("/") == 1 else 1], name=name, policy=", ".join(policy))


def _is_sequence(node: NodeView) -> bool:
    return node.behaviour.control == "Sequence"


def _same_row(chain: Sequence[NodeView], authored: set[str]) -> NodeView | None:
    """Returns the child that shares the row of a chain of nodes, or None; a row has at most one step."""
    inner = chain[-1]
    below = [child for child in inner.children if child.path_id in authored]
    if not below:
        below = list(inner.children) if inner.path_id not in authored or inner.step else []
        return below[0] if len(below) == 1 and not inner.behaviour.runs_skill else None
    if len(below) > 1 or (any(each.step for each in chain) and _leads_to_step(below[0], authored)):
        return None
    return below[0]


def _leads_to_step(node: NodeView, authored: set[str]) -> bool:
    """Returns whether a node is a step, or a step lies below it through nodes with one such child each."""
    below = [child for child in node.children if child.path_id in authored]
    return node.step or (len(below) == 1 and _leads_to_step(below[0], authored))


def _is_telling(port: Port) -> bool:
    """Returns whether a port holds texts or the name of one surface; in older logs the type of a text is "str"."""
    return "text" in port.type or "str" in port.type or ("Surface" in port.type and "," not in port.value)


def node_view(spec: NodeSpec, states: Mapping[str, NodeState] | None = None) -> NodeView:
    """Returns the view of a spec, with states by path id.

    A look that finds nothing is an expected failure if the node above succeeded or a selector continues, unless it made
    a step fail. So is the failure of a node below which only such looks failed.
    """
    return _with_expected(_view_of(spec, states or {}), False)


def _with_expected(node: NodeView, inside: bool) -> NodeView:
    """Marks the expected failures; with `inside`, the nearest node above allows expected failures."""
    state, failed = node.state, node.state.status is Status.FAILURE
    goes_on = state.status is Status.RUNNING and node.behaviour.control == "Fallback"
    inside = state.status is Status.SUCCESS or goes_on or (inside and failed and not node.step)
    children = tuple(_with_expected(child, inside) for child in node.children)
    below = [child.state.expected for child in children if child.state.status is Status.FAILURE]
    found_none = node.behaviour.runs_skill and node.name in _LOOKS and state.cause is Cause.POSTCONDITION
    expected = failed and inside and (found_none or (bool(below) and all(below)))
    same = expected is state.expected and [*map(id, children)] == [*map(id, node.children)]
    return node if same else replace(node, state=state._replace(expected=expected), children=children)


def _view_of(spec: NodeSpec, known: Mapping[str, NodeState]) -> NodeView:
    return NodeView(
        path_id=spec.path_id,
        kind=spec.kind,
        name=spec.name,
        state=known.get(spec.path_id, NodeState()),
        source=spec.source,
        children=tuple(_view_of(child, known) for child in spec.children),
        ports=tuple(_ports_of(spec)),
        step=spec.step,
    )


def logged_view(structure: Mapping[str, Any], states: Mapping[str, NodeState]) -> NodeView:
    """Returns the view of a logged structure, marked as in `node_view`.

    Raises KeyError or TypeError if the logged values are malformed.
    """
    return _with_expected(_logged_view(structure, states), False)


def _logged_view(structure: Mapping[str, Any], states: Mapping[str, NodeState]) -> NodeView:
    source = structure.get("source")
    return NodeView(
        path_id=structure["id"],
        kind=structure["type"],
        name=structure["name"],
        state=states.get(structure["id"], NodeState()),
        source=None if source is None else SourceLine(Path(source["file"]), int(source["line"])),
        children=tuple(_logged_view(child, states) for child in structure["children"]),
        ports=tuple(Port(**port) for port in structure.get("ports", ())),
        step=bool(structure.get("step")),
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
