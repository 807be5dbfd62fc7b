"""A step that names a skill and its ports: values from the file become bindings, outputs get names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from executive.tree.board import Binding, Constant, FromBoard
from executive.tree.node import NodeSpec
from executive.tree.plan import Registry, skill_spec
from executive.tree.port_values import FROM_KEY, PortValueError, gathered, port_value
from executive.tree.registry import missing
from executive.tree.types import field_types
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import CallSkill
from executive.words.slug import slug
from skills.api import Skill
from skills.files.errors import listing, suggestion

__all__ = ["skill_plan"]


def skill_plan(
    call: CallSkill,
    path_id: str,
    *,
    knowledge: Knowledge,
    registry: Registry,
    names: Mapping[str, str],
    gives_to: Callable[[str, str, type], str],
) -> NodeSpec:
    """The leaf of a skill step. `names` are the values of earlier steps and their blackboard keys; `gives_to` gives the
    key for a value of this step, by its name, its own key and its type.

    Raises InputError: no such skill, a value that does not fit its port, an unknown port or name.
    """
    skill = _registered(call, registry)
    inputs = _inputs(call, skill, knowledge, names)
    outputs = {
        port: gives_to((call.gives or {})[port], f"{path_id}/{slug(port)}", skill.outputs[port])
        for port in _given_ports(call, skill)
    }
    return skill_spec(registry, call.skill, path_id, call.source, inputs, outputs)


def _registered(call: CallSkill, registry: Registry) -> type[Skill[Any]]:
    if call.skill not in registry:
        raise call.error(("skill",), *missing(call.skill, registry))
    return registry[call.skill]


def _inputs(
    call: CallSkill, skill: type[Skill[Any]], knowledge: Knowledge, names: Mapping[str, str]
) -> dict[str, Binding]:
    """A binding for each input port that has a value."""
    hints = field_types(skill.Inputs)
    try:
        ports = gathered(call.values or {}, skill.Inputs)
        return {
            port: _named_output(call, path, value[FROM_KEY], names)
            if isinstance(value, dict) and set(value) == {FROM_KEY}
            else Constant(port_value(value, hints[port], knowledge, path))
            for port, (path, value) in ports.items()
        }
    except PortValueError as error:
        where = ".".join(map(str, error.path))
        message = f"{call.skill}: {where + ': ' if where and where not in error.message else ''}{error.message}"
        raise call.error(("with", *error.path), message, error.hint) from error


def _named_output(call: CallSkill, path: tuple[str | int, ...], name: Any, names: Mapping[str, str]) -> FromBoard:
    if not isinstance(name, str) or name not in names:
        none = None if names else "name one with 'gives: {PORT: NAME}' in an earlier step"
        hint = suggestion(str(name), names, none)
        raise call.error(("with", *path), f"no earlier step gives '{name}'", hint)
    return FromBoard(names[name])


def _given_ports(call: CallSkill, skill: type[Skill[Any]]) -> tuple[str, ...]:
    for port in call.gives or ():
        if port not in skill.outputs:
            known = f"its outputs are {listing(skill.outputs)}" if skill.outputs else "it has none"
            hint = suggestion(port, skill.outputs, known)
            raise call.error(("gives", port), f"{call.skill} has no output port '{port}'", hint)
    return tuple(call.gives or ())
