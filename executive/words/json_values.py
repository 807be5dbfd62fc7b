"""Converts values to JSON and back: plain values, tuples, enums, arrays, transforms and frozen dataclasses.

A value without a form in JSON is stored with its kind, so that it is read back equal and with its type. A class is
looked up among the loaded modules; nothing is imported, and only constructors of dataclasses are called.
"""

import dataclasses
import enum
import json
import sys
from collections.abc import Callable, Mapping
from functools import cache
from types import NoneType
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform

_KIND: Final = "$kind"


def to_text(value: Any) -> str:
    """Converts a value to JSON text. Raises TypeError for a value, or a part of it, that has no stored form."""
    return json.dumps(pack(value), separators=(",", ":"))


def from_text(text: str) -> Any:
    """Converts a text written by `to_text` back. Raises ValueError for a damaged text, and for an unknown class."""
    try:
        return unpack(json.loads(text))
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"no value can be read from {text[:80]!r} ({error})") from error


def pack(value: Any) -> Any:
    """Converts a value to plain JSON data. Raises TypeError like `to_text`."""
    of: Any = type(value)
    kind = _kind_of(of)
    return value if kind is None else {_KIND: kind, **_KINDS[kind][1](value)}


@cache
def _kind_of(of: Any) -> str | None:
    """Kind stored with values of a type; None for plain values. Raises TypeError for a type that cannot be stored."""
    if issubclass(of, bool | int | float | str | NoneType) and not issubclass(of, enum.Enum):
        return None
    for kind, (fits, _, _) in _KINDS.items():
        if fits(of):
            return kind
    raise TypeError(f"a {of.__name__} cannot be stored")


def unpack(value: Any) -> Any:
    """Converts data from `pack` back. Raises ValueError, KeyError, TypeError or AttributeError for any other data."""
    if not isinstance(value, dict):
        if isinstance(value, list):
            raise ValueError("a bare list is no stored value")
        return value
    if value[_KIND] not in _KINDS:
        raise ValueError(f"unknown kind of value {value[_KIND]!r}")
    return _KINDS[value[_KIND]][2](value)


def _class_of(name: str, fits: Callable[[Any], bool], kind: str) -> Any:
    """Finds the loaded class "module:Class.Inner" of a kind. Raises ValueError when there is none."""
    module, _, path = name.partition(":")
    found: Any = sys.modules.get(module)
    for part in path.split("."):
        found = getattr(found, part, None)
    if not isinstance(found, type):
        raise ValueError(f"there is no class {name} any more")
    if not fits(found):
        raise ValueError(f"{name} is no {kind}")
    return found


def _class_name(value: Any) -> str:
    return f"{type(value).__module__}:{type(value).__qualname__}"


def _pack_dataclass(value: Any) -> dict[str, Any]:
    fields = {field.name: pack(getattr(value, field.name)) for field in dataclasses.fields(value) if field.init}
    return {"class": _class_name(value), "fields": fields}


def _unpack_dataclass(packed: Mapping[str, Any]) -> Any:
    found = _class_of(packed["class"], dataclasses.is_dataclass, "dataclass")
    return found(**{name: unpack(item) for name, item in packed["fields"].items()})


def _is_enum(of: Any) -> bool:
    return issubclass(of, enum.Enum)


def _pack_array(value: Any) -> dict[str, Any]:
    if value.dtype.kind not in "biuf":
        raise TypeError(f"an array of {value.dtype} cannot be stored")
    return {"dtype": value.dtype.str, "shape": list(value.shape), "items": value.ravel().tolist()}


_Kind = tuple[Callable[[Any], bool], Callable[[Any], dict[str, Any]], Callable[[Mapping[str, Any]], Any]]
_KINDS: Final[Mapping[str, _Kind]] = {
    "enum": (
        _is_enum,
        lambda v: {"class": _class_name(v), "name": v.name},
        lambda p: _class_of(p["class"], _is_enum, "enum")[p["name"]],
    ),
    "number": (lambda of: issubclass(of, np.generic), lambda v: {"item": v.item()}, lambda p: p["item"]),
    "array": (
        lambda of: issubclass(of, np.ndarray),
        _pack_array,
        lambda p: np.array(p["items"], dtype=p["dtype"]).reshape(p["shape"]),
    ),
    "transform": (
        lambda of: issubclass(of, RigidTransform),
        lambda v: {"matrix": v.GetAsMatrix34().tolist()},
        lambda p: RigidTransform(np.array(p["matrix"])),
    ),
    "dataclass": (dataclasses.is_dataclass, _pack_dataclass, _unpack_dataclass),
    "tuple": (
        lambda of: issubclass(of, tuple),
        lambda v: {"items": [*map(pack, v)]},
        lambda p: tuple(map(unpack, p["items"])),
    ),
    "list": (
        lambda of: issubclass(of, list),
        lambda v: {"items": [*map(pack, v)]},
        lambda p: [*map(unpack, p["items"])],
    ),
    "set": (
        lambda of: issubclass(of, frozenset),
        lambda v: {"items": sorted(map(to_text, v))},
        lambda p: frozenset(map(from_text, p["items"])),
    ),
    "map": (
        lambda of: issubclass(of, Mapping),
        lambda v: {"items": [[pack(key), pack(item)] for key, item in v.items()]},
        lambda p: {unpack(key): unpack(item) for key, item in p["items"]},
    ),
}
