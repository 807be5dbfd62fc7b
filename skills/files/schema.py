"""A YAML document checked against a pydantic model; errors name the line and what would fit."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from itertools import pairwise
from types import UnionType
from typing import Annotated, Any, Final, ForwardRef, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, Field, ValidationError
from pydantic_core import ErrorDetails
from typing_extensions import TypeAliasType

from skills.files.errors import InputError, did_you_mean, few, suggestion
from skills.files.schema_errors import plain_hint, plain_words
from skills.files.yaml_nodes import KeyPath, quoted
from skills.files.yaml_source import YamlSource
from skills.quantities import QuantityError, without_range

__all__ = ["Name", "Text", "validate"]

_FIRST = r"[^\s\x00-\x1f\x7f\u200b-\u200f\u2060\ufeff]"
Text = Annotated[str, Field(min_length=1, pattern=rf"^\s*{_FIRST}[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$")]
"""A text in a file: not blank, without control characters."""
Name = Annotated[str, Field(min_length=1, pattern=rf"^ *{_FIRST}[^\x00-\x1f\x7f]*$")]
"""A name in a file: the same on one line."""

ModelT = TypeVar("ModelT", bound=BaseModel)
MOST_ERRORS: Final = 500
"""So many errors of one file are looked at."""


def validate(model: type[ModelT], source: YamlSource) -> ModelT:
    """The document as `model`.

    Raises:
        InputError: the first thing that does not fit the model, with its line and what would fit; the rest in `others`.
    """
    if not isinstance(source.data, dict):
        hint = f"begin with the keys {few(_field_names(model))}"
        raise InputError("the file holds no mapping of keys to values", hint=hint, file=source.path, line=1)
    known = _field_names(model)
    if source.data and not any(key in known or did_you_mean(str(key)[:40], known) for key in source.data):
        what, hint = "none of its keys is known here", f"begin with the keys {few(known)}"
        raise InputError(what, hint=hint, file=source.path, line=1)
    try:
        return model.model_validate(source.data, by_alias=True, by_name=False)
    except ValidationError as error:
        telling = _telling(error.errors()[:MOST_ERRORS], source)
        first, *others = [_input_error(model, source, faults) for faults in telling]
        raise InputError(first.message, hint=first.hint, file=first.file, line=first.line, others=others) from error


def _telling(errors: list[ErrorDetails], source: YamlSource) -> list[list[ErrorDetails]]:
    """The errors that tell most, by place: one, or what is wrong with each kind of value that could stand there.

    What an unknown key has brought about is left out.
    """
    paths = {id(error): _path(error, source) for error in errors}
    misspelled = {paths[id(error)][:-1] for error in errors if error["type"] == "extra_forbidden"}
    above = {path[:n] for path in paths.values() for n in range(len(path))}
    own = [error for error in errors if not (error["type"] == "too_short" and paths[id(error)] in above)]
    causes = (e for e in own if e["type"] == "extra_forbidden" or _parent(e, paths[id(e)]) not in misspelled)
    ordered = sorted(causes, key=lambda e: (e["type"] != "extra_forbidden", source.line(paths[id(e)])))
    places: dict[KeyPath, list[ErrorDetails]] = {}
    for error in ordered:
        places.setdefault(paths[id(error)], []).append(error)
    return [those if len(those[0]["loc"]) > len(place) else those[:1] for place, those in places.items()]


def _parent(error: ErrorDetails, path: KeyPath) -> KeyPath:
    """Where a key is missing or several do not go together."""
    return path[:-1] if error["type"] == "missing" else path


def _path(error: ErrorDetails, source: YamlSource) -> KeyPath:
    """Where an error is, without the names of the kinds of values that could stand there."""
    *parts, last = (part for part in error["loc"] if part != "[key]") if error["loc"] else ("",)
    path: list[str | int] = []
    data = source.data
    for part in parts:
        if _is_in(part, data):
            path.append(part)
            data = data[part]
    if error["type"] in ("missing", "extra_forbidden") or _is_in(last, data):
        path.append(last)
    return tuple(path)


def _is_in(part: str | int, data: Any) -> bool:
    if isinstance(data, dict):
        return part in data
    return isinstance(data, list) and isinstance(part, int) and 0 <= part < len(data)


def _input_error(model: type[BaseModel], source: YamlSource, errors: list[ErrorDetails]) -> InputError:
    """What pydantic says of one place, told with the place and a hint."""
    error = errors[0]
    path = _path(error, source)
    where = ".".join(str(part) for part in path)
    known = _field_names(*_models_at(model, path[:-1]))
    if error["type"] == "extra_forbidden":
        hint = suggestion(str(path[-1]), known, f"known keys are {few(known)}")
        return source.error(path, f"unknown {quoted(path[-1])}", hint)
    if error["type"] == "missing" and isinstance(path[-1], int):
        parts = ".".join(str(part) for part in path[:-1])
        return source.error(path[:-1], f"{parts}: it should have more parts than {path[-1]}", "add what is missing")
    if error["type"] == "missing":
        parent = ".".join(str(part) for part in path[:-1]) or "the file"
        return source.error(path[:-1], f"key {path[-1]!r} is missing in {parent}", f"add {path[-1]!r}")
    what = " or ".join(dict.fromkeys(map(plain_words, errors))).replace(" or should be ", " or ")
    telling = next((each for each in errors if isinstance(each.get("ctx", {}).get("error"), QuantityError)), error)
    hint = _comma_hint(error, path, source) or plain_hint(telling, source.words.get(path))
    return source.error(path, f"{where or 'the file'}: {what[:1].lower()}{what[1:]}", hint)


def _comma_hint(error: ErrorDetails, path: KeyPath, source: YamlSource) -> str | None:
    """What to write for `{battery: 0,3}`, in which YAML sees the keys battery and 3; None for anything else."""
    if error["type"] != "invalid_key":
        return None
    above: Any = source.data
    for part in path[:-1]:
        above = above[part]
    if not isinstance(above, Mapping):
        return None
    before = next((key for key, after in pairwise(above) if after == path[-1] and above[after] is None), None)
    whole = before is not None and type(above[before]) is int and type(path[-1]) is int
    return f"write '{before}: {above[before]}.{path[-1]}', with a point" if whole else None


def _field_names(*models: type[BaseModel]) -> list[str]:
    """The keys of models, those that are required first."""
    fields = [item for model in models for item in model.model_fields.items()]
    ordered = sorted(fields, key=lambda item: not item[1].is_required())
    return list(dict.fromkeys(field.alias or name for name, field in ordered))


def _models_at(model: type[BaseModel], path: KeyPath) -> tuple[type[BaseModel], ...]:
    """The models of which one describes what stands at `path`, following fields, mappings and lists."""
    kinds: tuple[Any, ...] = (model,)
    for part in path:
        kinds = tuple(inner for kind in kinds for inner in _inside(kind, part))
    return tuple(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel))


def _inside(kind: Any, part: str | int) -> tuple[Any, ...]:
    """The types that may stand under `part` in something of a type."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        field = next((f for n, f in kind.model_fields.items() if (f.alias or n) == part), None)
        return () if field is None else _choices(field.annotation)
    items = [arg for arg in get_args(kind) if arg is not Ellipsis]
    return _choices(items[-1]) if items else ()


def _choices(hint: Any) -> tuple[Any, ...]:
    """The types that a hint allows, without ranges and the names of types."""
    plain = without_range(hint)
    if isinstance(plain, TypeAliasType):
        value = without_range(plain.__value__)
        named = isinstance(value, ForwardRef) and vars(sys.modules[str(plain.__module__)])[value.__forward_arg__]
        return _choices(named or value)
    if get_origin(plain) in (Union, UnionType):
        return tuple(choice for arg in get_args(plain) for choice in _choices(arg))
    return (plain,)
