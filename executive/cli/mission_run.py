"""Runs one request from beginning to end: plant, tree, log, verdicts, and what is left in the output folder."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from executive.cli.assembly import judge, run_entry, simulate
from executive.cli.durable import Durable
from executive.cli.page_view import PageView, log_map
from executive.cli.report import RefereeReport, RunReport
from executive.cli.requests import Request
from executive.cli.souvenirs import Souvenirs, draw_answer, draw_souvenirs
from executive.cli.warm_up import warm_up
from executive.record.announce import announce
from executive.record.event_log import EventLog
from executive.run.control import Control
from executive.run.outcome import RunResult
from executive.run.runner import Observer, Progress, RunSettings, run
from executive.run.worker import LockStepWorker
from executive.tree.behaviours.skill_leaf import ERROR_TOPIC
from executive.tree.compiler import CompiledTree
from executive.view.collapse import DRAWN_NODES, folded_to
from executive.view.model import NodeView, node_view
from executive.view.svg import to_svg


@dataclass(frozen=True)
class Finished:
    """A run that has ended: its report, and the tree in its last state."""

    report: RunReport
    tree: NodeView


def run_request(
    request: Request,
    tree: CompiledTree,
    *,
    seed: int,
    out: Path,
    record: bool,
    observer: Observer | None = None,
    control: Control | None = None,
    page: PageView | None = None,
    durable: Durable | None = None,
) -> Finished:
    """Run a compiled request in the plant and write log, tree, recording and pictures into `out`.

    The observer is told after each tick; through `control` the run is held, cancelled, and so on; `page` shows it;
    with `durable` another process can take it up, or this one takes up another's.

    Raises:
        InputError: the world cannot be used.
    """
    simulation = simulate(request.world, seed=seed, robot_name=request.mission.robot_name, record=record)
    entry = run_entry(simulation, request.world, tree, believed=None if durable is None else durable.pose)
    if durable is not None:
        entry = replace(entry, journal=durable.journal)
        durable.begin(simulation)
    warm_up(entry)
    clock = simulation.clock
    log = EventLog(out / ("log.mcap" if durable is None else durable.log), clock)
    souvenirs = Souvenirs(log)
    try:
        if page is not None:
            page.begin(log, simulation)
        log_map(log, request)
        announce(log, clock, tree, request.knowledge, world=request.world.name, seed=seed)
        with cancelled_by_signals(control or Control(pace=None)) as heeded:
            result = run(
                [entry],
                clock=clock,
                worker=LockStepWorker(clock),
                publish=souvenirs,
                settings=RunSettings(seed=seed),
                control=heeded,
                observer=both(observer, page),
            )
        for trouble in () if durable is None else durable.journal.troubles:
            log(ERROR_TOPIC, {"node": tree.robot_name, "what": "keep the mission's state", "traceback": trouble})
    finally:
        log.close()
    tree = result.trees.get(tree.robot_name, tree)
    verdict = judge(simulation, tree, result.worst)
    view = node_view(tree.root, result.worst.states)
    (out / "tree.svg").write_text(to_svg(folded_to(view, DRAWN_NODES), title=request.mission.name), encoding="utf-8")
    draw_answer(souvenirs, out)
    if record:
        simulation.save_recording(out / "recording.html")
        draw_souvenirs(souvenirs, simulation, request.mission.robot_name, out)
    if page is not None:
        page.end(out / "recording.html" if record else None)
    referee = RefereeReport(verdict.success, verdict.why, verdict.collisions, verdict.drops, simulation.referee.events)
    return Finished(_report(request, tree, result, referee, seed=seed, log=log.path), view)


def both(*observers: Observer | None) -> Observer:
    """An observer that tells all that there are."""

    def tell(progress: Progress) -> None:
        for observer in observers:
            if observer is not None:
                observer(progress)

    return tell


def _report(
    request: Request, tree: CompiledTree, result: RunResult, referee: RefereeReport, *, seed: int, log: Path
) -> RunReport:
    worst = result.worst
    return RunReport(
        outcome=worst.outcome.value,
        cause=None if worst.cause is None else worst.cause.value,
        message=worst.message,
        referee=referee,
        commands=tuple(map(str, tree.commands)),
        world=request.world.name,
        seed=seed,
        sim_time_s=round(result.sim_time_s, 3),
        wall_time_s=round(result.wall_time_s, 3),
        real_time_factor=round(result.sim_time_s / max(result.wall_time_s, 1e-6), 2),
        ticks=result.ticks,
        log=str(log),
    )


@contextmanager
def cancelled_by_signals(control: Control) -> Iterator[Control]:
    """The control, which Ctrl-C and a polite kill cancel; a second Ctrl-C breaks in at once."""
    asked: list[int] = []

    def on_signal(number: int, _frame: FrameType | None) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(number)
        control.cancel(f"cancelled by {signal.Signals(number).name}")

    if threading.current_thread() is not threading.main_thread():
        yield control
        return
    before = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield control
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
