"""Runs one request from beginning to end on a backend: tree, log, verdicts, and what is left in the output folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from executive.cli.artifacts import Artifacts, draw_answer
from executive.cli.backend import Backend
from executive.cli.durable import Durable, mission_events
from executive.cli.found_out import with_found_out
from executive.cli.happening_log import HappeningLog
from executive.cli.page_view import PageView, log_map
from executive.cli.profiling import profiled
from executive.cli.report import RefereeReport, RunReport
from executive.cli.report_file import TREE_FILE, write_report
from executive.cli.requests import Prepared
from executive.cli.signals import HUNG_UP, cancelled_by_signals
from executive.cli.warm_up import warm_up
from executive.mission.request import Request
from executive.record.announce import announce
from executive.record.event_log import EventLog, Listener
from executive.record.profile import Profile
from executive.record.schemas import WORK
from executive.record.work import CountedDetector, Work
from executive.run.control import Control
from executive.run.outcome import RunResult
from executive.run.runner import Observer, Progress, RunSettings, run
from executive.run.worker import LockStepWorker
from executive.tree.behaviours.skill_leaf import ERROR_TOPIC
from executive.tree.compiler import CompiledTree
from executive.tree.node_view import NodeView, node_view
from executive.view.collapse import DRAWN_NODES, folded_to, what_ran
from executive.view.svg import to_svg
from skills.faults.faulty_robot import with_faults
from skills.faults.words import Fault, parse_fault


@dataclass(frozen=True)
class Finished:
    """A run that has ended: its report, and the tree in its last state."""

    report: RunReport
    tree: NodeView

    @property
    def hung_up(self) -> bool:
        """Whether it ended since its terminal was closed."""
        return self.report.message == HUNG_UP


def run_request(
    prepared: Prepared,
    backend: Backend,
    *,
    observer: Observer | None = None,
    control: Control | None = None,
    page: PageView | None = None,
    durable: Durable | None = None,
    profile: Profile | None = None,
    listener: Listener | None = None,
) -> Finished:
    """Run a request on a backend and write log, tree, report and what that has recorded into its folder.

    The observer is told after each tick, the listener of each logged message; through `control` the run is held,
    cancelled, and so on; `page` shows it; with `durable` another process can take it up, or this one takes
    up another's; `profile` times the subsystems.
    Raises InputError when the world cannot be used.
    """
    tree, out, clock, work = prepared.tree, prepared.request.out, backend.clock, Work()
    scenario = prepared.request.scenario
    entry = backend.entry(tree, durable)
    warm_up(entry)
    robot = with_faults(entry.robot, clock, _to_come(scenario.faults, clock.now()), since_s=0.0)
    entry = replace(entry, robot=robot, detector=CountedDetector(entry.detector, work))
    log = EventLog(out / ("log.mcap" if durable is None else durable.log), clock)
    if listener is not None:
        log.listen(listener)
    artifacts = Artifacts(log)
    try:
        if page is not None:
            page.begin(log, backend.show_live())
        log_map(log, prepared)
        world, seed = prepared.world.name, prepared.request.seed
        announce(log, clock, tree, prepared.knowledge, world=world, seed=seed, scenario=scenario.lines())
        watched = HappeningLog(log, robot, backend.happened) if scenario else None
        with cancelled_by_signals(control or Control(pace=None)) as controlled, LockStepWorker(clock) as worker:
            begin = run if profile is None else profiled(profile, run, backend, entry, worker)
            result = begin(
                [entry],
                clock=clock,
                worker=worker,
                publish=artifacts if profile is None else profile.timed("log", artifacts),
                settings=_settings(prepared.request),
                control=controlled,
                observer=both(observer, page, watched),
                work=work,
                profile=profile,
            )
        if durable is not None:
            _keep(durable, log, tree.robot_name)
        counts = work.totals({**backend.work(), "bytes_logged": log.bytes})
        log(WORK, counts)
    finally:
        log.close()
    events = mission_events(log.path)
    artifacts.recall(events)
    finished = _judged(prepared, backend, result, log)
    report = with_found_out(replace(finished.report, work=counts), prepared.knowledge, result, artifacts, events)
    draw_answer(artifacts, out)
    recording = backend.leave(artifacts, out)
    tree = result.trees.get(prepared.tree.robot_name, prepared.tree)
    write_report(prepared, report, tree, finished.tree, artifacts, events)
    if page is not None:
        page.end(recording)
    return replace(finished, report=report)


def _settings(request: Request) -> RunSettings:
    """The settings of a run: seed, time of day, and time limit."""
    usual = RunSettings(seed=request.seed)
    limit_s = usual.time_limit_s if request.time_limit_s is None else request.time_limit_s
    hours, minutes = map(int, (request.time_of_day or "0:0").split(":"))
    time_s = None if request.time_of_day is None else 3600.0 * hours + 60.0 * minutes
    return replace(usual, time_limit_s=limit_s, time_of_day_s=time_s)


def _to_come(faults: Sequence[str], now_s: float) -> list[Fault]:
    """The faults that are not over by now, as some are in a run that goes on after a restart."""
    return [fault for fault in map(parse_fault, faults) if not fault.over_by(now_s)]


def _keep(durable: Durable, log: EventLog, robot_name: str) -> None:
    """Keep the world for the next mission, which begins where this one ended, and log what could not be kept."""
    durable.journal.keep_world()
    for trouble in durable.journal.troubles:
        log(ERROR_TOPIC, {"node": robot_name, "what": "keep the mission's state", "traceback": trouble})


def _judged(prepared: Prepared, backend: Backend, result: RunResult, log: EventLog) -> Finished:
    """The report of a run with what the referee saw; the tree as it ended is drawn."""
    tree = result.trees.get(prepared.tree.robot_name, prepared.tree)
    view = node_view(tree.root, result.worst.states)
    picture = to_svg(folded_to(what_ran(view), DRAWN_NODES), title=prepared.mission.name)
    (prepared.request.out / TREE_FILE).write_text(picture, encoding="utf-8")
    referee = backend.judge(tree, result.worst)
    return Finished(_report(prepared, tree, result, referee, log=str(log.path)), view)


def both(*observers: Observer | None) -> Observer | None:
    """An observer that tells all that there are, None where there is none."""
    if not any(observers):
        return None

    def tell(progress: Progress) -> None:
        for observer in observers:
            if observer is not None:
                observer(progress)

    return tell


def _report(
    prepared: Prepared, tree: CompiledTree, result: RunResult, referee: RefereeReport | None, *, log: str
) -> RunReport:
    worst = result.worst
    return RunReport(
        outcome=worst.outcome.value,
        cause=None if worst.cause is None else worst.cause.value,
        message=worst.message,
        referee=referee,
        commands=tuple(map(str, tree.commands)),
        world=prepared.world.name,
        seed=prepared.request.seed,
        sim_time_s=round(result.sim_time_s, 3),
        wall_time_s=round(result.wall_time_s, 3),
        real_time_factor=round(result.sim_time_s / max(result.wall_time_s, 1e-6), 2),
        ticks=result.ticks,
        log=log,
        scenario=(*prepared.request.scenario.lines(), *prepared.request.variation.lines()),
    )
