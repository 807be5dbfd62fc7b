"""`errand check`: mission files validated and planned without running them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import TopologicalSorter
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.markup import escape

from executive.app.feasibility import check_prepared, route_planner_of
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.app.worlds import refuse_unusable
from executive.cli.options import takes_request
from executive.cli.output import BAD_INPUT, console_for, print_json
from executive.mission.request import Request
from executive.tree.compiler import CompiledTree
from executive.tree.estimate import Estimate, RoutePlanner
from executive.tree.node_view import node_view
from executive.view.collapse import folded_to
from executive.view.text import to_rich
from skills.files.errors import InputError, count_text, one_line

SHOWN_NODES: Final = 40
MOST_LETTERS: Final = 300

__all__ = ["CheckedFile", "Checker", "check"]


@dataclass(frozen=True)
class CheckedFile:
    """One file: its errors and warnings, what was found out about it before them, and the tree of each robot."""

    file: Path
    errors: tuple[InputError, ...] = ()
    trees: tuple[CompiledTree, ...] = ()
    estimate: Estimate = field(default_factory=Estimate)
    warnings: tuple[InputError, ...] = ()

    @property
    def ok(self) -> bool:
        """True without errors."""
        return not self.errors


class Checker:
    """Checks files; the routes planned in each world for each kind of robot are shared among them.

    `like` has what the requests share: the world in place of the files' own, stack, start, robots and values of
    parameters.
    """

    def __init__(self, like: Request | None = None) -> None:
        self._like = like or Request()
        self._routes: dict[tuple[Path, str, Path | None], RoutePlanner] = {}

    def check(self, file: Path) -> CheckedFile:
        """Check one file; raises nothing for what stands in it."""
        trees: tuple[CompiledTree, ...] = ()
        try:
            prepared = prepare(replace(self._like, file=file))
            trees = tuple(each.tree for each in prepared.all)
            refuse_unusable(prepared.world)
            checked = {each.mission.robot_name: check_prepared(each, self._planner(each)) for each in prepared.all}
        except InputError as error:
            return CheckedFile(file, _placed(file, (error, *error.others)), trees)
        except Exception as defect:  # the other files are still to be checked
            what = f"errand cannot check it ({type(defect).__name__}: {defect})"[:MOST_LETTERS]
            return CheckedFile(file, _placed(file, (InputError(what, hint="report it with this file"),)), trees)
        errors = tuple(error for each in checked.values() for error in each.errors)
        warnings = tuple(warning for each in checked.values() for warning in each.warnings)
        estimates = {name: each.estimate for name, each in checked.items()}
        return CheckedFile(file, _placed(file, errors), trees, _of_all(prepared, estimates), warnings)

    def _planner(self, prepared: Prepared) -> RoutePlanner:
        world, robot = prepared.world, prepared.robot
        key = (world.folder, robot.kind, robot.stack_file)
        if key not in self._routes:
            self._routes[key] = route_planner_of(world, robot)
        return self._routes[key]


def _of_all(prepared: Prepared, estimates: Mapping[str, Estimate]) -> Estimate:
    """What several robots take together: until the last is done, all that is driven, the most that one charge gives."""
    after = {each.mission.robot_name: each.after for each in prepared.all}
    done_s: dict[str, float] = {}
    latest_s: dict[str, float] = {}
    for name in TopologicalSorter(after).static_order():
        done_s[name] = estimates[name].duration_s + max((done_s[first] for first in after[name]), default=0.0)
        latest_s[name] = estimates[name].most_s + max((latest_s[first] for first in after[name]), default=0.0)
    whole = Estimate(
        max(done_s.values()),
        sum(each.distance_m for each in estimates.values()),
        max(each.charge for each in estimates.values()),
    )
    return whole.up_to(max(latest_s.values()), *(reason for each in estimates.values() for reason in each.reasons))


@takes_request("world", "given", "stack", "start", "robots")
def check(
    request: Request,
    files: Annotated[
        list[Path],
        typer.Argument(metavar="MISSION...", help="Files, or names of `errand missions`.", show_default=False),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object for all files on standard output.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Show commands and trees, too.")] = False,
) -> None:
    """Check mission files without running them: commands, tree, paths on the map, time and battery."""
    checker = Checker(request)
    checked = [checker.check(file) for file in files]
    if as_json:
        print_json(to_json(checked))
    else:
        console = console_for(as_json=False)
        for one in checked:
            _show(one, console, verbose=verbose)
    if not all(one.ok for one in checked):
        raise typer.Exit(BAD_INPUT)


def to_json(checked: Sequence[CheckedFile]) -> dict[str, Any]:
    """All files as one object: whether all are well, errors, warnings, how many nodes, the commands in order, and what
    each file that is well takes."""
    trees = [tree for one in checked for tree in one.trees]
    return {
        "ok": all(one.ok for one in checked),
        "errors": [_error_json(error) for one in checked for error in one.errors],
        "warnings": [_error_json(warning) for one in checked for warning in one.warnings],
        "nodes": sum(len(tree.path_ids) for tree in trees),
        "commands": [str(command) for tree in trees for command in tree.commands],
        "estimates": [_estimate_json(one) for one in checked if one.ok],
    }


def _estimate_json(one: CheckedFile) -> dict[str, Any]:
    """What a file takes; `most_s` is null where nobody knows how long it may take."""
    taken = one.estimate
    return {
        "file": str(one.file),
        "least_s": round(taken.duration_s, 1),
        "most_s": None if math.isinf(taken.most_s) else round(taken.most_s, 1),
        "reasons": list(taken.reasons),
        "distance_m": round(taken.distance_m, 2),
        "charge": round(taken.charge, 4),
    }


def _error_json(error: InputError) -> dict[str, Any]:
    file = None if error.file is None else str(error.file)
    return {"file": file, "line": error.line, "message": error.message, "hint": error.hint}


def _placed(file: Path, errors: Sequence[InputError]) -> tuple[InputError, ...]:
    """The errors, in the order of their lines; one that names no place stands at the head of the file."""
    placed = [
        error if error.file is not None else InputError(error.message, hint=error.hint, file=file, line=1)
        for error in errors
    ]
    return tuple(sorted(placed, key=lambda error: (str(error.file) != str(file), str(error.file), error.line or 0)))


def _show(one: CheckedFile, console: Console, *, verbose: bool) -> None:
    """One line on the file; its errors, and with `verbose` its commands and its tree, below."""
    mark = "[green]✓[/green]" if one.ok else "[red]✗[/red]"
    found = _in_words(one.estimate) if one.ok else count_text(len(one.errors), "error")
    console.print(f"{mark} [bold]{escape(one_line(str(one.file)))}[/bold]: {found}")
    for error in one.errors:
        typer.echo(f"errand: {error}", err=True)
    for warning in one.warnings:
        typer.echo(f"errand: warning: {warning}", err=True)
    for tree in one.trees if verbose else ():
        for command in tree.commands:
            console.print(f"  {command}", markup=False)
        console.print(to_rich(folded_to(node_view(tree.root), SHOWN_NODES), collapsed=False))


def _in_words(estimate: Estimate) -> str:
    charge = f"{estimate.charge:.1%} of the battery" if estimate.charge <= 1.0 else "more than one charge"
    return f"{_range_in_words(estimate)}, {estimate.distance_m:.0f} m of driving and {charge} when all goes well"


def _range_in_words(estimate: Estimate) -> str:
    """How long it takes: "about 2 min 05 s", "2 min 05 s to 5 min 10 s (1 to 3 rounds)"."""
    least = _minutes(estimate.duration_s)
    if round(estimate.spare_s if math.isfinite(estimate.spare_s) else 1.0) == 0:
        return f"about {least}"
    most = "or more" if math.isinf(estimate.spare_s) else f"to {_minutes(estimate.most_s)}"
    return f"{least} {most} ({'; '.join(estimate.reasons)})"


def _minutes(duration_s: float) -> str:
    minutes, seconds = divmod(round(duration_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {seconds:02d} s"
