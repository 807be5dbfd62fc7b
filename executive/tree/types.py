"""Checks of values and types against type hints, for the ports of skills."""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Mapping
from typing import Any, Final, Union

from skills.quantities import base_type, bounds, in_range, range_text


def conforms(value: Any, hint: Any) -> bool:
    """Returns whether `value` is of the type `hint` and in its range; an int passes as a float."""
    if bounds(hint):
        return conforms(value, base_type(hint)) and in_range(value, hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(conforms(value, option) for option in arguments)
    if origin is tuple:
        kinds = arguments[:1] * len(value) if isinstance(value, tuple) and arguments[1:] == (Ellipsis,) else arguments
        fits = isinstance(value, tuple) and len(value) == len(kinds)
        return fits and all(map(conforms, value, kinds))
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is None or hint is type(None):
        return value is None
    return isinstance(value, origin or hint)


def assignable(source: Any, target: Any) -> bool:
    """Returns whether a port of type `target` takes every value of type `source`; ranges are not compared."""
    source, target = base_type(source), base_type(target)
    if target is Any or source == target or (source is int and target is float):
        return True
    if typing.get_origin(target) in (Union, types.UnionType):
        return any(assignable(source, option) for option in typing.get_args(target))
    plain = isinstance(source, type) and isinstance(target, type)
    return plain and issubclass(source, target)


def required_fields(record: type) -> tuple[str, ...]:
    """Returns the names of a dataclass's fields that have no default."""
    missing, fields = dataclasses.MISSING, dataclasses.fields(record)
    return tuple(field.name for field in fields if field.default is missing and field.default_factory is missing)


def describe_type(hint: Any) -> str:
    """Describes a type hint to users: "number above 0 and at most 3 m/s", "list of text", "text or nothing"."""
    if bounds(hint):
        return f"{describe_type(base_type(hint))} {range_text(hint)}"
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


@functools.lru_cache(maxsize=512)
def field_types(record: type) -> Mapping[str, Any]:
    """Returns the resolved type hints of a dataclass, including ranges, by field name."""
    return types.MappingProxyType(typing.get_type_hints(record, include_extras=True))
