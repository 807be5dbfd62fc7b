"""Parameters of mission files: `${name}` in a value stands for the parameter's value; `$${` is a plain `${`.

A file declares a parameter by a default value, which fixes its type, or as {type: .., default: .., choices: [..]}.

A value that is only `${name}` takes the parameter's own type, so that `timeout: ${limit}` can be a number; within a
longer text the parameter's text is inserted.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

import yaml

from executive.words.expression import Value
from executive.words.mission import Parameter
from skills.inputs.errors import InputError, listing, nearest_name, suggestion, with_article
from skills.inputs.outside import json_object, plain_text
from skills.inputs.yaml_source import KeyPath, YamlSource, scalar_of
from skills.quantities import LARGEST, Number, correction, display_text

_REFERENCE: Final = re.compile(r"\$(\$)?\{([^{}]*)\}")
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_SCALARS: Final = (str, bool, int, float)
DECLARED: Final = "parameters"
_TYPES: Final[Mapping[str, tuple[type, ...]]] = {
    "text": (str,),
    "number": (int, float),
    "truth": (bool,),
    "place": (str,),
    "object": (str,),
    "person": (str,),
}
_TEXTS: Final = frozenset(name for name, kinds in _TYPES.items() if str in kinds)

Given = Mapping[str, Any]


def parse_values(settings: Iterable[str]) -> dict[str, Any]:
    """Parses values in the form NAME=VALUE, each as in YAML: `2.5` is a number. Raises InputError for other forms."""
    values: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        plain_text(setting, what=f"--set {name[:40]}")
        try:
            value = scalar_of(text)
        except (yaml.YAMLError, ValueError):
            value = None
        if isinstance(value, int | float) and not abs(value) <= LARGEST:
            raise InputError(f"--set {name[:40]}: its number is too large", hint="give a smaller one")
        if not equals or not _can_be_given(name, value):
            hint = "give a name, =, and a text, a number, true or false"
            raise InputError(f"--set {setting[:60]}: it is not NAME=VALUE", hint=hint)
        if name in values:
            raise InputError(f"--set {name[:40]} is given twice", hint="give it once")
        values[name] = value
    return values


def parse_json_values(text: bytes) -> dict[str, Any]:
    """Parses values in a JSON object; an empty text gives no values. Raises InputError for other texts."""
    hint = 'give one such as {"room": "kitchen"}, or nothing'
    values = json_object(text, what="the values", hint=hint)
    wrong = next((name for name, value in values.items() if not _can_be_given(name, value)), None)
    if wrong is not None:
        hint = "give each name a text, a number, true or false"
        raise InputError(f"'{wrong[:60]}' is not a name with a value", hint=hint)
    texts = {name: value for name, value in values.items() if isinstance(value, str)}
    return {**values, **{name: plain_text(text, what=f"the value of '{name}'") for name, text in texts.items()}}


def _can_be_given(name: str, value: Any) -> bool:
    finite = not isinstance(value, int | float) or abs(value) <= LARGEST
    return bool(_NAME.fullmatch(name)) and isinstance(value, _SCALARS) and finite


def with_parameters(source: YamlSource, given: Given) -> YamlSource:
    """Replaces the parameters of a document by the given values, or else by their defaults.

    Raises InputError when a name is no identifier, a parameter has no value, or `${name}` is not declared.
    """
    if not isinstance(source.data, dict):
        return source
    declared = _declared(source)
    unknown = [name for name in given if name not in declared]
    if unknown:
        known = f"it has {listing(declared)}" if declared else "it declares none"
        hint = suggestion(unknown[0], declared, known)
        raise InputError(f"{source.path.name} has no parameter '{unknown[0]}'", hint=hint)
    values: dict[str, Any] = {}
    for name, parameter in declared.items():
        value = _fitting(parameter, given.get(name, parameter.default), name, source, is_given=name in given)
        if value is None:
            hint = f"give it a default, or 'with: {{{name}: ...}}' where the file is used"
            raise source.error((DECLARED, name), f"parameter '{name}' has no value", hint)
        values[name] = value
    filled = {
        name: {**each, "default": values[name]} if isinstance(each, dict) else values[name]
        for name, each in (source.data[DECLARED] if declared else {}).items()
        if name in values
    }
    data = {
        key: filled if key == DECLARED and declared else _put_in(part, values, source, (key,))
        for key, part in source.data.items()
    }
    return replace(source, data=data)


def _fitting(parameter: Parameter, value: Any, name: str, source: YamlSource, *, is_given: bool) -> Any:
    """Converts a value to the parameter's type. Raises InputError when it does not fit or is not among the choices."""
    if value is None:
        return None
    if parameter.type in _TEXTS and isinstance(value, int | float) and not isinstance(value, bool):
        value = str(value)
    here = () if is_given else (DECLARED, name)
    kind = _TYPES.get(parameter.type or "", _SCALARS)
    fits = isinstance(value, kind) and (bool in kind or not isinstance(value, bool))
    if not fits:
        wanted = "true or false" if parameter.type == "truth" else with_article(parameter.type or "text")
        what = f"parameter '{name}' must be {wanted}, not {str(value)[:60]!r}"
        corrected = correction(value, Number) if kind == (int, float) and isinstance(value, str) else None
        raise source.error(here, what, corrected or f"give it {wanted}")
    if parameter.choices and value not in parameter.choices:
        what = f"parameter '{name}' cannot be {str(value)[:60]!r}"
        raise source.error(here, what, f"it is one of {listing(map(str, parameter.choices), last='or')}")
    return value


