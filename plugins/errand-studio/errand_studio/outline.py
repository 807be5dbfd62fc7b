"""Edits the steps of a mission file as text: moves, doubles, wraps, inserts and removes them.

An edit changes the lines of its steps alone, so comments and layout stay. Each edit is checked against the same edit of
the file's data. A comment before a step belongs to the step, as do comments behind it that are indented deeper.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import yaml

from errand_studio.mission_schema import inner_keys, step_list_keys
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import KeyPath, parse_yaml

STEP: Final = "- STEP"
WRAPS: Final = MappingProxyType(
    {
        "retry": "- group:\n    - STEP\n  retries: 2\n",
        "timeout": "- group:\n    - STEP\n  timeout: 120\n",
        "if": "- if: battery > 0.3\n  then:\n    - STEP\n",
        "repeat": "- repeat: {times: 2}\n  steps:\n    - STEP\n",
        "try": "- try:\n    - STEP\n  else:\n    - speak: That did not work.\n",
        "parallel": "- together:\n    - STEP\n    - speak: I am on my way.\n",
    }
)
"""Blocks around a step, by name."""
_FILE: Final = Path("mission")
_NOT_PLAIN: Final = "these lines cannot be edited by the outline"
_BY_HAND: Final = "edit them in the text; the outline takes steps that stand on lines of their own"


@dataclass(frozen=True)
class StepList:
    """List of steps: its path in the data, its node and the node of its key. An empty branch has a null as its node."""

    path: KeyPath
    key: yaml.ScalarNode
    node: yaml.Node

    @property
    def items(self) -> list[yaml.Node]:
        """Nodes of the steps."""
        return list(self.node.value) if isinstance(self.node, yaml.SequenceNode) else []

    @property
    def is_block(self) -> bool:
        """Returns whether each step begins with a dash on a line of its own."""
        return isinstance(self.node, yaml.SequenceNode) and not self.node.flow_style


@dataclass(frozen=True)
class Chunk:
    """Lines of one step, with the column of its dash."""

    lines: tuple[str, ...]
    column: int

    def at(self, column: int) -> tuple[str, ...]:
        """Returns the lines with the dash at another column."""
        return tuple(_shifted(line, column - self.column) for line in self.lines)

    @property
    def flow_text(self) -> str | None:
        """Text of the step inside of brackets; None if it takes several lines or has a comment."""
        if len(self.lines) != 1 or re.search(r"(^|\s)#", self.lines[0]):
            return None
        return self.lines[0].strip().removeprefix("-").strip()


@dataclass(frozen=True)
class Row:
    """Row of the outline: a step, or a list of steps inside a step, which has an `index` of -1.

    `line` and `end` are the first line (from 1) and the last one; `kind` is the first key, `text` its value, `more` the
    other keys.
    """

    path: KeyPath
    depth: int
    kind: str
    text: str
    more: str
    line: int
    end: int

    @property
    def is_list(self) -> bool:
        """Returns whether the row stands for a list of steps, such as `then`."""
        return self.kind == ""


def rows(text: str) -> list[Row]:
    """Returns the rows of a mission's outline. Raises InputError if the text is no YAML."""
    root = _root(text)
    return list(_rows(_Text(text), root, (), 0)) if root is not None else []


def list_paths(text: str) -> list[KeyPath]:
    """Returns the paths of all lists of steps in a text."""
    return [each.path for each in _lists(_root(text), ())]


def path_at(text: str, line: int) -> KeyPath | None:
    """Returns the path of the innermost step on a line (from 1)."""
    found = [row for row in rows(text) if not row.is_list and row.line <= line <= row.end]
    return found[-1].path if found else None


def move(text: str, path: KeyPath, to: KeyPath, index: int) -> str:
    """Moves a step to a list, where it gets an index. Raises InputError if the text cannot be edited so."""
    if to[: len(path)] == path:
        raise InputError("a step cannot be moved into itself", hint="choose a place outside of it")
    cut, chunk = _cut(text, path)
    return _checked(text, _insert(cut, _after_cut(to, path), index, chunk), ("move", path, to, index))


