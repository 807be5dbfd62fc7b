"""`errand evaluate`: an evaluation file, random missions, or a mission at many seeds. `errand report`: results."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from executive.cli.defaults import chosen_run, typed_options, yielding
from executive.cli.number_options import quantity_option
from executive.cli.options import ANYWAY, AS_JSON, REQUEST_OPTIONS, takes_request
from executive.cli.output import console_for, finish, plain_lines, progress_bar, show_table, terminal_answerer
from executive.mission.request import Request
from skills.inputs.errors import InputError
from skills.inputs.outside import is_folder, writing
from skills.quantities import Count

if TYPE_CHECKING:
    from rich.console import Console

    from executive.app.evaluate.results import Case, Evaluation, Results, ResultsFile
    from executive.app.evaluate.summary import Group, StandingRow

RESULTS: Final = "results.sqlite"
_FILE_HELP: Final = "An evaluation file, a mission file, or a name of `errand missions`."
EvaluationOrMission = Annotated[Path | None, typer.Argument(metavar="FILE", help=_FILE_HELP, show_default=False)]
ResultsPath = Annotated[Path | None, typer.Option(help="Results file; by default results.sqlite in --out.")]


@takes_request(without=("file", "seed", "record"), out=Path("out/evaluate"))
def evaluate(
    request: Request,
    context: typer.Context,
    file: EvaluationOrMission = None,
    seeds: Annotated[str | None, typer.Option(help="Such as 1-20 or 1,4,7; by default 1-20.")] = None,
    jobs: Annotated[int, quantity_option(Count, help="Number of processes on this machine.")] = 2,
    workers: Annotated[int | None, quantity_option(Count, help="Number of workers of a local Dask cluster.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="The scheduler of a Dask cluster.")
    ] = None,
    results: ResultsPath = None,
    each_fault: Annotated[
        bool, typer.Option("--each-fault", help="First without faults, then with each fault and scenario alone.")
    ] = False,
    anyway: ANYWAY = False,
    random_missions: Annotated[
        int | None, quantity_option(Count, help="Number of random English missions to run; each seed draws one.")
    ] = None,
    worlds: Annotated[
        str | None, typer.Option(metavar="WORLD,...", help="Worlds of the random missions, in turn; by default flat.")
    ] = None,
    as_json: AS_JSON = False,
) -> None:
    """Runs an evaluation file, random missions, or a mission at many seeds; counts claims and the referee's verdicts.

    An evaluation file names missions, worlds and variations. Its results and those of random missions are stored in a
    file, and the same command continues an interrupted evaluation.
    """
    from executive.app.evaluate.evaluation import evaluate_runs, refuse_impossible_runs
    from executive.app.evaluate.evaluation_file import is_evaluation, load_evaluation
    from executive.app.evaluate.random_missions import random_missions as drawn_missions
    from executive.app.evaluate.workers import Pool
    from executive.words.mission import DEFAULT_WORLD

    console, out = console_for(as_json), request.out
    has_own = each_fault or bool(typed_options(context) & REQUEST_OPTIONS)
    of_file = file is not None and is_evaluation(file)
    pool, stored_in = Pool(jobs, workers, scheduler), results or out / RESULTS
    bar = partial(progress_bar, console, "runs", lines=True)
    run = partial(evaluate_runs, pool=pool, out=out, tell=plain_lines(console), progress=bar)
    if random_missions is not None:
        _refuse_options(has_own or file is not None, "--random-missions chooses the runs itself", _FOR_RANDOM)
        evaluation = drawn_missions(random_missions, worlds or DEFAULT_WORLD, seeds or "1-")
        console.print(f"errand evaluate {evaluation.name}", markup=False)
        found = run(evaluation, results=stored_in, checked=not anyway)
    elif file is not None and of_file:
        _refuse_options(has_own or bool(seeds or worlds), "an evaluation file chooses the runs itself", _FOR_FILE, file)
        evaluation = load_evaluation(file)
        found = run(evaluation, results=stored_in, before=None if anyway else refuse_impossible_runs)
    else:
        _refuse_options(worlds is not None, "--worlds is for --random-missions", "name one world by --world")
        asked = yielding(replace(request, out=Request.out, file=file), context)
        evaluation = _at_seeds(asked, seeds or "1-20", each_fault=each_fault, anyway=anyway)
        stored_in = results or _own_results(out, evaluation)
        found = run(evaluation, results=stored_in)
    by_seed = random_missions is None and not of_file
    values = _show_seeds(found.cases, console) if by_seed else _show(evaluation, found, console)
    console.print(f"Results: {stored_in}; a report: errand report {stored_in} --out report.html", markup=False)
    finish(values, as_json, good=all(case.report.achieved for case in found.cases))


_FOR_RANDOM: Final = "give only --worlds, --seeds, --results, --out, and the options for workers"
_FOR_FILE: Final = "write missions, worlds, seeds, faults and stacks into it"


def _refuse_options(given: bool, what: str, hint: str, file: Path | None = None) -> None:
    """Raises InputError for given options that do not fit the kind of evaluation."""
    if given:
        raise InputError(what, hint=hint, file=file)


def _own_results(out: Path, evaluation: Evaluation) -> Path:
    """Returns the results file in a folder; renames a file with the results of other runs or of finished runs."""
    from executive.app.evaluate.results import ResultsFile
    from executive.app.evaluate.workers import installed_code

    file = out / RESULTS
    if file.is_file():
        with ResultsFile(file) as stored, stored.claim():
            about, done = stored.about(), len(stored.done_ids())
        begun = about.get("digest") == evaluation.digest and about.get("code") == installed_code()
        if not begun or done >= len(evaluation.runs):
            free = (out / f"results-{number}.sqlite" for number in count(1))
            file.rename(next(each for each in free if not each.exists()))
    return file


def _at_seeds(asked: Request, seeds: str, *, each_fault: bool, anyway: bool) -> Evaluation:
    """Builds the runs of a request at many seeds; asks its questions only once. Raises InputError."""
    from executive.app.evaluate.evaluation_file import evaluation_at_seeds, seed_range
    from executive.app.prepare.from_request import prepare_checked

    chosen = seed_range(seeds)
    prepared = prepare_checked(asked, ask=terminal_answerer(), anyway=anyway)
    if asked.file is None:
        asked = replace(asked, sentence=prepared.request.sentence, answers=(), questions=None)
    return evaluation_at_seeds(replace(asked, file=prepared.request.file), chosen, each_fault=each_fault)


def _show_seeds(cases: Sequence[Case], console: Console) -> dict[str, Any]:
    """Shows the runs of a mission at many seeds, with one table for each condition; returns JSON values."""
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
        rows = [{CONDITION: name, "runs": len(own), **totals_of(own)} for name, own in conditions.items()]
        console.print()
        head = (CONDITION, "runs", "tree", "referee", "false claims")
        show_table(console, head, (tuple(map(str, each.values())) for each in rows))
        result["conditions"] = rows
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in totals_of(cases).items())
    console.print(f"{len(cases)} runs: {counts}")
    return result


def _seed_row(case: Case) -> tuple[str, ...]:
    from executive.app.report.run_report import VERDICTS

    report, seen = case.report, case.report.seen
    counts = (str(seen.collisions), str(seen.drops))
    times = (f"{report.sim_time_s:.1f}", f"{report.real_time_factor:.1f}")
    message = report.message if seen.success else f"{report.message} / {seen.why}"
    return str(report.seed), report.outcome, VERDICTS[seen.success], *counts, *times, message


def _show(evaluation: Evaluation, found: Results, console: Console) -> dict[str, Any]:
    """Shows the results of an evaluation file or of random missions; returns JSON values."""
    from executive.app.evaluate.evaluation_file import CONDITION
    from executive.app.evaluate.summary import groups_of, standings_json, totals_of

    _show_cases(console, found)
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
        **standings_json(found),
        "scenario": evaluation.name,
        "workers": int(found.about.get("workers", 0)),
        "missions_per_hour": None if rate is None else float(rate),
    }


def _show_cases(console: Console, found: Results) -> None:
    """Shows success by groups, claims against verdicts, and each run to inspect with its log folder."""
    from executive.app.evaluate.results import Standing
    from executive.app.evaluate.summary import cases_to_inspect, groups_of, standing_rows

    head = ("", "runs", "success", "95 %", *(standing.column for standing in Standing))
    show_table(console, head, map(_group_row, groups_of(found.cases)))
    console.print()
    rows = standing_rows(found.cases)
    show_table(console, ("claim against verdict", "runs", "share", "95 %", "causes"), map(_standing_row, rows))
    inspected = [
        (one.label, one.report.world, str(one.run.request.seed), one.asked, one.why, str(found.log_folder(one) or ""))
        for one in cases_to_inspect(found.cases)
    ]
    if inspected:
        console.print()
        show_table(console, ("run", "world", "seed", "request", "why", "log"), inspected)


def _group_row(group: Group) -> tuple[str, ...]:
    from executive.app.evaluate.results import Standing

    rate = group.rate
    counts = (str(group.standings.get(standing, 0)) for standing in Standing)
    return group.label, str(rate.total), f"{rate.successes} ({rate.value:.1%})", rate.interval_text, *counts


def _standing_row(row: StandingRow) -> tuple[str, ...]:
    causes = ", ".join(f"{cause} {number}" for cause, number in row.causes.items())
    return row.standing.words, str(row.rate.successes), f"{row.rate.value:.1%}", row.rate.interval_text, causes


def report(
    run: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN|RESULTS]", help="Folder of a run, or a results file.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Write an HTML page that needs no other file.")
    ] = None,
    against: Annotated[Path | None, typer.Option(metavar="RESULTS", help="Compare with another results file.")] = None,
    as_json: AS_JSON = False,
) -> None:
    """Opens the report of a run, by default the last, or reports the results of an evaluation.

    Of an evaluation: success rates, causes, run time by skill, and each failure.
    """
    if run is None or run.suffix != ".sqlite":
        run = chosen_run(run)
    if run.suffix == ".html":
        raise InputError("it is a page", hint="open it in a browser, or name the folder of its run", file=run)
    run = run.parent if run.suffix == ".mcap" else run
    if is_folder(run):
        if out is not None or against is not None:
            raise InputError("--out and --against are for an evaluation", hint="name its results.sqlite")
        _open_report(run, as_json=as_json)
        return
    from executive.app.evaluate.results import ResultsFile
    from executive.app.evaluate.summary import summary_json, to_page

    console = console_for(as_json)
    with ResultsFile(run) as stored:
        found, other = _results(stored), None
        if against is not None:
            with ResultsFile(against) as compared_with:
                other = _results(compared_with).cases
        _show_report(console, found, other)
        if out is not None:
            page = to_page(found, stored.evidence, against=other, other=str(against or ""))
            with writing(out):
                out.write_text(page, encoding="utf-8")
            console.print(f"Written: {out}", markup=False)
        finish(summary_json(found, other), as_json)


def _open_report(folder: Path, *, as_json: bool) -> None:
    """Names the report of a run, and opens it where there is a screen. Raises InputError if there is none."""
    from executive.app.runs.folders import kept_run

    kept = kept_run(folder)
    page = kept.request.out / "report.html"
    if not page.is_file():
        what, hint = "the run has no report yet", "it is written when the run ends; `errand resume` goes on with it"
        raise InputError(what, hint=hint, file=folder)
    console_for(as_json).print(str(page), markup=False)
    finish(dict(kept.report or {}), as_json)
    if not as_json and sys.stdout.isatty() and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        typer.launch(str(page))


def _results(stored: ResultsFile) -> Results:
    """Returns all runs that have a result. Raises InputError if no run has one."""
    found = stored.results()
    if not found.cases:
        raise InputError("it holds no result yet", hint="repeat the command that writes it", file=stored.path)
    return found


def _show_report(console: Console, found: Results, other: Sequence[Case] | None) -> None:
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
