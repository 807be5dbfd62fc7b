"""`errand report`: what a results file says, as tables, as JSON and as an HTML page."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from executive.app.evaluate.case import RunSpec
from executive.app.evaluate.page import EvaluationPage, to_page
from executive.app.evaluate.results import ResultsFile
from executive.app.evaluate.summary import (
    GROUP_HEAD,
    STANDING_HEAD,
    Case,
    causes_of,
    compared,
    group_rows,
    groups_of,
    label_of,
    standing_rows,
    standing_texts,
    time_rows,
    to_look_at,
    totals_of,
)
from executive.cli.options import AS_JSON, request_arguments
from executive.cli.output import console_for, print_json, refusals, show_table, write_text
from skills.files.errors import InputError

__all__ = ["report", "show_cases", "standings_json"]


def report(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="A file of `errand evaluate SCENARIO`.")],
    html: Annotated[Path | None, typer.Option(help="Write a page that needs nothing else.")] = None,
    against: Annotated[Path | None, typer.Option(metavar="RESULTS", help="Compare with another results file.")] = None,
    as_json: AS_JSON = False,
) -> None:
    """Report the results of an evaluation: success with intervals, causes, where the time goes, each failure."""
    console = console_for(as_json)
    with refusals(), ResultsFile(results) as kept:
        cases, about = _cases(kept), kept.about()
        other = None if against is None else _other(against)
        _show(console, cases, other, about.get("logs"))
        if html is not None:
            facts = (
                ("scenario", about["scenario"]),
                ("runs with a result", f"{len(cases)} of {about['runs']}" if "runs" in about else str(len(cases))),
                ("version", about["code"]),
                ("missions per hour", about.get("missions_per_hour", "?")),
            )
            title = Path(about["scenario"]).stem.replace("_", " ")
            name = "" if against is None else str(against)
            repeats = partial(_repeats, logs=about.get("logs"))
            page = EvaluationPage(title, facts, cases, kept.evidence, repeats, other, name)
            write_text(html, to_page(page))
            console.print(f"Written: {html}", markup=False)
        if as_json:
            print_json(_json(about, cases, other))


def _repeats(case: Case, logs: str | None) -> Sequence[str]:
    """The commands that repeat a run, and print its log where that is on this machine."""
    folder = log_folder(case, logs)
    return (command_of(case.run), *([] if folder is None else [f"errand log {folder / 'log.mcap'}"]))


def _other(path: Path) -> Sequence[Case]:
    with ResultsFile(path) as kept:
        return _cases(kept)


def _cases(kept: ResultsFile) -> Sequence[Case]:
    """All runs that have a result. Raises InputError: none has."""
    runs = kept.runs()
    cases = [Case(runs[number], outcome) for number, outcome in kept.outcomes()]
    if not cases:
        raise InputError("it holds no result yet", hint="give the command that writes it again", file=kept.path)
    return cases


def _show(console: Console, cases: Sequence[Case], other: Sequence[Case] | None, logs: str | None) -> None:
    show_cases(console, cases, logs=logs)
    for row in causes_of(cases, most=1):
        console.print(f"{row.cause}: {row.runs}, as in: {row.sentences[0][0]}", markup=False)
    rows = ((row.skill, str(row.runs), f"{row.total_s:.1f}", f"{row.share:.1%}") for row in time_rows(cases))
    show_table(console, ("skill", "runs", "simulated s", "share"), rows)
    for found in compared(cases, other) if other is not None else ():
        test = "McNemar" if found.paired else "Fisher"
        here, there = (f"{rate.successes} of {rate.total}" for rate in (found.first, found.second))
        console.print(
            f"{label_of(found.dimension, found.name)}: {here} against {there}, p {found.p:.3g} ({test})", markup=False
        )


def _json(about: Mapping[str, str], cases: Sequence[Case], other: Sequence[Case] | None) -> dict[str, Any]:
    groups = [
        {
            "dimension": group.dimension,
            "name": group.name,
            "runs": group.runs,
            "achieved": group.achieved,
            "interval": group.rate.interval(),
            **group.counts,
        }
        for group in groups_of(cases)
    ]
    comparisons = [
        {
            "dimension": found.dimension,
            "name": found.name,
            "paired": found.paired,
            "here": [found.first.successes, found.first.total],
            "there": [found.second.successes, found.second.total],
            "only_here": found.only_first,
            "only_there": found.only_second,
            "p": found.p,
        }
        for found in (compared(cases, other) if other is not None else ())
    ]
    return {
        "scenario": about["scenario"],
        "runs": len(cases),
        **totals_of(cases),
        "groups": groups,
        "causes": [{"cause": row.cause, "runs": row.runs, "messages": dict(row.sentences)} for row in causes_of(cases)],
        "skills": {row.skill: {"runs": row.runs, "sim_s": row.total_s, "share": row.share} for row in time_rows(cases)},
        **({"against": comparisons} if other is not None else {}),
        **standings_json(cases, about.get("logs")),
    }


def command_of(run: RunSpec) -> str:
    """The command line that repeats a run alone."""
    return shlex.join(["errand", "run", *request_arguments(run.request)])


def show_cases(console: Console, cases: Sequence[Case], *, logs: str | None) -> None:
    """Show success by groups, claims against verdicts, and each run that is to be looked at with the folder of its log.

    `logs` is the folder that holds those.
    """
    show_table(console, GROUP_HEAD, group_rows(groups_of(cases)))
    console.print()
    show_table(console, STANDING_HEAD, standing_texts(cases))
    rows = [_to_look_at_row(case, logs) for case in to_look_at(cases)]
    if rows:
        console.print()
        show_table(console, ("run", "world", "seed", "asked for", "why", "log"), rows)


def _to_look_at_row(case: Case, logs: str | None) -> tuple[str, ...]:
    folder = log_folder(case, logs)
    world, seed = case.report.world, str(case.run.request.seed)
    return case.label, world, seed, case.asked, case.why, "" if folder is None else str(folder)


def log_folder(case: Case, logs: str | None) -> Path | None:
    """The folder with the log of a run; None where there is none, or the evaluation ran on another machine."""
    folder = None if logs is None else Path(logs) / case.outcome.run_id
    return folder if folder is not None and folder.is_dir() else None


def standings_json(cases: Sequence[Case], logs: str | None) -> dict[str, Any]:
    """Claims against verdicts as JSON values: the counts, and each run that is to be looked at."""
    return {
        "standings": {
            row.standing.value: {
                "runs": row.rate.successes,
                "interval": row.rate.interval(),
                "causes": dict(row.causes),
            }
            for row in standing_rows(cases)
        },
        "to_look_at": [
            {
                "id": case.outcome.run_id,
                "standing": case.outcome.standing.value,
                "world": case.report.world,
                "seed": case.run.request.seed,
                "mission": case.run.mission,
                "asked": case.asked,
                "cause": case.report.cause,
                "why": case.why,
                "log": None if (folder := log_folder(case, logs)) is None else str(folder),
                "command": command_of(case.run),
            }
            for case in to_look_at(cases)
        ],
    }
