"""YAML files that remember their lines, checked against a pydantic model; errors name the place and the hint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Final, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, Field, ValidationError
from pydantic_core import ErrorDetails

from skills.files.errors import InputError, did_you_mean, few, suggestion
from skills.files.outside import read_text
from skills.files.schema_errors import plain_hint, plain_words
from skills.files.yaml_nodes import MOST_NESTED, KeyPath, data_and_lines, quoted
from skills.files.yaml_scalars import as_written, truth_words
from skills.quantities import QuantityError, without_range

__all__ = ["KeyPath", "Name", "Text", "YamlSource", "read_yaml", "validate"]

_FIRST = r"[^\s\x00-\x1f\x7f\u200b-\u200f\u2060\ufeff]"
Text = Annotated[str, Field(min_length=1, pattern=rf"^\s*{_FIRST}[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$")]
"""A text in a file: not blank, without control characters."""
Name = Annotated[str, Field(min_length=1, pattern=rf"^ *{_FIRST}[^\x00-\x1f\x7f]*$")]
"""A name in a file: the same on one line."""

ModelT = TypeVar("ModelT", bound=BaseModel)
MAX_BYTES: Final = 1_000_000
MOST_ERRORS: Final = 500
"""So many errors of one file are looked at."""
_SURELY_FLAT: Final = 1_000
"""A text with fewer brackets and letters in a line is not checked for its depth by an own pass."""
_SECOND: Final = "but found another document"


@dataclass(frozen=True)
class YamlSource:
    """A YAML document: its data, and the line (from 1) at which each key or list item stands.

    `words` are those that YAML takes for true or false ("no", "on"), by their places.
    """

    path: Path
    data: Any
    lines: Mapping[KeyPath, int]
    first_line: int = 1
    words: Mapping[KeyPath, str] = field(default_factory=dict)

    def line(self, path: KeyPath) -> int:
        """The line of `path`, or of the nearest part of it that stands in the file."""
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in self.lines), None)
        return self.first_line if known is None else self.lines[known]

    def error(self, path: KeyPath, message: str, hint: str = "") -> InputError:
        """An error at `path`."""
        return InputError(message, hint=hint, file=self.path, line=self.line(path))


def read_yaml(
    path: Path | str, tags: frozenset[str] = frozenset(), *, hint: str = "name a file that exists"
) -> YamlSource:
    """Read one YAML document of plain data; `tags` are those that may stand in it, `hint` is for a missing file.

    Raises:
        InputError: the file cannot be read, is too large, is no YAML, or has a key twice, or a tag.
    """
    file = Path(path)
    text = read_text(file, most_bytes=MAX_BYTES, hint=hint)
    try:
        _refuse_deep(text, file)
        root = as_written(_composed(text))
        data, lines = data_and_lines(root, file, tags)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = 1 if mark is None else mark.line + 1
        if error.problem and _SECOND in error.problem:
            hint = "end the file before this line"
            raise InputError("it holds more than one document", hint=hint, file=file, line=line) from error
        what = f"broken YAML: {error.problem or error.context}"
        raise InputError(what, hint="correct the indentation, brackets or quotes here", file=file, line=line) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        what = f"broken YAML: the character {chr(error.character)!r} cannot stand in a text"
        raise InputError(what, hint="remove it", file=file, line=line) from error
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f"broken YAML: {error}", hint="correct it", file=file, line=1) from error
    except RecursionError as error:
        raise InputError("it is nested too deeply", hint="write it flatter", file=file, line=1) from error
    return YamlSource(file, data, lines, words=truth_words(root))


def _refuse_deep(text: str, file: Path) -> None:
    """Raise InputError before the composer, which calls itself for each level, runs out of stack."""
    most = text.count("[") + text.count("{") + max(map(len, text.splitlines()), default=0)
    if most <= _SURELY_FLAT:
        return
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_NESTED:
            what = f"it is nested more than {MOST_NESTED} deep"
            line = 1 if event.start_mark is None else event.start_mark.line + 1
            raise InputError(what, hint="write it flatter", file=file, line=line)


def _composed(text: str) -> yaml.Node | None:
    """The document as nodes, read fast; of a broken one the slow reader says more."""
    try:
        node: yaml.Node | None = yaml.compose(text, Loader=yaml.CSafeLoader)
    except yaml.YAMLError:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    return node


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
        return model.model_validate(source.data)
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
    known = _field_names(_model_at(model, path[:-1]))
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
    before = next((key for key, after in pairwise(above) if after == path[-1] and above[after] is None), None)
    whole = before is not None and type(above[before]) is int and type(path[-1]) is int
    return f"write '{before}: {above[before]}.{path[-1]}', with a point" if whole else None


def _field_names(model: type[BaseModel] | None) -> list[str]:
    """The keys of a model, those that are required first."""
    fields = [] if model is None else list(model.model_fields.items())
    ordered = sorted(fields, key=lambda item: not item[1].is_required())
    return [field.alias or name for name, field in ordered]


def _model_at(model: type[BaseModel], path: KeyPath) -> type[BaseModel] | None:
    """The model that describes what stands at `path`."""
    kind = without_range(_kind_at(model, path))
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _kind_at(model: type[BaseModel], path: KeyPath) -> Any:
    """The annotation of what stands at `path`, following fields, mappings and lists."""
    kind: Any = model
    for part in path:
        kind = _inside(kind, part)
    return kind


def _inside(kind: Any, part: str | int) -> Any:
    """The annotation of what stands under `part` in something annotated `kind`."""
    kind = without_range(kind)
    fields = {f.alias or n: Annotated[f.annotation, f] for n, f in getattr(kind, "model_fields", {}).items()}
    items = [arg for arg in get_args(kind) if arg is not Ellipsis]
    inner = fields[part] if part in fields else next(iter(items[-1:]), None)
    plain = without_range(inner)
    optional = get_origin(plain) in (Union, UnionType)
    return next(arg for arg in get_args(plain) if arg is not type(None)) if optional else inner
