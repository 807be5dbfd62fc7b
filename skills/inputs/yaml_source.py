"""Reader of YAML files: plain data with the line of each key; aliases are expanded within limits.

Some YAML 1.1 scalars are read as people mean them: `010`, `14:30` and `2026-12-01` are texts, `1e3` is a number, and
`on` as a key is a text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from skills.inputs.errors import InputError, with_article
from skills.inputs.outside import read_text

KeyPath = tuple[str | int, ...]
MOST_DIGITS: Final = 100
MOST_NESTED: Final = 80
MOST_COPIED: Final = 20_000
"""Most keys and items that aliases may add to a document."""
_SURELY_FLAT: Final = 1_000
"""Brackets plus letters of the longest line, below which a text cannot be nested too deeply."""
_SECOND_DOCUMENT: Final = "but found another document"
_TAG: Final = "tag:yaml.org,2002:"
_PLAIN_TAGS: Final = frozenset(
    _TAG + kind for kind in ("bool", "float", "int", "map", "merge", "null", "seq", "str", "timestamp", "value")
)
_NUMBER_TAGS: Final = (f"{_TAG}int", f"{_TAG}float")
_NOUNS: Final = {"int": "number", "float": "number", "timestamp": "date", "bool": "truth value"}
_BASE_60: Final = re.compile(r"[-+]?\d[\d_]*(?::[0-5]?\d)+(?:\.[\d_]*)?")
_OCTAL: Final = re.compile(r"[-+]?0[\d_]+")
_EXPONENT: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+")
_WORD: Final = re.compile(r"[\w -]{1,40}")
_Pair = tuple[yaml.ScalarNode, yaml.Node]


@dataclass(frozen=True)
class YamlSource:
    """A YAML document: its data, and the line (from 1) of each key or list item.

    `words` are the values that YAML reads as true or false although the file says "no" or "on", by path.
    """

    path: Path
    data: Any
    lines: Mapping[KeyPath, int]
    first_line: int = 1
    words: Mapping[KeyPath, str] = field(default_factory=dict)

    def line(self, path: KeyPath) -> int:
        """Line of `path`, or of its nearest ancestor in the file."""
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in self.lines), None)
        return self.first_line if known is None else self.lines[known]

    def below(self, path: KeyPath, data: Any) -> YamlSource:
        """Source for the part at `path`, with its lines; `data` replaces the part's data."""
        lines = {each[len(path) :]: line for each, line in self.lines.items() if each[: len(path)] == path != each}
        return YamlSource(self.path, data, lines, first_line=self.line(path))

    def error(self, path: KeyPath, message: str, hint: str = "") -> InputError:
        """Returns an error with the file and the line of `path`."""
        return InputError(message, hint=hint, file=self.path, line=self.line(path))


def read_yaml(
    path: Path | str, tags: frozenset[str] = frozenset(), *, hint: str = "name a file that exists"
) -> YamlSource:
    """Reads a file with one YAML document of plain data; `tags` are allowed besides, `hint` is for a missing file.

    Raises:
        InputError: the file cannot be read, is too large, is no YAML, or has a key twice, or a tag.
    """
    file = Path(path)
    return parse_yaml(read_text(file, hint=hint), file, tags)


def parse_yaml(text: str, file: Path, tags: frozenset[str] = frozenset()) -> YamlSource:
    """Parses the text of a YAML file. A value with one of `tags` is read without the tag.

    The parts that an alias or a merge key repeats have the lines of the anchor.

    Raises:
        InputError: as `read_yaml`.
    """
    try:
        _refuse_deep(text, file)
        root, reader = _composed(text), _Reader(file, tags)
        data = None if root is None else reader.value(root, ())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = 1 if mark is None else mark.line + 1
        if error.problem and _SECOND_DOCUMENT in error.problem:
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
    return YamlSource(file, data, reader.lines, words=reader.words)


