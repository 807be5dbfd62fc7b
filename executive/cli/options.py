"""Options that several commands share; `executive.mission.request` declares the options for a request."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable, Iterable, Sequence
from itertools import takewhile
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Final, get_args

import typer
from typer._click.shell_completion import CompletionItem
from typer.core import TyperCommand

from executive.app.prepare.mission_files import shipped_missions
from executive.cli.defaults import runs_folder, typed_options, yielding
from executive.cli.number_options import NumberReader, quantity_option
from executive.mission.request import Request, parse_start
from executive.mission.request_fields import RequestField, request_fields
from executive.words.forms import OptionGroup as Group
from skills.inputs.errors import InputError
from skills.inputs.plugins import OBSERVERS, installed_plugins
from skills.quantities import Port, Wait, quantity_of
from skills.robot import Pose2D

_START: Final = "--start"
_VIEW: Final = "--view"
_UNTIL_CTRL_C_S: Final = 1e9
"""Value of `--view` alone: the longest wait."""
_VALUE: Final = re.compile(r"[\d@].*|[^\s/=]*:[^\s/=]*")
"""Value of an observer's option: a number, or an address."""
_NUMERIC: Final = re.compile(r"[-+]?(?:\.?\d[\d.,]*(?:e[-+]?\d+)?|nan|inf(?:inity)?)", re.IGNORECASE)


def grouped(group: Group, *names: str, **settings: Any) -> Any:
    """Returns a typer option that appears under a heading in the help."""
    return typer.Option(*names, rich_help_panel=group.value, **settings)


START = Annotated[str | None, typer.Option(_START, metavar="X Y YAW", help="Start of the robot, metres and radians.")]
"""Type of a parameter for the option `--start` of a `StartCommand`; `start_pose` parses it."""
STORE = Annotated[Path | None, grouped(Group.OUTPUT, help="File of the missions; by default a hidden one beside logs.")]
ANYWAY = Annotated[bool, grouped(Group.REQUEST, "--anyway", help="Begin in spite of errors of `errand check`.")]
AS_JSON = Annotated[bool, grouped(Group.OUTPUT, "--json", help="The last line of the output is the result as JSON.")]
"""Type of a parameter for the option `--json`, by default False."""
QUIET = Annotated[bool, grouped(Group.OUTPUT, "--quiet", help="Show no lines and no tree during the run.")]
_SERVED = "Serve a live page, which stays after the end: so long, or until Ctrl-C."
_STAY = grouped(Group.PAGE, _VIEW, metavar="[SECONDS]", parser=NumberReader(Wait), help=_SERVED)
VIEW = Annotated[float | None, _STAY]
PORT = Annotated[int, quantity_option(Port, help="Port of the page; 0 takes a free one.", group=Group.PAGE)]
"""Type of a parameter `view_port` for the option `--view-port`, by default 0."""
HOST = Annotated[str, grouped(Group.PAGE, metavar="HOST", help="Address of the page; 0.0.0.0 lets other machines in.")]
"""Type of a parameter `view_host` for the option `--view-host`, by default 127.0.0.1."""

_DRIVEN = "Drive a real robot in the map of --world, such as spot://HOST?power_on=yes; needs its plug-in."
_ADDRESS = grouped(Group.ROBOTS, "--robot", metavar="ADDRESS[?OPTION=VALUE&...]", help=_DRIVEN)
ROBOT = Annotated[str | None, _ADDRESS]
_OBSERVED = "Let an observer join the run: NAME=VALUE, or --NAME [VALUE], as in --foxglove [HOST:PORT] for Foxglove."
OBSERVE = Annotated[list[str] | None, grouped(Group.PAGE, "--observe", metavar="NAME", help=_OBSERVED)]


