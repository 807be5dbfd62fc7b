"""Mutations that certainly break a good mission file, chosen by a seeded generator."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tests.hostile_values import DATA

Path_ = tuple[str | int, ...]
FREE = ("parameters", "knowledge", "with", "gives")  # below these any key may be right
NAMES = ("to", "take", "object", "skill", "use", "world")


def broken_files(good: list[Path], count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Yields `count` broken files: the name of the mutation and the bytes."""
    rng = np.random.default_rng(seed)
    names = sorted(MUTATIONS)
    made = 0
    while made < count:
        file, name = good[rng.integers(len(good))], names[made % len(names)]
        broken = MUTATIONS[name](file.read_text(encoding="utf-8"), rng)
        if broken is None:
            file = good[made % len(good)]
            broken = delete_required(file.read_text(encoding="utf-8"), rng)
            name = "delete_required"
        yield f"{name}-{file.stem}-{made}", broken
        made += 1


def positions(data: Any, path: Path_ = ()) -> Iterator[Path_]:
    """Paths of all keys and items except free ones."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        if key not in FREE:
            yield from positions(value, (*path, key))


def parent(data: Any, path: Path_) -> Any:
    for part in path[:-1]:
        data = data[part]
    return data


def chosen(rng: np.random.Generator, options: list[Any]) -> Any:
    return options[int(rng.integers(len(options)))] if options else None


def changed(text: str, rng: np.random.Generator, where: Callable[[Path_, Any], bool], change: Any) -> bytes | None:
    """Changes one suitable place of the document; None when there is none."""
    data = yaml.safe_load(text)
    path = chosen(rng, [p for p in positions(data) if where(p, parent(data, p)[p[-1]])])
    if path is None:
        return None
    broken = copy.deepcopy(data)
    change(parent(broken, path), path[-1], rng)
    return dumped(broken)


def dumped(data: Any) -> bytes:
    return yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode()


def one_of(*values: Any) -> Any:
    """A change that puts one of some values in."""

    def change(node, key, rng):
        node[key] = chosen(rng, list(values))

    return change


def remove(node, key, rng):
    node.pop(key)


def rename_key(text, rng):
    def rename(node, key, rng):
        value = node.pop(key)
        node[key[:-1] + key[-1] * 2 if rng.random() < 0.5 else "x" + key] = value

    return changed(text, rng, lambda p, v: isinstance(p[-1], str) and "set" not in p[:-1], rename)


def delete_required(text, rng):
    return changed(text, rng, lambda p, v: p in (("name",), ("steps",), ("parts",)), remove)


def delete_half_of_a_pair(text, rng):
    return changed(text, rng, lambda p, v: p[-1] == "do", remove)


def wrong_type(text, rng):
    wrong = [[1, 2], {"a": 1}, 3.5, True, None, []]

    def replace(node, key, rng):
        fits = [w for w in wrong if type(w) is not type(node[key]) and not (key == "name" and w is None)]
        value = chosen(rng, fits) if key in ("name", "steps", "say", "do") else [[{"a": [1]}]]
        node[key] = [1] if value is None else value

    def fits(path, value):
        return isinstance(path[-1], str) and path[-1] not in FREE and value is not None

    return changed(text, rng, fits, replace)


def wrong_number(text, rng):
    values = (-1, 0, -0.5, float("inf"), float("nan"), "soon", [60], True)
    return changed(text, rng, lambda p, v: p[-1] in ("timeout", "time", "limit"), one_of(*values))


def unknown_name(text, rng):
    names = ("moon base", "kitchn", "unicorn", "..", "a" * 300, "navigat", "flatt", "🙂")
    return changed(text, rng, lambda p, v: p[-1] in NAMES and isinstance(v, str), one_of(*names))


def unknown_sentence(text, rng):
    sentences = ("sing me a song", "", "bring", "fetch the unicorn from the kitchen", "x" * 5000, "?!")
    return changed(text, rng, lambda p, v: p[-1] == "say", one_of(*sentences))


def unknown_port(text, rng):
    def replace(node, key, rng):
        node[key] = {"nonsense": 1, **(node[key] or {})}

    return changed(text, rng, lambda p, v: p[-1] == "with", replace)


def mistyped_port(text, rng):
    def replace(node, key, rng):
        name = chosen(rng, sorted(node[key]))
        node[key][name] = chosen(rng, [[[]], {"b": {}}, [None]])

    return changed(text, rng, lambda p, v: p[-1] == "with" and isinstance(v, dict) and v, replace)


def unknown_parameter(text, rng):
    return changed(text, rng, lambda p, v: isinstance(v, str), one_of("the ${nowhere} room"))


def steps_of(data):
    """Steps of a file, or of its first part."""
    return next(iter(data["parts"].values()))["steps"] if "parts" in data else data["steps"]


def empty_step(text, rng):
    data = yaml.safe_load(text)
    steps = steps_of(data)
    steps.insert(int(rng.integers(len(steps) + 1)), chosen(rng, [{}, None, "go", 3, [], {"with": {}}]))
    return dumped(data)


def uses_itself(text, rng):
    data = yaml.safe_load(text)
    steps_of(data).append({"use": "mission.yaml"})
    data.pop("parameters", None)
    return dumped(data)


def bad_override(text, rng):
    data = yaml.safe_load(text)
    wrong = [{"places": {"kitchen": 3}}, {"thngs": {}}, {"people": {"Robin": {"at": "mars"}}}, {"surfaces": {"x": {}}}]
    data["knowledge"] = chosen(rng, [*wrong, [1], "all"])
    return dumped(data)


def with_a_tab(text, rng):
    lines = text.splitlines()
    at = chosen(rng, [n for n, line in enumerate(lines) if line.startswith("  ")])
    lines[at] = "\t" + lines[at]
    return "\n".join(lines).encode()


def unbalanced(text, rng):
    lines = text.splitlines()
    at = chosen(rng, [n for n, line in enumerate(lines) if ":" in line and not line.startswith("#")])
    value = chosen(rng, ["{", "[", '"', "'", "}", "*x", "!!python/object:x y", "@"])
    lines[at] = f"{lines[at].split(':')[0]}: {value}"
    return "\n".join(lines).encode()


def doubled_key(text, rng):
    return (text + "name: again\n").encode()


def not_utf8(text, rng):
    raw = bytearray(text.encode())
    raw[int(rng.integers(len(raw)))] = 0xFF
    return bytes(raw)


def binary(text, rng):
    return rng.integers(0, 256, int(rng.integers(1, 2000)), dtype=np.uint8).tobytes()


def control_character(text, rng):
    at = int(rng.integers(len(text)))
    return (text[:at] + chosen(rng, ["\x00", "\x07", "\x1b"]) + text[at:]).encode()


def empty(text, rng):
    return chosen(rng, [b"", b"\n\n", b"# nothing\n", b"---\n", b"null\n", b"[]\n", b"3\n", b"text\n"])


def huge(text, rng):
    steps = {"name": "huge", "steps": [{"say": "go to the kitchen"}]}
    kind = int(rng.integers(3))
    if kind == 0:
        return (yaml.safe_dump(steps) + "# " + "x" * 2_000_000).encode()
    if kind == 1:
        return ("name: deep\nsteps: " + "[" * 5000 + "]" * 5000).encode()
    return b"name: x\nsteps: &a [{say: go to the kitchen}, *a]\n"


def cut_off(text, rng):
    lines = [line for line in text.splitlines(keepends=True) if not line.startswith("#")]
    at = next(n for n, line in enumerate(lines) if line.startswith(("steps:", "parts:")))
    return "".join(lines[: int(rng.integers(at + 1))]).encode()


def two_documents(text, rng):
    return f"{text}\n---\n{text}".encode()


MUTATIONS: dict[str, Callable[[str, np.random.Generator], bytes | None]] = {
    make.__name__: make
    for make in (
        rename_key, delete_required, delete_half_of_a_pair, wrong_type, wrong_number, unknown_name, unknown_sentence,
        unknown_port, mistyped_port, unknown_parameter, empty_step, uses_itself, bad_override, with_a_tab, unbalanced,
        doubled_key, not_utf8, binary, control_character, empty, huge, cut_off, two_documents,
    )
}  # fmt: skip


# Mutations at random, of which some leave a good file.

PARTS = (
    "steps", "if", "then", "else", "repeat", "for_each", "as", "times", "until", "while", "every", "try", "together",
    "done_when", "wait", "for", "seconds", "until_clock", "check", "dock", "level", "group", "always", "when", "holds",
    "ask", "choices", "match", "limit", "default", "gives", "answer", "set", "variables", "all", "any", "not", "button",
    "object", "person", "door", "at", "look", "to", "take", "do", "skill", "use", "with", "on_failure", "timeout",
)  # fmt: skip
VALUES = (
    None, True, False, 0, 1, -1, 3.5, 10**9, 10**400, 1e300, float("inf"), float("nan"), "", " ", "kitchen", "mars",
    "start", "count + 1", "count >", "1 / 0", "battery < 0.3", "holding", "'a' * 9", "{count}", "{", "${room}", "${",
    "$${room}", "beer", "tea", "dock", "rooms", "people in hall", "14:30", "2 s", "9" * 400, "x" * 3000, "\u0000",
    "\ud7ff", "🙂", "a\nb", "__import__('os')", "every_block.yaml", "../x.yaml", [], {}, [[]], [None], {"a": 1},
    ["dock"], [{}], [{"to": "hall"}], {"times": 2}, {"expression": "true"}, {"all": ["holding"]}, {"answer": "count"},
    {1: 2}, {True: []}, *(value for value in DATA if not isinstance(value, bytes)),
)  # fmt: skip


def mutated_files(good: list[Path], count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Yields `count` files with one to three random changes each: a name and the bytes."""
    rng = np.random.default_rng(seed)
    texts = [file.read_text(encoding="utf-8") for file in good]
    for number in range(count):
        chosen_file = int(rng.integers(len(texts)))
        raw = texts[chosen_file].encode()
        ways = [RANDOM_CHANGES[int(rng.integers(len(RANDOM_CHANGES)))] for _ in range(chosen(rng, [1, 1, 1, 2, 3]))]
        for way in ways:
            raw = way(raw, rng)
        yield f"{good[chosen_file].stem}-{number}-{'-'.join(way.__name__ for way in ways)}", raw