def scalar_of(text: str) -> Any:
    """Parses one scalar as a file holds it. Raises yaml.YAMLError or ValueError when it is broken or no scalar."""
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if node is None:
        return None
    if not isinstance(node, yaml.ScalarNode):
        raise ValueError("no plain value")
    node.tag = _meant_tag(node)
    return yaml.constructor.SafeConstructor().construct_document(node)


def yaml_of(data: Any, *, width: int = 120, flow_style: bool | None = None) -> str:
    """Writes plain data as YAML that `parse_yaml` reads back to equal data; a list of scalars takes one line."""
    return str(
        yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=width, default_flow_style=flow_style)
    )


class _Dumper(yaml.SafeDumper):
    """Puts a text that this module reads as a number ("0E0") in quotes."""


_Dumper.add_implicit_resolver(f"{_TAG}float", re.compile(f"^(?:{_EXPONENT.pattern})$"), list("-+.0123456789"))


def quoted_key(key: object) -> str:
    """Quotes a key for an error; hides a key that is no plain word, since the file may be a foreign one."""
    return f"key {key!r}" if _WORD.fullmatch(str(key)) else "key that is no plain word"


def _refuse_deep(text: str, file: Path) -> None:
    """Raises InputError for deep nesting, before the recursive composer runs out of stack."""
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
    """Composes the nodes of a document with the fast reader; a broken one with the slow reader, which explains more."""
    try:
        node: yaml.Node | None = yaml.compose(text, Loader=yaml.CSafeLoader)
    except yaml.YAMLError:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    return node


def _meant_tag(node: yaml.ScalarNode, *, is_key: bool = False) -> str:
    """Tag of the type that people mean by a scalar."""
    kind, text = node.tag.removeprefix(_TAG), node.value
    if node.style:
        return node.tag
    if kind in ("timestamp", "value") or (kind == "bool" and is_key):
        return f"{_TAG}str"
    if (kind == "int" and _OCTAL.fullmatch(text)) or (kind in ("int", "float") and _BASE_60.fullmatch(text)):
        return f"{_TAG}str"
    return f"{_TAG}float" if kind == "str" and _EXPONENT.fullmatch(text) else node.tag


