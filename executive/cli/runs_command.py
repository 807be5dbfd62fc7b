"""`errand runs` lists the runs whose files are kept, and removes old ones."""

from __future__ import annotations

from datetime import datetime
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from executive.cli.options import AS_JSON
from executive.cli.output import console_for, finish, show_table
from executive.mission.request_fields import command_of

if TYPE_CHECKING:
    from executive.app.runs.folders import KeptRun

runs = typer.Typer(name="runs", help="List the runs whose files are kept.", rich_markup_mode=None)
Out = Annotated[Path, typer.Option("-o", "--out", help="Folder with the folders of the runs.")]


@runs.callback(invoke_without_command=True)
def show(context: typer.Context, out: Out = Path("out"), as_json: AS_JSON = False) -> None:
    """Lists the runs, the oldest first, with outcome and the referee's verdict; `errand report RUN` opens one."""
    if context.invoked_subcommand is not None:
        return
    from executive.app.runs.folders import kept_runs

    found = [_values(kept) for kept in kept_runs(out)]
    header = ("run", "mission", "seed", "outcome", "verdict", "message")
    show_table(console_for(as_json), header, [[str(row[name]) for name in header] for row in found])
    finish({"runs": found}, as_json)


@runs.command()
def clean(
    older_than: Annotated[str, typer.Option(metavar="TIME", help="Age, as in 7d or 12h.", show_default=False)],
    out: Out = Path("out"),
    as_json: AS_JSON = False,
) -> None:
    """Removes the folders of older runs; other files and the folders of runs that go on stay."""
    from executive.app.runs.folders import remove_runs
    from executive.store.triggers import Every

    removed, stay = remove_runs(out, Every.from_text(older_than).period, datetime.now().astimezone())
    for word, folder in (*zip(repeat("Removed"), removed), *zip(repeat("Stays, because its run goes on"), stay)):
        console_for(as_json).print(f"{word}: {folder}", markup=False)
    if not removed and not stay:
        console_for(as_json).print(f"No run in {out} is older.", markup=False)
    finish({"removed": list(map(str, removed)), "going_on": list(map(str, stay))}, as_json)


def _values(kept: KeptRun) -> dict[str, Any]:
    """Returns a run as JSON values."""
    from executive.app.report.run_report import VERDICTS

    asked, report = kept.request, kept.report or {"outcome": "running or interrupted"}
    verdict = "" if kept.report is None else VERDICTS[(report.get("referee") or {}).get("success")]
    values = {"run": asked.out.name, "mission": asked.name, "seed": asked.seed, "outcome": report["outcome"]}
    values |= {"verdict": verdict, "message": report.get("message", "")}
    return values | {"begun": kept.begun.isoformat(), "version": kept.version, "command": command_of(asked)}
