"""Scalars of YAML 1.1 that people mean otherwise: octals, base-60 numbers, dates and exponents.

`010` is ten to the writer, `14:30` a time of day, `2026-12-01` a date and `1e3` a number. The first three are read as
the text that stands there: a key that wants a text gets it, and one that wants a number can say what to write.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

import yaml

__all__ = ["as_written", "scalar_of", "truth_words", "yaml_of"]

_TAG: Final = "tag:yaml.org,2002:"
_BASE_60: Final = re.compile(r"[-+]?\d[\d_]*(?::[0-5]?\d)+(?:\.[\d_]*)?")
_OCTAL: Final = re.compile(r"[-+]?0[\d_]+")
_EXPONENT: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+")
_PLAIN_TRUTHS: Final = ("true", "false")
Path = tuple[str | int, ...]


def as_written(node: yaml.Node | None) -> yaml.Node | None:
    """The same document, in which each plain scalar has the type that people mean; changes the nodes in place."""
    for each, is_key in _scalars(node, set()):
        if not each.style:
            each.tag = _meant(each, is_key=is_key)
    return node


def scalar_of(text: str) -> Any:
    """The value of one scalar as a file has it. Raises yaml.YAMLError, and ValueError: it is broken, or a mapping."""
    node = as_written(yaml.compose(text, Loader=yaml.SafeLoader))
    if node is not None and not isinstance(node, yaml.ScalarNode):
        raise ValueError("no plain value")
    return None if node is None else yaml.constructor.SafeConstructor().construct_document(node)


class _Dumper(yaml.SafeDumper):
    """Writes a text that this module reads as a number ("0E0") in quotes."""


_Dumper.add_implicit_resolver(f"{_TAG}float", re.compile(f"^(?:{_EXPONENT.pattern})$"), list("-+.0123456789"))


def yaml_of(data: Any, *, width: int = 120, flow_style: bool | None = None) -> str:
    """The YAML of plain data, which `parse_yaml` reads back to the same data; lists of scalars stand in one line."""
    return str(
        yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=width, default_flow_style=flow_style)
    )


def truth_words(node: yaml.Node | None) -> Mapping[Path, str]:
    """The words that YAML takes for true or false besides these two ("no", "on"), by their places."""
    words: dict[Path, str] = {}
    waiting: list[tuple[Path, yaml.Node]] = [] if node is None else [((), node)]
    seen: set[int] = set()
    while waiting:
        path, each = waiting.pop()
        if isinstance(each, yaml.ScalarNode) and each.tag == f"{_TAG}bool" and each.value.lower() not in _PLAIN_TRUTHS:
            words[path] = each.value
        if id(each) in seen:
            continue
        seen.add(id(each))
        if isinstance(each, yaml.MappingNode):
            waiting += [((*path, key.value), value) for key, value in each.value if isinstance(key, yaml.ScalarNode)]
        elif isinstance(each, yaml.SequenceNode):
            waiting += [((*path, index), item) for index, item in enumerate(each.value)]
    return words


def _meant(node: yaml.ScalarNode, *, is_key: bool) -> str:
    """The tag of what a plain scalar means."""
    kind, text = node.tag.removeprefix(_TAG), node.value
    if kind in ("timestamp", "value") or (kind == "bool" and is_key):
        return f"{_TAG}str"
    if (kind == "int" and _OCTAL.fullmatch(text)) or (kind in ("int", "float") and _BASE_60.fullmatch(text)):
        return f"{_TAG}str"
    return f"{_TAG}float" if kind == "str" and _EXPONENT.fullmatch(text) else node.tag


def _scalars(node: yaml.Node | None, seen: set[int]) -> Iterator[tuple[yaml.ScalarNode, bool]]:
    """Each scalar below a node once, and whether it is a key; aliases lead to the same node."""
    waiting: list[tuple[yaml.Node, bool]] = [] if node is None else [(node, False)]
    while waiting:
        each, is_key = waiting.pop()
        if id(each) in seen:
            continue
        seen.add(id(each))
        if isinstance(each, yaml.ScalarNode):
            yield each, is_key
        elif isinstance(each, yaml.MappingNode):
            waiting += [pair for key, value in each.value for pair in ((key, True), (value, False))]
        elif isinstance(each, yaml.SequenceNode):
            waiting += [(item, False) for item in each.value]