class StartCommand(TyperCommand):
    """Command that accepts three numbers or a word after `--start`, optional values, and groups in its help."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Joins the values of options that take any number of words, and parses as click does."""
        return super().parse_args(ctx, join_values(args))

    def invoke(self, ctx: Any) -> Any:
        """Invokes the command. Raises InputError before it begins if its page cannot be served, or has no `--view`."""
        address = {name: ctx.params.get(name) for name in ("view_host", "view_port")}
        if ctx.params.get("view") is not None:
            from executive.view.feed import Feed
            from executive.view.server import PageContent, serve

            serve(PageContent(Feed()), (*address.values(),)).close()
        elif "view" in ctx.params and typed_options(ctx) & address.keys():
            raise InputError("--view-host and --view-port have no effect without --view", hint="add --view")
        return super().invoke(ctx)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Writes the arguments, then the options of each group, then the others."""
        records: dict[str, list[tuple[str, str]]] = {name: [] for name in ("Arguments", *Group)}
        for each in self.get_params(ctx):
            if (record := each.get_help_record(ctx)) is not None:
                name = "Arguments" if each.param_type_name == "argument" else getattr(each, "rich_help_panel", None)
                records.setdefault(name or "Options", []).append(record)
        for name, rows in records.items():
            if rows:
                with formatter.section(name):
                    formatter.write_dl(rows)


def join_values(arguments: Sequence[str]) -> list[str]:
    """Joins three numbers after `--start` into one argument, and the values that an option may have or lack."""
    words, rest = list[str](), list(arguments)
    while rest:
        word = rest.pop(0)
        if word == _START and rest and _NUMERIC.fullmatch(rest[0]):
            numbers = [*takewhile(lambda each: not each.startswith("--"), rest[:3])]
            word, rest = f"{_START}={' '.join(numbers)}", rest[len(numbers) :]
        elif word == _VIEW:
            given = rest and _NUMERIC.fullmatch(rest[0])
            word = f"{_VIEW}={rest.pop(0) if given else _UNTIL_CTRL_C_S}"
        elif installed_plugins(OBSERVERS).select(name=(name := word[2:].partition("=")[0])) and word[:2] == "--":
            value = word[len(name) + 3 :] or (rest.pop(0) if rest and _VALUE.fullmatch(rest[0]) else "")
            word = f"--observe={name}={value}"
        words.append(word)
    return words


def _parameter(field: RequestField, default: Any) -> inspect.Parameter:
    """Returns the parameter from which Typer builds the option."""
    option, kind = field.option, field.kind
    plain = next(each for each in get_args(kind) if each is not NoneType) if NoneType in get_args(kind) else kind
    if quantity_of(plain) is not None:
        info = quantity_option(plain, *field.names, help=option.help, group=option.group)
        kind = get_args(plain)[0] if plain is kind else get_args(plain)[0] | None
    elif option.argument:
        info = typer.Argument(metavar=option.metavar, help=option.help, show_default=False)
    else:
        info = typer.Option(*field.names, metavar=option.metavar, help=option.help, rich_help_panel=option.group)
    if option.read is not None:
        kind, default = (bool, False) if option.typed is bool else (option.typed | None, None)
    elif field.several:
        kind, default = list[get_args(kind)[0]] | None, None  # type: ignore[misc]
    hint: Any = Annotated[kind, info]
    return inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)


def _value(field: RequestField, typed: Any) -> Any:
    """Converts a typed value to the field's value; returns the default if none is typed. Raises InputError."""
    if field.option.read is not None:
        return field.default if typed in (None, False) or typed == [] else field.option.read(typed)
    return tuple(typed or ()) if field.several else typed


REQUEST_OPTIONS: Final = frozenset(each.name for each in request_fields()) - {"file", "out"}
"""Names of the options that make a request what it is, wherever its files go."""


def stay_s(view: float) -> float | None:
    """Time (s) for which a page is served, from the value of `--view`; None: until Ctrl-C."""
    return None if view >= _UNTIL_CTRL_C_S else view


def start_pose(text: str | None) -> Pose2D | None:
    """Parses a pose in the form `X Y YAW`; returns None for no text. Raises InputError."""
    start = None if text is None else parse_start(text)
    return start if isinstance(start, Pose2D) else None


def takes_request(
    *names: str, without: Sequence[str] = (), **defaults: Any
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Gives a command the options for these fields (by default all), and the Request as its first argument.

    `defaults` replace the fields' own defaults.
    """
    fields = [each for each in request_fields() if (not names or each.name in names) and each.name not in without]

    def decorated(function: Callable[..., None]) -> Callable[..., None]:
        """Returns the command with the options for the fields, followed by its own."""
        signature = inspect.signature(function, eval_str=True)
        _, *own = (each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in signature.parameters.values())
        context = inspect.Parameter("context", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
        options = [_parameter(each, defaults.get(each.name, each.default)) for each in fields]
        parameters = [context, *options, *(each for each in own if each.name != "context")]

        @functools.wraps(function)
        def command(context: typer.Context, **given: Any) -> None:
            request = _request([(each, given.pop(each.name)) for each in fields])
            request = yielding(request, context) if context.default_map else request
            function(request, **({"context": context, **given} if "context" in signature.parameters else given))

        command.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        command.__annotations__ = {each.name: each.annotation for each in parameters}
        return command

    return decorated


def _request(typed: Iterable[tuple[RequestField, Any]]) -> Request:
    """Builds the request from typed values. Raises InputError."""
    values: dict[str, Any] = {}
    for each, words in typed:
        part = values if not each.part else values.setdefault(each.part, {})
        part[each.name] = _value(each, words)
    return Request(**values)


def _worlds() -> Iterable[str]:
    from plant.worlds.world import known_worlds

    return known_worlds()


def _runs() -> list[str]:
    """Folders of runs, the newest first."""
    return sorted((str(file.parent) for file in runs_folder().glob("*/run.json")), reverse=True)


_NAMES: Final = {"file": shipped_missions, "files": shipped_missions, "world": _worlds, "run": _runs}


def items_of(parameter: str, typed: str) -> list[CompletionItem]:
    """Completes the value of a parameter, a name or a path, by the parameter's name."""
    paths = [f"{each}/" if each.is_dir() else str(each) for each in sorted(Path().glob(f"{typed}*")) if typed]
    names = (name for name in _NAMES[parameter]() if name.startswith(typed))
    return [CompletionItem(value) for value in dict.fromkeys((*names, *paths))]
