"""Commands that other distributions register in the entry-point group `errand.commands`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from skills.files.errors import InputError, listing

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

__all__ = ["GROUP", "help_lines", "plugin_command"]

GROUP: Final = "errand.commands"
"""Name = the word after `errand`, value = a `typer.Typer` or a function with typer's options."""
_KNOWN: Final[Mapping[str, str]] = {"dataset": "errand-train"}
"""The project's own commands that stand in another distribution, and which that is."""


def help_lines(shipped: Collection[str]) -> dict[str, str]:
    """The plug-ins' commands and a line for the help of each, from the metadata: none of their code is imported."""
    if not _any_registered():
        return {}
    from skills.files.plugins import distribution_of

    lines = dict[str, str]()
    for entry in sorted(_registered(), key=lambda each: each.name):
        if entry.name not in shipped:
            summary = None if entry.dist is None else entry.dist.metadata["Summary"]
            lines[entry.name] = summary or f"A command of {distribution_of(entry)}."
    return lines


def plugin_command(name: str, made: Callable[[str, Any], Any]) -> Any | None:
    """The command of a plug-in, which `made` makes of its name and what is registered; None: nobody registers it.

    Raises InputError: it cannot be loaded, several distributions register it, or it is one of errand-train, which is
    not installed.
    """
    found = [entry for entry in _registered() if entry.name == name]
    if not found:
        if name in _KNOWN:
            what = f"'{name}' is a command of {_KNOWN[name]}, which is not installed"
            raise InputError(what, hint="run `make train` in a clone of Errand")
        return None
    from skills.files.plugins import PluginDefect, distribution_of, run_plugin

    if len(found) > 1:
        what = f"{listing(sorted(map(distribution_of, found)))} both have a command '{name}'"
        raise InputError(what, hint="uninstall one of them")
    (entry,) = found
    try:
        return run_plugin(entry, lambda: made(name, entry.load()))
    except PluginDefect as defect:
        what = f"cannot load command '{name}' ({entry.value}) of {distribution_of(entry)}: {defect}"
        raise InputError(what, hint="repair or uninstall that distribution") from defect


def _registered() -> Collection[EntryPoint]:
    from skills.files.plugins import installed_plugins

    return installed_plugins(GROUP)


def _any_registered() -> bool:
    """Whether any installed distribution names the group; `importlib.metadata` takes longer than the whole help."""
    return any(f"[{GROUP}]".encode() in content for content in _entry_point_files())


def _entry_point_files() -> Iterator[bytes]:
    for folder in map(Path, sys.path):
        for info in (*folder.glob("*.dist-info"), *folder.glob("*.egg-info")):
            with suppress(OSError):
                yield (info / "entry_points.txt").read_bytes()
