"""`errand evaluate`: a scenario file, random missions, or a mission at many seeds."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console

from executive.app.evaluate.cluster import Pool
from executive.app.evaluate.evaluation import Evaluated, evaluate_runs, refuse_impossible_runs
from executive.app.evaluate.random_missions import random_missions as drawn_missions
from executive.app.evaluate.runs import Evaluation, RunSpec, seed_range
from executive.app.evaluate.scenario import files_of, is_evaluation, load_evaluation
from executive.app.evaluate.summary import Case, groups_of, totals_of
from executive.app.feasibility import refuse_impossible
from executive.app.prepare import prepare
from executive.app.report import VERDICTS, RunReport
from executive.cli.number_options import quantity_option
from executive.cli.options import ANYWAY, AS_JSON, takes_request
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, refusals, show_table
from executive.cli.report_command import show_cases, standings_json
from executive.cli.terminal import terminal_answerer
from executive.mission.request import Request
from executive.mission.scenario import NO_SCENARIO, Scenario
from executive.words.slug import slug
from executive.words.steps import DEFAULT_WORLD
from skills.files.errors import InputError
from skills.quantities import Count

__all__ = ["evaluate"]

RESULTS: Final = "results.sqlite"
CONDITION: Final = "condition"


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
        int | None, quantity_option(Count, help="Run so many random English missions; each seed draws one.")
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
    console, out, request = console_for(as_json), request.out, replace(request, out=Request.out)
    has_own = each_fault or request != Request()
    with refusals():
        pool, kept_in = Pool(jobs, workers, scheduler), results or out / RESULTS
        if random_missions is not None:
            if has_own or file is not None:
                what = "--random-missions draws itself what is run"
                raise InputError(what, hint="give only --worlds, --seeds, who works, and where results land")
            evaluation = drawn_missions(random_missions, worlds or DEFAULT_WORLD, seeds or "1-")
            console.print(f"errand evaluate {evaluation.name}", markup=False)
            found = evaluate_runs(evaluation, pool, kept_in, out=out, console=console, checked=not anyway)
        elif file is not None and is_evaluation(file):
            if has_own or seeds is not None or worlds is not None:
                what = "a scenario file says itself what is run"
                raise InputError(what, hint="write missions, worlds, seeds, faults and stacks into it", file=file)
            evaluation, before = load_evaluation(file), None if anyway else refuse_impossible_runs
            found = evaluate_runs(evaluation, pool, kept_in, out=out, console=console, before=before)
        else:
            if worlds is not None:
                raise InputError("--worlds is for --random-missions", hint="name one world by --world")
            evaluation = _at_seeds(replace(request, file=file), seeds or "1-20", each_fault=each_fault, anyway=anyway)
            with _file_of(results) as kept_in:
                found = evaluate_runs(evaluation, pool, kept_in, out=out, console=console)
            _show_seeds(found.cases, console, as_json=as_json)
            _end(found.cases)
        _show(evaluation, found, kept_in, console, as_json=as_json)
        _end(found.cases)


def _end(cases: Sequence[Case]) -> None:
    """End with status 1 unless every run has achieved its mission."""
    raise typer.Exit(0 if all(case.outcome.achieved for case in cases) else NOT_ACHIEVED)


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
    chosen = seed_range(seeds)
    prepared = prepare(asked, ask=terminal_answerer())
    if not anyway:
        refuse_impossible(prepared)
    if asked.file is None:
        asked = replace(asked, sentence=prepared.request.sentence, answers=(), questions=None)
    asked = replace(asked, file=prepared.request.file).from_anywhere()
    name = asked.sentence or (asked.file.stem if asked.file is not None else "")
    runs: dict[str, RunSpec] = {}
    for number, (condition, request) in enumerate(_conditions(asked, each_fault=each_fault)):
        folder, files = f"{number}-{slug(condition)}/" if each_fault else "", files_of(request)
        for seed in chosen:
            each = replace(request, seed=seed, out=Request.out)
            run = RunSpec(each, name, {CONDITION: condition} if condition else {}, files, f"{folder}seed-{seed:03d}")
            runs.setdefault(run.id, run)
    return Evaluation(name, tuple(runs.values()))


def _conditions(asked: Request, *, each_fault: bool) -> Sequence[tuple[str, Request]]:
    """The request under each condition by name: with all its faults and scenarios, or without, and with each alone.

    Raises InputError: there are none to try alone.
    """
    if not each_fault:
        return [("", asked)]
    scenario, plain = asked.scenario, replace(asked, scenario=NO_SCENARIO, scenario_files=())
    alone = [(words, replace(plain, scenario=Scenario((words,)))) for words in scenario.faults]
    alone += [(str(path), replace(plain, scenario_files=(path,))) for path in asked.scenario_files]
    if scenario.random:
        alone.append((f"{scenario.random} random faults", replace(plain, scenario=Scenario(random=scenario.random))))
    if not alone:
        raise InputError("there is no fault to try alone", hint="give some by --fault, --random-faults or --scenario")
    return [("no fault", plain), *alone]


def _show_seeds(cases: Sequence[Case], console: Console, *, as_json: bool) -> None:
    """Show a mission at many seeds: a row for each run, under several conditions a row for each of those."""
    conditions: dict[str, list[Case]] = {}
    for case in cases:
        conditions.setdefault(case.run.varied.get(CONDITION, ""), []).append(case)
    for name, own in conditions.items():
        if name:
            console.print(f"\n{name}", style="bold", markup=False)
        header = ("seed", "tree", "referee", "collisions", "drops", "sim s", "x real", "message")
        show_table(console, header, map(_seed_row, own))
    result: dict[str, Any] = {"runs": [case.outcome.report for case in cases], **totals_of(cases)}
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
    report = RunReport.from_json(case.outcome.report)
    seen = report.seen
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
            "runs": [{**case.outcome.report, "id": case.outcome.run_id} for case in cases],
            **totals_of(cases),
            **({"conditions": conditions} if conditions else {}),
            **standings_json(cases, logs),
            "scenario": evaluation.name,
            "workers": found.workers,
            "missions_per_hour": None if rate is None else float(rate),
        }
    )
