"""Entry point of the command line, which imports the module of a command only when the command runs.

Otherwise the help would import the plant, the sentence parser and the detector.
"""

from __future__ import annotations

import atexit
import gc
import logging
import os
import re
import sys
import threading
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Annotated, Any, Final, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from skills.inputs.errors import MOST_LETTERS, InputError, listing, nearest_name, one_line

_COLLECTED_AFTER: Final = (400_000, 20, 50)
"""Thresholds of the three generations of garbage collection; imports create many objects that all stay."""


COMMANDS_GROUP: Final = "errand.commands"
"""The entry-point group of plug-ins: name = the word after `errand`, or GROUP.NAME below a group of Errand; value = a
`typer.Typer` or a function with typer's options."""
_COMPLETED: Final = frozenset({"file", "files", "world", "run"})
"""Parameters whose values a shell completes."""
_HELP: Final = (
    r'^def {0}\((?:(?!^\w).)*?\n    """(?P<function>[^"\n]+)'
    r'|^{0} = typer\.Typer\((?:(?!^\w).)*?help="(?P<group>[^"\n]+)"'
)
"""First line of a function's docstring, or the help of a `typer.Typer`, in a module's text."""
_PLUG_INS: Final = "Plug-ins bring more commands: docs/how-to/commands.md names them."
EXIT_CODES: Final = "Exit codes: 0 success; 1 the mission was not achieved; 2 bad input, named in one line."


@dataclass(frozen=True)
class _Command:
    """Command of Errand: the module with the function or `typer.Typer` of its name, and its help."""

    module: str
    help: str


COMMANDS: Final[Mapping[str, _Command]] = {
    "run": _Command("run_command", "Run a sentence or a mission file in the simulated world."),
    "check": _Command(
        "check_command", "Check mission files without running them: commands, tree, paths, time and battery."
    ),
    "missions": _Command("missions_command", "List the missions that come with Errand."),
    "init": _Command("missions_command", "Copy the missions that come with Errand into a folder."),
    "parse": _Command("parse_command", "Show the commands that a sentence means."),
    "tree": _Command("inspect_command", "Show the tree of a sentence, a mission file or a log."),
    "listen": _Command("listen_command", "Recognise what is said in recordings or at a microphone, and its commands."),
    "log": _Command("inspect_command", "Print what each node of a run did and why, detections and the outcome."),
    "replay": _Command("inspect_command", "Show a run at any time of it: tree, map, pictures, events, 3D."),
    "runs": _Command("runs_command", "List the runs whose files are kept; remove old ones."),
    "queue": _Command("queue_command", "Store missions, and run them one after another."),
    "fleet": _Command("fleet_command", "Run the queued missions with several robots."),
    "resume": _Command("queue_command", "Resume the mission that was interrupted; then run its queue."),
    "evaluate": _Command(
        "evaluate_command",
        "Run an evaluation file, or a mission at many seeds; count claims and the referee's verdicts.",
    ),
    "report": _Command("evaluate_command", "Open the report of a run, or report the results of an evaluation."),
    "detect": _Command("detect_command", "Find objects of the nine classes in pictures."),
    "stack": _Command("plugins_command", "What a robot uses: localiser, planners, controller, detector."),
    "skills": _Command("plugins_command", "List the skills for mission files, with their inputs."),
    "plugins": _Command("plugins_command", "List the installed plug-ins, what each registers, and errors in them."),
    "shell": _Command("shell_command", "Take one command after another in one process, which starts them faster."),
    "doctor": _Command("doctor_command", "Look at what a run needs on this machine; names the mend of each fault."),
    "warm-up": _Command("doctor_command", "Compile the numeric code for this machine, so that runs begin at once."),
    "new": _Command("new_command", "Write an installable package with a skill, a task or a robot."),
}
"""Commands of Errand by name, in the order of the help; commands of plug-ins follow them."""


def shipped_command(name: str) -> Any:
    """Imports and returns the command of a name. Raises KeyError."""
    module = import_module(f"executive.cli.{COMMANDS[name].module}")
    return as_command(name, getattr(module, name.replace("-", "_")))


