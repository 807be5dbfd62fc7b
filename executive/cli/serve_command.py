"""`errand queue serve`: its options, and what it needs opened around it."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path
from typing import Annotated, Final

import typer

from executive.app.durable import STORE as STORE_NAME
from executive.app.signals import ended_by_signals
from executive.cli.number_options import quantity_option
from executive.cli.options import AS_JSON, QUIET, STORE
from executive.cli.output import console_for, print_json, refusals
from executive.cli.terminal import terminal_answerer
from executive.store.missions import MissionStore
from executive.store.standing import StandingMissions
from executive.store.wakeup import WakeupPipe
from skills.quantities import Port, Wait

__all__ = ["Out", "serve"]

Out = Annotated[Path, typer.Option(help="Folder for logs; each mission gets one of its own in it.")]
_LONGEST_S: Final = 3.2e9  # a hundred years


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
    """Wait for triggers and run what is queued, until Ctrl-C: at times, on a full battery, calls and messages."""
    from executive.app.listeners import CallAddress, Listeners
    from executive.app.runs import MissionRuns, QueueServer, resumable_line
    from executive.cli.shown import ConsoleScreen

    console = console_for(as_json)
    limit = None if for_s is None else timedelta(seconds=min(for_s, _LONGEST_S))

    def tell(line: str) -> None:
        console.print(line, markup=False)

    with refusals(), MissionStore(store or out / STORE_NAME, create=False) as missions, missions.claimed():
        end = None if limit is None else missions.now() + limit
        address = CallAddress(host, port, token)
        with WakeupPipe(missions) as wakeup, Listeners(missions.path, address, tell) as listeners:
            standing, runner = (
                StandingMissions(missions),
                MissionRuns(missions, ConsoleScreen(console, quiet=quiet), ask=terminal_answerer()),
            )
            server = QueueServer(missions, standing, wakeup, runner, follow=listeners.follow, tell=tell)
            with ended_by_signals(server.stop):
                tell(f"Standing missions: {len(standing.missions())} ({missions.path}). Ctrl-C ends.")
                ended = server.serve(end=end, until_idle=until_idle)
            resumable = resumable_line(missions)
    tell(f"{sum(each.achieved for each in ended)} of {len(ended)} missions achieved")
    if resumable is not None:
        tell(resumable)
    if as_json:
        print_json({"missions": [{"mission": e.mission, "outcome": e.outcome, "achieved": e.achieved} for e in ended]})
