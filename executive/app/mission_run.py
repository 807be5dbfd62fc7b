"""Runs one request from beginning to end on a backend: tree, log, verdicts, and what is left in the output folder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from executive.app.artifacts import Artifacts, draw_answer
from executive.app.backend import Backend
from executive.app.durable import Durable, mission_events
from executive.app.found_out import with_found_out
from executive.app.goal_conditions import Share
from executive.app.happening_log import HappeningLog
from executive.app.page_view import PageView, log_map
from executive.app.preload import preload
from executive.app.prepared import Prepared
from executive.app.profiling import RunProfile
from executive.app.report import RefereeReport, RobotReport, RunReport
from executive.app.report_file import EndedTree, write_report
from executive.app.signals import HUNG_UP, cancelled_by_signals
from executive.mission.request import Request
from executive.record.announce import announce
from executive.record.event_log import EventLog
from executive.record.profile import Profile
from executive.record.schemas import WORK
from executive.run.control import Control
from executive.run.outcome import RobotResult, RunResult
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings, RunVisitor
from executive.run.worker import LockStepWorker
from executive.tree.behaviours.skill_leaf import ERROR_TOPIC
from executive.tree.compiler import CompiledTree
from executive.tree.node_view import NodeView, node_view
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
    visitors: Sequence[RunVisitor] = (),
    control: Control | None = None,
    page: PageView | None = None,
    durable: Durable | None = None,
    profile: Profile | None = None,
) -> Finished:
    """Run a request on a backend and write log, tree, report and what that has recorded into its folder.

    The log and the other `visitors` watch it; through `control` the run is held, cancelled, and so on; `page` shows it;
    with `durable` another process can take it up, or this one takes up another's; `profile` times the subsystems.
    Raises InputError when the world cannot be used.
    """
    out, clock = prepared.request.out, backend.clock
    scenario = prepared.request.scenario
    entries = [entry_for(each, backend, durable) for each in prepared.all]
    spare = _spare(prepared, backend)
    log = EventLog(out / ("log.mcap" if durable is None else durable.log), clock, apart=prepared.several)
    artifacts = Artifacts()
    try:
        if page is not None:
            page.serve(log, backend.show_live())
        log_map(log, prepared)
        world, seed = prepared.world.name, prepared.request.seed
        kinds = {name: robot.kind for name, robot in prepared.robots.items()} if prepared.several else {}
        for each in prepared.all:
            lines = scenario.lines()
            announce(log, clock, each.tree, each.knowledge, world=world, seed=seed, scenario=lines, robots=kinds)
        journals = () if durable is None else durable.journals.values()
        watching = [artifacts, log, *journals, *visitors, *([] if page is None else [page])]
        if scenario:
            watching.append(HappeningLog(log, entries[0].robot, backend.happened))
        if profile is not None:
            watching.append(RunProfile(profile, backend, (artifacts, log), journals))
        with cancelled_by_signals(control or Control(pace=None)) as controlled, LockStepWorker(clock) as worker:
            result = run(
                entries,
                clock=clock,
                worker=worker,
                visitors=watching,
                settings=_settings(prepared.request),
                control=controlled,
                spare=spare,
            )
        if durable is not None:
            _keep(durable, log, prepared.tree.robot_name)
        counts = dict(sorted(Counter({**result.work, **backend.work(), "bytes_logged": log.bytes}).items()))
        log(WORK, counts)
    finally:
        log.close()
    events = mission_events(log.path)
    artifacts.recall(events)
    finished, ended = _judged(prepared, backend, result, log)
    report = with_found_out(replace(finished.report, work=counts), prepared.knowledge, result, artifacts, events)
    draw_answer(artifacts, out)
    recording = backend.leave(artifacts, out)
    write_report(prepared, report, ended, artifacts, events)
    if page is not None:
        page.offer(recording)
    return replace(finished, report=report)


def entry_for(prepared: Prepared, backend: Backend, durable: Durable | None) -> RunEntry:
    """The robot of a mission with its faults, and its numeric code warm."""
    entry, clock = backend.entry(prepared.tree, durable), backend.clock
    preload(entry)
    faults = _to_come(prepared.request.scenario.faults, clock.now())
    return replace(
        entry,
        robot=with_faults(entry.robot, clock, faults, since_s=0.0),
        after=prepared.after,
        speaker_W=prepared.speaker_W,
    )


def _spare(prepared: Prepared, backend: Backend) -> Sequence[RunEntry]:
    """The robots of a request that have nothing to do in it."""
    busy = {each.tree.robot_name for each in prepared.all}
    names = [name for name in prepared.robots if name not in busy]
    return [backend.entry(replace(prepared.tree, robot_name=name), None) for name in names]


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
    next(iter(durable.journals.values())).keep_world()
    for trouble in durable.troubles:
        log(ERROR_TOPIC, {"node": robot_name, "what": "keep the mission's state", "traceback": trouble})


def _judged(
    prepared: Prepared, backend: Backend, result: RunResult, log: EventLog
) -> tuple[Finished, Sequence[EndedTree]]:
    """The report of a run with what the referee saw, and the tree of each robot as it ended."""
    trees = {each.tree.robot_name: result.trees.get(each.tree.robot_name, each.tree) for each in prepared.all}
    shares = {each.robot_name: Share(trees[each.robot_name], each, 0) for each in result.robots}
    robots = {name: _robot_report(name, shares, backend, prepared) for name in shares}
    worst = min(robots, key=lambda name: (robots[name].achieved, name != result.worst.robot_name))
    views = {each.robot_name: node_view(trees[each.robot_name].root, each.states) for each in result.robots}
    ended = [EndedTree(trees[name], view, robots[name]) for name, view in views.items()]
    report = _report(prepared, robots[worst], result, log=str(log.path))
    return Finished(replace(report, robots=robots) if prepared.request.robots else report, views[worst]), ended


def _robot_report(name: str, shares: Mapping[str, Share], backend: Backend, prepared: Prepared) -> RobotReport:
    """What one robot did; what the others moved in the same run was moved by the mission, too."""
    own = shares[name]
    others = [share for other, share in shares.items() if other != name]
    seen = backend.judge(own.tree, own.result, before=others)
    return robot_report(own.result, own.tree, prepared.robots[name].kind, seen)


def robot_report(ended: RobotResult, tree: CompiledTree, kind: str, seen: RefereeReport | None) -> RobotReport:
    """How a robot's mission ended, and what the referee has seen of it."""
    return RobotReport(
        kind=kind,
        outcome=ended.outcome.value,
        cause=None if ended.cause is None else ended.cause.value,
        message=ended.message,
        referee=seen,
        commands=tuple(map(str, tree.commands)),
    )


def _report(prepared: Prepared, worst: RobotReport, result: RunResult, *, log: str) -> RunReport:
    return RunReport(
        outcome=worst.outcome,
        cause=worst.cause,
        message=worst.message,
        referee=worst.referee,
        commands=worst.commands,
        world=prepared.world.name,
        seed=prepared.request.seed,
        sim_time_s=round(result.sim_time_s, 3),
        wall_time_s=round(result.wall_time_s, 3),
        real_time_factor=round(result.sim_time_s / max(result.wall_time_s, 1e-6), 2),
        ticks=result.ticks,
        log=log,
        scenario=(*prepared.request.scenario.lines(), *prepared.request.variation.lines()),
    )