def remove(text: str, path: KeyPath) -> str:
    """Removes a step with its comments. Raises InputError if the text cannot be edited so."""
    return _checked(text, _cut(text, path)[0], ("remove", path))


def double(text: str, path: KeyPath) -> str:
    """Inserts a copy of a step behind it. Raises InputError if the text cannot be edited so."""
    chunk = _chunk(text, path, comments=False)
    return _checked(text, _insert(text, path[:-1], _index(path) + 1, chunk), ("double", path))


def insert(text: str, to: KeyPath, index: int, step: str) -> str:
    """Inserts a step, written as an item of a list. Raises InputError if the text cannot be edited so."""
    chunk = Chunk(tuple(step.rstrip("\n").splitlines()), 0)
    return _checked(text, _insert(text, to, index, chunk), ("insert", to, index, _data(step)[0]))


def wrap(text: str, path: KeyPath, kind: str) -> str:
    """Puts a step into one of `WRAPS`. Raises InputError if the text cannot be edited so."""
    cut, chunk = _cut(text, path)
    lead = next((n for n, line in enumerate(chunk.lines) if line.lstrip().startswith("-")), 0)
    lines: list[str] = [_shifted(line, -chunk.column) for line in chunk.lines[:lead]]
    inner = replace(chunk, lines=chunk.lines[lead:])
    for line in WRAPS[kind].splitlines():
        column = len(line) - len(line.lstrip())
        lines += inner.at(column) if line.strip() == STEP else [line]
    wrapped = _insert(cut, path[:-1], _index(path), Chunk(tuple(lines), 0))
    return _checked(text, wrapped, ("wrap", path, _data(WRAPS[kind])[0]))


def _shifted(line: str, by: int) -> str:
    if by >= 0:
        return " " * by + line if line.strip() else line
    return line[-by:] if not line[:-by].strip() else line


def _index(path: KeyPath) -> int:
    return int(path[-1])


def _after_cut(path: KeyPath, cut: KeyPath) -> KeyPath:
    """Path of a list after the step at `cut` has left its own list."""
    at = len(cut) - 1
    if len(path) > at and path[:at] == cut[:at] and str(path[at]).isdigit() and int(path[at]) > _index(cut):
        return (*path[:at], int(path[at]) - 1, *path[at + 1 :])
    return path


def _data(text: str) -> Any:
    return parse_yaml(text, _FILE).data


def _root(text: str) -> yaml.Node | None:
    parse_yaml(text, _FILE)
    root: yaml.Node | None = yaml.compose(text, Loader=yaml.CSafeLoader)
    return root


def _lists(node: yaml.Node | None, path: KeyPath) -> Iterator[StepList]:
    """Yields the lists of steps below a node, parents first."""
    for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
        own = (*path, key.value)
        if key.value in step_list_keys():
            yield from _lists_at(own, key, value)
        elif key.value in inner_keys():
            parts = value.value if isinstance(value, yaml.SequenceNode | yaml.MappingNode) else ()
            for n, part in enumerate(parts):
                name, inner = (part[0].value, part[1]) if isinstance(part, tuple) else (n, part)
                yield from _lists(inner, (*own, name))


def _lists_at(path: KeyPath, key: yaml.ScalarNode, value: yaml.Node) -> Iterator[StepList]:
    """Yields the list under a key, or the lists of answers under `choices`, and all lists below."""
    if isinstance(value, yaml.MappingNode):
        for name, branch in value.value:
            yield from _lists_at((*path, name.value), name, branch)
        return
    is_empty = isinstance(value, yaml.ScalarNode) and value.tag.endswith(":null")
    is_list = isinstance(value, yaml.SequenceNode) and all(map(_is_step, value.value))
    if is_empty or is_list:
        own = StepList(path, key, value)
        yield own
        for n, item in enumerate(own.items):
            yield from _lists(item, (*path, n))