def some_bytes(raw, rng):
    """Changes, adds or removes some bytes."""
    data = bytearray(raw)
    for _ in range(int(rng.integers(1, 6))):
        at, kind = int(rng.integers(len(data) + 1)), int(rng.integers(3))
        letter = int(rng.integers(256)) if rng.random() < 0.2 else ord(chosen(rng, list(" :-{}[]'\"#,&*!|>%@0a\n\t")))
        data[at : at + (kind != 1)] = b"" if kind == 0 else bytes([letter])
    return bytes(data) or b" "


def some_lines(raw, rng):
    """Removes, doubles, moves, indents or cuts off a line."""
    lines = raw.split(b"\n")
    at, other, kind = int(rng.integers(len(lines))), int(rng.integers(len(lines))), int(rng.integers(5))
    line = lines[at]
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(other, line)
    elif kind == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 3:
        lines[at] = b" " * int(rng.integers(9)) + line.lstrip()
    else:
        lines[at] = line[: int(rng.integers(len(line) + 1))]
    return b"\n".join(lines) or b" "


def some_key(raw, rng):
    """Replaces, removes or adds a key."""

    def change(node, key, rng):
        kind, part = int(rng.integers(3)), chosen(rng, list(PARTS))
        if kind == 0 or not isinstance(node, dict):
            node[key] = {part: node[key]}
        elif kind == 1:
            node[part] = node.pop(key)
        else:
            node[part] = chosen(rng, list(VALUES))

    return _tree_changed(raw, rng, change)


