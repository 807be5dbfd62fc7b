"""`errand evaluate`: a scenario file, random missions, or a mission at many seeds."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from executive.cli.number_options import quantity_option
from executive.cli.options import ANYWAY, AS_JSON, takes_request
from executive.cli.output import (
    NOT_ACHIEVED,
    console_for,
    plain_lines,
    print_json,
    refusals,
    show_table,
    terminal_answerer,
)
from executive.mission.request import Request
from skills.files.errors import InputError
from skills.quantities import Count

if TYPE_CHECKING:
    from rich.console import Console

    from executive.app.evaluate.case import Evaluation
    from executive.app.evaluate.evaluation import Evaluated
    from executive.app.evaluate.summary import Case

__all__ = ["evaluate"]

RESULTS: Final = "results.sqlite"


@takes_request(without=("file", "seed", "record"), out=Path("out/evaluate"))
def evaluate(
    request: Request,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="A scenario file, a mission file, or a name of `errand missions`.", show_default=False
        ),
    ] = None,
    seeds: Annotated[str | None, typer.Option(help="Such as 1-20 or 1,4,7; 1-20 unless said.")] = None,
    jobs: Annotated[int, quantity_option(Count, help="How many processes on this machine.")] = 2,
    workers: Annotated[int | None, quantity_option(Count, help="A local Dask cluster of so many workers.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="The scheduler of a Dask cluster.")
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(help="Where results land; results.sqlite in the folder for logs."),
    ] = None,
    each_fault: Annotated[
        bool, typer.Option("--each-fault", help="Without any, then with each fault and scenario alone.")
    ] = False,
    anyway: ANYWAY = False,
    random_missions: Annotated[
        int | None, quantity_option(Count, help="Runs so many random English missions; each seed draws one.")
    ] = None,
    worlds: Annotated[
        str | None, typer.Option(metavar="WORLD,...", help="The worlds of random missions, in turn; flat unless said.")
    ] = None,
    as_json: AS_JSON = False,
) -> None:
    """Run a scenario file, random missions, or a mission at many seeds; count claims and what the referee saw.

    A scenario file says what is run, where and with what varied. Results of scenarios and of random missions land in a
    file, and the same command goes on where it stopped. Of a mission, faults and scenarios are all in each run, unless
    each is to be tried alone.
    """
    from executive.app.evaluate.cluster import Pool
    from executive.app.evaluate.evaluation import evaluate_runs, refuse_impossible_runs
    from executive.app.evaluate.evaluation_file import is_evaluation, load_evaluation
    from executive.app.evaluate.random_missions import random_missions as drawn_missions
    from executive.words.mission import DEFAULT_WORLD

    console, out, request = console_for(as_json), request.out, replace(request, out=Request.out)
    has_own = each_fault or request != Request()
    with refusals():
        pool, kept_in = Pool(jobs, workers, scheduler), results or out / RESULTS
        run = partial(evaluate_runs, pool=pool, out=out, tell=plain_lines(console), progress=partial(_bar, console))
        if random_missions is not None:
            if has_own or file is not None:
                what = "--random-missions draws itself what is run"
                raise InputError(what, hint="give only --worlds, --seeds, who works, and where results land")
            evaluation = drawn_missions(random_missions, worlds or DEFAULT_WORLD, seeds or "1-")
            console.print(f"errand evaluate {evaluation.name}", markup=False)
            found = run(evaluation, results=kept_in, checked=not anyway)
            _show(evaluation, found, kept_in, console, as_json=as_json)
        elif file is not None and is_evaluation(file):
            if has_own or seeds is not None or worlds is not None:
                what = "a scenario file says itself what is run"
                raise InputError(what, hint="write missions, worlds, seeds, faults and stacks into it", file=file)
            evaluation, before = load_evaluation(file), None if anyway else refuse_impossible_runs
            found = run(evaluation, results=kept_in, before=before)
            _show(evaluation, found, kept_in, console, as_json=as_json)
        else:
            if worlds is not None:
                raise InputError("--worlds is for --random-missions", hint="name one world by --world")
            evaluation = _at_seeds(replace(request, file=file), seeds or "1-20", each_fault=each_fault, anyway=anyway)
            with _file_of(results) as kept_in:
                found = run(evaluation, results=kept_in)
            _show_seeds(found.cases, console, as_json=as_json)
    if not all(case.report.achieved for case in found.cases):
        raise typer.Exit(NOT_ACHIEVED)


@contextmanager
def _bar(console: Console, total: int) -> Iterator[Callable[[], None]]:
    """A bar of progress over so many runs."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    text = TextColumn("{task.description}")
    columns = (text, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("runs", total=total)
        yield lambda: bar.advance(task)


@contextmanager
def _file_of(results: Path | None) -> Iterator[Path]:
    """The results file that is named, else one that nobody needs afterwards."""
    if results is not None:
        yield results
        return
    with tempfile.TemporaryDirectory(prefix="errand-results-") as folder:
        yield Path(folder) / RESULTS


def _at_seeds(asked: Request, seeds: str, *, each_fault: bool, anyway: bool) -> Evaluation:
    """A request at many seeds, its questions answered once. Raises InputError: it cannot be done."""
    from executive.app.evaluate.case import seed_range
    from executive.app.evaluate.evaluation_file import evaluation_at_seeds
    from executive.app.feasibility import refuse_impossible
    from executive.app.prepare import prepare

    chosen, prepared = seed_range(seeds), prepare(asked, ask=terminal_answerer())
    if not anyway:
        refuse_impossible(prepared)
    if asked.file is None:
        asked = replace(asked, sentence=prepared.request.sentence, answers=(), questions=None)
    return evaluation_at_seeds(replace(asked, file=prepared.request.file), chosen, each_fault=each_fault)


def _show_seeds(cases: Sequence[Case], console: Console, *, as_json: bool) -> None:
    """Show a mission at many seeds: a row for each run, under several conditions a row for each of those."""
    from executive.app.evaluate.evaluation_file import CONDITION
    from executive.app.evaluate.summary import totals_of

    conditions: dict[str, list[Case]] = {}
    for case in cases:
        conditions.setdefault(case.run.varied.get(CONDITION, ""), []).append(case)
    for name, own in conditions.items():
        if name:
            console.print(f"\n{name}", style="bold", markup=False)
        header = ("seed", "tree", "referee", "collisions", "drops", "sim s", "x real", "message")
        show_table(console, header, map(_seed_row, own))
    result: dict[str, Any] = {"runs": [case.report.to_json() for case in cases], **totals_of(cases)}
    if "" not in conditions:
        told = [{CONDITION: name, "runs": len(own), **totals_of(own)} for name, own in conditions.items()]
        console.print()
        head = (CONDITION, "runs", "tree", "referee", "false claims")
        show_table(console, head, (tuple(map(str, each.values())) for each in told))
        result["conditions"] = told
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in totals_of(cases).items())
    console.print(f"{len(cases)} runs: {counts}")
    if as_json:
        print_json(result)


