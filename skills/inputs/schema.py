"""Checks YAML documents against pydantic models; errors name the line and what would fit."""

import re
import sys
from collections.abc import Mapping
from itertools import pairwise
from types import MappingProxyType, UnionType
from typing import Annotated, Any, Final, ForwardRef, TypeVar, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails
from typing_extensions import TypeAliasType

from skills.inputs.errors import MOST_LISTED, InputError, listing, nearest_name, short_list, suggestion
from skills.inputs.yaml_source import KeyPath, YamlSource, quoted_key
from skills.quantities import QuantityError, base_type, display_text

_FIRST = r"[^\s\x00-\x1f\x7f\u200b-\u200f\u2060\ufeff]"
Text = Annotated[str, Field(min_length=1, pattern=rf"^\s*{_FIRST}[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$")]
"""A text in a file: not blank, without control characters."""
Name = Annotated[str, Field(min_length=1, pattern=rf"^ *{_FIRST}[^\x00-\x1f\x7f]*$")]
"""A name in a file: a text on one line."""

ModelT = TypeVar("ModelT", bound=BaseModel)


def matching(pattern: str, what: str, hint: str) -> AfterValidator:
    """Validator of a text by a pattern; an error says `what` it should be, and the `hint`."""

    def checked(text: str) -> str:
        if re.fullmatch(pattern, text) is None:
            raise QuantityError(what, hint)
        return text

    return AfterValidator(checked)


MOST_ERRORS: Final = 500
"""Errors of one file that are considered."""
_PLAIN_WORDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "model_type": "should be a mapping of keys to values",
        "model_attributes_type": "should be a mapping of keys to values",
        "dataclass_type": "should be a mapping of keys to values",
        "dict_type": "should be a mapping of keys to values",
        "tuple_type": "should be a list",
        "list_type": "should be a list",
        "string_type": "should be a text",
        "float_type": "should be a number",
        "float_parsing": "should be a number",
        "int_type": "should be a whole number",
        "int_parsing": "should be a whole number",
        "int_from_float": "should be a whole number",
        "bool_type": "should be true or false",
        "bool_parsing": "should be true or false",
        "string_too_short": "should not be empty",
        "too_short": "should not be empty",
        "too_long": "has too many parts",
        "string_pattern_mismatch": "should hold something that can be seen, and no control characters",
        "finite_number": "should be a finite number",
        "invalid_key": "the key should be a text",
        "missing": "is missing",
        "extra_forbidden": "is unknown",
        "unexpected_keyword_argument": "is unknown",
    }
)


class Strict(BaseModel):
    """Immutable model of a mapping; unknown keys are errors. Code uses field names, files use their aliases."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, validate_by_name=True, validate_by_alias=True, defer_build=True
    )


def validate(model: type[ModelT], source: YamlSource) -> ModelT:
    """Validates a document by a model.

    Raises:
        InputError: the first error with its line and what would fit; `others` has the rest.
    """
    if not isinstance(source.data, dict):
        hint = f"begin with the keys {short_list(_field_names(model))}"
        raise InputError("the file holds no mapping of keys to values", hint=hint, file=source.path, line=1)
    known = _field_names(model)
    if source.data and not any(key in known or nearest_name(str(key)[:40], known) for key in source.data):
        what, hint = "none of its keys is known here", f"begin with the keys {short_list(known)}"
        raise InputError(what, hint=hint, file=source.path, line=1)
    try:
        return model.model_validate(source.data, by_alias=True, by_name=False)
    except ValidationError as error:
        places = _most_telling(error.errors()[:MOST_ERRORS], source)
        first, *others = [_input_error(model, source, faults) for faults in places]
        raise InputError(first.message, hint=first.hint, file=first.file, line=first.line, others=others) from error


def _most_telling(errors: list[ErrorDetails], source: YamlSource) -> list[list[ErrorDetails]]:
    """Returns the most informative errors at each location: one, or one for each kind of value that may stand there.

    Omits errors that an unknown key has caused.
    """
    paths = {id(error): _path(error, source) for error in errors}
    misspelled = {paths[id(error)][:-1] for error in errors if error["type"] == "extra_forbidden"}
    above = {path[:n] for path in paths.values() for n in range(len(path))}
    own = [error for error in errors if not (error["type"] == "too_short" and paths[id(error)] in above)]
    parents = {id(e): paths[id(e)][:-1] if e["type"] == "missing" else paths[id(e)] for e in own}
    causes = (e for e in own if e["type"] == "extra_forbidden" or parents[id(e)] not in misspelled)
    ordered = sorted(causes, key=lambda e: (e["type"] != "extra_forbidden", source.line(paths[id(e)])))
    places: dict[KeyPath, list[ErrorDetails]] = {}
    for error in ordered:
        places.setdefault(paths[id(error)], []).append(error)
    return [those if len(those[0]["loc"]) > len(place) else those[:1] for place, those in places.items()]


def _path(error: ErrorDetails, source: YamlSource) -> KeyPath:
    """Path of an error in the file, without the names of the alternative value kinds."""
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
    """Converts the pydantic errors at one location to an error with its line and a hint."""
    error = errors[0]
    path = _path(error, source)
    where = ".".join(str(part) for part in path)
    known = _field_names(*_models_at(model, path[:-1]))
    if error["type"] == "extra_forbidden":
        hint = suggestion(str(path[-1]), known, f"known keys are {short_list(known)}")
        return source.error(path, f"unknown {quoted_key(path[-1])}", hint)
    if error["type"] == "missing" and isinstance(path[-1], int):
        parts = ".".join(str(part) for part in path[:-1])
        return source.error(path[:-1], f"{parts}: it should have more parts than {path[-1]}", "add what is missing")
    if error["type"] == "missing":
        parent = ".".join(str(part) for part in path[:-1]) or "the file"
        return source.error(path[:-1], f"key {path[-1]!r} is missing in {parent}", f"add {path[-1]!r}")
    what = " or ".join(dict.fromkeys(map(_plain_words, errors))).replace(" or should be ", " or ")
    telling = next((each for each in errors if isinstance(each.get("ctx", {}).get("error"), QuantityError)), error)
    hint = _comma_hint(error, path, source) or _plain_hint(telling, source.words.get(path))
    return source.error(path, f"{where or 'the file'}: {what[:1].lower()}{what[1:]}", hint)


def _comma_hint(error: ErrorDetails, path: KeyPath, source: YamlSource) -> str | None:
    """Hint for `{battery: 0,3}`, in which YAML sees the keys battery and 3; None for anything else."""
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
    """Keys of the models, the required ones first."""
    fields = [item for model in models for item in model.model_fields.items()]
    ordered = sorted(fields, key=lambda item: not item[1].is_required())
    return list(dict.fromkeys(field.alias or name for name, field in ordered))


def _models_at(model: type[BaseModel], path: KeyPath) -> tuple[type[BaseModel], ...]:
    """Models that may describe the value at `path`; follows fields, mappings and lists."""
    kinds: tuple[Any, ...] = (model,)
    for part in path:
        kinds = tuple(inner for kind in kinds for inner in _inside(kind, part))
    return tuple(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel))


def _inside(kind: Any, part: str | int) -> tuple[Any, ...]:
    """Types that may stand under `part` in a value of a type."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        field = next((f for n, f in kind.model_fields.items() if (f.alias or n) == part), None)
        return () if field is None else _choices(field.annotation)
    items = [arg for arg in get_args(kind) if arg is not Ellipsis]
    return _choices(items[-1]) if items else ()


