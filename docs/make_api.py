"""The page on the public API: the names that `docs/api.md` lists, with what the code says of them."""

from __future__ import annotations

import ast
import dataclasses
import enum
import inspect
import itertools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from skills.quantities import quantity_of, range_text

LIST = Path(__file__).resolve().parent / "api.md"
_ROW = re.compile(r"^\| `([\w.]+)` \| ((?:`\w+`(?:, )?)+) \|", re.MULTILINE)
PORTS = """## Ports and units

The fields of a skill's `Inputs` are its input ports; `outputs` names the output ports with their types. A type may be
any class, a tuple or a union. The compiler checks every connection before a run, and the leaf every value during it; an
`int` passes as a `float`. In a mission file `with` sets input ports by name.

Quantities are in SI units: metres, radians, seconds, kilograms, newtons. A name says its unit where it has one (`_m`,
`_rad`, `_s`, `_m_s`, `_n`, `_kg`). The charge of a battery is from 0 to 1. Times count the robot's clock.

A name says its frame, too. `X_AB` is the pose of frame B in frame A; `points_W` are in the world frame. The frames are
world `W`, odometry `O`, body `B` (x ahead, y left, z up), hand `H`, camera `C` (z ahead, x right, y down), lidar `L`.
"""


def public_names() -> dict[str, tuple[str, ...]]:
    """The public names by module, as `docs/api.md` lists them."""
    found = dict[str, tuple[str, ...]]()
    for module, names in _ROW.findall(LIST.read_text(encoding="utf-8")):
        found[module] = (*found.get(module, ()), *re.findall(r"`(\w+)`", names))
    return found


def meaning(module: ModuleType, name: str) -> str:
    """The docstring of a public name; of a number its range, of another constant the text below it in the source."""
    thing = inspect.unwrap(getattr(module, name))
    if inspect.isclass(thing) or inspect.isroutine(thing):
        return _doc(thing)
    if quantity_of(thing) is not None:
        return f"A number {range_text(thing)}."
    body = ast.parse(inspect.getsource(module)).body
    for statement, following in itertools.pairwise(body):
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        if name in (getattr(each, "id", None) for each in targets) and isinstance(following, ast.Expr):
            return inspect.cleandoc(str(ast.literal_eval(following.value)))
    return ""


def api_page() -> str:
    """The text of the page."""
    parts = [f"# API reference\n\nThe names that [the public API](../api.md) lists.\n\n{PORTS}"]
    for module, names in public_names().items():
        loaded = import_module(module)
        parts.append(f"## {module}\n\n{_doc(loaded)}\n")
        parts += [_section(loaded, name) for name in names]
    return "\n".join(parts)


def _section(module: ModuleType, name: str) -> str:
    thing, text = inspect.unwrap(getattr(module, name)), meaning(module, name)
    if inspect.isroutine(thing):
        return f"### {name}\n\n```python\n{name}{_signature(thing)}\n```\n\n{text}\n"
    members = _members(thing) if inspect.isclass(thing) else ()
    return f"### {name}\n\n{text}\n" + "".join(f"\n{part}\n" for part in members)


def _members(kind: type[Any]) -> Iterator[str]:
    if issubclass(kind, enum.Enum):
        yield "Values: " + ", ".join(f"`{member.name}`" for member in kind) + "."
    elif dataclasses.is_dataclass(kind):
        yield "| field | type | default |\n|---|---|---|\n" + "\n".join(_fields(kind))
    methods = list(_methods(kind))
    if methods:
        yield "\n".join(methods)


def _fields(kind: type[Any]) -> Iterator[str]:
    for field in (each for each in dataclasses.fields(kind) if each.init and not each.name.startswith("_")):
        default = "" if field.default is dataclasses.MISSING else f"`{_plain(field.default)}`"
        if field.default_factory is not dataclasses.MISSING:
            default = "new object"
        yield f"| `{field.name}` | {_escaped(str(field.type))} | {_escaped(default)} |"


@dataclass(frozen=True)
class Member:
    """A method or property that a class itself defines."""

    name: str
    function: Callable[..., Any]
    is_property: bool

    def line(self) -> str:
        """Its line on the page."""
        shown = self.name if self.is_property else f"{self.name}{_signature(self.function, bound=True)}"
        return f"- `{shown}`: {' '.join(_doc(self.function).split())}"


def members_of(kind: type[Any]) -> Iterator[Member]:
    """The public methods and properties that a class itself defines."""
    fields = {field.name for field in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    for name, value in tuple(vars(kind).items()):
        inner = value.func if isinstance(value, cached_property) else value
        inner = getattr(inner, "__func__", getattr(inner, "fget", inner))
        if (
            not name.startswith("_")
            and name not in fields
            and inspect.isfunction(inner)
            and inner.__module__ == kind.__module__
        ):
            yield Member(name, inner, isinstance(value, property | cached_property))


def _methods(kind: type[Any]) -> Iterator[str]:
    return (member.line() for member in members_of(kind))


@dataclass(frozen=True)
class _Written:
    """Shown in a signature as it is written in the source."""

    text: str

    def __repr__(self) -> str:
        return self.text


def _signature(function: Callable[..., Any], *, bound: bool = False) -> str:
    found = inspect.signature(function)
    parameters = list(found.parameters.values())[1 if bound else 0 :]
    shown = [
        p.replace(
            annotation=p.annotation if p.annotation is p.empty else _Written(str(p.annotation)),
            default=p.default if p.default is p.empty else _Written(_plain(p.default)),
        )
        for p in parameters
    ]
    returned = found.return_annotation
    given = returned if returned is found.empty else _Written(str(returned))
    return str(found.replace(parameters=shown, return_annotation=given))


def _plain(value: Any) -> str:
    """A default in short: one that is an object goes by its class."""
    text = repr(value)
    return text if len(text) <= 30 and " at 0x" not in text else f"{type(value).__name__}(...)"


def _escaped(text: str) -> str:
    return text.replace("|", "&#124;")


def _doc(thing: Any) -> str:
    """A docstring as Markdown: each entry below "Args:" and "Raises:" becomes an item of a list."""
    text = re.sub(r"^(Args|Raises):\n(?= )", r"\1:\n\n", inspect.cleandoc(thing.__doc__ or ""), flags=re.MULTILINE)
    lines = text.splitlines()
    begun = False
    for n, line in enumerate(lines):
        begun = line in ("Args:", "Raises:") or (begun and (line == "" or line.startswith("    ")))
        if begun and re.match(r"    \S", line):
            lines[n] = f"- {line.strip()}"
    return "\n".join(lines)