def _seed_row(case: Case) -> tuple[str, ...]:
    from executive.app.report import VERDICTS

    report, seen = case.report, case.report.seen
    return (
        str(report.seed),
        report.outcome,
        VERDICTS[seen.success],
        str(seen.collisions),
        str(seen.drops),
        f"{report.sim_time_s:.1f}",
        f"{report.real_time_factor:.1f}",
        report.message if seen.success else f"{report.message} / {seen.why}",
    )


def _show(evaluation: Evaluation, found: Evaluated, kept_in: Path, console: Console, *, as_json: bool) -> None:
    """Show a scenario or random missions: success by groups, claims against verdicts, what is to be looked at."""
    from executive.app.evaluate.evaluation_file import CONDITION
    from executive.app.evaluate.summary import groups_of, totals_of
    from executive.cli.report_command import show_cases, standings_json

    cases, logs = found.cases, found.about.get("logs")
    show_cases(console, cases, logs=logs)
    console.print(f"Results: {kept_in}; a report: errand report {kept_in} --html report.html", markup=False)
    if not as_json:
        return
    rate = found.about.get("missions_per_hour")
    conditions = [
        {CONDITION: group.name, "runs": group.runs, **group.counts}
        for group in groups_of(cases)
        if group.dimension == "variation"
    ]
    print_json(
        {
            "runs": [{**case.report.to_json(), "id": case.outcome.run_id} for case in cases],
            **totals_of(cases),
            **({"conditions": conditions} if conditions else {}),
            **standings_json(cases, logs),
            "scenario": evaluation.name,
            "workers": found.workers,
            "missions_per_hour": None if rate is None else float(rate),
        }
    )
