"""Values of a skill's ports: checks against their type hints, and conversion of YAML values to the types of inputs.

Numbers, texts and truth values stay the same; a tuple is given as a list, an enum as one of its values, a dataclass as
a mapping of its fields, whose units may be omitted ("yaw" for "yaw_rad"). A pose may also be the name of a place, a
`Surface` the name of a surface, several surfaces the name of a room, an `ObjectKind` its words ("red wrench").
"""

import dataclasses
import enum
import functools
import math
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType, NoneType
from typing import Any, Final, Union

from executive.words.command import parse_object
from executive.words.knowledge import Knowledge
from skills.api import ObjectKind, Surface
from skills.inputs.errors import listing, suggestion
from skills.quantities import QuantityError, base_type, bounds, in_range, number_of, range_text, unitless_name
from skills.robot import Pose2D


def conforms(value: Any, hint: Any) -> bool:
    """Returns whether `value` is of the type `hint` and in the hint's range; an int counts as a float."""
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
    return value in arguments if origin is typing.Literal else isinstance(value, origin or hint)


def assignable(source: Any, target: Any) -> bool:
    """Returns whether a port of type `target` accepts every value of type `source`; ranges are not compared."""
    source, target = base_type(source), base_type(target)
    if target is Any or source == target or (source is int and target is float):
        return True
    if typing.get_origin(target) in (Union, types.UnionType):
        return any(assignable(source, option) for option in typing.get_args(target))
    parts = typing.get_args(source), typing.get_args(target)
    if typing.get_origin(source) is typing.get_origin(target) is tuple and len(parts[0]) == len(parts[1]):
        return all(each is other or assignable(each, other) for each, other in zip(*parts, strict=True))
    plain = isinstance(source, type) and isinstance(target, type)
    return plain and issubclass(source, target)


def required_fields(record: type) -> tuple[str, ...]:
    """Returns the names of a dataclass's fields that have no default."""
    missing, fields = dataclasses.MISSING, dataclasses.fields(record)
    return tuple(field.name for field in fields if field.default is missing and field.default_factory is missing)


@functools.lru_cache(maxsize=512)
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
    return _TYPE_NAMES.get(hint) or (hint.__name__ if plain else str(hint).replace("typing.", ""))


_TYPE_NAMES: Final[Mapping[Any, str]] = MappingProxyType(
    {float: "number", int: "whole number", str: "text", bool: "true or false", NoneType: "nothing", Any: "any value"}
)


@functools.lru_cache(maxsize=512)
def field_types(record: type) -> Mapping[str, Any]:
    """Returns the resolved type hints of a dataclass, including ranges, by field name."""
    return MappingProxyType(typing.get_type_hints(record, include_extras=True))


FROM_KEY: Final = "from"
Path = tuple[str | int, ...]


class PortValueError(ValueError):
    """Raised for a value that does not fit its port; `path` leads to the wrong value, `hint` says how to correct it."""

    def __init__(self, path: Path, message: str, hint: str) -> None:
        super().__init__(message)
        self.path, self.message, self.hint = path, message, hint


def assign_ports(values: Mapping[str, Any], inputs: type) -> dict[str, tuple[Path, Any]]:
    """Assigns values to the input ports of the dataclass `inputs`, each with its path in `values`.

    A unit may be omitted from a port's name. If only one port's dataclass has fields of these names, their keys set
    this port: `{x: 1, y: 2, yaw: 0}` is the `goal` of navigate. Raises PortValueError for a key that is neither a port
    nor such a field.
    """
    hints = field_types(inputs)
    found: dict[str, tuple[Path, Any]] = {}
    loose: dict[str, Any] = {}
    for key, value in values.items():
        port = _named(key, hints)
        if port is None:
            loose[key] = value
        elif port in found:
            raise PortValueError((key,), f"port '{port}' has two values", "remove one of them")
        else:
            found[port] = ((key,), value)
    if loose:
        port = _port_of(loose, hints, taken=found)
        found[port] = ((), loose)
    return found


