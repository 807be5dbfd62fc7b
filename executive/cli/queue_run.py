"""Runs what is queued, one mission after another; each begins in the world as the one before has left it."""

from __future__ import annotations

import traceback
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

from rich.console import Console

from executive.app.durable import Durable, as_it_was, kept, new_run, next_run, plant_file, same_world, take_up
from executive.app.memory import return_memory
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.app.simulated import run_simulated
from executive.cli.shown import control_for, show_files, show_run
from executive.cli.terminal import terminal_answerer
from executive.run.control import Control
from executive.store.database import StoreError
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.words.slug import slug
from skills.files.errors import InputError

_ENDED: Final = (MissionState.SUCCESS, MissionState.FAILURE, MissionState.CANCELLED, MissionState.ERROR)


def run_queue(missions: MissionStore, console: Console, *, quiet: bool) -> list[dict[str, Any]]:
    """Run all that is queued, until one is cancelled; their reports. One that cannot begin is set aside.

    Raises:
        InputError: a mission was broken off before and waits to be taken up, or the store cannot be used.
    """
    results: list[dict[str, Any]] = []
    broken = missions.missions(MissionState.RUNNING)
    if broken:
        raise broken_off(missions, broken[-1])
    while (mission := next_queued(missions)) is not None:
        results.append(run_or_set_aside(start_of, missions, mission, console, quiet=quiet))
        if results[-1]["outcome"] == MissionState.CANCELLED.value:
            break
    return results


class Begin(Protocol):
    """Begins a mission of the store, or goes on with it; `start_of` and `go_on`."""

    def __call__(
        self,
        missions: MissionStore,
        mission: StoredMission,
        console: Console,
        *,
        quiet: bool,
        control: Control | None = None,
    ) -> dict[str, Any]:
        """Run it to its end; its report. Raises InputError: it cannot."""


def run_or_set_aside(
    begin: Begin,
    missions: MissionStore,
    mission: StoredMission,
    console: Console,
    *,
    quiet: bool,
    control: Control | None = None,
) -> dict[str, Any]:
    """Run a mission of the queue; its report. One that cannot be run is set aside, so that the next one can.

    Raises:
        StoreError: the store cannot be used, or the disk is full; no other mission can be run either.
    """
    try:
        return begin(missions, mission, console, quiet=quiet, control=control)
    except StoreError:
        raise
    except InputError as error:
        cause = str(error)
    except OSError as error:
        cause = f"{error.filename}: {error.strerror}" if error.filename else str(error)
    except Exception as defect:
        cause = f"a defect of errand or of a plug-in ended it ({type(defect).__name__}: {defect})"
        console.print(f"The traceback is in {_traceback_file(missions, mission)}", markup=False)
    finally:
        return_memory()
    return set_aside(missions, mission, cause, console)


def set_aside(missions: MissionStore, mission: StoredMission, cause: str, console: Console) -> dict[str, Any]:
    """End a mission that cannot be run with its cause; its report."""
    missions.finish(mission.id, MissionState.ERROR, cause)
    console.print(f"Mission {mission.id} ({mission.request.name}) is set aside: {cause}", markup=False)
    again = f"errand resume --mission {mission.id} --store {missions.path}"
    console.print(f"  `{again}` tries again", markup=False)
    return {"mission": mission.id, "outcome": MissionState.ERROR.value, "achieved": False, "message": cause}


def _traceback_file(missions: MissionStore, mission: StoredMission) -> Path:
    """Write the traceback of a defect beside the store, where that can be done; the file."""
    file = missions.path.with_name(f"mission-{mission.id}-traceback.txt")
    with suppress(OSError):
        file.write_text(traceback.format_exc(), encoding="utf-8")
    return file


def broken_off(missions: MissionStore, mission: StoredMission) -> InputError:
    """Why nothing else is run before a mission that was broken off."""
    what = f"mission {mission.id} ({mission.request.name}) was broken off"
    return InputError(what, hint="`errand resume` goes on with it and then with the queue", file=missions.path)


