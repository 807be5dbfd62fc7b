"""Runs what is queued with several robots in one plant, and writes what is kept of it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from executive.app.artifacts import Artifacts
from executive.app.fleet_dispatch import FleetDispatch
from executive.app.fleet_report import mission_rows, told, write_fleet_report
from executive.app.page_view import PageView, log_map
from executive.app.prepared import Prepared
from executive.app.signals import cancelled_by_signals, ended_by_signals
from executive.record.event_log import EventLog
from executive.record.reader import read_events
from executive.run.control import Control
from executive.run.runner import run
from executive.run.visitor import RunSettings
from executive.run.worker import LockStepWorker

__all__ = ["run_fleet"]

TIME_LIMIT_S: Final = 1200.0
"""For each mission of the queue, on the robots' clock."""


def run_fleet(
    dispatch: FleetDispatch,
    *,
    out: Path,
    seed: int,
    time_limit_s: float | None = None,
    page: PageView | None = None,
    first: Prepared | None = None,
) -> None:
    """Run until no mission can be given out any more; log, recording and report are written into a folder.

    `page` shows it; the log begins with the map that `first` knows. Raises InputError.
    """
    backend, clock = dispatch.backend, dispatch.backend.clock
    dispatch.log = log = EventLog(out / "log.mcap", clock, apart=True)
    artifacts, begun_s = Artifacts(), clock.now()
    limit_s = TIME_LIMIT_S * max(1, len(dispatch.missions)) if time_limit_s is None else time_limit_s
    asked = Control(pace=None) if page is None else page.control
    try:
        if page is not None:
            page.serve(log, backend.show_live())
        if first is not None:
            log_map(log, first)
        with ended_by_signals(dispatch.stop), cancelled_by_signals(asked) as control, LockStepWorker(clock) as worker:
            result = run(
                dispatch,
                clock=clock,
                worker=worker,
                visitors=(artifacts, log, *([] if page is None else [page])),
                settings=RunSettings(seed=seed, time_limit_s=limit_s),
                control=control,
                spare=dispatch.spare(),
            )
        dispatch.close()
    finally:
        log.close()
    recording = backend.leave(artifacts, out)
    rows = mission_rows(dispatch.store, told(dispatch.store, list(dispatch.missions)))
    kinds = {name: robot.kind for name, robot in dispatch.robots.items()}
    lasted = f"{clock.now() - begun_s:.1f} s simulated in {result.wall_time_s:.1f} s"
    facts = (("world and seed", f"{first.world.name}, seed {seed}"),) if first is not None else ()
    write_fleet_report(
        out, rows, dispatch.over, kinds, artifacts, read_events(log.path), (*facts, ("duration", lasted))
    )
    if page is not None:
        page.offer(recording)
