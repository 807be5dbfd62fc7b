"""YAML files that remember their lines, checked against a pydantic model; errors name the place and the mend."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from executive.errors import InputError, did_you_mean, listing

__all__ = ["YamlSource", "read_yaml", "validate"]

ModelT = TypeVar("ModelT", bound=BaseModel)
KeyPath = tuple[str | int, ...]


@dataclass(frozen=True)
class YamlSource:
    """A YAML document: its data, and the line (from 1) at which each key or list item stands."""

    path: Path
    data: Any
    lines: Mapping[KeyPath, int]

    def line(self, path: KeyPath) -> int:
        """The line of `path`, or of the nearest part of it that stands in the file."""
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in self.lines), None)
        return 1 if known is None else self.lines[known]

    def error(self, path: KeyPath, message: str, mend: str = "") -> InputError:
        """An error at `path`."""
        return InputError(message, mend=mend, file=self.path, line=self.line(path))


def read_yaml(path: Path | str) -> YamlSource:
    """Read one YAML document of plain data.

    Raises:
        InputError: the file cannot be read, is no YAML, or has a key twice.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        data = yaml.safe_load(text)
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", mend="name a file that exists", file=file) from error
    except UnicodeDecodeError as error:
        raise InputError("it is no UTF-8 text", mend="save it as UTF-8", file=file) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = 1 if mark is None else mark.line + 1
        what = f"broken YAML: {error.problem or error.context}"
        raise InputError(what, mend="mend the indentation, brackets or quotes here", file=file, line=line) from error
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f"broken YAML: {error}", mend="mend it", file=file, line=1) from error
    lines: dict[KeyPath, int] = {}
    for key_path, line in _walk(root, ()):
        if key_path in lines:
            what = f"key {key_path[-1]!r} stands twice (first in line {lines[key_path]})"
            raise InputError(what, mend="remove one of the two", file=file, line=line)
        lines[key_path] = line
    return YamlSource(file, data, lines)


def _walk(node: yaml.Node | None, path: KeyPath) -> Iterator[tuple[KeyPath, int]]:
    """Every key and list item below `node` with its line."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            yield (*path, key.value), key.start_mark.line + 1
            yield from _walk(value, (*path, key.value))
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield (*path, index), item.start_mark.line + 1
            yield from _walk(item, (*path, index))


def validate(model: type[ModelT], source: YamlSource) -> ModelT:
    """The document as `model`.

    Raises:
        InputError: the first thing that does not fit the model, with its line and what would fit.
    """
    if not isinstance(source.data, dict):
        mend = f"begin with the keys {listing(_field_names(model))}"
        raise InputError("the file holds no mapping of keys to values", mend=mend, file=source.path, line=1)
    try:
        return model.model_validate(source.data)
    except ValidationError as error:
        first = min(error.errors(), key=lambda e: (e["type"] != "extra_forbidden", source.line(_path(e))))
        raise _input_error(model, source, first) from error


def _path(error: ErrorDetails) -> KeyPath:
    return tuple(part for part in error["loc"] if part != "[key]")


def _input_error(model: type[BaseModel], source: YamlSource, error: ErrorDetails) -> InputError:
    """A pydantic error, told with its place and its mend."""
    path = _path(error)
    where = ".".join(str(part) for part in path)
    known = _field_names(_model_at(model, path[:-1]))
    if error["type"] == "extra_forbidden":
        near = did_you_mean(str(path[-1]), known)
        mend = f"did you mean {near!r}?" if near else f"known keys are {listing(known)}"
        return source.error(path, f"unknown key {path[-1]!r}", mend)
    if error["type"] == "missing":
        parent = ".".join(str(part) for part in path[:-1]) or "the file"
        return source.error(path[:-1], f"key {path[-1]!r} is missing in {parent}", f"add {path[-1]!r}")
    what = error["msg"].removeprefix("Value error, ")
    return source.error(
        path, f"{where or 'the file'}: {what[:1].lower()}{what[1:]}", f"it reads {error['input']!r} now"[:120]
    )


def _field_names(model: type[BaseModel] | None) -> list[str]:
    return [] if model is None else [field.alias or name for name, field in model.model_fields.items()]


def _model_at(model: type[BaseModel], path: KeyPath) -> type[BaseModel] | None:
    """The model that describes what stands at `path`, following fields, mappings and lists."""
    kind: Any = model
    for part in path:
        kind = _inside(kind, part)
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _inside(kind: Any, part: str | int) -> Any:
    """The annotation of what stands under `part` in something annotated `kind`."""
    fields = {f.alias or n: f.annotation for n, f in getattr(kind, "model_fields", {}).items()}
    items = [arg for arg in get_args(kind) if arg is not Ellipsis]
    inner = fields[part] if part in fields else next(iter(items[-1:]), None)
    optional = get_origin(inner) in (Union, UnionType)
    return next(arg for arg in get_args(inner) if arg is not type(None)) if optional else inner
