"""Completes keys and values of a mission at the cursor, by the schema, the world, the skills and the tasks."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cache
from typing import Any, Final

from errand_studio.mission_schema import mission_schema, step_list_keys
from executive.tree.registry import installed_skills
from executive.words.knowledge import Knowledge
from executive.words.task import installed_tasks
from plant.worlds.world import known_worlds

Option = Mapping[str, str]
_REF: Final = "#/$defs/"
_LINE: Final = re.compile(r"(\s*)((?:- +)*)(?:([\w ]+?|\"[^\"]*\"):(?:\s+(.*))?|(.*))$")
_PIECE: Final = re.compile(r"[{}\[\],]|([\w ]+?):(?=\s|$)")


def complete(text: str, line: int, column: int, knowledge: Knowledge) -> tuple[int, list[Option]]:
    """Returns the options at a cursor (line from 1), with the column from which they replace the text."""
    lines = text.splitlines() or [""]
    before = (lines[line - 1] if line <= len(lines) else "")[:column]
    word = re.search(r"[\w ]*$", before)
    start = column - len((word[0] if word else "").lstrip())
    path, siblings, is_value = _context(lines, line, before)
    wanted = before[start:].strip().lower()
    found = _values(path, siblings, knowledge) if is_value else _keys(path, siblings)
    return start, [option for option in found if f" {wanted}" in f" {option['label'].lower()}"]


def _context(lines: Sequence[str], line: int, before: str) -> tuple[list[str], dict[str, str], bool]:
    """Returns the keys above the cursor, the pairs beside it, and whether a value stands there."""
    keys, indent, last = _outer_keys(lines, line, before)
    siblings = _beside(lines, line, indent)
    if keys[-1:] == ["with"]:  # the ports are those of the skill beside it
        siblings = {**siblings, "skill": _beside(lines, *last).get("skill", "")}
    match = _LINE.match(before)
    key, rest = (match[3], match[4] if match[3] else match[5]) if match else (None, None)
    path, is_value = (keys, False) if key is None else ([*keys, key.strip()], True)
    opened = list[tuple[str, list[str]]]()
    for piece in _PIECE.finditer(rest or ""):
        bracket, above = opened[-1] if opened else ("", keys)
        if piece[0] in "{[":
            opened.append((piece[0], path))
            siblings = {"skill": siblings.get("skill", "")} if path[-1:] == ["with"] else {}
            is_value = piece[0] == "["
        elif piece[0] in "}]":
            path, is_value = above, True
            opened = opened[:-1]
        elif piece[0] == ",":
            path, is_value = above, bracket == "["
        else:
            siblings, path, is_value = {**siblings, piece[1].strip(): ""}, [*above, piece[1].strip()], True
    return path, siblings, is_value


def _outer_keys(lines: Sequence[str], line: int, before: str) -> tuple[list[str], int, tuple[int, int]]:
    """Returns the keys under which a line stands, the column of its first key, and line and column of the last key."""
    match = _LINE.match(before)
    indent = len(match[1]) + len(match[2]) if match else 0
    column, keys = indent - (len(match[2]) if match and match[2] else 0), list[str]()
    dashed, own_indent, last = bool(match and match[2]), indent, (line, indent)
    for number in range(line - 1, 0, -1):
        above = lines[number - 1]
        found = _LINE.match(above)
        if found is None or not above.strip() or above.lstrip().startswith("#"):
            continue
        own = len(found[1]) + len(found[2])
        if found[3] is not None and not found[4] and (own < indent or (dashed and own == column)):
            last = last if keys else (number, own)
            keys.insert(0, found[3].strip())
            indent, column, dashed = own, len(found[1]), bool(found[2])
    return keys, own_indent, last


def _beside(lines: Sequence[str], line: int, indent: int) -> dict[str, str]:
    """Returns the keys of the same step, with their values."""
    found = dict[str, str]()
    for step in (range(line - 1, -1, -1), range(line, len(lines))):
        for number in step:
            match = _LINE.match(lines[number]) if number < len(lines) else None
            own = len(match[1]) + len(match[2]) if match else 0
            if match is None or (lines[number].strip() and own < indent):
                break
            if own == indent and match[3] and number != line - 1:
                found[match[3].strip()] = match[4] or ""
            if (own == indent and match[2] and number < line) or (number >= line and match[2] and own <= indent):
                break
    return found


def _resolved(schema: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yields the alternatives of a part of the schema."""
    if "$ref" in schema:
        target: Any = mission_schema()
        for name in schema["$ref"].removeprefix("#/").split("/"):
            target = target[name]
        yield from _resolved(target)
        return
    alternatives = [each for each in schema.get("anyOf", ()) if set(each) != {"required"}]
    if alternatives and "properties" not in schema:
        for each in alternatives:
            yield from _resolved(each)
        return
    yield schema


