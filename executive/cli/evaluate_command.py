"""`errand evaluate`: a scenario file, random missions, or a mission at many seeds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from executive.app.evaluate.scenario import is_evaluation
from executive.app.evaluate.seeds import seed_range
from executive.app.feasibility import refuse_impossible
from executive.app.prepare import prepare
from executive.cli.number_options import quantity_option
from executive.cli.options import ANYWAY, AS_JSON, request_arguments, takes_request
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, refusals, show_table
from executive.cli.sweep import COUNTS, condition_rows, condition_totals, conditions, folders, rows, sweep, totals
from executive.cli.terminal import terminal_answerer
from executive.mission.request import Request
from skills.files.errors import InputError
from skills.quantities import Count

__all__ = ["evaluate"]


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
        Path | None, typer.Option(help="Where results land; results.sqlite in the folder for logs.")
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
    with refusals():
        out, request = request.out, replace(request, out=Request.out)
        has_own = each_fault or request != Request()
        if random_missions is not None or (file is not None and is_evaluation(file)):
            from executive.app.evaluate.worker_pool import Pool
            from executive.cli.evaluate_scenario import Handling, evaluate_scenario
            from executive.cli.random_evaluation import evaluate_random_missions

            how = Handling(console_for(as_json), Pool(jobs, workers, scheduler), results, out, anyway, as_json)
            if random_missions is not None:
                if has_own or file is not None:
                    what = "--random-missions draws itself what is run"
                    raise InputError(what, hint="give only --worlds, --seeds, who works, and where results land")
                raise typer.Exit(evaluate_random_missions(random_missions, worlds, seeds, how))
            assert file is not None
            if has_own or seeds is not None or worlds is not None:
                what = "a scenario file says itself what is run"
                raise InputError(what, hint="write missions, worlds, seeds, faults and stacks into it", file=file)
            raise typer.Exit(evaluate_scenario(file, how))
        if worlds is not None:
            raise InputError("--worlds is for --random-missions", hint="name one world by --world")
        if workers is not None or scheduler is not None or results is not None:
            what = "--workers, --scheduler and --results are for a scenario file and for random missions"
            raise InputError(what, hint="write one: missions, worlds, seeds, variations")
        chosen = seed_range(seeds or "1-20")
        asked = replace(request, file=file)
        prepared = prepare(asked, ask=terminal_answerer())
        if not anyway:
            refuse_impossible(prepared)
        if file is None:
            asked = replace(asked, sentence=prepared.request.sentence, answers=(), questions=None)
        tried = [(name, request_arguments(each)) for name, each in conditions(asked, each=each_fault)]
    console = console_for(as_json)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("runs", total=len(chosen) * len(tried))
        found = [
            (name, sweep(arguments, chosen, jobs=jobs, out=folder, done=lambda report: bar.advance(task)))
            for (name, arguments), folder in zip(tried, folders(out, [name for name, _ in tried]), strict=True)
        ]
    header = ("seed", "tree", "referee", "collisions", "drops", "sim s", "x real", "message")
    reports = [report for _, each in found for report in each]
    for name, runs in found:
        if each_fault:
            console.print(f"\n{name}", style="bold", markup=False)
        show_table(console, header, rows(runs))
    result = totals(reports)
    if each_fault:
        console.print()
        show_table(console, ("condition", "runs", "tree", "referee", "false claims"), condition_rows(found))
        result["conditions"] = condition_totals(found)
    counts = ", ".join(f"{result[key]} {key.replace('_', ' ')}" for key in COUNTS)
    console.print(f"{len(reports)} runs: {counts}")
    if as_json:
        print_json(result)
    if not all(report.achieved for report in reports):
        raise typer.Exit(NOT_ACHIEVED)