def round_source(source: YamlSource, steps: KeyPath, data: Any, name: str, value: Value) -> YamlSource:
    """Builds the document of a round of a `for_each`: the steps `data`, at their path, with the round's value inserted.

    Raises InputError when `${..}` names neither the round's value nor that of an inner `for_each`.
    """
    below = source.below(steps[:-1], {steps[-1]: data})
    return replace(below, data=_put_in(below.data, {name: value}, below, ()))


def _declared(source: YamlSource) -> dict[str, Parameter]:
    """Declared parameters; one without a type takes any plain value. Leaves malformed entries to the schema."""
    declared = source.data.get(DECLARED)
    if not isinstance(declared, dict):
        return {}
    found = {}
    for name, default in declared.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            hint = "use letters, digits and underscores, a letter first"
            raise source.error((DECLARED, str(name)), f"{name!r} cannot be a parameter's name", hint)
        if isinstance(default, dict):
            kind, choices = default.get("type"), default.get("choices")
            if kind not in _TYPES:
                hint = f"its type is one of {listing(_TYPES, last='or')}"
                raise source.error((DECLARED, name), f"parameter '{name}' has no type", hint)
            listed = tuple(choices) if isinstance(choices, list) else None
            found[name] = Parameter.model_construct(type=kind, default=default.get("default"), choices=listed)
            continue
        if default is not None and not isinstance(default, _SCALARS):
            hint = "give it a text, a number, true or false, or {type: .., default: ..}"
            raise source.error((DECLARED, name), f"parameter '{name}' cannot hold {display_text(default)}", hint)
        fitting = (kind for kind in ("truth", "number", "text") if isinstance(default, _TYPES[kind]))
        found[name] = Parameter.model_construct(type=next(fitting, None), default=default)
    return found


def _put_in(
    value: Any, values: Mapping[str, Any], source: YamlSource, path: KeyPath, rounds: frozenset[str] = frozenset()
) -> Any:
    """Replaces parameters in a value; keeps `rounds`, the names that enclosing `for_each` blocks will replace."""
    if isinstance(value, str):
        return _text(value, values, source, path, rounds)
    if isinstance(value, dict):
        within = rounds | _rounds_name(value)
        return {
            key: _put_in(part, values, source, (*path, str(key)), within if key == "steps" else rounds)
            for key, part in value.items()
        }
    if isinstance(value, list):
        return [_put_in(part, values, source, (*path, index), rounds) for index, part in enumerate(value)]
    return value


def _rounds_name(step: Mapping[str, Any]) -> frozenset[str]:
    """Name under which the steps of a `for_each` read the value of each round."""
    repeat = step.get("repeat")
    name = repeat.get("as") if isinstance(repeat, Mapping) and "for_each" in repeat else None
    return frozenset({name}) if isinstance(name, str) else frozenset()


def _text(text: str, values: Mapping[str, Any], source: YamlSource, path: KeyPath, rounds: frozenset[str]) -> Any:
    if "${" not in text:
        return text
    whole = _REFERENCE.fullmatch(text)
    if whole is not None and not whole[1] and whole[2] not in rounds:
        return _value(whole[2], values, source, path)

    def replaced(match: re.Match[str]) -> str:
        if match[2] in rounds or (match[1] and rounds):
            return match[0]
        return f"${{{match[2]}}}" if match[1] else str(_value(match[2], values, source, path))

    return _REFERENCE.sub(replaced, text)


def _value(name: str, values: Mapping[str, Any], source: YamlSource, path: KeyPath) -> Any:
    if name not in values:
        near = nearest_name(name, values)
        misspelled = None if DECLARED in source.data else nearest_name(DECLARED, (str(key) for key in source.data))
        known = f"declare it under '{DECLARED}' with its default"
        known = known if misspelled is None else f"did you mean '{DECLARED}' by '{misspelled}'?"
        known = f"declared are {listing(values)}" if values else known
        hint = f"did you mean '${{{near}}}'?" if near else known
        raise source.error(path, f"unknown parameter '{name}'", hint)
    return values[name]
