"""`errand check` validates mission files and plans them without running them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.markup import escape

from executive.app.prepare.checker import Checked, Checker
from executive.cli.defaults import yielding
from executive.cli.options import takes_request
from executive.cli.output import BAD_INPUT, console_for, finish, progress_bar
from executive.mission.request import Request
from executive.tree.node_view import node_view
from executive.view.text import readable, to_rich
from skills.inputs.errors import InputError, count_text, one_line

SHOWN_NODES: Final = 40


@takes_request("sentence", "answers", "world", "given", "stack", "start", "robots", "time_of_day")
def check(
    request: Request,
    context: typer.Context,
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[MISSION...]", help="Files, or names of `errand missions`.", show_default=False),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object for all files on standard output.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Show commands and trees, too.")] = False,
) -> None:
    """Checks mission files or a sentence without running them: commands, tree, paths on the map, time and battery."""
    checker, console = Checker(), console_for(as_json)
    if (request.sentence is None) == (not files):
        what = "a mission file or a sentence is needed" if not files else "both mission files and a sentence are given"
        raise InputError(what, hint='name files, or give a sentence: errand check --say "go to the kitchen"')
    missions = [replace(request, file=file) for file in files or ()] or [request]
    with progress_bar(console, "files", len(missions)) as advance:
        checked = [_check(checker, each, context, advance) for each in missions]
    for one in () if as_json else checked:
        _show(one, str(one.file or request.sentence or "--say ''"), console_for(as_json=False), verbose=verbose)
    finish(to_json(checked), as_json, good=all(one.ok for one in checked), otherwise=BAD_INPUT)


def _check(checker: Checker, request: Request, context: typer.Context, advance: Callable[[], None]) -> Checked:
    """Checks a mission file as a request; options that the file leaves open are taken from the file of defaults."""
    with suppress(InputError):  # the check reports it
        request = yielding(request, context)
    checked = checker.check(request)
    advance()
    return checked


def to_json(checked: Sequence[Checked]) -> dict[str, Any]:
    """Returns one object on all files: `ok`, errors, warnings, number of nodes, commands, and estimates."""
    trees = [tree for one in checked for tree in one.trees]
    return {
        "ok": all(one.ok for one in checked),
        "errors": [_error_json(error) for one in checked for error in one.errors],
        "warnings": [_error_json(warning) for one in checked for warning in one.warnings],
        "detectors": [about for one in checked for about in one.detectors],
        "nodes": sum(len(tree.path_ids) for tree in trees),
        "commands": [str(command) for tree in trees for command in tree.commands],
        "estimates": [_estimate_json(one) for one in checked if one.ok],
    }


def _estimate_json(one: Checked) -> dict[str, Any]:
    """Returns the estimate of a file; `most_s` is null if it has no upper limit."""
    taken = one.estimate
    return {
        "file": None if one.file is None else str(one.file),
        "least_s": round(taken.duration_s, 1),
        "most_s": None if math.isinf(taken.most_s) else round(taken.most_s, 1),
        "reasons": list(taken.reasons),
        "time_limit_s": one.time_limit_s,
        "distance_m": round(taken.distance_m, 2),
        "charge": round(taken.charge, 4),
    }


def _error_json(error: InputError) -> dict[str, Any]:
    file = None if error.file is None else str(error.file)
    return {"file": file, "line": error.line, "message": error.message, "hint": error.hint}


def _show(one: Checked, name: str, console: Console, *, verbose: bool) -> None:
    """Prints a line on the file or sentence, and its errors; with `verbose` also the commands and the tree."""
    mark = "[green]✓[/green]" if one.ok else "[red]✗[/red]"
    found = "; ".join(one.summary) if one.ok else count_text(len(one.errors), "error")
    console.print(f"{mark} [bold]{escape(one_line(name))}[/bold]: {found}")
    for error in one.errors:
        typer.echo(f"errand: {error}", err=True)
    for warning in one.warnings:
        typer.echo(f"errand: warning: {warning}", err=True)
    for about in one.detectors:
        console.print(f"  detector: {about}", markup=False)
    for tree in one.trees if verbose else ():
        for command in tree.commands:
            console.print(f"  {command}", markup=False)
        console.print(to_rich(readable(node_view(tree.root), SHOWN_NODES), collapsed=False))