def port_value(value: Any, hint: Any, knowledge: Knowledge, path: Path = ()) -> Any:
    """Converts `value` to the type `hint`. Raises PortValueError when it does not fit the type or its range."""
    if bounds(hint):
        try:
            return number_of(value, hint)
        except QuantityError as error:
            raise PortValueError(path, error.what, error.hint) from error
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin in (Union, types.UnionType):
        return _union(value, arguments, knowledge, path)
    if origin is tuple or hint is tuple:
        return _tuple(value, arguments, knowledge, path)
    special = _SPECIAL.get(hint) if isinstance(hint, type) else None
    if special is not None and not isinstance(value, dict | list):
        return special(value, knowledge, path)
    if _is_record(hint):
        return _record(value, hint, knowledge, path)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return _word(value, hint, path)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            raise _refusal(value, "a mapping of keys to values", path)
        kind = arguments[1] if len(arguments) == 2 else Any
        items = {str(key): port_value(item, kind, knowledge, (*path, str(key))) for key, item in value.items()}
        return MappingProxyType(items)
    return _plain(value, hint, path)


def _named(key: str, names: Iterable[str]) -> str | None:
    """Returns the name that a key means, with or without a unit; None if no name fits."""
    known = list(names)
    return key if key in known else next((name for name in known if unitless_name(name) == key), None)


def _port_of(loose: Mapping[str, Any], hints: Mapping[str, Any], taken: Iterable[str]) -> str:
    """Returns the only port whose type has all these fields. Raises PortValueError if there is not exactly one."""
    records = {port: field_types(hint) for port, hint in hints.items() if _is_record(hint)}
    fitting = [p for p, fields in records.items() if p not in taken and all(_named(key, fields) for key in loose)]
    if len(fitting) == 1:
        return fitting[0]
    fields = {unitless_name(name) for names in (*records.values(), hints) for name in names}
    known = {**dict.fromkeys(hints), **dict.fromkeys(sorted(fields))}
    wrong = next((key for key in loose if _named(key, known) is None), next(iter(loose)))
    ports = f"its ports are {listing(hints)}" if hints else "it has no input ports"
    hint = suggestion(wrong, (word for word in known if word != wrong), ports)
    raise PortValueError((wrong,), f"there is no input port '{wrong}'", hint)


def _is_record(hint: Any) -> bool:
    return isinstance(hint, type) and dataclasses.is_dataclass(hint)


def _union(value: Any, options: tuple[Any, ...], knowledge: Knowledge, path: Path) -> Any:
    """Converts the value to the first type that takes it. Raises the most specific PortValueError if none does."""
    if value is None and NoneType in options:
        return None
    refusals = []
    for option in (each for each in options if each is not NoneType):
        try:
            return port_value(value, option, knowledge, path)
        except PortValueError as error:
            refusals.append(error)
    raise max(refusals, key=lambda error: len(error.path))


def _tuple(value: Any, arguments: tuple[Any, ...], knowledge: Knowledge, path: Path) -> tuple[Any, ...]:
    several = len(arguments) == 2 and arguments[1] is Ellipsis
    if several and arguments[0] is Surface and isinstance(value, str):
        return _surfaces(value, knowledge, path)
    if not isinstance(value, list):
        raise _refusal(value, "a list", path)
    kinds = arguments[:1] * len(value) if several else arguments
    if arguments and len(kinds) != len(value):
        raise _refusal(value, f"a list of {len(kinds)} values", path)
    pairs = zip(value, kinds or (Any,) * len(value), strict=True)
    return tuple(port_value(item, kind, knowledge, (*path, n)) for n, (item, kind) in enumerate(pairs))


def _record(value: Any, record: type, knowledge: Knowledge, path: Path) -> Any:
    """Converts a mapping of fields to a dataclass."""
    hints = field_types(record)
    plain = [unitless_name(field.name) for field in dataclasses.fields(record)]
    if not isinstance(value, dict):
        raise _refusal(value, f"a mapping with {listing(plain)}", path)
    read: dict[str, Any] = {}
    for key, item in value.items():
        name = _named(str(key), hints)
        if name is None:
            what = f"there is no field '{key}'"
            raise PortValueError((*path, str(key)), what, suggestion(str(key), plain))
        read[name] = port_value(item, hints[name], knowledge, (*path, str(key)))
    filled = {**_DEFAULTS.get(record, {}), **read}
    for name in required_fields(record):
        if name not in filled:
            raise PortValueError(path, f"'{unitless_name(name)}' is missing", f"give {listing(plain)}")
    try:
        return record(**filled)
    except (ValueError, TypeError) as error:
        raise PortValueError(path, str(error), f"give {listing(plain)}") from error


