"""`errand run` and `errand evaluate`: missions in the simulated world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from executive.app.durable import STORE, give_up_broken, kept, new_run, run_arguments
from executive.app.evaluate.scenario import is_evaluation
from executive.app.evaluate.seeds import seed_range
from executive.app.feasibility import refuse_impossible
from executive.app.mission_run import Finished
from executive.app.page_view import PageView, queueing
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.app.simulated import run_simulated
from executive.cli.listen_command import hear_request
from executive.cli.number_options import quantity_option
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, refusals, show_table
from executive.cli.run_options import (
    CLUTTER,
    FAULT,
    FRICTION,
    LIGHT,
    NO_RECORD,
    PEOPLE,
    RANDOM_FAULTS,
    ROBOTS,
    SCENARIO,
    SET,
    START_OR_UNKNOWN,
    TIME_LIMIT,
    TIME_OF_DAY,
    VIEW,
    VIEW_FOR,
    VIEW_PORT,
    robots_of,
    time_of_day,
)
from executive.cli.shown import control_for, show_files, show_run, voice_for
from executive.cli.stack_command import STACK
from executive.cli.sweep import (
    COUNTS,
    condition_rows,
    condition_totals,
    conditions,
    folders,
    rows,
    sweep,
    totals,
)
from executive.cli.terminal import terminal_answerer
from executive.language.questions import QuestionPolicy
from executive.mission.file.parameters import given_values
from executive.mission.request import Request, Start
from executive.mission.scenario import Scenario
from executive.record.profile import Profile, lines
from executive.speech.voice import Voice
from executive.store.missions import MissionStore
from executive.words.variation import NORMAL_LIGHT, Variation
from skills.files.errors import InputError
from skills.quantities import Count, Seed

World = Annotated[str | None, typer.Option(help="World by name or folder; flat unless said.")]
Say = Annotated[str | None, typer.Option(help='What is said, as in "Hey Alice, fetch me a drink".')]
MissionFile = Annotated[
    Path | None, typer.Argument(metavar="MISSION", help="A file, or a name of `errand missions`.", show_default=False)
]
Wake = Annotated[
    bool | None,
    typer.Option("--wake/--no-wake", help="Must the robot's name be said? If spoken, or where the world asks for it."),
]
Answer = Annotated[list[str] | None, typer.Option(help="An answer to a question that is asked back; in their order.")]
Questions = Annotated[
    QuestionPolicy | None,
    typer.Option(help="What becomes of other questions; asked at a terminal, else refused, unless a file says."),
]
Store = Annotated[Path | None, typer.Option(help="Where missions are kept; missions.sqlite in the folder for logs.")]
Anyway = Annotated[bool, typer.Option("--anyway", help="Begin although `errand check` would refuse it.")]
ScenarioOrMission = Annotated[
    Path | None,
    typer.Argument(
        metavar="FILE", help="A scenario file, a mission file, or a name of `errand missions`.", show_default=False
    ),
]
RandomMissions = Annotated[
    int | None, quantity_option(Count, help="Run so many random English missions; each seed draws one.")
]
Worlds = Annotated[
    str | None, typer.Option(metavar="WORLD,...", help="The worlds of random missions, in turn; flat unless said.")
]
OwnMap = Annotated[
    Path | None, typer.Option("--map", help="The robot's map, a folder of `errand map build`; else the world's own.")
]
AsJson = Annotated[bool, typer.Option("--json", help="The last line of standard output is the result as JSON.")]
PageOf = Callable[[Prepared], PageView | None]


def run(
    file: MissionFile = None,
    say: Say = None,
    listen_to: Annotated[Path | None, typer.Option("--listen", help="A wav file that says it.")] = None,
    world: World = None,
    given: SET = None,
    seed: Annotated[int, quantity_option(Seed, help="Sets the things in the world and all noise.")] = 1,
    wake: Wake = None,
    answer: Answer = None,
    questions: Questions = None,
    out: Annotated[Path, typer.Option(help="Folder for log, tree, recording and pictures.")] = Path("out"),
    as_json: AsJson = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No lines and no tree while it runs.")] = False,
    whole_tree: Annotated[bool, typer.Option("--tree", help="Show the whole tree in the end.")] = False,
    no_record: NO_RECORD = False,
    profile: Annotated[bool, typer.Option("--profile", help="Print the CPU time by subsystem.")] = False,
    store: Store = None,
    stack: STACK = None,
    own_map: OwnMap = None,
    start: START_OR_UNKNOWN = None,
    robots: ROBOTS = None,
    fault: FAULT = None,
    random_faults: RANDOM_FAULTS = 0,
    scenario: SCENARIO = None,
    light: LIGHT = NORMAL_LIGHT,
    clutter: CLUTTER = 0,
    people: PEOPLE = 0,
    friction: FRICTION = 1.0,
    day_time: TIME_OF_DAY = None,
    time_limit: TIME_LIMIT = None,
    anyway: Anyway = False,
    aloud: Annotated[bool, typer.Option("--voice", help="Say aloud what the robot says, by espeak-ng.")] = False,
    view: VIEW = False,
    view_for: VIEW_FOR = None,
    view_port: VIEW_PORT = 0,
) -> None:
    """Run a sentence or a mission file in the simulated world."""
    console = console_for(as_json)
    wants_page = view or view_for is not None
    kept_in = store or out / STORE
    timing = Profile() if profile else None

    def page_of(prepared: Prepared) -> PageView | None:
        later = queueing(prepared, store=kept_in, out=out)
        return PageView(prepared, console, port=view_port, later=later) if wants_page else None

    with refusals(), voice_for(aloud) as voice:
        setups = robots_of(robots)
        if listen_to is not None:
            must = wake is not False
            say = hear_request(listen_to, file or say, world=world, require_wake=must, console=console, robots=setups)
        at = None if start is None else Start.of(start)
        asked = Request(say, file, world, wake, tuple(answer or ()), questions, seed, out, not no_record, stack)
        asked = replace(asked, given=given_values(given or ()), start=at, map=own_map)
        asked = replace(asked, time_of_day=time_of_day(day_time), time_limit_s=time_limit)
        asked = replace(asked, robots=setups)
        asked = _disturbed(asked, fault, random_faults, scenario)
        asked = replace(asked, variation=Variation(light, clutter, people, friction))
        finished, page = _run_kept(
            asked,
            kept_in,
            anyway=anyway,
            quiet=quiet,
            whole_tree=whole_tree,
            console=console,
            page=page_of,
            profile=timing,
            voice=voice,
        )
    if timing is not None:
        for line in lines(timing.table()):
            console.print(line, markup=False)
    if as_json:
        print_json(finished.report.to_json())
    if page is not None:
        page.stay(0.0 if finished.hung_up else view_for)
    if not finished.report.achieved:
        raise typer.Exit(NOT_ACHIEVED)


def evaluate(
    file: ScenarioOrMission = None,
    say: Say = None,
    world: World = None,
    given: SET = None,
    seeds: Annotated[str | None, typer.Option(help="Such as 1-20 or 1,4,7; 1-20 unless said.")] = None,
    jobs: Annotated[int, quantity_option(Count, help="How many processes on this machine.")] = 2,
    workers: Annotated[int | None, quantity_option(Count, help="A local Dask cluster of so many workers.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="The scheduler of a Dask cluster.")
    ] = None,
    results: Annotated[
        Path | None, typer.Option(help="Where results land; results.sqlite in the folder for logs.")
    ] = None,
    wake: Wake = None,
    answer: Answer = None,
    questions: Questions = None,
    stack: STACK = None,
    own_map: OwnMap = None,
    start: START_OR_UNKNOWN = None,
    fault: FAULT = None,
    random_faults: RANDOM_FAULTS = 0,
    scenario: SCENARIO = None,
    each_fault: Annotated[
        bool, typer.Option("--each-fault", help="Without any, then with each fault and scenario alone.")
    ] = False,
    anyway: Anyway = False,
    random_missions: RandomMissions = None,
    worlds: Worlds = None,
    out: Annotated[Path, typer.Option(help="Folder for the logs.")] = Path("out/evaluate"),
    as_json: AsJson = False,
) -> None:
    """Run a scenario file, random missions, or a mission at many seeds; count claims and what the referee saw.

    A scenario file says what is run, where and with what varied. Results of scenarios and of random missions land in a
    file, and the same command goes on where it stopped. Of a mission, faults and scenarios are all in each run, unless
    each is to be tried alone.
    """
    with refusals():
        own = (say, world, given, wake, answer, questions, stack, own_map, start, fault, scenario)
        has_own = any(each is not None for each in own) or random_faults > 0 or each_fault
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
        at = None if start is None else Start.of(start)
        asked = Request(say, file, world, wake, tuple(answer or ()), questions, stack=stack, start=at, map=own_map)
        asked = replace(asked, given=given_values(given or ()))
        asked = _disturbed(asked, fault, random_faults, scenario)
        prepared = _prepared(asked, anyway=anyway)
        tried = [(name, run_arguments(each, prepared)) for name, each in conditions(asked, each=each_fault)]
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


def _disturbed(
    asked: Request, faults: Sequence[str] | None, random_faults: int, files: Sequence[Path] | None
) -> Request:
    """The request with what is to go wrong and to happen."""
    return replace(asked, scenario=Scenario(tuple(faults or ()), random_faults), scenario_files=tuple(files or ()))


def _prepared(asked: Request, *, anyway: bool) -> Prepared:
    """The request understood, and refused where it cannot be done. Raises InputError."""
    prepared = prepare(asked, ask=terminal_answerer())
    if not anyway:
        refuse_impossible(prepared)
    return prepared


def _run_kept(
    asked: Request,
    store: Path,
    *,
    anyway: bool,
    quiet: bool,
    whole_tree: bool,
    console: Console,
    page: PageOf,
    profile: Profile | None,
    voice: Voice,
) -> tuple[Finished, PageView | None]:
    """Run it, shown, and kept in the store so that another process can take it up."""
    prepared = _prepared(asked, anyway=anyway)
    shown = page(prepared)
    with MissionStore(store) as missions, missions.claimed():
        mission = missions.add(prepared.request.from_anywhere(), queued=False)
        for broken in give_up_broken(missions, mission):
            console.print(
                f"Mission {broken.id} ({broken.request.name}) had been broken off; it is given up.", markup=False
            )
        with kept(missions, mission) as ended:
            control = control_for(console, quiet=quiet) if shown is None else shown.control
            durable = new_run(missions, mission, prepared)
            start = partial(run_simulated, prepared, page=shown, durable=durable, profile=profile)
            talk = None if shown is None else shown.talk
            finished = show_run(
                start,
                prepared,
                console,
                control=control,
                quiet=quiet,
                whole_tree=whole_tree,
                talk=talk,
                voice=voice,
            )
            ended(finished.report)
    show_files(asked.out, console)
    return finished, shown
