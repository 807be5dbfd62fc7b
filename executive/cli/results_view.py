"""What the results of many runs say, as tables and as JSON: the same while an evaluation ends and in its report."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from executive.app.evaluate.evaluation_run import request_of
from executive.app.evaluate.runs import RunSpec
from executive.app.evaluate.summary import (
    GROUP_HEAD,
    STANDING_HEAD,
    Case,
    group_rows,
    groups_of,
    standing_rows,
    standing_texts,
    to_look_at,
)
from executive.cli.options import request_arguments
from executive.cli.output import show_table
from executive.mission.request import Request

__all__ = ["command_of", "log_folder", "show_cases", "standings_json"]


def command_of(run: RunSpec) -> str:
    """The command line that repeats a run alone."""
    request = replace(request_of(run, Request.out), record=True)
    return shlex.join(["errand", "run", *request_arguments(request)])


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
    world, seed = str(case.outcome.report.get("world") or ""), str(case.run.seed)
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
                "world": case.outcome.report.get("world"),
                "seed": case.run.seed,
                "mission": case.run.mission,
                "asked": case.asked,
                "cause": case.outcome.report.get("cause"),
                "why": case.why,
                "log": None if (folder := log_folder(case, logs)) is None else str(folder),
                "command": command_of(case.run),
            }
            for case in to_look_at(cases)
        ],
    }
