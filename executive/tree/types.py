"""Checks of values and types against type hints, for the ports of skills."""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Mapping
from typing import Any, Final, Union

from skills.quantities import bounds, in_range, range_text, without_range


def conforms(value: Any, hint: Any) -> bool:
    """True when `value` is of the type that `hint` names and in its range.

    An int passes as a float; parameters are checked.
    """
    if bounds(hint):
        return conforms(value, without_range(hint)) and in_range(value, hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(conforms(value, option) for option in arguments)
    if origin is tuple:
        return isinstance(value, tuple) and _tuple_conforms(value, arguments)
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is None or hint is type(None):
        return value is None
    return isinstance(value, origin or hint)


def _tuple_conforms(value: tuple[Any, ...], arguments: tuple[Any, ...]) -> bool:
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return all(conforms(item, arguments[0]) for item in value)
    return len(value) == len(arguments) and all(map(conforms, value, arguments))


def assignable(source: Any, target: Any) -> bool:
    """True when every value of type `source` may go into a port of type `target`, whose range is checked elsewhere."""
    source, target = without_range(source), without_range(target)
    if target is Any or source == target or (source is int and target is float):
        return True
    if typing.get_origin(target) in (Union, types.UnionType):
        return any(assignable(source, option) for option in typing.get_args(target))
    plain = isinstance(source, type) and isinstance(target, type)
    return plain and issubclass(source, target)


def required(record: type) -> tuple[str, ...]:
    """The fields of a dataclass that have no default."""
    missing, fields = dataclasses.MISSING, dataclasses.fields(record)
    return tuple(field.name for field in fields if field.default is missing and field.default_factory is missing)


def describe_type(hint: Any) -> str:
    """A type hint as a user reads it: "number above 0 and at most 3 m/s", "list of text", "text or nothing"."""
    if bounds(hint):
        return f"{describe_type(without_range(hint))} {range_text(hint)}"
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple and arguments[1:] == (Ellipsis,):
        return f"list of {describe_type(arguments[0])}"
    if origin is tuple:
        return f"[{', '.join(map(describe_type, arguments))}]"
    if origin in (Union, types.UnionType):
        return " or ".join(map(describe_type, arguments))
    plain = isinstance(hint, type) and not arguments
    return _PLAIN.get(hint) or (hint.__name__ if plain else str(hint).replace("typing.", ""))


_PLAIN: Final[Mapping[Any, str]] = types.MappingProxyType(
    {float: "number", int: "whole number", str: "text", bool: "true or false", type(None): "nothing", Any: "any value"}
)


def field_types(record: type) -> Mapping[str, Any]:
    """The resolved type hints of a dataclass, ranges included, by field name."""
    return _resolved(record)


@functools.lru_cache(maxsize=512)
def _resolved(record: type) -> Mapping[str, Any]:
    return types.MappingProxyType(typing.get_type_hints(record, include_extras=True))
