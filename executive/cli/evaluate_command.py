"""`errand evaluate`: a scenario file, random missions, or a mission at many seeds; `errand report`: their results."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from executive.cli.number_options import quantity_option
from executive.cli.options import ANYWAY, AS_JSON, request_arguments, takes_request
from executive.cli.output import console_for, finish, plain_lines, show_table, terminal_answerer, writing
from executive.mission.request import Request
from skills.files.errors import InputError
from skills.quantities import Count

if TYPE_CHECKING:
    from rich.console import Console

    from executive.app.evaluate.results import Case, Evaluated, Evaluation, ResultsFile, RunSpec
    from executive.app.evaluate.summary import Group, StandingRow

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
    """Runs a scenario file, random missions, or a mission at many seeds; count claims and what the referee saw.

    A scenario file says what is run, where and with what varied. Results of scenarios and of random missions land in a
    file, and the same command goes on where it stopped. Of a mission, faults and scenarios are all in each run, unless
    each is to be tried alone.
    """
    from executive.app.evaluate.evaluation import evaluate_runs, refuse_impossible_runs
    from executive.app.evaluate.evaluation_file import is_evaluation, load_evaluation
    from executive.app.evaluate.random_missions import random_missions as drawn_missions
    from executive.app.evaluate.workers import Pool
    from executive.words.mission import DEFAULT_WORLD

    console, out, request = console_for(as_json), request.out, replace(request, out=Request.out)
    has_own = each_fault or request != Request()
    pool, kept_in = Pool(jobs, workers, scheduler), results or out / RESULTS
    run = partial(evaluate_runs, pool=pool, out=out, tell=plain_lines(console), progress=partial(_bar, console))
    if random_missions is not None:
        if has_own or file is not None:
            what = "--random-missions draws itself what is run"
            raise InputError(what, hint="give only --worlds, --seeds, who works, and where results land")
        evaluation = drawn_missions(random_missions, worlds or DEFAULT_WORLD, seeds or "1-")
        console.print(f"errand evaluate {evaluation.name}", markup=False)
        found = run(evaluation, results=kept_in, checked=not anyway)
        values = _shown(evaluation, found, kept_in, console)
    elif file is not None and is_evaluation(file):
        if has_own or seeds is not None or worlds is not None:
            what = "a scenario file says itself what is run"
            raise InputError(what, hint="write missions, worlds, seeds, faults and stacks into it", file=file)
        evaluation, before = load_evaluation(file), None if anyway else refuse_impossible_runs
        found = run(evaluation, results=kept_in, before=before)
        values = _shown(evaluation, found, kept_in, console)
    else:
        if worlds is not None:
            raise InputError("--worlds is for --random-missions", hint="name one world by --world")
        evaluation = _at_seeds(replace(request, file=file), seeds or "1-20", each_fault=each_fault, anyway=anyway)
        with _file_of(results) as kept_in:
            found = run(evaluation, results=kept_in)
        values = _shown_seeds(found.cases, console)
    finish(values, as_json, good=all(case.report.achieved for case in found.cases))


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
    """The results file that the user names, else a temporary one."""
    if results is not None:
        yield results
        return
    with tempfile.TemporaryDirectory(prefix="errand-results-") as folder:
        yield Path(folder) / RESULTS


def _at_seeds(asked: Request, seeds: str, *, each_fault: bool, anyway: bool) -> Evaluation:
    """A request at many seeds, its questions answered once. Raises InputError: it cannot be done."""
    from executive.app.checker import prepare_checked
    from executive.app.evaluate.evaluation_file import evaluation_at_seeds, seed_range

    chosen = seed_range(seeds)
    prepared = prepare_checked(asked, ask=terminal_answerer(), anyway=anyway)
    if asked.file is None:
        asked = replace(asked, sentence=prepared.request.sentence, answers=(), questions=None)
    return evaluation_at_seeds(replace(asked, file=prepared.request.file), chosen, each_fault=each_fault)


def _shown_seeds(cases: Sequence[Case], console: Console) -> dict[str, Any]:
    """Shows a mission at many seeds, a row for each run, under several conditions one for each of those; as JSON."""
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
    return result


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


def _shown(evaluation: Evaluation, found: Evaluated, kept_in: Path, console: Console) -> dict[str, Any]:
    """Shows a scenario or random missions: success by groups, claims against verdicts, what to look at; as JSON."""
    from executive.app.evaluate.evaluation_file import CONDITION
    from executive.app.evaluate.summary import groups_of, standings_json, totals_of

    _show_cases(console, found)
    console.print(f"Results: {kept_in}; a report: errand report {kept_in} --html report.html", markup=False)
    rate, groups = found.about.get("missions_per_hour"), groups_of(found.cases)
    conditions = [
        {CONDITION: group.name, "runs": len(group.cases), **totals_of(group.cases)}
        for group in groups
        if group.dimension == "variation"
    ]
    return {
        "runs": [{**case.report.to_json(), "id": case.run.id} for case in found.cases],
        **totals_of(found.cases),
        **({"conditions": conditions} if conditions else {}),
        **standings_json(found, command_of),
        "scenario": evaluation.name,
        "workers": int(found.about.get("workers", 0)),
        "missions_per_hour": None if rate is None else float(rate),
    }


def _show_cases(console: Console, found: Evaluated) -> None:
    """Shows success by groups, claims against verdicts, and each run that is to be looked at with its log's folder."""
    from executive.app.evaluate.results import Standing
    from executive.app.evaluate.summary import groups_of, standing_rows, to_look_at

    head = ("", "runs", "success", "95 %", *(standing.column for standing in Standing))
    show_table(console, head, map(_group_row, groups_of(found.cases)))
    console.print()
    rows = standing_rows(found.cases)
    show_table(console, ("claim against verdict", "runs", "share", "95 %", "causes"), map(_standing_row, rows))
    looked_at = [(case, found.log_folder(case)) for case in to_look_at(found.cases)]
    if looked_at:
        console.print()
        rows_of = (
            (case.label, case.report.world, str(case.run.request.seed), case.asked, case.why, str(folder or ""))
            for case, folder in looked_at
        )
        show_table(console, ("run", "world", "seed", "asked for", "why", "log"), rows_of)


