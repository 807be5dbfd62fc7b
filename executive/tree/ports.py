"""A node's ports and settings as text, for views that show them."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterator, Mapping
from typing import Any

from executive.tree.board import Constant, FromBoard
from executive.tree.node import NodeSpec
from executive.tree.types import describe_type, field_types


@dataclasses.dataclass(frozen=True)
class Port:
    """An input or output with its value as text; `on_board` when the value is a blackboard key."""

    name: str
    value: str
    type: str = ""
    output: bool = False
    on_board: bool = False


def ports_of(spec: NodeSpec) -> tuple[Port, ...]:
    """The ports of a skill, or the options of any other node."""
    if spec.kind == "skill":
        return tuple(_skill_ports(spec.options))
    return tuple(Port(name, plain(value)) for name, value in spec.options.items())


def _skill_ports(options: Mapping[str, Any]) -> Iterator[Port]:
    skill, bound = options["skill"], options.get("inputs", {})
    types = field_types(skill.Inputs)
    for field in dataclasses.fields(skill.Inputs):
        kind = describe_type(types[field.name])
        match bound.get(field.name):
            case FromBoard(key):
                yield Port(field.name, key, kind, on_board=True)
            case Constant(value):
                yield Port(field.name, plain(value), kind)
            case _:
                yield Port(field.name, _default(field), kind)
    for name, key in options.get("outputs", {}).items():
        yield Port(name, key, describe_type(skill.outputs.get(name, Any)), output=True, on_board=True)


def _default(field: dataclasses.Field[Any]) -> str:
    return "" if field.default is dataclasses.MISSING else plain(field.default)


def plain(value: Any) -> str:
    """A value in few words: numbers short, enum members by name, objects and surfaces by their own text or name."""
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
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _record(value)
    return "" if value is None else str(value)


def _record(value: Any) -> str:
    fields = [field.name for field in dataclasses.fields(value) if field.repr]
    if any("__str__" in vars(kind) for kind in type(value).__mro__[:-1]):
        return str(value)
    if "name" in fields:
        return str(value.name)
    return " ".join(f"{name}={plain(getattr(value, name))}" for name in fields)