def _word(value: Any, words: type[enum.Enum], path: Path) -> enum.Enum:
    for member in words:
        if value in (member.value, member.name, member.name.lower()):
            return member
    known = [str(member.value) for member in words]
    raise PortValueError(path, f"{value!r} is none of its words", suggestion(str(value), known))


def _plain(value: Any, hint: Any, path: Path) -> Any:
    """Checks a number, a text, a truth value or null."""
    if hint not in _PLAIN:
        how = f"let an earlier step give it, and write {{{FROM_KEY}: NAME}}"
        raise PortValueError(path, "such a value cannot be written in a file", how)
    kinds, wanted = _PLAIN[hint]
    fits = isinstance(value, kinds) and (hint is bool or not isinstance(value, bool))
    if not fits or (isinstance(value, float) and not math.isfinite(value)):
        raise _refusal(value, wanted, path)
    return float(value) if hint is float else value


def _pose(value: Any, knowledge: Knowledge, path: Path) -> Pose2D:
    """Converts the name of a place to its pose."""
    name = _name(value, "x, y and yaw, or the name of a place", path)
    place = knowledge.place(name)
    if place is None:
        raise _unknown("place", name, knowledge.place_names(), knowledge, path)
    return knowledge.place_pose(place).pose_2d()


def _surface(value: Any, knowledge: Knowledge, path: Path) -> Surface:
    """Converts the name of a surface to the surface."""
    name = _name(value, "the name of a surface", path)
    known = knowledge.place(name)
    if known is None or known not in knowledge.surfaces:
        raise _unknown("surface", name, tuple(knowledge.surfaces), knowledge, path)
    return knowledge.surfaces[known].surface(known)


def _surfaces(name: str, knowledge: Knowledge, path: Path) -> tuple[Surface, ...]:
    """Converts the name of a room to the surfaces in it, or the name of a surface to that surface alone."""
    place = knowledge.place(name)
    surfaces = () if place is None else knowledge.surfaces_in(place)
    if not surfaces:
        known = tuple(one for one in knowledge.place_names() if knowledge.surfaces_in(one))
        raise _unknown("surface or room with surfaces", name, known, knowledge, path)
    return tuple(_surface(surface, knowledge, path) for surface in surfaces)


def _object_kind(value: Any, knowledge: Knowledge, path: Path) -> ObjectKind:
    """Converts the words for an object to the object with its own name."""
    said = parse_object(_name(value, "an object in words", path))
    known = knowledge.object_name(said.name)
    if known is None:
        raise _unknown("object", said.name, knowledge.object_names(), knowledge, path)
    return ObjectKind(known, said.attributes)


def _name(value: Any, wanted: str, path: Path) -> str:
    if not isinstance(value, str) or not value.strip():
        raise _refusal(value, wanted, path)
    return value


def _refusal(value: Any, wanted: str, path: Path) -> PortValueError:
    fault = "it is empty" if value is None else f"{str(value)[:60]!r} does not fit"
    return PortValueError(path, fault, f"give {wanted}")


def _unknown(kind: str, name: str, known: tuple[str, ...], knowledge: Knowledge, path: Path) -> PortValueError:
    hint = suggestion(name, knowledge.spellings(known), shown=known)
    return PortValueError(path, f"unknown {kind} '{name}'", hint)


_PLAIN: Final[Mapping[Any, tuple[tuple[type, ...], str]]] = {
    str: ((str,), "a text"),
    bool: ((bool,), "true or false"),
    int: ((int,), "a whole number"),
    float: ((int, float), "a number"),
    NoneType: ((NoneType,), "nothing (null)"),
}
_SPECIAL: Final[Mapping[type, Callable[[Any, Knowledge, Path], Any]]] = {
    Pose2D: _pose,
    Surface: _surface,
    ObjectKind: _object_kind,
}
_DEFAULTS: Final[Mapping[type, Mapping[str, Any]]] = {Pose2D: MappingProxyType({"yaw_rad": 0.0})}
