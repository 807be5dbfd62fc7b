"""`errand resume`: takes up the mission that a crash, a kill or a cancel broke off, and then the rest of its queue."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from executive.app.durable import STORE as STORE_NAME
from executive.cli.number_options import quantity_option
from executive.cli.options import AS_JSON, QUIET
from executive.cli.output import NOT_ACHIEVED, console_for, print_json, refusals
from executive.cli.terminal import terminal_answerer
from executive.store.missions import MissionState, MissionStore, StoredMission
from skills.files.errors import InputError, listing
from skills.quantities import Count

__all__ = ["resume"]

_MAY_GO_ON: Final = (MissionState.RUNNING, MissionState.CANCELLED, MissionState.ERROR)


def resume(
    store: Annotated[Path, typer.Option(help="Where the missions are kept.")] = Path("out") / STORE_NAME,
    mission: Annotated[
        int | None, quantity_option(Count, help="Its number; by default the one that was broken off or cancelled last.")
    ] = None,
    as_json: AS_JSON = False,
    quiet: QUIET = False,
) -> None:
    """Go on with the mission that was broken off or cancelled, from its last finished step; then with its queue."""
    console = console_for(as_json)
    with refusals(), MissionStore(store, create=False) as missions, missions.claimed():
        from executive.app.runs import MissionRuns, queued, run_in_turn
        from executive.cli.shown import ConsoleScreen

        chosen = _broken_off(missions, mission)
        runs = MissionRuns(missions, ConsoleScreen(console, quiet=quiet), ask=terminal_answerer())
        ended = [runs.run(chosen), *(run_in_turn(queued(missions), runs) if chosen.queued else ())]
    if as_json:
        print_json({**ended[0].to_json(), "then": [each.to_json() for each in ended[1:]]})
    if not all(each.achieved for each in ended):
        raise typer.Exit(NOT_ACHIEVED)


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
