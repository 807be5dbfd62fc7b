"""Checks of the ports before any tick: every input bound, every bound value of the right type, written before read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from executive.tree.board import Binding, Constant, FromBoard, FromBoardOr
from executive.tree.kinds import writes
from executive.tree.node import NodeSpec
from executive.tree.types import assignable, conforms, describe_type, field_types, required
from skills.files.errors import InputError, suggestion


def check_wiring(root: NodeSpec) -> None:
    """Check all ports of a tree.

    Raises InputError: an input port without a value, an unknown port, a value of a wrong type, a blackboard key that no
    earlier node writes, an output bound to a port that the skill does not have, or a path id used twice.
    """
    written: dict[str, Any] = {}
    seen: set[str] = set()
    for node in root.walk():
        if node.path_id in seen:
            raise _error(node, "two nodes have this path id", "give the steps different names")
        seen.add(node.path_id)
        if node.kind == "skill":
            for message, hint in _faults(node, written):
                raise _error(node, message, hint)
        written.update(writes(node))


def _faults(node: NodeSpec, written: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What is wrong with one skill's ports, and the hint."""
    skill, inputs, outputs = (node.options[key] for key in ("skill", "inputs", "outputs"))
    types = field_types(skill.Inputs)
    for name in required(skill.Inputs):
        if name not in inputs:
            yield f"input port '{name}' has no value", f"give it a {describe_type(types[name])}"
    for port, binding in inputs.items():
        if port not in types:
            yield f"there is no input port '{port}'", suggestion(port, types, f"known: {', '.join(types)}")
        else:
            yield from _misfit(port, binding, types[port], written)
    for port in outputs:
        if port not in skill.outputs:
            yield f"there is no output port '{port}'", f"known: {', '.join(skill.outputs) or 'none'}"


def _misfit(port: str, binding: Binding, kind: Any, written: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What is wrong with one bound input."""
    wanted = f"give it a {describe_type(kind)}"
    if isinstance(binding, Constant) and not conforms(binding.value, kind):
        yield f"input port '{port}' got {binding.value!r}", wanted
    if isinstance(binding, FromBoardOr) and not conforms(binding.default, kind):
        yield f"input port '{port}' has the default {binding.default!r}", wanted
    if not isinstance(binding, FromBoard) or (isinstance(binding, FromBoardOr) and binding.key not in written):
        return
    if binding.key not in written:
        yield f"input port '{port}' reads '{binding.key}', which nothing before it writes", wanted
        return
    given = binding.gives or written[binding.key]
    if not assignable(given, kind):
        yield f"input port '{port}' reads '{binding.key}', a {describe_type(given)}", wanted


def _error(node: NodeSpec, message: str, hint: str) -> InputError:
    return InputError.at(node.source, f"{node.path_id}: {message}", hint=hint)