def some_value(raw, rng):
    """Replaces a value by another one of the file."""
    return _tree_changed(raw, rng, one_of(*VALUES))


def some_branch(raw, rng):
    """Replaces a part of the file by another part."""
    data = _plain(raw)
    places = list(positions(data)) if isinstance(data, dict) else []
    if not places:
        return some_bytes(raw, rng)
    source, target = chosen(rng, places), chosen(rng, places)
    value = copy.deepcopy(parent(data, source)[source[-1]])
    parent(data, target)[target[-1]] = value
    return _dumped(data)


def _tree_changed(raw, rng, change):
    data = _plain(raw)
    places = list(positions(data)) if isinstance(data, dict) else []
    if not places:
        return some_bytes(raw, rng)
    path = chosen(rng, places)
    change(parent(data, path), path[-1], rng)
    return _dumped(data)


def _plain(raw):
    try:
        return yaml.safe_load(raw)
    except (yaml.YAMLError, ValueError, RecursionError):
        return None


def _dumped(data):
    text = yaml.dump(data, sort_keys=False, allow_unicode=True, Dumper=_Dumper)
    return text.encode("utf-8", "surrogatepass")


class _Dumper(yaml.SafeDumper):
    """Dumper that writes a value twice instead of an alias."""

    def ignore_aliases(self, data):
        return True


RANDOM_CHANGES = (some_bytes, some_lines, some_key, some_value, some_value, some_branch)