def _in_brackets(node: yaml.Node) -> bool:
    return isinstance(node, yaml.CollectionNode) and bool(node.flow_style)


def _is_step(node: yaml.Node) -> bool:
    return isinstance(node, yaml.MappingNode) or (isinstance(node, yaml.ScalarNode) and node.value == "dock")


class _Text:
    """Lines of a text, and the spans of its nodes."""

    def __init__(self, text: str) -> None:
        self.ends = text.endswith("\n")
        self.newline = "\r\n" if "\r\n" in text else "\n"
        self.lines = text.split(self.newline)
        if self.ends:
            self.lines.pop()

    def joined(self) -> str:
        return self.newline.join(self.lines) + (self.newline if self.ends else "")

    def slice(self, node: yaml.Node) -> str:
        """Text of a scalar or a collection in brackets, on one line."""
        start, end = node.start_mark, node.end_mark
        if start.line == end.line:
            return self.lines[start.line][start.column : end.column].rstrip()
        parts = [self.lines[start.line][start.column :], *self.lines[start.line + 1 : end.line]]
        return " ".join(" ".join([*parts, self.lines[end.line][: end.column] if end.column else ""]).split())

    def last_line(self, node: yaml.Node) -> int:
        """Number of the last line of a node's content."""
        if isinstance(node, yaml.ScalarNode) or _in_brackets(node) or not node.value:
            mark = node.end_mark
            last = mark.line if mark.column or not (isinstance(node, yaml.ScalarNode) and node.style) else mark.line - 1
            while isinstance(node, yaml.ScalarNode) and node.style in ("|", ">") and self._beside(node, last):
                last -= 1
            return int(last)
        inner = node.value[-1]
        return max(map(self.last_line, inner)) if isinstance(inner, tuple) else self.last_line(inner)

    def _beside(self, node: yaml.Node, line: int) -> bool:
        """Returns whether a line at the end of a block of text is not part of the text."""
        if line <= node.start_mark.line:
            return False
        text = self.lines[line] if line < len(self.lines) else ""
        first = self.lines[node.start_mark.line + 1]
        return not text.strip() or len(text) - len(text.lstrip()) < len(first) - len(first.lstrip())

    def first_line(self, own: StepList, index: int) -> int:
        """Number of the line with the dash of a step."""
        line, column = own.items[index].start_mark.line, own.node.start_mark.column
        while line > 0 and self.lines[line][column : column + 1] != "-":
            line -= 1
        return int(line)

    def end(self, own: StepList, index: int) -> int:
        """Number of the line behind a step, with the comments that are indented deeper than its dash."""
        line, column = self.last_line(own.items[index]) + 1, own.node.start_mark.column
        while line < len(self.lines) and (comment := self.lines[line]).lstrip().startswith("#"):
            if len(comment) - len(comment.lstrip()) <= column:
                break
            line += 1
        return line

    def begin(self, own: StepList, index: int) -> int:
        """Number of the first line of a step, with the comments and blank lines before it."""
        return self.end(own, index - 1) if index > 0 else int(own.key.end_mark.line) + 1


def _list_at(text: str, path: KeyPath) -> StepList:
    found = next((each for each in _lists(_root(text), ()) if each.path == path), None)
    if found is None:
        where = ".".join(map(str, path))[:60]
        raise InputError(f"there is no list of steps at '{where}'", hint="the text has changed: choose again")
    starts = [(item.start_mark.line, item.start_mark.column) for item in found.items]
    if starts != sorted(set(starts)):  # a step is an alias of another
        raise InputError(_NOT_PLAIN, hint=_BY_HAND)
    return found


