"""Commands that other distributions register in the entry-point group `errand.commands`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from skills.files.errors import InputError, listing

__all__ = ["GROUP", "help_lines", "plugin_command"]

GROUP: Final = "errand.commands"
"""Name = the word after `errand`, value = a `typer.Typer` or a function with typer's options."""
_KNOWN: Final[Mapping[str, str]] = {"dataset": "errand-train"}
"""Commands of the project's other distribution."""


def help_lines(shipped: Collection[str]) -> dict[str, str]:
    """The commands of plug-ins by name, each with the summary of its distribution. Imports none of their code.

    It reads the metadata files itself, because importing `importlib.metadata` takes longer than the whole help.
    """
    lines = dict[str, str]()
    for folder in map(Path, sys.path):
        for info in (*folder.glob("*.dist-info"), *folder.glob("*.egg-info")):
            section = _text(info / "entry_points.txt").partition(f"[{GROUP}]\n")[2].partition("\n[")[0]
            names = [line.partition("=")[0].strip() for line in section.splitlines() if "=" in line]
            lines |= {name: _summary(info) for name in names if name not in shipped}
    return dict(sorted(lines.items()))


def _summary(info: Path) -> str:
    metadata = _text(info / "METADATA") or _text(info / "PKG-INFO")
    found = (line.removeprefix("Summary: ") for line in metadata.splitlines() if line.startswith("Summary: "))
    return next(found, f"A command of {info.stem.partition('-')[0]}.")


def _text(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="utf-8", errors="replace")
    return ""


def plugin_command(name: str, make: Callable[[str, Any], Any]) -> Any | None:
    """The command of a plug-in, or None if no distribution registers the name.

    `make` makes a command from its name and the registered object. Raises InputError if the command cannot be loaded,
    several distributions register it, or it belongs to errand-train, which is not installed.
    """
    from skills.files.plugins import PluginDefect, distribution_of, installed_plugins, run_plugin

    found = [entry for entry in installed_plugins(GROUP) if entry.name == name]
    if not found:
        if name in _KNOWN:
            what = f"'{name}' is a command of {_KNOWN[name]}, which is not installed"
            raise InputError(what, hint="run `make train` in a clone of Errand")
        return None
    if len(found) > 1:
        what = f"{listing(sorted(map(distribution_of, found)))} both have a command '{name}'"
        raise InputError(what, hint="uninstall one of them")
    (entry,) = found
    try:
        return run_plugin(entry, lambda: make(name, entry.load()))
    except PluginDefect as defect:
        what = f"cannot load command '{name}' ({entry.value}) of {distribution_of(entry)}: {defect}"
        raise InputError(what, hint="repair or uninstall that distribution") from defect
