"""`errand queue` and `errand resume`: missions in a store, run one after another or when a trigger fires."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from datetime import datetime, timedelta
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from executive.app.runs.signals import ended_by_signals
from executive.cli.defaults import runs_folder
from executive.cli.number_options import quantity_argument, quantity_option
from executive.cli.options import AS_JSON, HOST, OBSERVE, PORT, QUIET, STORE, VIEW, StartCommand, takes_request
from executive.cli.output import console_for, finish, plain_lines, progress_bar, show_table, terminal_answerer
from executive.cli.run_command import refuse_unaddressed
from executive.mission.load import load_stack
from executive.mission.request import Request
from executive.store.missions import MissionState, MissionStore, StoredMission, store_in, utc_now
from executive.store.standing_missions import StandingMission, StandingMissions
from executive.store.trigger_source import installed_source
from executive.store.triggers import Every, Missed, OnCall, OnTopic, Timed, Trigger, event_of, schedule_of
from executive.store.wakeup import WakeupPipe, wake_server
from skills.inputs.errors import InputError, listing
from skills.inputs.outside import writing
from skills.quantities import Count, Port, Wait

if TYPE_CHECKING:
    from rich.console import Console

    from executive.app.runs.queue import MissionResult, MissionRuns

queue = typer.Typer(name="queue", help="Store missions, run them in turn.", no_args_is_help=True, rich_markup_mode=None)

Out = Annotated[Path, typer.Option(help="Folder for logs, with a folder for each mission.")]
RunsOut = Annotated[Path | None, typer.Option("--out", help="Replaces the --out of the missions; 'out' for the store.")]
NoRecord = Annotated[bool, typer.Option("--no-record", help="Leave no recording and no pictures.")]
Number = Annotated[int, quantity_argument(Count, metavar="NUMBER", help="Number of a mission in `errand queue list`.")]
At = Annotated[str | None, typer.Option(metavar="TIME", help='As in "every weekday 09:00" or "2026-12-01 09:00".')]
EveryPeriod = Annotated[str | None, typer.Option("--every", metavar="PERIOD", help="Its period, as in 30m, 2h or 90s.")]
On = Annotated[
    str | None,
    typer.Option(metavar="EVENT", help='Queue it on "battery full", "battery 80%", "call NAME" or "topic KIND:TOPIC".'),
]
WhenMissed = Annotated[
    Missed | None,
    typer.Option(help="For times that pass while no server waits: skip them (default), or queue the mission once."),
]

_LONGEST_S: Final = 3.2e9  # a hundred years
_RESUMABLE: Final = (MissionState.RUNNING, MissionState.CANCELLED, MissionState.ERROR)


@queue.command(cls=StartCommand)
@takes_request(without=("start", "questions"))
def add(
    request: Request,
    store: STORE = None,
    anyway: Annotated[bool, typer.Option("--anyway", help="Queue it although `errand check` would refuse it.")] = False,
    at: At = None,
    every: EveryPeriod = None,
    on: On = None,
    missed: WhenMissed = None,
    as_json: AS_JSON = False,
) -> None:
    """Checks and queues a sentence or a mission file; with a trigger, `errand queue serve` queues it each time."""
    from executive.app.prepare.from_request import prepare_checked

    trigger = _trigger(at, every, on, missed)
    refuse_unaddressed(request)
    load_stack(request.stack)
    prepared = prepare_checked(request, ask=terminal_answerer(), anyway=anyway)
    request = prepared.request.from_anywhere()
    with writing(request.out, "name another --out"):
        request.out.mkdir(parents=True, exist_ok=True)
    with MissionStore(store or store_in(runs_folder())) as missions:
        if trigger is None:
            mission, standing = missions.add(request, queued=True), {}
        else:
            added = StandingMissions(missions).add(request, trigger, missed or Missed.SKIP)
            mission, standing = missions.mission(added.id), {added.id: added}
    wake_server(missions.path)
    said = "is queued" if trigger is None else f"waits for `errand queue serve` to queue it ({trigger})"
    console_for(as_json).print(f"Mission {mission.id} {said}: {request.name}", markup=False)
    finish(_mission_json(mission, standing), as_json)


def _store(out: Path, resumes: bool = False) -> Path:
    """Store of `queue add`, or if it is missing, that in `out`; a resumed mission is sought in `out` first."""
    stores = (store_in(runs_folder()), store_in(out))
    return next((each for each in stores[:: -1 if resumes else 1] if each.is_file()), stores[0])


@queue.command(name="list")
def show(out: Out = Path("out"), store: STORE = None, as_json: AS_JSON = False) -> None:
    """Lists all missions of the store with their states."""
    with MissionStore(store or _store(out), create=False) as missions:
        known = missions.missions()
        standing = {each.id: each for each in StandingMissions(missions).missions()}
    header = ("mission", "state", "name", "world", "seed", "commands", "message", "trigger")
    show_table(console_for(as_json), header, [_row(each, standing) for each in known])
    finish({"missions": [_mission_json(each, standing) for each in known]}, as_json)


@queue.command()
def remove(number: Number, out: Out = Path("out"), store: STORE = None) -> None:
    """Removes a mission; a mission with a trigger can be removed while a server runs."""
    with MissionStore(store or _store(out), create=False) as missions:
        stands = missions.mission(number).state is MissionState.STANDING
        with nullcontext() if stands else missions.claim():
            missions.remove(number)
        wake_server(missions.path)
    console_for(False).print(f"Mission {number} is removed.")


@queue.command(cls=StartCommand)
def run(
    out: RunsOut = None,
    store: STORE = None,
    quiet: QUIET = False,
    view: VIEW = None,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    observe: OBSERVE = None,
    no_record: NoRecord = False,
    as_json: AS_JSON = False,
) -> None:
    """Runs all queued missions, each in the world that the mission before it left."""
    from executive.app.runs.queue import resumable_line

    console = console_for(as_json)
    with _runs(store, out, console, quiet, view, (view_host, view_port), observe, not no_record) as (missions, runs):
        ended = _in_turn(missions, runs, console)
        resumable = resumable_line(missions)
    if ended:
        console.print(f"{sum(each.achieved for each in ended)} of {len(ended)} missions achieved")
    else:
        console.print("No mission is queued; `errand queue add` queues one, `errand queue list` shows all.")
    if resumable is not None:
        console.print(resumable, markup=False)
    finish({"missions": [each.to_json() for each in ended]}, as_json, good=all(each.achieved for each in ended))


@contextmanager
def _runs(
    store: Path | None,
    out: Path | None,
    console: Console,
    quiet: bool,
    view: float | None,
    address: tuple[str, int],
    observe: Sequence[str] | None,
    record: bool,
    resumes: bool = False,
) -> Iterator[tuple[MissionStore, MissionRuns]]:
    """Claims a store while the block runs; yields the store with the runner for its missions.

    With `view` each mission has a live page, and the last page stays as `errand run --view` says.
    """
    folder = out or runs_folder()
    with MissionStore(store or _store(folder, resumes), create=False) as missions, missions.claim():
        with writing(folder, "name another --out"):
            folder.mkdir(parents=True, exist_ok=True)
        from executive.app.runs.backend import observers
        from executive.app.runs.queue import MissionRuns
        from executive.cli.screen import ConsoleScreen, page_of

        page = None if view is None else page_of(console, address, missions.path, folder)
        with observers(observe) as observing:
            screen = ConsoleScreen(console, quiet=quiet, page=page, observing=observing)
            yield missions, MissionRuns(missions, screen, ask=terminal_answerer(), out=out, record=record)
    screen.stay(view)


def _in_turn(
    missions: MissionStore, runs: MissionRuns, console: Console, first: StoredMission | None = None
) -> list[MissionResult]:
    """Runs the queued missions one after another with a progress bar.

    Runs the mission `first` before them, or only `first` if it is not queued. Stops after a cancelled mission.
    """
    from executive.app.runs.queue import queued_missions, run_in_turn

    coming, done, waiting = iter(() if first is None else (first,)), count(1), 0
    if several := first is None or first.queued:
        coming, waiting = chain(coming, queued_missions(missions)), _waiting(missions)
    with progress_bar(console, "missions", waiting + (first is not None)) as advance:
        return run_in_turn(coming, runs, lambda: advance(total=next(done) + (_waiting(missions) if several else 0)))


def _waiting(missions: MissionStore) -> int:
    """Counts the queued missions."""
    return sum(each.queued for each in missions.missions(MissionState.QUEUED))


def _row(mission: StoredMission, standing: Mapping[int, StandingMission]) -> tuple[str, ...]:
    """Returns the row for a mission in `errand queue list`."""
    asked, commands = mission.request, "\n".join(mission.request.commands)
    state = "running or interrupted" if mission.state is MissionState.RUNNING else mission.state.value
    trigger = f"{mission.standing}: {mission.why}" if mission.why else ""
    if (stands := standing.get(mission.id)) is not None:
        due = _due(stands)
        timed = isinstance(stands.trigger, Timed)
        trigger = f"{stands.trigger}{f', next {due:%a %Y-%m-%d %H:%M}' if due else ', over' if timed else ''}"
    return str(mission.id), state, asked.name, asked.world_name, str(asked.seed), commands, mission.message, trigger


def _mission_json(mission: StoredMission, standing: Mapping[int, StandingMission]) -> dict[str, Any]:
    """Returns a mission as JSON values."""
    asked = mission.request
    values: dict[str, Any] = {"mission": mission.id, "state": mission.state.value, "name": asked.name}
    values |= {"world": asked.world_name, "seed": asked.seed, "commands": list(asked.commands)}
    values["message"] = mission.message
    if (stands := standing.get(mission.id)) is not None:
        due = _due(stands)
        values |= {"trigger": str(stands.trigger), "next": None if due is None else due.isoformat()}
        values |= {} if isinstance(stands.trigger, OnCall | OnTopic) else {"missed": stands.missed.value}
    return {**values, "standing": mission.standing, "why": mission.why} if mission.why else values


def _due(standing: StandingMission) -> datetime | None:
    """Next time at which a standing mission is due, in local time."""
    due = standing.due_next(utc_now(), None)
    return None if due is None else due.astimezone()


def _trigger(at: str | None, every: str | None, on: str | None, missed: Missed | None) -> Trigger | None:
    """Returns the trigger that the options describe; None if they describe none. Raises InputError."""
    given: list[Trigger] = [schedule_of(at)] if at is not None else []
    given += [Every.from_text(every)] if every is not None else []
    given += [event_of(on)] if on is not None else []
    if len(given) > 1:
        raise InputError("give one of --at, --every and --on", hint="queue the mission once for each trigger")
    trigger = given[0] if given else None
    if missed is not None and (trigger is None or isinstance(trigger, OnCall | OnTopic)):
        what = "without a trigger" if trigger is None else f"for '{trigger}'"
        hint = "leave it out: calls and messages only count while `errand queue serve` runs"
        hint = hint if trigger else "give --at, --every or --on as well"
        raise InputError(f"--missed has no meaning {what}", hint=hint)
    if isinstance(trigger, OnTopic):
        installed_source(trigger.kind)
    return trigger


@queue.command(cls=StartCommand)
def serve(
    out: RunsOut = None,
    store: STORE = None,
    host: Annotated[str, typer.Option(help="Host name or address for HTTP calls.")] = "127.0.0.1",
    port: Annotated[int, quantity_option(Port, help="Port for HTTP calls; 0 takes a free one.")] = 8950,
    token: Annotated[
        str | None,
        typer.Option(envvar="ERRAND_TOKEN", help="Bearer token of calls; by default one stored beside the store."),
    ] = None,
    until_idle: Annotated[bool, typer.Option("--until-idle", help="End when no mission is queued.")] = False,
    for_s: Annotated[
        float | None, quantity_option(Wait, "--for", help="Begin no mission after this time, and end.")
    ] = None,
    quiet: QUIET = False,
    view: VIEW = None,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    observe: OBSERVE = None,
    no_record: NoRecord = False,
    as_json: AS_JSON = False,
) -> None:
    """Queues missions at times, on a full battery, calls and messages, and runs them, until Ctrl-C."""
    from executive.app.runs.queue import resumable_line
    from executive.app.runs.queue_server import CallAddress, Listeners, QueueServer

    console = console_for(as_json)
    tell = plain_lines(console)
    with _runs(store, out, console, quiet, view, (view_host, view_port), observe, not no_record) as (missions, runs):
        end = None if for_s is None else missions.now() + timedelta(seconds=min(for_s, _LONGEST_S))
        address = CallAddress(host, port, token)
        with WakeupPipe(missions) as wakeup, Listeners(missions.path, address, tell) as listeners:
            standing = StandingMissions(missions)
            server = QueueServer(missions, standing, wakeup, runs, follow=listeners.follow, tell=tell)
            with ended_by_signals(server.stop):
                tell(f"Standing missions: {len(standing.missions())} ({missions.path}). Ctrl-C ends.")
                ended = server.serve(end=end, until_idle=until_idle)
            resumable = resumable_line(missions)
    tell(f"{sum(each.achieved for each in ended)} of {len(ended)} missions achieved")
    if resumable is not None:
        tell(resumable)
    finish({"missions": [{"mission": e.mission, "outcome": e.outcome, "achieved": e.achieved} for e in ended]}, as_json)


def resume(
    out: RunsOut = None,
    store: STORE = None,
    mission: Annotated[
        int | None,
        quantity_option(Count, help="Number of the mission; by default the last interrupted or cancelled one."),
    ] = None,
    as_json: AS_JSON = False,
    quiet: QUIET = False,
    view: VIEW = None,
    view_port: PORT = 0,
    view_host: HOST = "127.0.0.1",
    observe: OBSERVE = None,
    no_record: NoRecord = False,
) -> None:
    """Resumes an interrupted or cancelled mission from its last finished step; then runs its queue."""
    console = console_for(as_json)
    address, record = (view_host, view_port), not no_record
    with _runs(store, out, console, quiet, view, address, observe, record, True) as (missions, runs):
        ended = _in_turn(missions, runs, console, _interrupted(missions, mission))
    values = {**ended[0].to_json(), "then": [each.to_json() for each in ended[1:]]}
    finish(values, as_json, good=all(each.achieved for each in ended))


def _interrupted(missions: MissionStore, number: int | None) -> StoredMission:
    """Returns the mission to resume: the named mission, an interrupted one, or the newest if it was cancelled.

    Raises InputError if there is no such mission.
    """
    if number is None:
        begun = [each for each in missions.missions() if each.starts]
        found = [each for each in begun if each.state is MissionState.RUNNING]
        found += [each for each in begun[-1:] if each.state in _RESUMABLE]
        if found:
            return found[0]
        queued = missions.missions(MissionState.QUEUED)
        hint = "`errand queue run` runs the queued missions" if queued else "`errand queue list` shows all missions"
        raise InputError("no mission was interrupted", hint=hint, file=missions.path)
    chosen = missions.mission(number)
    if chosen.state not in _RESUMABLE:
        known = listing((state.value for state in _RESUMABLE), last="or")
        raise InputError(
            f"mission {number} is {chosen.state.value}", hint=f"name a mission that is {known}", file=missions.path
        )
    return chosen