def as_command(name: str, found: Any) -> Any:
    """Converts a `typer.Typer`, or a function with typer's options, to a command. Raises TypeError for others."""
    if isinstance(found, typer.Typer):
        found._add_completion = False  # only the root installs it
        return _with_epilog(get_command(found))
    if not isinstance(found, FunctionType):
        raise TypeError("it is neither a typer.Typer nor a function")
    from executive.cli.options import StartCommand  # loads the model of requests

    alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    alone.command(name=name, cls=StartCommand)(found)
    return _with_epilog(get_command(alone))


def _with_epilog(command: Any) -> Any:
    """Adds the exit codes to the help of a command and of its subcommands, and completion to their parameters."""
    command.epilog = command.epilog or EXIT_CODES
    for each in command.params:
        if each.name in _COMPLETED:
            each.shell_complete = partial(_complete, each.name)
    for each in getattr(command, "commands", {}).values():
        _with_epilog(each)
    return command


def _complete(parameter: str, _context: Any, typed: str) -> list[Any]:
    from executive.cli.options import items_of

    return items_of(parameter, typed)


def help_lines() -> dict[str, str]:
    """Returns the help for commands of plug-ins, by name, without importing the plug-ins.

    Reads the metadata files directly, because importing `importlib.metadata` takes longer than the whole help.
    """
    lines = dict[str, str]()
    for folder in map(Path, sys.path):
        for info in (*folder.glob("*.dist-info"), *folder.glob("*.egg-info")):
            section = _text(info / "entry_points.txt").partition(f"[{COMMANDS_GROUP}]\n")[2].partition("\n[")[0]
            rows = [line.partition("=") for line in section.splitlines() if "=" in line]
            named = {name.strip(): value.strip() for name, _, value in rows if name.strip() not in COMMANDS}
            lines |= {name: _help_of(value) or _summary(info) for name, value in named.items()}
    return dict(sorted(lines.items()))


def _help_of(value: str) -> str:
    """First line of the help in the source of a command, whose code does not run; empty when none is found."""
    module, _, name = value.partition(":")
    package, *below = module.split(".")
    spec = find_spec(package)
    places = [Path(folder, *below) for folder in (spec and spec.submodule_search_locations) or ()]
    files = [file for each in places for file in (each.with_suffix(".py"), each / "__init__.py")]
    pattern = re.compile(_HELP.format(re.escape(name)), re.MULTILINE | re.DOTALL)
    found = (pattern.search(_text(file)) for file in files or (Path(str(spec and spec.origin)),))
    return next((each["function"] or each["group"] for each in found if each), "")


def _summary(info: Path) -> str:
    metadata = _text(info / "METADATA") or _text(info / "PKG-INFO")
    found = (line.removeprefix("Summary: ") for line in metadata.splitlines() if line.startswith("Summary: "))
    return next(found, f"A command of {info.stem.partition('-')[0]}.")


def _text(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="utf-8", errors="replace")
    return ""


def plugin_command(name: str) -> Any | None:
    """Loads the command of a plug-in; returns None if no distribution registers the name.

    Raises InputError if the command cannot be loaded, or several distributions register it.
    """
    from skills.inputs.plugins import PluginDefect, distribution_of, installed_plugins, run_plugin

    words, short = name.replace(".", " "), name.rpartition(".")[2]
    found = [entry for entry in installed_plugins(COMMANDS_GROUP) if entry.name == name]
    if not found:
        return None
    if len(found) > 1:
        what = f"{listing(sorted(map(distribution_of, found)))} both have a command '{words}'"
        raise InputError(what, hint="uninstall one of them")
    (entry,) = found
    try:
        return run_plugin(entry, lambda: as_command(short, entry.load()))
    except PluginDefect as defect:
        what = f"cannot load command '{words}' ({entry.value}) of {distribution_of(entry)}: {defect}"
        raise InputError(what, hint="repair or uninstall that distribution") from defect


