"""JSON Schema of mission files, for editors."""

import dataclasses
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final, get_type_hints

from executive.words.leaf_steps import Dock
from executive.words.mission import Mission
from executive.words.steps import add_tasks
from skills.quantities import base_type, bounds, unitless_name

_NO_SKILLS: Final[Mapping[str, type]] = MappingProxyType({})


def mission_json_schema(inputs: Mapping[str, type] = _NO_SKILLS) -> dict[str, Any]:
    """Makes the JSON Schema of mission files. A value that is no text may also be a parameter, "${name}".

    `inputs` are the `Inputs` of skills by name: the numbers of a step with such a skill have the ranges of its ports.
    """
    schema = Mission.model_json_schema(by_alias=True)
    described: dict[str, Any] = _open_to_parameters(schema)
    steps = described["$defs"]
    described["required"] = [key for key in described["required"] if key != "steps"]
    described["anyOf"] = [{"required": [key]} for key in ("steps", "parts")]
    steps["Dock"]["required"] = [Dock.key]
    add_tasks(steps["Do"])
    steps["CallSkill"]["allOf"] = [
        {
            "if": {"properties": {"skill": {"const": name}}, "required": ["skill"]},
            "then": {"properties": {"with": {"properties": dict(_ports(record))}}},
        }
        for name, record in inputs.items()
    ]
    return described


def _ports(record: type) -> Iterator[tuple[str, Any]]:
    """Yields the schemas of a skill's numbers with a range, by all names that a file may use.

    A number may also be a parameter, or an output of an earlier step; the fields of a pose may stand by themselves.
    """
    for name, hint in get_type_hints(record, include_extras=True).items():
        limits = {_KEYWORDS[bound]: limit for bound, limit in bounds(hint).items()}
        if limits:
            kind = "integer" if base_type(hint) is int else "number"
            taken = [{"type": kind, **limits}, dict(_PARAMETER), {"type": "object", "required": ["from"]}]
            yield from ((each, {"anyOf": taken}) for each in dict.fromkeys((name, unitless_name(name))))
        elif isinstance(hint, type) and dataclasses.is_dataclass(hint):
            yield from _ports(hint)


_REFERENCE: Final = r"^\$\{[A-Za-z_][A-Za-z0-9_]*\}$"
_PARAMETER: Final[Mapping[str, Any]] = MappingProxyType({"type": "string", "pattern": _REFERENCE})
_CLOSED_TYPES: Final = ("number", "integer", "boolean")
_KEYWORDS: Final = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def _open_to_parameters(node: Any) -> Any:
    """Allows a parameter in place of a number, a truth value or one of some words."""
    if isinstance(node, list):
        return [_open_to_parameters(part) for part in node]
    if not isinstance(node, dict):
        return node
    opened = {key: _open_to_parameters(part) for key, part in node.items() if key != "title" or "properties" in node}
    closed = opened.get("type") in _CLOSED_TYPES or "enum" in opened
    if not closed:
        return opened
    outside = {key: opened.pop(key) for key in ("default", "description") if key in opened}
    return {"anyOf": [opened, dict(_PARAMETER)], **outside}
