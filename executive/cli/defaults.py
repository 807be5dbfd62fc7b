"""Defaults for options from `errand.toml`, or from `[tool.errand]` in `pyproject.toml`, of this folder or one above."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from skills.inputs.errors import InputError, suggestion
from skills.inputs.outside import is_there, read_text

if TYPE_CHECKING:
    from executive.mission.request import Request

FILE: Final = "errand.toml"
_SECTION: Final = "[tool.errand]"
_OF_REQUESTS: Final = (("run",), ("check",), ("evaluate",), ("queue", "add"))
_OF_STORES: Final = (("run",), *(("queue", name) for name in ("add", "list", "remove", "run", "serve")), ("resume",))
_OF_RUNS: Final = (*_OF_STORES, ("runs",), ("runs", "clean"))
_COMMANDS: Final[Mapping[str, tuple[tuple[str, ...], ...]]] = {
    "world": (*_OF_REQUESTS, ("tree",), ("parse",), ("listen",), ("teleop",), ("fleet", "run"), ("map", "build")),
    "robots": (*_OF_REQUESTS, ("fleet", "run")),
    "stack": (*_OF_REQUESTS, ("stack", "show")),
    "out": _OF_RUNS,
    "store": _OF_STORES,
}
"""Keys of the file, with the commands that have an option of this name."""
_NAMES: Final = frozenset({"world", "stack"})
"""Keys whose value may be a name instead of a path."""


def default_map(folder: Path) -> dict[str, Any]:
    """Returns the defaults for each command's options from the nearest file; {} without a file. Raises InputError."""
    file, values = _nearest(folder)
    found: dict[str, Any] = {}
    for key, value in values.items():
        if key not in _COMMANDS:
            what = f"'{key[:60]}' is no default"
            raise InputError(what, hint=suggestion(key, _COMMANDS), file=file)
        if not isinstance(value, str) or not value:
            raise InputError(f"the value of '{key}' is no text", hint=f'write {key} = "..."', file=file)
        for words in _COMMANDS[key]:
            options = found
            for word in words:
                options = options.setdefault(word, {})
            options[key] = value if key == "robots" else _path(file.parent, value, is_name=key in _NAMES)
    return found


def runs_folder() -> Path:
    """Returns the folder of the runs where a command has no option for it. Raises InputError."""
    return Path(default_map(Path()).get("run", {}).get("out", "out"))


def chosen_run(run: Path | None) -> Path:
    """Returns the folder or file of a run, by default the link to the last run. Raises InputError if it is missing."""
    from executive.app.runs.folders import LAST

    if not is_there(path := run or runs_folder() / LAST):
        raise InputError("there is no run, or it is removed", hint="name one that `errand runs` lists", file=path)
    return path


def _nearest(folder: Path) -> tuple[Path, Mapping[str, Any]]:
    """Returns the nearest file of defaults, in a folder or above it, with its values. Raises InputError."""
    for each in (folder, *folder.resolve().parents):
        if (file := each / FILE).is_file():
            return file, _values(file)
        project = each / "pyproject.toml"
        if project.is_file() and _SECTION in project.read_text(encoding="utf-8", errors="replace"):
            return project, _values(project).get("tool", {}).get("errand", {})
    return folder / FILE, {}


def _values(file: Path) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(read_text(file))
    except (ValueError, RecursionError) as error:
        what = "it is nested too deeply" if isinstance(error, RecursionError) else f"it is no TOML ({error})"
        raise InputError(what, hint="correct it there", file=file) from error


def _path(folder: Path, value: str, *, is_name: bool) -> str:
    """Returns a path relative to the folder of the defaults file; a name that is no file there stays the same."""
    path = folder / value
    return value if is_name and not path.exists() else os.path.relpath(path)


def typed_options(context: Any) -> frozenset[str]:
    """Returns the names of the options that the user has typed."""
    return frozenset(name for name in context.params if context.get_parameter_source(name).name == "COMMANDLINE")


def yielding(request: Request, context: Any) -> Request:
    """Drops the defaults that the command line or the mission file overrides. Raises InputError."""
    from executive.app.prepare.mission_files import mission_file
    from executive.mission.request import Request
    from skills.inputs.yaml_source import read_yaml

    usual = {name for name in context.params if context.get_parameter_source(name).name == "DEFAULT_MAP"}
    dropped = set[str]()
    if request.robots and "robots" not in usual:
        dropped |= {"stack"}
    if (request.stack is not None and "stack" not in usual) or request.start is not None:
        dropped |= {"robots"}
    if usual and request.file is not None:
        written = read_yaml(mission_file(request.file)).data
        written = written if isinstance(written, dict) else {}
        dropped |= {"world"} & written.keys()
        dropped |= {"robots", "stack"} if {"robots", "parts"} & written.keys() else set()
    return replace(request, **{name: getattr(Request, name) for name in dropped & usual})
