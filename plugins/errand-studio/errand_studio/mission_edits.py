"""Edits of a mission's text as a user makes them in the outline: each returns the text and the step to select."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from errand_studio import outline
from skills.inputs.yaml_source import KeyPath

Edited = tuple[str, KeyPath | None]
_STEPS: Final = ("steps",)
_LAST: Final = 10_000


def edited(what: str, text: str, path: KeyPath, kind: str = "") -> Edited:
    """Edits the step at `path`; `what` is the edit, `kind` the block to wrap it in. Raises InputError as `outline`."""
    index, own = int(path[-1]), path[:-1]
    match what:
        case "remove":
            return outline.remove(text, path), None
        case "double":
            return outline.double(text, path), (*own, index + 1)
        case "wrap in":
            return outline.wrap(text, path, kind), path
        case "up" if index > 0:
            return outline.move(text, path, own, index - 1), (*own, index - 1)
        case "down":
            return outline.move(text, path, own, index + 1), (*own, index + 1)
        case "out" if len(own) > 1:
            above = next(path[:n] for n in range(len(own) - 1, 0, -1) if isinstance(path[n - 1], int))
            to, behind = above[:-1], int(above[-1]) + 1
            return outline.move(text, path, to, behind), (*to, behind)
        case "in" if index > 0:
            within = [each for each in outline.list_paths(text) if each[: len(path)] == (*own, index - 1)]
            if within:
                return outline.move(text, path, within[-1], _LAST), None
    return text, path


def dropped(text: str, to: KeyPath, place: str, path: KeyPath | None, step: str) -> Edited:
    """Moves the step at `path`, or inserts `step`, `into` the list `to` or `before` or `behind` the step there."""
    target, index = (to, 0) if place == "into" else (to[:-1], int(to[-1]) + (place == "behind"))
    if path is None:
        return outline.insert(text, target, index, step), (*target, index)
    index -= target == path[:-1] and index > int(path[-1])
    return outline.move(text, path, target, index), None


def inserted(text: str, path: KeyPath | None, steps: Sequence[str], name: str) -> Edited:
    """Inserts steps behind the step at `path`, or at the end. An empty text becomes a mission called `name`."""
    text = text if text.strip() else f"name: {name}\nsteps:\n  []\n"
    if path is None:
        path = (*_STEPS, sum(row.path[:-1] == _STEPS for row in outline.rows(text) if not row.is_list) - 1)
    target, index = path[:-1], int(path[-1])
    for step in steps:
        index += 1
        text = outline.insert(text, target, index, step)
    return text, (*target, index)


def path_of(value: Any) -> KeyPath | None:
    """Reads a path that a browser sends."""
    if not isinstance(value, list) or not value or not all(isinstance(each, str | int) for each in value):
        return None
    return tuple(value)


def items(lines: Sequence[str]) -> list[str]:
    """Splits the lines of steps into the steps."""
    return ["- " + step for step in "\n".join(lines).removeprefix("- ").split("\n- ")]