def resumable_line(missions: MissionStore) -> str | None:
    """How to go on with the mission that was begun last, where it was cancelled; None where it was not."""
    begun = [each for each in missions.missions() if each.starts]
    if not begun or begun[-1].state is not MissionState.CANCELLED:
        return None
    last = begun[-1]
    what = f"Mission {last.id} ({last.request.name}) was cancelled"
    return f"{what}; `errand resume --store {missions.path}` goes on with it{' and then with the queue' * last.queued}."


def next_queued(missions: MissionStore) -> StoredMission | None:
    """The mission that is run next; None where nothing is queued."""
    return next((each for each in missions.missions(MissionState.QUEUED) if each.queued), None)


def go_on(
    missions: MissionStore, mission: StoredMission, console: Console, *, quiet: bool, control: Control | None = None
) -> dict[str, Any]:
    """Go on with a mission that was broken off or cancelled; its report with what was done with its past.

    Raises:
        InputError: as `take_up` and `start_of`.
    """
    name = mission.request.name
    if not missions.has_steps(mission.id):
        console.print(f"Mission {mission.id} ({name}) had not begun; it begins now.", markup=False)
        return start_of(missions, mission, console, quiet=quiet, control=control)
    taken = take_up(missions, mission, ask=terminal_answerer())
    console.print(f"Mission {mission.id} ({name}) goes on.", markup=False)
    prepared = _in_its_folder(mission, taken.prepared)
    result = run_kept(missions, mission, prepared, taken.durable, console, quiet=quiet, control=control)
    told = list(taken.told)
    console.print("\n  ".join(["What became of its past:", *told]), markup=False)
    show_files(prepared.request.out, console)
    return {**result, "resumed": told}


def start_of(
    missions: MissionStore, mission: StoredMission, console: Console, *, quiet: bool, control: Control | None = None
) -> dict[str, Any]:
    """Run one mission of the store from its beginning; its report.

    Raises:
        InputError: its file, its world or the plant's state cannot be used.
    """
    prepared = _in_its_folder(mission, prepare(as_it_was(mission, missions.path), ask=terminal_answerer()))
    before = _before(missions, mission) if mission.queued else None
    durable = new_run(missions, mission, prepared) if before is None else next_run(missions, mission, prepared, before)
    console.print(f"Mission {mission.id}: {mission.request.name}", markup=False, style="bold")
    result = run_kept(missions, mission, prepared, durable, console, quiet=quiet, control=control)
    show_files(prepared.request.out, console)
    return result


def _in_its_folder(mission: StoredMission, prepared: Prepared) -> Prepared:
    """With the folder for its files: each mission of a queue has its own."""
    asked = mission.request
    out = asked.out / f"{mission.id:03d}-{slug(asked.name)}" if mission.queued else asked.out
    return replace(prepared, request=replace(prepared.request, out=out))


def run_kept(
    missions: MissionStore,
    mission: StoredMission,
    prepared: Prepared,
    durable: Durable,
    console: Console,
    *,
    quiet: bool,
    control: Control | None = None,
) -> dict[str, Any]:
    """Run a mission of the store, shown on the console, and note there how it ended; its report.

    `control` is one that somebody else has, too.
    """
    control = control or control_for(console, quiet=quiet)
    with kept(missions, mission) as ended:
        start = partial(run_simulated, prepared, durable=durable)
        finished = show_run(start, prepared, console, control=control, quiet=quiet)
        ended(finished.report)
    return {**finished.report.to_json(), "mission": mission.id, "achieved": finished.report.achieved}


def _before(missions: MissionStore, mission: StoredMission) -> StoredMission | None:
    """The mission that left the world in which this one begins; None when it begins in a fresh one."""
    ended = [each for each in missions.missions(*_ENDED) if each.queued and each.starts and each.id < mission.id]
    last = max(ended, key=lambda each: each.id, default=None)
    if last is None or not same_world(last, mission) or last.clock_s is None:
        return None
    return last if plant_file(missions).with_name(f"{plant_file(missions).name}.a").exists() else None