def _choices(hint: Any) -> tuple[Any, ...]:
    """Types that a type hint allows, without ranges and aliases."""
    plain = base_type(hint)
    if isinstance(plain, TypeAliasType):
        value = base_type(plain.__value__)
        named = isinstance(value, ForwardRef) and vars(sys.modules[str(plain.__module__)])[value.__forward_arg__]
        return _choices(named or value)
    if get_origin(plain) in (Union, UnionType):
        return tuple(choice for arg in get_args(plain) for choice in _choices(arg))
    return (plain,)


def first_error(errors: list[ErrorDetails]) -> tuple[tuple[Any, ...], str, str]:
    """Returns location, words and hint for the first error; an unknown key comes before a missing one."""
    first = min(errors, key=lambda each: each["type"] not in ("extra_forbidden", "unexpected_keyword_argument"))
    return first["loc"], _plain_words(first), _plain_hint(first)


def _plain_words(error: ErrorDetails) -> str:
    """Describes what is wrong: "should be from 0 to 1"."""
    kind, context = error["type"], error.get("ctx", {})
    if isinstance(context.get("error"), QuantityError):
        return str(context["error"].what)
    if kind == "too_short" and context["min_length"] > 1:
        return f"should have {context['min_length']} parts or more"
    if kind in ("literal_error", "enum"):
        words = [f"'{word}'" for word in _allowed(error)]
        if len(words) > MOST_LISTED:
            return f"should be {', '.join(words[:MOST_LISTED])} or one of {len(words) - MOST_LISTED} more"
        return f"should be {listing(words, last='or')}"
    said = _PLAIN_WORDS.get(kind, error["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, "))
    return f"should be {said.removeprefix('Input should be ')}" if said.startswith("Input should be ") else said


def _plain_hint(error: ErrorDetails, word: str | None = None) -> str:
    """Says what to do about an error; `word` is the text in the file where YAML reads it as true or false."""
    value = error.get("input")
    refusal = error.get("ctx", {}).get("error")
    if isinstance(refusal, QuantityError):
        return refusal.hint
    if error["type"] == "string_type" and isinstance(value, bool):
        said = word or ("yes" if value else "no")
        return f'put it in quotes: "{said}"' if word else f'put it in quotes, as in "{said}"'
    if error["type"] == "string_type" and isinstance(value, int | float):
        return f'put it in quotes: "{value if isinstance(value, float) else display_text(value)}"'
    if error["type"] in ("invalid_key", "missing"):
        return "put the key in quotes" if error["type"] == "invalid_key" else f"write '{error['loc'][-1]}: ...'"
    near = nearest_name(str(value), (word for word in _allowed(error) if word != str(value)))
    return f"it reads {display_text(value)} now" if near is None else f"did you mean '{near}'?"


def _allowed(error: ErrorDetails) -> list[str]:
    """Words that a value may take; empty when any word is allowed."""
    expected = str(error.get("ctx", {}).get("expected", ""))
    return [word.strip().strip("'") for part in expected.split(" or ") for word in part.split(", ") if word.strip()]
