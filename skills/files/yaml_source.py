"""YAML files that remember their lines; errors name the place and the hint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import yaml

from skills.files.errors import InputError
from skills.files.outside import read_text
from skills.files.yaml_nodes import MOST_NESTED, KeyPath, data_and_lines
from skills.files.yaml_scalars import as_written, truth_words

__all__ = ["KeyPath", "YamlSource", "parse_yaml", "read_yaml"]

MAX_BYTES: Final = 1_000_000
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

    def below(self, path: KeyPath, data: Any) -> YamlSource:
        """A document of what stands at `path`, with its lines; `data` is in its place."""
        lines = {each[len(path) :]: line for each, line in self.lines.items() if each[: len(path)] == path != each}
        return YamlSource(self.path, data, lines, first_line=self.line(path))

    def error(self, path: KeyPath, message: str, hint: str = "") -> InputError:
        """An error at `path`."""
        return InputError(message, hint=hint, file=self.path, line=self.line(path))


def read_yaml(
    path: Path | str, tags: frozenset[str] = frozenset(), *, hint: str = "name a file that exists"
) -> YamlSource:
    """Reads one YAML document of plain data; `tags` are those that may stand in it, `hint` is for a missing file.

    Raises:
        InputError: the file cannot be read, is too large, is no YAML, or has a key twice, or a tag.
    """
    file = Path(path)
    return parse_yaml(read_text(file, most_bytes=MAX_BYTES, hint=hint), file, tags)


def parse_yaml(text: str, file: Path, tags: frozenset[str] = frozenset()) -> YamlSource:
    """Parses the text of such a document, which stands in a file. Raises InputError as `read_yaml`."""
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
    """Raises InputError before the composer, which calls itself for each level, runs out of stack."""
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
