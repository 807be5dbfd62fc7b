"""`errand evaluate` of many runs: gives out those of a scenario file, or random ones, and keeps each result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from executive.app.evaluate.evaluation_run import lost_outcome, prepared_run, run_one
from executive.app.evaluate.installed import installed_code
from executive.app.evaluate.outcome import RunOutcome
from executive.app.evaluate.results import ResultsFile
from executive.app.evaluate.runs import Evaluation, RunSpec
from executive.app.evaluate.scenario import load_evaluation
from executive.app.evaluate.summary import Case, groups_of, totals_of
from executive.app.evaluate.worker_pool import Pool
from executive.app.evaluate.workers import Workers
from executive.app.feasibility import refuse_impossible
from executive.app.mission_files import mission_file
from executive.cli.output import NOT_ACHIEVED, print_json
from executive.cli.results_view import show_cases, standings_json
from executive.mission.stack_file import stack_file
from skills.files.errors import Problems

__all__ = ["Handling", "evaluate_runs", "evaluate_scenario", "give_out_runs"]

RESULTS: Final = "results.sqlite"
LOGS: Final = "logs"
_CANCELLED: Final = "cancelled"


@dataclass(frozen=True)
class Handling:
    """How an evaluation is handled.

    `console` shows progress and tables, `pool` does the work. Results land in the file `results` (None: the one in
    `out`), logs in the folder `out`. `anyway` runs what `errand check` would refuse; `as_json` prints all as JSON.
    """

    console: Console
    pool: Pool
    results: Path | None
    out: Path
    anyway: bool
    as_json: bool


def evaluate_scenario(file: Path, how: Handling) -> int:
    """Run what is still missing of a scenario's runs; the exit status. Raises InputError; results are kept."""
    evaluation = load_evaluation(file, mission_file=mission_file, stack_file=stack_file)
    return evaluate_runs(evaluation, how, before=None if how.anyway else partial(_refuse_impossible, out=how.out))


def evaluate_runs(
    evaluation: Evaluation,
    how: Handling,
    *,
    before: Callable[[Sequence[RunSpec]], None] | None = None,
    checked: bool = False,
) -> int:
    """Run what is still missing of the runs; the exit status.

    `before` is called with the missing runs before the first begins, to refuse them all by InputError. When `checked`,
    a run that `errand check` would refuse counts as refused.

    Raises:
        InputError: from `before`, or results cannot be kept; those that are there stay.
    """
    out, console = how.out, how.console
    with ResultsFile(how.results or out / RESULTS, create=True) as kept, kept.claimed():
        kept.begin(evaluation, code=installed_code())
        done = kept.done()
        missing = [run for run in evaluation.runs if run.id not in done]
        if missing and before is not None:
            before(missing)
        if done:
            console.print(f"{len(done)} of {len(evaluation.runs)} runs have a result in {kept.path}.", markup=False)
        kept.note(logs=str((out / LOGS).resolve()))
        workers = _worked_through(missing, kept, how, checked=checked) if missing else 0
        return _shown(evaluation, kept, how, workers=workers)


def _worked_through(missing: Sequence[RunSpec], kept: ResultsFile, how: Handling, *, checked: bool) -> int:
    """Give out the runs; how many workers there were."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with how.pool.opened() as workers, Progress(*columns, console=how.console) as bar:
        count, began = workers.count, time.monotonic()
        task = bar.add_task("runs", total=len(missing))
        for outcome in give_out_runs(missing, workers, checked=checked):
            if kept.add(outcome):
                _keep_files(outcome, how.out)
            bar.advance(task)
        hours = (time.monotonic() - began) / 3600.0
    kept.note(workers=str(count), missions_per_hour=f"{len(missing) / hours:.1f}")
    return count


def give_out_runs(runs: Sequence[RunSpec], workers: Workers, *, checked: bool = False) -> Iterator[RunOutcome]:
    """The outcome of each run as it ends; one that was cancelled is none, and is left to the next time.

    When `checked`, a run that `errand check` would refuse counts as refused.
    """
    for finished in workers.give_out(partial(run_one, checked=checked), runs):
        outcome = finished.result or lost_outcome(finished.item, finished.lost)
        if outcome.report["outcome"] != _CANCELLED:
            yield outcome


def _keep_files(outcome: RunOutcome, out: Path) -> None:
    """Write what a run has left, which is to be looked at, into a folder of its own."""
    if not outcome.evidence.files:
        return
    folder = out / LOGS / outcome.run_id
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in outcome.evidence.files.items():
        (folder / Path(name).name).write_bytes(data)


def _refuse_impossible(runs: Sequence[RunSpec], out: Path) -> None:
    """Understand and check what differs by more than the seed, the light and the like. Raises InputError with all."""
    problems, seen = Problems(), set[str]()
    for run in runs:
        plain = replace(run, seed=1, random_faults=0, varied={})
        key = replace(plain, variation=replace(plain.variation, clutter=0, people=0, friction=1.0)).id
        if key not in seen:
            seen.add(key)
            with problems:
                refuse_impossible(prepared_run(plain, out))
    problems.raise_any()


def _shown(evaluation: Evaluation, kept: ResultsFile, how: Handling, *, workers: int) -> int:
    """Show the tables, and print all as JSON where wanted; the exit status."""
    cases = [Case(evaluation.runs[number], outcome) for number, outcome in kept.outcomes()]
    about = kept.about()
    show_cases(how.console, cases, logs=about.get("logs"))
    how.console.print(f"Results: {kept.path}; a report: errand report {kept.path} --html report.html", markup=False)
    if how.as_json:
        print_json(_json(evaluation, cases, about, workers or int(about.get("workers", 0))))
    return 0 if all(case.outcome.achieved for case in cases) else NOT_ACHIEVED


def _json(evaluation: Evaluation, cases: Sequence[Case], about: Mapping[str, str], workers: int) -> dict[str, Any]:
    """The keys of a sweep, and those of a scenario."""
    rate = about.get("missions_per_hour")
    conditions = [
        {"condition": group.name, "runs": group.runs, **group.counts}
        for group in groups_of(cases)
        if group.dimension == "variation"
    ]
    return {
        "runs": [{**case.outcome.report, "id": case.outcome.run_id} for case in cases],
        **totals_of(cases),
        **({"conditions": conditions} if conditions else {}),
        **standings_json(cases, about.get("logs")),
        "scenario": evaluation.name,
        "workers": workers,
        "missions_per_hour": None if rate is None else float(rate),
    }