def with_plugin_commands(name: str, group: TyperGroup, typed: str) -> None:
    """Adds the commands of plug-ins to a command group: lists all of them, and loads the one that is typed.

    Raises InputError like `plugin_command`.
    """
    for each, line in help_lines().items():
        above, _, short = each.rpartition(".")
        if above == name and isinstance(group.commands.get(short), _Listed | None):
            loaded = plugin_command(each) if short == typed else None
            group.add_command(loaded or _Listed(short, short_help=line), short)


class _Listed(TyperCommand):
    """Command of a plug-in as the help lists it; it is loaded when it is called."""


class _LazyGroup(TyperGroup):
    """Group of all commands, which imports a command when it is resolved, and shortens error messages."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        for name, entry in COMMANDS.items():
            self.add_command(TyperCommand(name, help=entry.help))

    def list_commands(self, ctx: Any) -> list[str]:
        """Lists all commands, those of plug-ins last."""
        for name, line in help_lines().items():
            if name not in self.commands and "." not in name:
                self.add_command(_Listed(name, short_help=line))
        return super().list_commands(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Imports and returns the command that the first argument names."""
        with suppress(InputError) if ctx.resilient_parsing else nullcontext():  # a shell completes, and shows no error
            self._load(*[*args, "", ""][:2])
        if args and args[0] not in self.commands and not args[0].startswith("-") and not ctx.resilient_parsing:
            near = nearest_name(args[0], self.list_commands(ctx))
            ctx.fail(f"No such command {one_line(args[0])!r}. {f'Did you mean {near!r}?' if near else _PLUG_INS}")
        return super().resolve_command(ctx, args)

    def _load(self, name: str, typed: str) -> None:
        """Imports a command; for a group, loads the subcommand that is typed. Raises InputError."""
        if name in COMMANDS:
            command = shipped_command(name)
            if isinstance(command, TyperGroup) and isinstance(command.commands.get(typed), _Listed | None):
                with_plugin_commands(name, command, typed)
            self.add_command(command, name)
        elif name and "." not in name and (found := plugin_command(name)) is not None:
            self.add_command(found, name)

    def main(self, *args: Any, **settings: Any) -> Any:
        """Runs a command as typer does; bad input ends it with one line."""
        try:
            return super().main(*args, **settings)
        except (InputError, OSError) as error:
            from executive.cli.output import refuse

            refuse(error)

    def invoke(self, ctx: Any) -> Any:
        """Invokes a command as typer does; long messages are shortened."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            line = one_line(error.message)
            error.message = line if len(line) <= MOST_LETTERS else f"{line[:MOST_LETTERS]}..."
            raise


app = typer.Typer(
    name="errand",
    cls=_LazyGroup,
    help="From an English request to a robot's work.",
    epilog=EXIT_CODES,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"max_content_width": 120},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"errand {version('spot-errand')}")
        raise typer.Exit


@app.callback()
def _errand(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """From an English request to a robot's work."""
    from executive.cli.defaults import default_map

    context.default_map = default_map(Path())


def main() -> NoReturn:
    """Runs the command line; ends the process once output is flushed and all threads have ended.

    Python's own shutdown would first destroy all modules, which takes longer than some commands.
    """
    gc.set_threshold(*_COLLECTED_AFTER)
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # else it reads the files of all distributions
    code: object = 0
    try:
        command_line()
    except SystemExit as end:
        code = end.code
    if not isinstance(code, int | None):
        sys.exit(code)  # type: ignore[arg-type]
    with suppress(OSError, ValueError):  # the reader of the output is gone; Python reports it
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        os._exit(code or 0)
    sys.exit(code)


def command_line() -> None:
    """Runs the command that the arguments name. Always raises SystemExit.

    Refuses arguments that are not valid UTF-8, because no log, store or JSON can hold them.
    """
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)  # pydrake sets its level
    for argument in sys.argv[1:]:
        try:
            argument.encode()
        except UnicodeEncodeError:
            refused = InputError(f"'{argument[:60]}' is no UTF-8 text", hint="name it in UTF-8")
            typer.echo(f"errand: {refused}", err=True)
            sys.exit(2)
    app()


if __name__ == "__main__":
    main()
