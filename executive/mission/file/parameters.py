"""Parameters of mission files: `${name}` in a value stands for what the parameter holds; `$${` is a plain `${`.

A value that is nothing but `${name}` takes the parameter's own type, so that `timeout: ${limit}` can be a number;
within a longer text the parameter's text is put in.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

import yaml

from executive.mission.errors import InputError, did_you_mean, listing, suggestion
from executive.mission.file.model import KeyPath
from executive.mission.yaml_source import YamlSource

__all__ = ["Given", "given_values", "values_in_json", "with_parameters"]

_REFERENCE: Final = re.compile(r"\$(\$)?\{([^{}]*)\}")
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SCALARS: Final = (str, bool, int, float)
DECLARED: Final = "parameters"

Given = Mapping[str, Any]


def given_values(settings: Iterable[str]) -> dict[str, Any]:
    """Values in the form NAME=VALUE, each as YAML has it: `2.5` is a number. Raises InputError."""
    values: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError:
            value = None
        if not equals or not _can_be_given(name, value):
            hint = "give a name, =, and a text, a number, true or false"
            raise InputError(f"--set {setting[:60]}: it is not NAME=VALUE", hint=hint)
        values[name] = value
    return values


def values_in_json(text: bytes) -> dict[str, Any]:
    """Values in a JSON object, each as `given_values` takes them; none in an empty text. Raises InputError."""
    try:
        values = json.loads(text) if text.strip() else {}
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        raise InputError("the values are no JSON object", hint='give one such as {"room": "kitchen"}, or nothing')
    wrong = next((name for name, value in values.items() if not _can_be_given(name, value)), None)
    if wrong is not None:
        hint = "give each name a text, a number, true or false"
        raise InputError(f"'{wrong[:60]}' is not a name with a value", hint=hint)
    return values


def _can_be_given(name: str, value: Any) -> bool:
    finite = not isinstance(value, float) or math.isfinite(value)
    return bool(_NAME.fullmatch(name)) and isinstance(value, _SCALARS) and finite


def with_parameters(source: YamlSource, given: Given) -> YamlSource:
    """The document with its parameters put in: those that are given, else their defaults.

    Raises:
        InputError: a name that is no word, a parameter without a value, or `${name}` of one that is not declared.
    """
    if not isinstance(source.data, dict):
        return source
    declared = _declared(source)
    unknown = [name for name in given if name not in declared]
    if unknown:
        known = f"it has {listing(declared)}" if declared else "it declares none"
        hint = suggestion(unknown[0], declared, known)
        raise InputError(f"{source.path.name} has no parameter '{unknown[0]}'", hint=hint)
    values = {**declared, **given}
    for name, value in values.items():
        if value is None:
            hint = f"give it a default, or 'with: {{{name}: ...}}' where the file is used"
            raise source.error((DECLARED, name), f"parameter '{name}' has no value", hint)
    data = {
        key: part if key == DECLARED else _put_in(part, values, source, (key,)) for key, part in source.data.items()
    }
    return replace(source, data=data)


def _declared(source: YamlSource) -> dict[str, Any]:
    """The parameters with their defaults; what is no mapping is left to the schema to refuse."""
    declared = source.data.get(DECLARED)
    if not isinstance(declared, dict):
        return {}
    for name, default in declared.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            hint = "use letters, digits and underscores, a letter first"
            raise source.error((DECLARED, str(name)), f"{name!r} cannot be a parameter's name", hint)
        if default is not None and not isinstance(default, _SCALARS):
            hint = "give it a text, a number, true or false"
            raise source.error((DECLARED, name), f"parameter '{name}' cannot hold {type(default).__name__}", hint)
    return dict(declared)


def _put_in(value: Any, values: Mapping[str, Any], source: YamlSource, path: KeyPath) -> Any:
    if isinstance(value, str):
        return _text(value, values, source, path)
    if isinstance(value, dict):
        return {key: _put_in(part, values, source, (*path, str(key))) for key, part in value.items()}
    if isinstance(value, list):
        return [_put_in(part, values, source, (*path, index)) for index, part in enumerate(value)]
    return value


def _text(text: str, values: Mapping[str, Any], source: YamlSource, path: KeyPath) -> Any:
    if "${" not in text:
        return text
    whole = _REFERENCE.fullmatch(text)
    if whole is not None and not whole[1]:
        return _value(whole[2], values, source, path)

    def replaced(match: re.Match[str]) -> str:
        return f"${{{match[2]}}}" if match[1] else str(_value(match[2], values, source, path))

    return _REFERENCE.sub(replaced, text)


def _value(name: str, values: Mapping[str, Any], source: YamlSource, path: KeyPath) -> Any:
    if name not in values:
        near = did_you_mean(name, values)
        known = f"declared are {listing(values)}" if values else _how_to_declare(source)
        hint = f"did you mean '${{{near}}}'?" if near else known
        raise source.error(path, f"unknown parameter '{name}'", hint)
    return values[name]


def _how_to_declare(source: YamlSource) -> str:
    misspelled = did_you_mean(DECLARED, (str(key) for key in source.data))
    if misspelled is not None and DECLARED not in source.data:
        return f"did you mean '{DECLARED}' by '{misspelled}'?"
    return f"declare it under '{DECLARED}' with its default"