def _chunk(text: str, path: KeyPath, *, comments: bool = True) -> Chunk:
    """Returns the lines of a step, with or without the comments before it."""
    own, lines = _list_at(text, path[:-1]), _Text(text)
    if _index(path) >= len(own.items):
        raise InputError("there is no such step", hint="the text has changed: choose again")
    if not own.is_block:
        return Chunk((f"- {lines.slice(own.items[_index(path)])}",), 0)
    begin = (lines.begin if comments else lines.first_line)(own, _index(path))
    return Chunk(tuple(lines.lines[begin : lines.end(own, _index(path))]), own.node.start_mark.column)


def _cut(text: str, path: KeyPath) -> tuple[str, Chunk]:
    """Cuts a step out of a text. A list without steps becomes `[]`, on a line of its own if it had dashes."""
    own, lines, chunk, index = _list_at(text, path[:-1]), _Text(text), _chunk(text, path), _index(path)
    if own.is_block:
        begin, end = lines.begin(own, index), lines.end(own, index)
        column = max(own.node.start_mark.column, own.key.start_mark.column + 1)
        lines.lines[begin:end] = [] if len(own.items) > 1 else [f"{' ' * column}[]"]
        return lines.joined(), chunk
    texts = [lines.slice(item) for item in own.items]
    _write_flow(lines, own, texts[:index] + texts[index + 1 :])
    return lines.joined(), chunk


def _write_flow(lines: _Text, own: StepList, texts: Sequence[str]) -> None:
    """Writes the steps of a list in brackets."""
    start, end = own.node.start_mark, own.node.end_mark
    first, last = lines.lines[start.line], lines.lines[end.line]
    lines.lines[start.line : end.line + 1] = [f"{first[: start.column]}[{', '.join(texts)}]{last[end.column :]}"]


def _insert(text: str, to: KeyPath, index: int, chunk: Chunk) -> str:
    """Inserts the lines of a step into a list."""
    own, lines = _list_at(text, to), _Text(text)
    index = min(index, len(own.items))
    if own.is_block:
        at = lines.begin(own, index) if index < len(own.items) else lines.end(own, index - 1)
        lines.lines[at:at] = chunk.at(own.node.start_mark.column)
        return lines.joined()
    start, key = own.node.start_mark, own.key
    if not own.items and own.key.end_mark.line < start.line and isinstance(own.node, yaml.SequenceNode):
        column = start.column if start.column > key.start_mark.column + 1 else key.start_mark.column
        lines.lines[start.line : start.line + 1] = chunk.at(column)
        return lines.joined()
    texts = [lines.slice(item) for item in own.items]
    if isinstance(own.node, yaml.SequenceNode) and chunk.flow_text is not None:
        _write_flow(lines, own, [*texts[:index], chunk.flow_text, *texts[index:]])
        if _is_yaml(lines.joined()):
            return lines.joined()
        lines = _Text(text)
    return _as_block(lines, own, [*(Chunk((f"- {each}",), 0) for each in texts[:index]), chunk], texts[index:])


def _is_yaml(text: str) -> bool:
    try:
        parse_yaml(text, _FILE)
    except InputError:
        return False
    return True


def _as_block(lines: _Text, own: StepList, chunks: Sequence[Chunk], texts: Sequence[str]) -> str:
    """Writes a list in brackets, or an empty branch, with dashes below its key."""
    start, end, column = own.node.start_mark, own.node.end_mark, own.key.start_mark.column + _indent(lines)
    head = lines.lines[start.line][: start.column].rstrip()
    rest = lines.lines[end.line][end.column :].rstrip()
    every = [*chunks, *(Chunk((f"- {each}",), 0) for each in texts)]
    written = [line for each in every for line in each.at(column)]
    lines.lines[start.line : end.line + 1] = [f"{head}{rest}", *written]
    return lines.joined()


def _indent(lines: _Text) -> int:
    """Columns between a key and the dashes below it, as the file has them first."""
    for above, line in zip(lines.lines, lines.lines[1:], strict=False):
        if re.match(r"\s*(- )*\w+:\s*(#.*)?$", above) and (dash := re.match(r"\s*(?=- )", line)):
            key = re.match(r"\s*(?:- )*", above)
            return max(0, len(dash[0]) - len(key[0] if key else ""))
    return 2


