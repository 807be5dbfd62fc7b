"""`errand evaluate SCENARIO`: gives out the runs of a scenario file, and keeps each result as it lands."""

from __future__ import annotations

import shlex
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from executive.cli.evaluation_run import lost_outcome, prepared_run, request_of, run_one
from executive.cli.feasibility import refuse_impossible
from executive.cli.missions_command import mission_file
from executive.cli.output import NOT_ACHIEVED, print_json, show_table
from executive.cli.stack_command import stack_file
from executive.cli.worker_pool import Pool
from executive.evaluation.installed import installed_code
from executive.evaluation.outcome import RunOutcome
from executive.evaluation.results import ResultsFile
from executive.evaluation.runs import Evaluation, RunSpec
from executive.evaluation.scenario import load_evaluation
from executive.evaluation.summary import Case, group_rows, groups_of, totals_of
from executive.evaluation.workers import Workers
from skills.files.errors import Problems

__all__ = ["command_of", "evaluate_scenario", "give_out_runs"]

RESULTS: Final = "results.sqlite"
_CANCELLED: Final = "cancelled"


def evaluate_scenario(
    file: Path, console: Console, *, pool: Pool, results: Path | None, out: Path, anyway: bool, as_json: bool
) -> int:
    """Run what is still missing of a scenario's runs; the exit status. Raises InputError; results are kept."""
    evaluation = load_evaluation(file, mission_file=mission_file, stack_file=_stack_file)
    with ResultsFile(results or out / RESULTS, create=True) as kept, kept.claimed():
        kept.begin(evaluation, code=installed_code())
        done = kept.done()
        missing = [run for run in evaluation.runs if run.id not in done]
        if missing and not anyway:
            _refuse_impossible(missing, out)
        if done:
            console.print(f"{len(done)} of {len(evaluation.runs)} runs have a result in {kept.path}.", markup=False)
        workers = _worked_through(missing, kept, console, pool=pool, out=out) if missing else 0
        return _shown(evaluation, kept, console, workers=workers, as_json=as_json)


def _stack_file(path: Path) -> Path:
    return stack_file(path) or path


def _worked_through(missing: Sequence[RunSpec], kept: ResultsFile, console: Console, *, pool: Pool, out: Path) -> int:
    """Give out the runs; how many workers there were."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with pool.opened() as workers, Progress(*columns, console=console) as bar:
        count, began = workers.count, time.monotonic()
        task = bar.add_task("runs", total=len(missing))
        for outcome in give_out_runs(missing, workers):
            if kept.add(outcome):
                _keep_files(outcome, out)
            bar.advance(task)
        hours = (time.monotonic() - began) / 3600.0
    kept.note(workers=str(count), missions_per_hour=f"{len(missing) / hours:.1f}")
    return count


def give_out_runs(runs: Sequence[RunSpec], workers: Workers) -> Iterator[RunOutcome]:
    """The outcome of each run as it ends; one that was cancelled is none, and is left to the next time."""
    for finished in workers.give_out(run_one, runs):
        outcome = finished.result or lost_outcome(finished.item, finished.lost)
        if outcome.report["outcome"] != _CANCELLED:
            yield outcome


def _keep_files(outcome: RunOutcome, out: Path) -> None:
    """Write what a failed run has left into a folder of its own."""
    if not outcome.evidence.files:
        return
    folder = out / "failed" / outcome.run_id
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


def command_of(run: RunSpec) -> str:
    """The command line that repeats a run alone."""
    request = request_of(run, Path("out"))
    asked = [run.file] if run.file is not None else ["--say", run.sentence or ""]
    arguments = [*asked, "--seed", str(run.seed)]
    arguments += ["--world", run.world] if run.world else []
    arguments += ["--robots", run.robot_words] if run.robots else []
    arguments += [f"--set={name}={value}" for name, value in run.given.items()]
    arguments += [part for answer in run.answers for part in ("--answer", answer)]
    arguments += ["--stack", run.stack] if run.stack else []
    arguments += [f"--fault={words}" for words in run.faults]
    arguments += [f"--random-faults={run.random_faults}"] if run.random_faults else []
    arguments += [f"--scenario={run.scenario}"] if run.scenario else []
    arguments += [f"--time-limit={run.time_limit_s:g}"] if run.time_limit_s else []
    return shlex.join(["errand", "run", *arguments, *request.variation.arguments()])


def _shown(evaluation: Evaluation, kept: ResultsFile, console: Console, *, workers: int, as_json: bool) -> int:
    """Show the groups, and print all as JSON where wanted; the exit status."""
    cases = [Case(evaluation.runs[number], outcome) for number, outcome in kept.outcomes()]
    show_table(console, ("", "runs", "success", "95 %", "referee", "false claims"), group_rows(groups_of(cases)))
    about = kept.about()
    console.print(f"Results: {kept.path}; a report: errand report {kept.path} --html report.html", markup=False)
    if as_json:
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
        "scenario": str(evaluation.file),
        "workers": workers,
        "missions_per_hour": None if rate is None else float(rate),
    }