def _group_row(group: Group) -> tuple[str, ...]:
    from executive.app.evaluate.results import Standing

    rate = group.rate
    counts = (str(group.standings.get(standing, 0)) for standing in Standing)
    return group.label, str(rate.total), f"{rate.successes} ({rate.value:.1%})", rate.interval_text, *counts


def _standing_row(row: StandingRow) -> tuple[str, ...]:
    causes = ", ".join(f"{cause} {number}" for cause, number in row.causes.items())
    return row.standing.words, str(row.rate.successes), f"{row.rate.value:.1%}", row.rate.interval_text, causes


def command_of(run: RunSpec) -> str:
    """The command line that repeats a run alone."""
    return shlex.join(["errand", "run", *request_arguments(run.request)])


def report(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="A file of `errand evaluate SCENARIO`.")],
    html: Annotated[Path | None, typer.Option(help="Write a page that needs nothing else.")] = None,
    against: Annotated[Path | None, typer.Option(metavar="RESULTS", help="Compare with another results file.")] = None,
    as_json: AS_JSON = False,
) -> None:
    """Reports the results of an evaluation: success with intervals, causes, where the time goes, each failure."""
    from executive.app.evaluate.results import ResultsFile
    from executive.app.evaluate.summary import summary_json, to_page

    console = console_for(as_json)
    with ResultsFile(results) as kept:
        found, other = _evaluated(kept), None
        if against is not None:
            with ResultsFile(against) as compared_with:
                other = _evaluated(compared_with).cases
        _show_report(console, found, other)
        if html is not None:
            page = to_page(found, kept.evidence, command_of, against=other, other=str(against or ""))
            with writing(html):
                html.write_text(page, encoding="utf-8")
            console.print(f"Written: {html}", markup=False)
        finish(summary_json(found, command_of, other), as_json)


def _evaluated(kept: ResultsFile) -> Evaluated:
    """All runs that have a result. Raises InputError: none has."""
    found = kept.evaluated()
    if not found.cases:
        raise InputError("it holds no result yet", hint="give the command that writes it again", file=kept.path)
    return found


def _show_report(console: Console, found: Evaluated, other: Sequence[Case] | None) -> None:
    from executive.app.evaluate.summary import causes_of, comparisons_of, label_of, time_rows

    _show_cases(console, found)
    for row in causes_of(found.cases, most=1):
        console.print(f"{row.cause}: {row.runs}, as in: {next(iter(row.messages))}", markup=False)
    rows = ((row.skill, str(row.runs), f"{row.sim_s:.1f}", f"{row.share:.1%}") for row in time_rows(found.cases))
    show_table(console, ("skill", "runs", "simulated s", "share"), rows)
    for each in comparisons_of(found.cases, other) if other is not None else ():
        test = "McNemar" if each.paired else "Fisher"
        here, there = (f"{rate.successes} of {rate.total}" for rate in (each.here, each.there))
        what = label_of(each.dimension, each.name)
        console.print(f"{what}: {here} against {there}, p {each.p:.3g} ({test})", markup=False)
