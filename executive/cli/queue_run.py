"""Runs what is queued, one mission after another; each begins in the world as the one before has left it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, Final

from rich.console import Console

from executive.cli.durable import Durable, as_it_was, kept, new_run, next_run, plant_file, same_world
from executive.cli.requests import Prepared, prepare
from executive.cli.shown import control_for, show_files, show_run
from executive.cli.simulated import run_simulated
from executive.mission.errors import InputError
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.tree.compiling.builder import slug

_ENDED: Final = (MissionState.SUCCESS, MissionState.FAILURE, MissionState.CANCELLED, MissionState.ERROR)


def run_queue(missions: MissionStore, console: Console, *, quiet: bool) -> list[dict[str, Any]]:
    """Run all that is queued, until one is cancelled; their reports.

    Raises:
        InputError: a mission was broken off before and waits to be taken up, or one cannot begin.
    """
    results: list[dict[str, Any]] = []
    broken = missions.missions(MissionState.RUNNING)
    if broken:
        what = f"mission {broken[-1].id} ({broken[-1].request.name}) was broken off"
        raise InputError(what, hint="`errand resume` goes on with it and then with the queue", file=missions.path)
    while queued := [each for each in missions.missions(MissionState.QUEUED) if each.queued]:
        results.append(start_of(missions, queued[0], console, quiet=quiet))
        if results[-1]["outcome"] == MissionState.CANCELLED.value:
            break
    return results


def start_of(missions: MissionStore, mission: StoredMission, console: Console, *, quiet: bool) -> dict[str, Any]:
    """Run one mission of the store from its beginning; its report.

    Raises:
        InputError: its file, its world or the plant's state cannot be used.
    """
    prepared = prepare(as_it_was(mission, missions.path))
    asked = mission.request
    out = asked.out / f"{mission.id:03d}-{slug(asked.name)}" if mission.queued else asked.out
    prepared = replace(prepared, request=replace(prepared.request, out=out))
    before = _before(missions, mission) if mission.queued else None
    durable = new_run(missions, mission) if before is None else next_run(missions, mission, before)
    console.print(f"Mission {mission.id}: {asked.name}", markup=False, style="bold")
    result = run_kept(missions, mission, prepared, durable, console, quiet=quiet)
    show_files(out, console)
    return result


def run_kept(
    missions: MissionStore,
    mission: StoredMission,
    prepared: Prepared,
    durable: Durable,
    console: Console,
    *,
    quiet: bool,
) -> dict[str, Any]:
    """Run a mission of the store, shown on the console, and note there how it ended; its report."""
    with kept(missions, mission) as ended:
        start = partial(run_simulated, prepared, durable=durable)
        finished = show_run(start, prepared, console, control=control_for(console, quiet=quiet), quiet=quiet)
        ended(finished.report)
    return {**finished.report.to_json(), "mission": mission.id, "achieved": finished.report.achieved}


def _before(missions: MissionStore, mission: StoredMission) -> StoredMission | None:
    """The mission that left the world in which this one begins; None when it begins in a fresh one."""
    ended = [each for each in missions.missions(*_ENDED) if each.queued and each.starts and each.id < mission.id]
    last = max(ended, key=lambda each: each.id, default=None)
    if last is None or not same_world(last, mission) or last.clock_s is None:
        return None
    return last if plant_file(missions).with_name(f"{plant_file(missions).name}.a").exists() else None