def _checked(before: str, after: str, edit: tuple[Any, ...]) -> str:
    """Returns the edited text. Raises InputError if its data is not the data of the text before, edited alike."""
    try:
        data, wanted = _data(after), edited(_data(before), *edit)
    except InputError as error:
        raise InputError(_NOT_PLAIN, hint=_BY_HAND) from error
    if data != wanted:
        raise InputError(_NOT_PLAIN, hint=_BY_HAND)
    return after


def edited(data: Any, what: str, path: KeyPath, *values: Any) -> Any:
    """Returns the data of a mission after an edit, which the edited text must have."""
    data = copy.deepcopy(data)
    if what == "insert":
        index, step = values
        _list_in(data, path).insert(index, step)
        return data
    own, index = _list_in(data, path[:-1]), _index(path)
    if what == "double":
        own.insert(index + 1, copy.deepcopy(own[index]))
    elif what == "remove":
        own.pop(index)
    elif what == "move":
        to, at = values
        step = own.pop(index)
        _list_in(data, _after_cut(to, path)).insert(at, step)
    else:
        (block,) = values
        own[index] = _filled(block, own[index])
    return data


def _filled(block: Any, step: Any) -> Any:
    """Returns a block with a step in place of `STEP`."""
    if block == STEP.removeprefix("- "):
        return step
    if isinstance(block, list):
        return [_filled(each, step) for each in block]
    return {key: _filled(each, step) for key, each in block.items()} if isinstance(block, dict) else block


def _list_in(data: Any, path: KeyPath) -> list[Any]:
    above = data
    for key in path[:-1]:
        above = above[key]
    if above[path[-1]] is None:
        above[path[-1]] = []
    found: list[Any] = above[path[-1]]
    return found


def _rows(lines: _Text, node: yaml.Node, path: KeyPath, depth: int) -> Iterator[Row]:
    """Yields the rows of all steps below a node."""
    below = list(_lists(node, path))
    own = [each for each in below if not any(_is_below(each.path, other.path) for other in below)]
    kind = node.value[0][0].value if path and isinstance(node, yaml.MappingNode) else ""
    for each in own:
        is_main = each.key.value in (kind, "steps") if path else len(own) == 1
        shown = not (is_main and each.items)
        if shown:
            first, name = each.key.start_mark.line + 1, " ".join(map(str, each.path[len(path) :]))
            yield Row(each.path, depth, "", name, "" if each.items else "empty", first, lines.last_line(each.node) + 1)
        for n, item in enumerate(each.items):
            step, line = (*each.path, n), item.start_mark.line + 1
            first_key, said, more = _said(lines, item)
            last = lines.end(each, n) if each.is_block else lines.last_line(item) + 1
            inner = depth + shown
            yield Row(step, inner, first_key, said, more, line, last)
            yield from _rows(lines, item, step, inner + 1)


def _is_below(path: KeyPath, other: KeyPath) -> bool:
    return path != other and path[: len(other)] == other


def _said(lines: _Text, node: yaml.Node) -> tuple[str, str, str]:
    """Returns the first key of a step, its value, and the other keys without lists of steps."""
    if not isinstance(node, yaml.MappingNode) or not node.value:
        return lines.slice(node), "", ""
    said = {
        key.value: _short(lines, value)
        for key, value in node.value
        if not (key.value in step_list_keys() and not isinstance(value, yaml.ScalarNode))
    }
    kind = str(node.value[0][0].value)
    first = said.pop(kind, "")
    return kind, first, ", ".join(f"{key}: {value}" for key, value in said.items() if key not in inner_keys())


def _short(lines: _Text, node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return " ".join(str(node.value).split())
    if _in_brackets(node):
        return lines.slice(node)
    parts = (f"{key.value}: {_short(lines, value)}" for key, value in node.value) if node.tag.endswith("map") else ()
    return f"{{{', '.join(parts)}}}"
