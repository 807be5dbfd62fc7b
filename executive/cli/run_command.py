"""`errand run`: a sentence or a mission file in the simulated world."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from executive.cli.options import ANYWAY, AS_JSON, QUIET, STORE, VIEW, VIEW_FOR, VIEW_PORT, takes_request
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, refusals
from executive.cli.terminal import terminal_answerer
from executive.cli.wake_check import refuse_unaddressed
from executive.mission.request import Request

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from executive.app.mission_run import Finished
    from executive.app.page_view import PageView
    from executive.app.prepared import Prepared
    from executive.record.profile import Profile
    from executive.speech.voice import Voice

__all__ = ["run"]


@takes_request()
def run(
    request: Request,
    listen_to: Annotated[Path | None, typer.Option("--listen", help="A wav file that says it.")] = None,
    as_json: AS_JSON = False,
    quiet: QUIET = False,
    whole_tree: Annotated[bool, typer.Option("--tree", help="Show the whole tree in the end.")] = False,
    profile: Annotated[bool, typer.Option("--profile", help="Print the CPU time by subsystem.")] = False,
    store: STORE = None,
    anyway: ANYWAY = False,
    aloud: Annotated[bool, typer.Option("--voice", help="Say aloud what the robot says, by espeak-ng.")] = False,
    view: VIEW = False,
    view_for: VIEW_FOR = None,
    view_port: VIEW_PORT = 0,
) -> None:
    """Run a sentence or a mission file in the simulated world."""
    with refusals():
        refuse_unaddressed(request)
    from executive.app.durable import STORE as STORE_NAME
    from executive.app.page_view import PageView, queueing
    from executive.cli.listen_command import hear_request
    from executive.cli.shown import voice_for
    from executive.record.profile import Profile, lines

    console = console_for(as_json)
    kept_in = store or request.out / STORE_NAME
    timing = Profile() if profile else None

    def page_of(prepared: Prepared) -> PageView | None:
        if not view and view_for is None:
            return None
        later = queueing(prepared, store=kept_in, out=request.out)
        return PageView(prepared, console, port=view_port, later=later)

    with refusals(), voice_for(aloud) as voice:
        if listen_to is not None:
            request = replace(request, sentence=hear_request(listen_to, request, console=console))
        finished, page = _run_kept(
            request,
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


def _run_kept(
    request: Request,
    store: Path,
    *,
    anyway: bool,
    quiet: bool,
    whole_tree: bool,
    console: Console,
    page: Callable[[Prepared], PageView | None],
    profile: Profile | None,
    voice: Voice,
) -> tuple[Finished, PageView | None]:
    """Run it, shown, and kept in the store so that another process can take it up."""
    from executive.app.durable import give_up_broken, kept, new_run
    from executive.app.feasibility import refuse_impossible
    from executive.app.prepare import prepare
    from executive.app.simulated import run_simulated
    from executive.cli.shown import control_for, show_files, show_run
    from executive.store.missions import MissionStore

    prepared = prepare(request, ask=terminal_answerer())
    if not anyway:
        refuse_impossible(prepared)
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
    show_files(request.out, console)
    return finished, shown
