"""`errand run`: a sentence or a mission file in the simulated world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from executive.cli.options import ANYWAY, AS_JSON, QUIET, STORE, VIEW, VIEW_FOR, VIEW_PORT, takes_request
from executive.cli.output import NOT_ACHIEVED, console_for, plain_lines, print_json, terminal_answerer
from executive.cli.wake_check import refuse_unaddressed
from executive.mission.request import Request

if TYPE_CHECKING:
    from executive.app.prepared import Prepared

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
    refuse_unaddressed(request)
    from executive.app.feasibility import refuse_impossible
    from executive.app.page_view import PageView, queueing
    from executive.app.prepare import prepare
    from executive.app.runs import MissionRuns
    from executive.cli.listen_command import hear_request
    from executive.cli.screen import ConsoleScreen, voice_for
    from executive.record.work import Profile, lines
    from executive.store.missions import STORE as STORE_NAME
    from executive.store.missions import MissionStore

    console = console_for(as_json)
    kept_in = store or request.out / STORE_NAME
    timing = Profile() if profile else None

    def page_of(prepared: Prepared) -> PageView:
        return PageView(
            prepared, plain_lines(console), port=view_port, later=queueing(prepared, store=kept_in, out=request.out)
        )

    with voice_for(aloud) as voice:
        if listen_to is not None:
            request = replace(request, sentence=hear_request(listen_to, request, console=console))
        prepared = prepare(request, ask=terminal_answerer())
        if not anyway:
            refuse_impossible(prepared)
        page = page_of if view or view_for is not None else None
        screen = ConsoleScreen(console, quiet=quiet, whole_tree=whole_tree, voice=voice, page=page, profile=timing)
        with MissionStore(kept_in) as missions, missions.claimed():
            mission = missions.add(prepared.request.from_anywhere(), queued=False)
            ended = MissionRuns(missions, screen).run(mission, prepared)
    if timing is not None:
        for line in lines(timing.table()):
            console.print(line, markup=False)
    if as_json:
        assert ended.report is not None  # only a mission of a queue is set aside
        print_json(ended.report.to_json())
    if screen.shown_page is not None:
        screen.shown_page.stay(0.0 if ended.hung_up else view_for)
    if not ended.achieved:
        raise typer.Exit(NOT_ACHIEVED)
