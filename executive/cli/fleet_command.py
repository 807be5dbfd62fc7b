"""`errand fleet` runs queued missions with several robots; each mission goes to the robot that finishes it first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from executive.app.report.run_report import VERDICTS
from executive.cli.options import AS_JSON, HOST, OBSERVE, PORT, QUIET, VIEW, StartCommand, stay_s, takes_request
from executive.cli.output import NOT_ACHIEVED, console_for, finish, plain_lines, print_json, progress_bar, show_table
from executive.mission.request import Request
from executive.run.control import Control
from executive.store.missions import STORE, GivenMissions, MissionState, MissionStore, StoredMission, store_in
from skills.inputs.errors import InputError
from skills.inputs.outside import is_folder, is_there

fleet = typer.Typer(name="fleet", help="Run a queue with several robots.", no_args_is_help=True, rich_markup_mode=None)

Queue = Annotated[Path, typer.Argument(metavar="QUEUE", help="The store of `errand queue add`, or its folder.")]


@fleet.command(cls=StartCommand)
@takes_request("robots", "world", "seed", "faults", "time_limit_s", "record")
def run(
    request: Request,
    queue: Queue,
    out: Annotated[Path | None, typer.Option(help="Folder for the run's folder; by default the store's.")] = None,
    quiet: QUIET = False,
    view: VIEW = None,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    observe: OBSERVE = None,
    as_json: AS_JSON = False,
) -> None:
    """Runs all queued missions in one world with several robots.

    A fault is for the robot that it names ("bob: robot dies at 20 s"), else for all robots.
    """
    from executive.app.runs.backend import observers

    console, store = console_for(as_json), _store(queue)
    tell = plain_lines(console)
    with MissionStore(store, create=False) as missions, missions.claim(), observers(observe) as observing:
        from executive.app.fleet.dispatch import silence
        from executive.app.fleet.fleet_run import run_fleet, simulated_fleet
        from executive.app.runs.folders import new_run
        from executive.app.runs.page_view import PageView, queue_function

        if not request.robots:
            raise InputError("a fleet needs its robots", hint="name them, as in --robots alice=spot,bob=spot")
        dispatch = simulated_fleet(
            missions,
            _to_do(missions),
            request.robots,
            world=request.world,
            seed=request.seed,
            faults=_faults(request.scenario.faults, [each.name for each in request.robots]),
            tell=silence if quiet else tell,
            record=request.record,
        )
        beside = store.parents[store.parent.name == STORE.parent.name]  # not in the hidden folder
        kept = new_run(replace(request, name="fleet", out=out or beside), missions.now())
        first = next(iter(next(iter(dispatch.missions.values())).options.values()))
        later = queue_function(replace(first.request, robots=request.robots), dispatch.add)
        page = PageView(None, tell, address=(view_host, view_port), later=later) if view is not None else None
        control = Control(pace=None) if page is None else page.control
        shown = [*([] if page is None else [page]), *(make(first, control) for make in observing)]
        run_in = partial(run_fleet, dispatch, out=kept.request.out, seed=request.seed, first=first, visitors=shown)
        with kept.going_on(), progress_bar(console, "missions", len(dispatch.missions)) as ended:
            verdict = run_in(control=control, ended=ended, time_limit_s=request.time_limit_s)
        results = dispatch.rows
        left = resumable_lines(missions, queue)
    seen = {each["referee"]["success"] for each in results if each["referee"] is not None}
    ending = {"outcome": "success" if verdict.good else "failure", "message": verdict.word, "missions": results}
    kept.end({**ending, "referee": {"success": False not in seen and (True in seen or None)}})
    for line in (verdict.word, *left, f"Written to {kept.request.out}"):
        console.print(line, markup=False)
    if as_json:
        print_json({"missions": results})
    if page is not None and view is not None:
        page.stay(stay_s(view))
    if not verdict.good:
        raise typer.Exit(NOT_ACHIEVED)


@fleet.command()
def status(queue: Queue, as_json: AS_JSON = False) -> None:
    """Shows the robot and the state of each mission, also during a run."""
    with MissionStore(_store(queue), create=False) as missions:
        from executive.app.fleet.fleet_mission import missions_json

        results = missions_json(missions, [each.id for each in missions.missions() if each.queued])
        names = {each.id: each.request.name for each in missions.missions()}
    header = ("mission", "name", "robot", "state", "after", "referee", "reassigned", "message")
    show_table(console_for(as_json), header, [_row(each, names) for each in results])
    finish({"missions": results}, as_json)


def _store(queue: Path) -> Path:
    store = store_in(queue) if is_folder(queue) else queue
    if not is_there(store):
        raise InputError("there is no queue", hint="name its folder, as in `errand fleet run out`", file=queue)
    return store


def _to_do(missions: MissionStore) -> Sequence[StoredMission]:
    """Returns the queued missions; first queues again or fails the missions that an interrupted fleet run left.

    Raises InputError if a mission of another command was interrupted, or no mission is queued.
    """
    given = GivenMissions(missions)
    known = given.all()
    wholes = {each.part_of for each in known.values()}
    for each in missions.missions(MissionState.RUNNING):
        if each.id in wholes:
            continue
        if each.id not in known:
            from executive.app.runs.queue import interrupted_error

            raise interrupted_error(missions, each)
        if known[each.id].blocked is not None:
            message = f"the run was interrupted, and {known[each.id].robot} had begun it"
            missions.finish(each.id, MissionState.FAILURE, message)
        else:
            missions.finish(each.id, MissionState.QUEUED, "")
            given.hand_back(each.id)
    given.settle()
    queued = [each for each in missions.missions(MissionState.QUEUED) if each.queued]
    if not queued:
        hint = " ".join(resumable_lines(missions)) or "queue a mission by `errand queue add`"
        raise InputError("no mission is queued", hint=hint, file=missions.path)
    return queued


def resumable_lines(missions: MissionStore, queue: Path | None = None) -> Sequence[str]:
    """Returns lines on how to continue: `errand fleet run` for queued missions, `errand resume` for cancelled ones."""
    given = GivenMissions(missions).all()
    waiting = [each for each in missions.missions(MissionState.QUEUED) if each.queued]
    lines = list[str]()
    if waiting and queue is not None:
        left = f"{len(waiting)} missions are" if len(waiting) > 1 else "1 mission is"
        lines.append(f"{left} left in the queue; `errand fleet run {queue}` with the same options goes on.")
    for each in missions.missions(MissionState.CANCELLED):
        if each.id in given and given[each.id].part_of is None:
            again = f"`errand resume --mission {each.id} --store {missions.path}`"
            lines.append(f"Mission {each.id} ({each.request.name}) was cancelled; {again} does it with one robot.")
    return lines


def _faults(words: Sequence[str], robots: Sequence[str]) -> Mapping[str, Sequence[str]]:
    """Returns the faults for each robot. Raises InputError for words that describe no fault."""
    from executive.app.prepare.scenarios import check_fault

    faults: dict[str, list[str]] = {name: [] for name in robots}
    for each in words:
        named, said = check_fault(each, robots)
        for name in robots if named is None else (named,):
            faults[name].append(said)
    return faults


def _row(mission: Mapping[str, Any], names: Mapping[int, str]) -> tuple[str, ...]:
    """Returns the row for a mission in `errand fleet status`."""
    number, referee = mission["id"], mission["referee"]
    seen = "" if referee is None else VERDICTS[referee["success"]]
    after = "" if mission["after"] is None else mission["after"]
    values = (number, names[number], mission["robot"] or "", mission["outcome"], after, seen, mission["reassigned"])
    return (*map(str, values), mission["message"])