def _below(schemas: Iterable[Mapping[str, Any]], key: str) -> list[Mapping[str, Any]]:
    """Returns the parts of the schema under a key; those of the items of a list, too."""
    found = list[Mapping[str, Any]]()
    for schema in schemas:
        inner = schema.get("properties", {}).get(key) or schema.get("additionalProperties") or {}
        for each in _resolved(inner) if isinstance(inner, dict) else ():
            found += list(_resolved(each["items"])) if "items" in each else [each]
    return found


def _parts(path: Sequence[str], siblings: Mapping[str, str]) -> list[Mapping[str, Any]]:
    """Returns the parts of the schema in which a key stands; of steps, those that have the keys beside it."""
    at = max((n for n, key in enumerate(path) if key in step_list_keys()), default=-1)
    steps: Mapping[str, Any] = {"$ref": f"{_REF}AnyStep"}
    schemas = list(_resolved(steps if at >= 0 else mission_schema()))
    inner = path[at + 1 :]
    for key in inner:
        schemas = _below(schemas, key)
    if at >= 0 and not inner:
        schemas = [each for each in schemas if all(key in each.get("properties", {}) for key in siblings)] or schemas
    return schemas


def _keys(path: Sequence[str], siblings: Mapping[str, str]) -> list[Option]:
    """Returns the keys that can stand here."""
    if path and path[-1] == "with" and (skill := installed_skills().get(siblings.get("skill", "").strip())):
        ports = {port.name: f"port of {siblings['skill'].strip()}" for port in fields(skill.Inputs)}
        return [_key_option(name, about) for name, about in ports.items()]
    found = dict[str, str]()
    for schema in _parts(path, siblings):
        for key, value in schema.get("properties", {}).items():
            found.setdefault(key, str(value.get("description") or "").split("\n")[0])
    left = {key: about for key, about in found.items() if key not in siblings}
    return [_key_option(key, about) for key, about in left.items()]


def _key_option(key: str, about: str) -> Option:
    return {"label": key, "detail": about[:60], "apply": f"{key}: "}


def _values(path: Sequence[str], siblings: Mapping[str, str], knowledge: Knowledge) -> list[Option]:
    """Returns the values that can stand behind the last key."""
    key, options = path[-1], dict[str, str]()
    for schema in _parts(path, siblings):
        values = [*schema.get("enum", ()), *([schema["const"]] if "const" in schema else [])]
        options.update(dict.fromkeys(map(str, values), key))
        options |= dict.fromkeys(("true", "false"), key) if schema.get("type") == "boolean" else {}
    for kind, names in _names(knowledge).items():
        if kind in _KINDS.get(key, ()):
            options |= dict.fromkeys(names, kind)
    return [{"label": label, "detail": kind} for label, kind in options.items()]


_KINDS: Final[Mapping[str, Sequence[str]]] = {
    "to": ("place", "surface", "person", "start"),
    "at": ("place", "surface"),
    "of": ("surface", "place", "object"),
    "take": ("object",),
    "object": ("object", "person"),
    "person": ("person",),
    "door": ("place",),
    "do": ("task",),
    "skill": ("skill",),
    "world": ("world",),
}
"""Kinds of names that stand behind a key."""


def _names(knowledge: Knowledge) -> Mapping[str, Iterable[str]]:
    return {
        "place": knowledge.places,
        "surface": knowledge.surfaces,
        "object": knowledge.object_names(),
        "person": knowledge.people,
        "start": ("start",),
        **_installed(),
    }


@cache
def _installed() -> Mapping[str, tuple[str, ...]]:
    return {
        "task": tuple(installed_tasks()),
        "skill": tuple(installed_skills()),
        "world": tuple(sorted(known_worlds())),
    }
