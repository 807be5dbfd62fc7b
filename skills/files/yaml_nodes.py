"""Data and lines of a composed YAML document: anchors and merge keys are followed, within bounds."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from skills.files.errors import InputError

__all__ = ["KeyPath", "data_and_lines", "quoted"]

KeyPath = tuple[str | int, ...]
MOST_DIGITS: Final = 100
MOST_NESTED: Final = 80
MOST_COPIED: Final = 20_000
"""So many keys and items may stand in a document besides those that are written, through its aliases."""
_STANDARD: Final = "tag:yaml.org,2002:"
_MERGE: Final = f"{_STANDARD}merge"
_NUMBERS: Final = (f"{_STANDARD}int", f"{_STANDARD}float")
_PLAIN: Final = frozenset(
    _STANDARD + kind for kind in ("bool", "float", "int", "map", "merge", "null", "seq", "str", "timestamp", "value")
)
_WORD: Final = re.compile(r"[\w -]{1,40}")
Pair = tuple[yaml.Node, yaml.Node]


def data_and_lines(
    root: yaml.Node | None, file: Path, tags: frozenset[str] = frozenset()
) -> tuple[Any, dict[KeyPath, int]]:
    """The data of a document, and the line (from 1) at which each key or list item is written.

    What an alias or a merge key brings has the lines of its anchor. `tags` are those that may stand there besides
    those of plain data; what they stand at is read as if it had none.

    Raises:
        InputError: a key stands twice, or there is a tag, a circle of aliases, or more than anyone would write.
    """
    if root is None:
        return None, {}
    reading = _Reading(file, tags)
    return reading.value(root, ()), reading.lines


def quoted(key: object) -> str:
    """A key as an error names it: one that is no plain word is not repeated, for the file may be none of ours."""
    return f"key {key!r}" if _WORD.fullmatch(str(key)) else "key that is no plain word"


@dataclass
class _Reading:
    """A document while it is read."""

    file: Path
    tags: frozenset[str]
    lines: dict[KeyPath, int] = field(default_factory=dict)
    above: list[yaml.Node] = field(default_factory=list)
    met: set[int] = field(default_factory=set)
    copied: int = 0
    scalars: yaml.constructor.SafeConstructor = field(default_factory=yaml.constructor.SafeConstructor)

    def value(self, node: yaml.Node, path: KeyPath) -> Any:
        """The data of a node that stands at `path`."""
        self._check(node)
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        self.above.append(node)
        found = self._mapping(node, path) if isinstance(node, yaml.MappingNode) else self._list(node, path)
        self.above.pop()
        return found

    def _error(self, node: yaml.Node, what: str, hint: str) -> InputError:
        return InputError(what, hint=hint, file=self.file, line=node.start_mark.line + 1)

    def _check(self, node: yaml.Node) -> None:
        """Raises InputError: a tag, a circle, too deep, or too much."""
        if node.tag not in _PLAIN and node.tag not in self.tags:
            raise self._error(
                node, f"the tag '{node.tag.replace(_STANDARD, '!!')[:40]}' cannot be used here", "remove it"
            )
        if any(node is each for each in self.above):
            raise self._error(node, "an alias stands inside of what it repeats", "write it out")
        if len(self.above) > MOST_NESTED:
            raise self._error(node, f"it is nested more than {MOST_NESTED} deep", "write it flatter")
        if id(node) in self.met:
            self.copied += 1 if isinstance(node, yaml.ScalarNode) else 1 + len(node.value)
        self.met.add(id(node))
        if self.copied > MOST_COPIED:
            what = f"its aliases repeat more than {MOST_COPIED} keys and items"
            raise self._error(self.above[0] if self.above else node, what, "repeat less")

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        if node.tag in _NUMBERS and len(node.value) > MOST_DIGITS:
            what = f"a number of {len(node.value)} digits (at most {MOST_DIGITS} are read)"
            raise self._error(node, what, "write a shorter one")
        if not node.value.isascii() and any("\ud800" <= letter <= "\udfff" for letter in node.value):
            raise self._error(node, "half a letter (a lone surrogate) stands in it", "write the whole letter")
        if node.tag in self.tags:
            return node.value
        try:
            return self.scalars.construct_object(node)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            kind = node.tag.removeprefix(_STANDARD)
            what = f"it looks like a {_KINDS.get(kind, kind)} and is none"
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

    def _pairs(self, node: yaml.MappingNode) -> tuple[dict[Any, Pair], dict[Any, Pair]]:
        """The keys that are written in a mapping, and those that its merge key brings; of these the first counts."""
        own: dict[Any, Pair] = {}
        merge: Pair | None = None
        for key_node, value in node.value:
            is_merge = key_node.tag == _MERGE
            key = "<<" if is_merge else self._key(key_node)
            before = merge if is_merge else own.get(key)
            if before is not None:
                first = before[0].start_mark.line + 1
                hint = "write one: '<<: [*a, *b]'" if is_merge else "remove one of the two"
                raise self._error(key_node, f"{quoted(key)} stands twice (first in line {first})", hint)
            if is_merge:
                merge = (key_node, value)
            else:
                own[key] = (key_node, value)
        return own, {} if merge is None else self._merged(merge[1])

    def _merged(self, node: yaml.Node) -> dict[Any, Pair]:
        """The keys of the mapping, or the mappings, that a merge key names."""
        self._check(node)
        several = node.value if isinstance(node, yaml.SequenceNode) else [node]
        if not all(isinstance(each, yaml.MappingNode) for each in several):
            raise self._error(node, "'<<' takes a mapping, or a list of mappings", "write '<<: *name'")
        self.above.append(node)
        found: dict[Any, Pair] = {}
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
        return self._scalar(node)


_KINDS: Final = {"int": "number", "float": "number", "timestamp": "date", "bool": "truth value"}