@dataclass
class _Reader:
    """Converts the nodes of one document to data; records lines and true-or-false words."""

    file: Path
    tags: frozenset[str]
    lines: dict[KeyPath, int] = field(default_factory=dict)
    words: dict[KeyPath, str] = field(default_factory=dict)
    above: list[yaml.Node] = field(default_factory=list)
    met: set[int] = field(default_factory=set)
    copied: int = 0
    scalars: yaml.constructor.SafeConstructor = field(default_factory=yaml.constructor.SafeConstructor)

    def value(self, node: yaml.Node, path: KeyPath) -> Any:
        """Returns the data of a node at `path`."""
        self._check(node)
        if isinstance(node, yaml.ScalarNode):
            found = self._scalar(node)
            if isinstance(found, bool) and node.value.lower() not in ("true", "false"):
                self.words[path] = node.value
            return found
        self.above.append(node)
        found = self._mapping(node, path) if isinstance(node, yaml.MappingNode) else self._list(node, path)
        self.above.pop()
        return found

    def _error(self, node: yaml.Node, what: str, hint: str) -> InputError:
        return InputError(what, hint=hint, file=self.file, line=node.start_mark.line + 1)

    def _check(self, node: yaml.Node) -> None:
        """Raises InputError for a tag, a circle of aliases, and for a document that is too deep or repeats too much."""
        if node.tag not in _PLAIN_TAGS and node.tag not in self.tags:
            what = f"the tag '{node.tag.replace(_TAG, '!!')[:40]}' cannot be used here"
            raise self._error(node, what, "remove it")
        if node in self.above:
            raise self._error(node, "an alias stands inside of what it repeats", "write it out")
        if len(self.above) > MOST_NESTED:
            raise self._error(node, f"it is nested more than {MOST_NESTED} deep", "write it flatter")
        if id(node) in self.met:
            self.copied += 1 if isinstance(node, yaml.ScalarNode) else 1 + len(node.value)
        self.met.add(id(node))
        if self.copied > MOST_COPIED:
            what = f"its aliases repeat more than {MOST_COPIED} keys and items"
            raise self._error(self.above[0] if self.above else node, what, "repeat less")

    def _scalar(self, node: yaml.ScalarNode, *, is_key: bool = False) -> Any:
        node.tag = _meant_tag(node, is_key=is_key)
        if node.tag in _NUMBER_TAGS and len(node.value) > MOST_DIGITS:
            what = f"a number of {len(node.value)} digits (at most {MOST_DIGITS} are read)"
            raise self._error(node, what, "write a shorter one")
        if not node.value.isascii() and any("\ud800" <= letter <= "\udfff" for letter in node.value):
            raise self._error(node, "half a letter (a lone surrogate) stands in it", "write the whole letter")
        if node.tag in self.tags:
            return node.value
        try:
            return self.scalars.construct_object(node)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            kind = node.tag.removeprefix(_TAG)
            what = f"it looks like {with_article(_NOUNS.get(kind, kind))}, but is not a valid one"
            raise self._error(node, what, "correct it, or put it in quotes") from error

    def _list(self, node: yaml.Node, path: KeyPath) -> list[Any]:
        found = []
        for index, item in enumerate(node.value):
            self.lines[(*path, index)] = item.start_mark.line + 1
            found.append(self.value(item, (*path, index)))
        return found

    def _mapping(self, node: yaml.MappingNode, path: KeyPath) -> dict[Any, Any]:
        own, merged = self._pairs(node)
        found: dict[Any, Any] = {}
        for key, (key_node, value) in {**merged, **own}.items():
            self.lines[(*path, key)] = key_node.start_mark.line + 1
            found[key] = self.value(value, (*path, key))
        return found

    def _pairs(self, node: yaml.MappingNode) -> tuple[dict[Any, _Pair], dict[Any, _Pair]]:
        """Returns the keys that a mapping contains, and those that its merge key adds; the first mapping wins."""
        own: dict[Any, _Pair] = {}
        merge: _Pair | None = None
        for key_node, value in node.value:
            is_merge = key_node.tag == f"{_TAG}merge"
            key = "<<" if is_merge else self._key(key_node)
            before = merge if is_merge else own.get(key)
            if before is not None:
                first = before[0].start_mark.line + 1
                hint = "write one: '<<: [*a, *b]'" if is_merge else "remove one of the two"
                raise self._error(key_node, f"{quoted_key(key)} stands twice (first in line {first})", hint)
            if is_merge:
                merge = (key_node, value)
            else:
                own[key] = (key_node, value)
        return own, {} if merge is None else self._merged(merge[1])

    def _merged(self, node: yaml.Node) -> dict[Any, _Pair]:
        """Returns the keys of the mapping or mappings to which a merge key refers."""
        self._check(node)
        several = node.value if isinstance(node, yaml.SequenceNode) else [node]
        if not all(isinstance(each, yaml.MappingNode) for each in several):
            raise self._error(node, "'<<' takes a mapping, or a list of mappings", "write '<<: *name'")
        self.above.append(node)
        found: dict[Any, _Pair] = {}
        if isinstance(node, yaml.MappingNode):
            own, merged = self._pairs(node)
            found = {**merged, **own}
        for each in several if several != [node] else ():
            found = {**self._merged(each), **found}
        self.above.pop()
        return found

    def _key(self, node: yaml.Node) -> Any:
        if not isinstance(node, yaml.ScalarNode):
            raise self._error(node, "a key cannot be a list or a mapping", "write a word before the colon")
        self._check(node)
        return self._scalar(node, is_key=True)
