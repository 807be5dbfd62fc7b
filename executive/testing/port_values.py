"""Plain YAML values as what a skill's ports take: records from mappings, tuples from lists."""

from __future__ import annotations

import dataclasses
import enum
import types
import typing
from collections.abc import Mapping
from typing import Any, Union

from executive.errors import did_you_mean, listing
from executive.types import conforms, describe_type, field_types

KeyPath = tuple[str | int, ...]


class PortValueError(ValueError):
    """A value that does not fit a port: `path` leads to it, `mend` says what would fit."""

    def __init__(self, path: KeyPath, message: str, mend: str) -> None:
        super().__init__(f"{'.'.join(map(str, path))}: {message}; {mend}")
        self.path, self.message, self.mend = path, message, mend


def inputs_of(record: type, values: Mapping[str, Any]) -> Any:
    """An instance of the dataclass `record`, such as a skill's Inputs, from plain values. Raises PortValueError."""
    return _record(values, record, ())


def port_value(value: Any, hint: Any, path: KeyPath = ()) -> Any:
    """A plain value as the type that `hint` names. Raises PortValueError."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Union, types.UnionType):
        return _either(value, hint, arguments, path)
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return value if isinstance(value, hint) else _record(value, hint, path)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return _member(value, hint, path)
    if origin is tuple and isinstance(value, list | tuple):
        return _items(value, arguments, hint, path)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not conforms(value, hint):
        raise PortValueError(path, f"{value!r} does not fit", f"give it a {describe_type(hint)}")
    return value


def _record(value: Any, record: type, path: KeyPath) -> Any:
    hints = field_types(record)
    if not isinstance(value, Mapping):
        mend = f"give it a mapping with {listing(hints)}"
        raise PortValueError(path, f"{value!r} is no {record.__name__}", mend)
    for key in value:
        if key not in hints:
            near = did_you_mean(str(key), hints)
            mend = f"did you mean '{near}'?" if near else f"known are {listing(hints)}"
            raise PortValueError((*path, key), f"{record.__name__} has no '{key}'", mend)
    needed = (dataclasses.MISSING, dataclasses.MISSING)
    for field in dataclasses.fields(record):
        if field.name not in value and (field.default, field.default_factory) == needed:
            raise PortValueError(path, f"'{field.name}' is missing", f"give it a {describe_type(hints[field.name])}")
    return record(**{key: port_value(item, hints[key], (*path, key)) for key, item in value.items()})


def _either(value: Any, hint: Any, options: tuple[Any, ...], path: KeyPath) -> Any:
    if value is None and type(None) in options:
        return None
    rest = [option for option in options if option is not type(None)]
    if len(rest) == 1:
        return port_value(value, rest[0], path)
    for option in rest:
        try:
            return port_value(value, option, path)
        except PortValueError:
            continue
    raise PortValueError(path, f"{value!r} does not fit", f"give it a {describe_type(hint)}")


def _member(value: Any, kind: type[enum.Enum], path: KeyPath) -> enum.Enum:
    try:
        return value if isinstance(value, kind) else kind(value)
    except ValueError as error:
        known = listing([str(member.value) for member in kind], last="or")
        raise PortValueError(path, f"{value!r} does not fit", f"give {known}") from error


def _items(value: Any, arguments: tuple[Any, ...], hint: Any, path: KeyPath) -> tuple[Any, ...]:
    endless = len(arguments) == 2 and arguments[1] is Ellipsis
    kinds = [arguments[0]] * len(value) if endless else list(arguments)
    if len(kinds) != len(value):
        raise PortValueError(path, f"{len(value)} values", f"give it a {describe_type(hint)}")
    return tuple(port_value(item, kind, (*path, n)) for n, (item, kind) in enumerate(zip(value, kinds, strict=True)))
