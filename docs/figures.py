"""Measured figures: `docs/figures/NAME.json`, which a benchmark writes, and their text on a page.

A page says `{{ figures.NAME.KEY }}` for a value or a table, and `{{ figures.NAME }}` for the command, seeds and date.
"""

from __future__ import annotations

import functools
import json
import re
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent / "figures"
QUOTE = re.compile(r"\{\{ figures\.(\w+)(?:\.(\w+))? \}\}")
KEYS = ("command", "commit", "date", "machine", "seeds", "values")
"""Keys of a file; a fact that nobody wrote down is null. `recorded` may add the day when the figure was first told."""


class UnknownFigureError(ValueError):
    """Raised for a quote of a figure that no file has."""


@functools.cache
def load(name: str) -> dict[str, Any]:
    """Reads the file of one measure. Raises UnknownFigureError."""
    file = FOLDER / f"{name}.json"
    if not file.is_file():
        raise UnknownFigureError(f"no figures '{name}': there is no {file.name} in docs/figures")
    data: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return data


def quoted(text: str) -> str:
    """Replaces the quotes of figures in a page's text. Raises UnknownFigureError."""
    return QUOTE.sub(lambda found: shown(found[1], found[2]), text)


def shown(name: str, key: str | None) -> str:
    """Returns the text of a value, a table as Markdown, or without a key the origin. Raises UnknownFigureError."""
    data = load(name)
    if key is None:
        return origin(data)
    if key not in data["values"]:
        raise UnknownFigureError(f"no figure '{key}' in docs/figures/{name}.json")
    value = data["values"][key]
    if not isinstance(value, list):
        return str(value)
    header, *rows = [[str(cell).replace("|", "&#124;") for cell in row] for row in value]
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, ["---"] * len(header), *rows))


def origin(data: dict[str, Any]) -> str:
    """Says how and when figures were measured, and what nobody wrote down."""
    missing = [key for key in ("seeds", "date", "machine", "commit") if not data[key]]
    facts = [
        f"`{data['command']}`" if data["command"] else "command not recorded",
        f"seeds {data['seeds']}" if data["seeds"] else "",
        data["date"] or (f"written down {data['recorded']}" if data.get("recorded") else ""),
        data["machine"] or "",
        f"commit {data['commit']}" if data["commit"] else "",
        f"not recorded: {', '.join(missing)}" if missing else "",
        data.get("note", "").rstrip("."),
    ]
    return "; ".join(filter(None, facts))
