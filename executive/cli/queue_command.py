"""`errand queue` and `errand resume`: missions kept in a store, run one after another or whenever a trigger fires."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from executive.app.signals import ended_by_signals
from executive.cli.number_options import quantity_argument, quantity_option
from executive.cli.options import AS_JSON, QUIET, STORE, takes_request
from executive.cli.output import console_for, finish, plain_lines, show_table, terminal_answerer
from executive.cli.run_command import refuse_unaddressed
from executive.mission.load import load_stack
from executive.mission.request import Request
from executive.store.missions import STORE as STORE_NAME
from executive.store.missions import MissionState, MissionStore, StoredMission, utc_now
from executive.store.standing_missions import StandingMission, StandingMissions
from executive.store.trigger_source import refuse_missing_source
from executive.store.triggers import Every, Missed, OnCall, OnTopic, Timed, Trigger, event_of, local, schedule_of
from executive.store.wakeup import WakeupPipe, wake_server
from skills.files.errors import InputError, listing
from skills.quantities import Count, Port, Wait

queue = typer.Typer(
    name="queue",
    help="Missions kept in a store, to be run one after another.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Out = Annotated[Path, typer.Option(help="Folder for logs; each mission gets one of its own in it.")]
Number = Annotated[
    int, quantity_argument(Count, metavar="NUMBER", help="The mission's number, as `errand queue list` shows it.")
]
At = Annotated[
    str | None,
    typer.Option(metavar="TIME", help='Queue it at these times, as in "every weekday 09:00" or "2026-12-01 09:00".'),
]
EveryPeriod = Annotated[
    str | None, typer.Option("--every", metavar="PERIOD", help="Queue it again and again, as in 30m, 2h or 90s.")
]
On = Annotated[
    str | None,
    typer.Option(metavar="EVENT", help='Queue it on "battery full", "battery 80%", "call NAME" or "topic KIND:TOPIC".'),
]
WhenMissed = Annotated[
    Missed | None,
    typer.Option(
        help="How to treat times that pass while nothing serves, or a mission runs: skip them (default), or queue once."
    ),
]

_LONGEST_S: Final = 3.2e9  # a hundred years
_MAY_GO_ON: Final = (MissionState.RUNNING, MissionState.CANCELLED, MissionState.ERROR)


@queue.command()
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
    """Queue a sentence or a mission file, checked; with a trigger, `errand queue serve` queues it each time."""
    from executive.app.checker import prepare_checked

    trigger = _trigger(at, every, on, missed)
    refuse_unaddressed(request)
    load_stack(request.stack)
    prepared = prepare_checked(request, ask=terminal_answerer(), anyway=anyway)
    out, request = request.out, prepared.request.from_anywhere()
    with MissionStore(store or out / STORE_NAME) as missions:
        if trigger is None:
            mission, standing = missions.add(request, queued=True), {}
        else:
            added = StandingMissions(missions).add(request, trigger, missed or Missed.SKIP)
            mission, standing = missions.mission(added.id), {added.id: added}
    wake_server(store or out / STORE_NAME)
    said = "is queued" if trigger is None else f"stands, to be queued by `errand queue serve` ({trigger})"
    console_for(as_json).print(f"Mission {mission.id} {said}: {request.name}", markup=False)
    finish(_told(mission, standing), as_json)


@queue.command(name="list")
def show(out: Out = Path("out"), store: STORE = None, as_json: AS_JSON = False) -> None:
    """Shows all missions of the store and how far each is."""
    with MissionStore(store or out / STORE_NAME, create=False) as missions:
        known = missions.missions()
        standing = {each.id: each for each in StandingMissions(missions).missions()}
    header = ("mission", "state", "name", "world", "seed", "commands", "message", "trigger")
    show_table(console_for(as_json), header, [_row(each, standing) for each in known])
    finish({"missions": [_told(each, standing) for each in known]}, as_json)


@queue.command()
def remove(number: Number, out: Out = Path("out"), store: STORE = None) -> None:
    """Forgets a mission; one that stands can be removed while a server runs."""
    with MissionStore(store or out / STORE_NAME, create=False) as missions:
        stands = missions.mission(number).state is MissionState.STANDING
        with nullcontext() if stands else missions.claim():
            missions.remove(number)
        wake_server(missions.path)
    console_for(False).print(f"Mission {number} is removed.")


@queue.command()
def run(
    out: Out = Path("out"),
    store: STORE = None,
    quiet: QUIET = False,
    as_json: AS_JSON = False,
) -> None:
    """Runs all that is queued, each mission in the world as the one before has left it."""
    from executive.app.runs import MissionRuns, queued_missions, resumable_line, run_in_turn
    from executive.cli.screen import ConsoleScreen

    console = console_for(as_json)
    with MissionStore(store or out / STORE_NAME, create=False) as missions, missions.claim():
        runs = MissionRuns(missions, ConsoleScreen(console, quiet=quiet), ask=terminal_answerer())
        ended = run_in_turn(queued_missions(missions), runs)
        resumable = resumable_line(missions)
    if ended:
        console.print(f"{sum(each.achieved for each in ended)} of {len(ended)} missions achieved")
    else:
        console.print("Nothing is queued; `errand queue add` queues a mission, `errand queue list` shows all.")
    if resumable is not None:
        console.print(resumable, markup=False)
    finish({"missions": [each.to_json() for each in ended]}, as_json, good=all(each.achieved for each in ended))


def _row(mission: StoredMission, standing: Mapping[int, StandingMission]) -> tuple[str, ...]:
    asked, commands = mission.request, "\n".join(mission.request.commands)
    state = "running or broken off" if mission.state is MissionState.RUNNING else mission.state.value
    trigger = f"{mission.standing}: {mission.why}" if mission.why else ""
    if (stands := standing.get(mission.id)) is not None:
        due = _due(stands)
        timed = isinstance(stands.trigger, Timed)
        trigger = f"{stands.trigger}{f', next {due:%a %Y-%m-%d %H:%M}' if due else ', over' if timed else ''}"
    return str(mission.id), state, asked.name, asked.world_name, str(asked.seed), commands, mission.message, trigger


def _told(mission: StoredMission, standing: Mapping[int, StandingMission]) -> dict[str, Any]:
    asked = mission.request
    told: dict[str, Any] = {"mission": mission.id, "state": mission.state.value, "name": asked.name}
    told |= {"world": asked.world_name, "seed": asked.seed, "commands": list(asked.commands)}
    told["message"] = mission.message
    if (stands := standing.get(mission.id)) is not None:
        due = _due(stands)
        told |= {"trigger": str(stands.trigger), "next": None if due is None else due.isoformat()}
        told |= {} if isinstance(stands.trigger, OnCall | OnTopic) else {"missed": stands.missed.value}
    return {**told, "standing": mission.standing, "why": mission.why} if mission.why else told


def _due(standing: StandingMission) -> datetime | None:
    """When it is due next, in local time."""
    due = standing.due_next(utc_now(), None)
    return None if due is None else local(due, None)


def _trigger(at: str | None, every: str | None, on: str | None, missed: Missed | None) -> Trigger | None:
    """The trigger of the options; None where there is none. Raises InputError."""
    given: list[Trigger] = [schedule_of(at)] if at is not None else []
    given += [Every.from_text(every)] if every is not None else []
    given += [event_of(on)] if on is not None else []
    if len(given) > 1:
        raise InputError("--at, --every and --on are one trigger each", hint="queue the mission once for each of them")
    trigger = given[0] if given else None
    if missed is not None and (trigger is None or isinstance(trigger, OnCall | OnTopic)):
        what = "without a trigger" if trigger is None else f"for '{trigger}'"
        hint = "leave it out: calls and messages are queued as they come, and only while `errand queue serve` runs"
        hint = hint if trigger else "give --at, --every or --on as well"
        raise InputError(f"--missed says nothing {what}", hint=hint)
    if isinstance(trigger, OnTopic):
        refuse_missing_source(trigger.kind)
    return trigger


@queue.command()
def serve(
    out: Out = Path("out"),
    store: STORE = None,
    host: Annotated[str, typer.Option(help="Where HTTP calls are served.")] = "127.0.0.1",
    port: Annotated[int, quantity_option(Port, help="The port for HTTP calls; 0 takes a free one.")] = 8950,
    token: Annotated[
        str | None,
        typer.Option(envvar="ERRAND_TOKEN", help="What calls must bear; by default one kept beside the store."),
    ] = None,
    until_idle: Annotated[bool, typer.Option("--until-idle", help="End when nothing is queued.")] = False,
    for_s: Annotated[
        float | None,
        quantity_option(Wait, "--for", help="End after so long; no mission begins then."),
    ] = None,
    quiet: QUIET = False,
    as_json: AS_JSON = False,
) -> None:
    """Waits for triggers and runs what is queued, until Ctrl-C: at times, on a full battery, calls and messages."""
    from executive.app.queue_server import CallAddress, Listeners, QueueServer
    from executive.app.runs import MissionRuns, resumable_line
    from executive.cli.screen import ConsoleScreen

    console = console_for(as_json)
    tell = plain_lines(console)
    with MissionStore(store or out / STORE_NAME, create=False) as missions, missions.claim():
        end = None if for_s is None else missions.now() + timedelta(seconds=min(for_s, _LONGEST_S))
        address = CallAddress(host, port, token)
        with WakeupPipe(missions) as wakeup, Listeners(missions.path, address, tell) as listeners:
            standing = StandingMissions(missions)
            runner = MissionRuns(missions, ConsoleScreen(console, quiet=quiet), ask=terminal_answerer())
            server = QueueServer(missions, standing, wakeup, runner, follow=listeners.follow, tell=tell)
            with ended_by_signals(server.stop):
                tell(f"Standing missions: {len(standing.missions())} ({missions.path}). Ctrl-C ends.")
                ended = server.serve(end=end, until_idle=until_idle)
            resumable = resumable_line(missions)
    tell(f"{sum(each.achieved for each in ended)} of {len(ended)} missions achieved")
    if resumable is not None:
        tell(resumable)
    finish({"missions": [{"mission": e.mission, "outcome": e.outcome, "achieved": e.achieved} for e in ended]}, as_json)


def resume(
    store: Annotated[Path, typer.Option(help="Where the missions are kept.")] = Path("out") / STORE_NAME,
    mission: Annotated[
        int | None, quantity_option(Count, help="Its number; by default the one that was broken off or cancelled last.")
    ] = None,
    as_json: AS_JSON = False,
    quiet: QUIET = False,
) -> None:
    """Goes on with the mission that was broken off or cancelled, from its last finished step; then with its queue."""
    console = console_for(as_json)
    with MissionStore(store, create=False) as missions, missions.claim():
        from executive.app.runs import MissionRuns, queued_missions, run_in_turn
        from executive.cli.screen import ConsoleScreen

        chosen = _broken_off(missions, mission)
        runs = MissionRuns(missions, ConsoleScreen(console, quiet=quiet), ask=terminal_answerer())
        ended = [runs.run(chosen), *(run_in_turn(queued_missions(missions), runs) if chosen.queued else ())]
    values = {**ended[0].to_json(), "then": [each.to_json() for each in ended[1:]]}
    finish(values, as_json, good=all(each.achieved for each in ended))


def _broken_off(missions: MissionStore, number: int | None) -> StoredMission:
    """The mission to go on with: the one named, the one that no process ended, or the newest where it was cancelled.

    Raises InputError when there is none.
    """
    if number is None:
        begun = [each for each in missions.missions() if each.starts]
        broken = [each for each in begun if each.state is MissionState.RUNNING]
        broken += [each for each in begun[-1:] if each.state in _MAY_GO_ON]
        if broken:
            return broken[0]
        queued = missions.missions(MissionState.QUEUED)
        hint = "`errand queue run` does what is queued" if queued else "`errand queue list` shows how missions ended"
        raise InputError("no mission was broken off", hint=hint, file=missions.path)
    chosen = missions.mission(number)
    if chosen.state not in _MAY_GO_ON:
        known = listing((state.value for state in _MAY_GO_ON), last="or")
        raise InputError(
            f"mission {number} is {chosen.state.value}", hint=f"name one that is {known}", file=missions.path
        )
    return chosen
