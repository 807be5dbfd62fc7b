"""Gives out the runs of an evaluation, and keeps each result as it ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from executive.app.evaluate.case import Evaluation, RunSpec
from executive.app.evaluate.cluster import Pool
from executive.app.evaluate.evaluation_run import lost_outcome, run_one
from executive.app.evaluate.outcome import RunOutcome
from executive.app.evaluate.results import ResultsFile
from executive.app.evaluate.summary import Case
from executive.app.evaluate.workers import Workers, installed_code
from executive.app.feasibility import refuse_impossible
from executive.app.prepare import prepare
from executive.words.variation import NO_VARIATION
from skills.files.errors import Problems

__all__ = ["Evaluated", "Progress", "evaluate_runs", "give_out_runs", "refuse_impossible_runs"]

Progress = Callable[[int], AbstractContextManager[Callable[[], None]]]
"""Shows how many of so many runs are done; what it gives is called after each."""
LOGS: Final = "logs"
_CANCELLED: Final = "cancelled"


@dataclass(frozen=True)
class Evaluated:
    """The runs that have a result, what is known about all of them, and how many workers there were."""

    cases: Sequence[Case]
    about: Mapping[str, str]
    workers: int


def evaluate_runs(
    evaluation: Evaluation,
    pool: Pool,
    results: Path,
    *,
    out: Path,
    tell: Callable[[str], None] = lambda line: None,
    progress: Progress = lambda total: nullcontext(lambda: None),
    before: Callable[[Sequence[RunSpec]], None] | None = None,
    checked: bool = False,
) -> Evaluated:
    """Run what is still missing of the runs, and keep each result in the file `results`, files of runs in `out`.

    Args:
        evaluation: the runs.
        pool: who works on them.
        results: the results file, made where there is none.
        out: the folder for the files of runs.
        tell: shows a line.
        progress: shows how far it is.
        before: is called with the missing runs before the first begins, to refuse them all by InputError.
        checked: whether a run that `errand check` would refuse counts as refused.

    Raises:
        InputError: from `before`, or results cannot be kept; those that are there stay.
    """
    with ResultsFile(results, create=True) as kept, kept.claimed():
        kept.begin(evaluation, code=installed_code())
        done = kept.done()
        missing = [run for run in evaluation.runs if run.id not in done]
        if missing and before is not None:
            before(missing)
        if done:
            tell(f"{len(done)} of {len(evaluation.runs)} runs have a result in {kept.path}.")
        kept.note(logs=str((out / LOGS).resolve()))
        if missing:
            _work_through(missing, kept, pool, out, progress, checked=checked)
        cases = [Case(evaluation.runs[number], outcome) for number, outcome in kept.outcomes()]
        about = kept.about()
    return Evaluated(cases, about, int(about.get("workers", 0)))


def _work_through(
    missing: Sequence[RunSpec], kept: ResultsFile, pool: Pool, out: Path, progress: Progress, *, checked: bool
) -> None:
    with pool.opened() as workers, progress(len(missing)) as advance:
        count, began = workers.count, time.monotonic()
        folders = {run.id: out / (run.folder or f"{LOGS}/{run.id}") for run in missing}
        for outcome in give_out_runs(missing, workers, checked=checked):
            kept.add(_with_files(outcome, folders[outcome.run_id]))
            advance()
        hours = (time.monotonic() - began) / 3600.0
    kept.note(workers=str(count), missions_per_hour=f"{len(missing) / hours:.1f}")


def give_out_runs(runs: Sequence[RunSpec], workers: Workers, *, checked: bool = False) -> Iterator[RunOutcome]:
    """The outcome of each run as it ends; one that was cancelled is none, and is left to the next time.

    When `checked`, a run that `errand check` would refuse counts as refused.
    """
    for finished in workers.give_out(partial(run_one, checked=checked), runs):
        outcome = finished.result or lost_outcome(finished.item, finished.lost)
        if outcome.report.outcome != _CANCELLED:
            yield outcome


def _with_files(outcome: RunOutcome, folder: Path) -> RunOutcome:
    """The outcome, its files written into a folder of its own, and its log named where there is one."""
    files = outcome.evidence.files
    if not files:
        return outcome
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / Path(name).name).write_bytes(data)
    return replace(outcome, report=replace(outcome.report, log=str(folder / "log.mcap")))


def refuse_impossible_runs(runs: Sequence[RunSpec]) -> None:
    """Understand and check what differs by more than the seed, the light and the like. Raises InputError with all."""
    problems, seen = Problems(), set[str]()
    for run in runs:
        request = run.request
        varied = replace(NO_VARIATION, light=request.variation.light)
        plain = replace(request, seed=1, scenario=replace(request.scenario, random=0), variation=varied)
        if plain.to_json() not in seen:
            seen.add(plain.to_json())
            with problems:
                refuse_impossible(prepare(plain, ask=None))
    problems.raise_any()
