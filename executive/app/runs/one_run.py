"""Runs one request on a backend and writes log, tree, report and pictures into its folder."""

import ctypes
import gc
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from executive.app.prepare.prepared import Prepared
from executive.app.report.artifacts import Artifacts, draw_answer, save_pictures, save_views
from executive.app.report.report_page import REPORT, EndedTree, with_findings, write_report
from executive.app.report.run_report import RobotReport, RunReport
from executive.app.runs.backend import Backend, Display, Durable, OpenRun
from executive.app.runs.goal_conditions import Share
from executive.app.runs.signals import ended_by_signals
from executive.app.runs.simulated import SimulatedBackend, compile_first
from executive.record.announce import announce, map_message
from executive.record.event_log import EventLog
from executive.record.history import Event, read_events
from executive.run.control import Control
from executive.run.outcome import RobotResult, RunResult
from executive.run.runner import run
from executive.run.visitor import Progress, RunEntry, RunSettings, RunVisitor
from executive.run.worker import LockStepWorker, ThreadWorker
from executive.tree.node_view import NodeView, node_view
from executive.tree.nodes.skill_leaf import ERROR_TOPIC
from executive.words.goal import RefereeReport
from executive.words.knowledge import Knowledge
from executive.words.robot_config import named_robot
from executive.words.schemas import CONTROL, MAP, RUN, WORK
from plant.worlds.world import World
from skills.api import PlanningError, Publish
from skills.faults.faulty_robot import FaultyRobot, inject_faults, parse_fault
from skills.footprint import Footprint
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError, SpareFiles, shortage_of_files
from skills.quantities import clock_s
from skills.robot import Pose2D, Robot

_FILES_RESERVED, _FILES_FREE = 32, 8
_MOST_STARTS: Final = 1000


@dataclass(frozen=True)
class FinishedRun:
    """Report of an ended run, the last state of its tree, and whether the terminal was closed meanwhile."""

    report: RunReport
    tree: NodeView
    hung_up: bool = False


def run_request(
    prepared: Prepared,
    backend: Backend | None = None,
    *,
    visitors: Sequence[RunVisitor] = (),
    control: Control | None = None,
    durable: Durable | None = None,
    worker: ThreadWorker | None = None,
) -> FinishedRun:
    """Runs a prepared request and writes log, tree, report and pictures into its folder.

    The `backend` is by default the plant of the request's world. `visitors` watch the run, a `Display` also before and
    after it; `control` pauses, steps and cancels it. `durable` stores the state of the run for another process to
    resume, or resumes an earlier run. The `worker` runs jobs in parallel to the ticks (None: in lock-step with the
    backend's clock).

    Raises InputError if the world or the stored state cannot be used.
    """
    request, scenario, settings = prepared.request, prepared.request.scenario, _settings(prepared)
    out, world, kinds = request.out, prepared.world, {name: robot.kind for name, robot in prepared.robots.items()}
    backend, artifacts = backend or simulated_backend(prepared), Artifacts()
    entries = [entry_for(each, backend, durable) for each in prepared.all]
    idle = [name for name in kinds if all(name != entry.tree.robot_name for entry in entries)]
    spare = [backend.entry(replace(prepared.tree, robot_name=name), None) for name in idle]
    path, clock = out / ("log.mcap" if durable is None else durable.log), backend.clock
    with closing(FilesOfRun()) as files, closing(EventLog(path, clock, apart=prepared.several)) as log:
        displays = [each for each in visitors if isinstance(each, Display)]
        journals = () if durable is None else tuple(durable.journals.values())
        for display in displays:
            display.opened(OpenRun(log, backend))
        log_map(log, world, prepared.knowledge)
        facts: dict[str, Any] = {"world": world.name, "seed": request.seed, "scenario": scenario.lines()}
        facts["robots"] = kinds if prepared.several else {}
        for each in prepared.all:
            announce(log, clock, each.tree.robot_name, each.tree.commands, each.knowledge, **facts)
        watching = [files, artifacts, log, *journals, *visitors]
        if scenario:
            watching.append(DisturbanceLog(log, [each.robot for each in entries], backend.happened))
        watching += backend.visitors(control := control or Control(pace=None), log)
        with ended_by_signals(control.cancel) as ending, closing(worker or LockStepWorker(clock)) as jobs:
            result = run(
                entries, clock=clock, worker=jobs, visitors=watching, settings=settings, control=control, spare=spare
            )
        if durable is not None:  # the next mission of the queue begins in this one's world
            next(iter(durable.journals.values())).keep_world()
            for trouble in durable.troubles:
                log(ERROR_TOPIC, {"node": prepared.tree.robot_name, "what": "store its state", "traceback": trouble})
        counts = dict(sorted(Counter({**result.work, **backend.work(), "bytes_logged": log.bytes}).items()))
        log(WORK, counts)
    if ending.hurried:
        backend.hurry()
    finished, recording = _conclude(prepared, backend, result, log, artifacts, counts)
    for display in displays:
        display.reported(recording, out / REPORT, tuple(finished.report.every_verdict()))
    return replace(finished, hung_up=ending.hung_up)


def _conclude(
    prepared: Prepared,
    backend: Backend,
    result: RunResult,
    log: EventLog,
    artifacts: Artifacts,
    counts: Mapping[str, int],
) -> tuple[FinishedRun, Path | None]:
    """Judges an ended run and writes report, pictures and recording; returns the report and the recording's path."""
    out, events = prepared.request.out, mission_events(log.path)
    artifacts.recall(events)
    finished, ended = _judge(prepared, backend, result, log)
    report = replace(finished.report, work=counts, log_time_s=round(events[-1].stamp_s - events[0].stamp_s, 3))
    report = with_findings(report, prepared.knowledge, result, artifacts, events)
    draw_answer(artifacts, out)
    save_pictures(events, out / "pictures")
    if prepared.request.record:
        save_views(artifacts, out)
    recording = backend.leave(artifacts, out)
    write_report(prepared, report, ended, artifacts, events)
    return replace(finished, report=report), recording


def simulated_backend(prepared: Prepared) -> Backend:
    """Builds the plant of a request's world."""
    compile_first()
    request = prepared.request
    return SimulatedBackend(
        prepared.world,
        prepared.robots,
        seed=request.seed,
        record=request.record,
        variation=request.variation,
        spared=mentioned_classes(prepared),
    )


def mentioned_classes(prepared: Prepared) -> frozenset[str]:
    """Returns the classes of the objects that a mission mentions; clutter contains no object of these classes."""
    named = {each.name for command in prepared.tree.commands for each in (command.item, command.object) if each}
    known = prepared.knowledge
    return frozenset(one for name in named for one in known.classes(known.object_name(name) or name))


def log_map(log: EventLog, world: World, knowledge: Knowledge) -> None:
    """Writes the map into the log, so that viewers need only the log."""
    log(MAP, map_message(load_grid_map(world.scan_map_path), knowledge, world=world.name))


def entry_for(prepared: Prepared, backend: Backend, durable: Durable | None) -> RunEntry:
    """Returns the robot of a mission with its faults, after its numeric code is compiled."""
    entry, clock = backend.entry(prepared.tree, durable), backend.clock
    preload(entry)
    split = [(words, *named_robot(words, prepared.robots)) for words in prepared.request.scenario.faults]
    own = (replace(parse_fault(said), words=words) for words, robot, said in split if robot in (None, entry.robot.name))
    faults = [each for each in own if not each.over_by(clock.now())]  # a resumed run may be past some faults
    return replace(
        entry,
        robot=inject_faults(entry.robot, clock, faults, since_s=0.0),
        after=prepared.after,
        speaker_W=prepared.speaker_W,
    )


def _settings(prepared: Prepared) -> RunSettings:
    """Returns the settings of a run: seed, time of day and time limit."""
    time_s = None if (day := prepared.request.time_of_day) is None else clock_s(day)
    return RunSettings(prepared.request.seed, time_limit_s=prepared.time_limit_s, time_of_day_s=time_s)


def log_name(start: int) -> str:
    """Returns the file name of a mission's log; each restart of the mission has a log of its own."""
    return "log.mcap" if start == 1 else f"log-{start}.mcap"


def mission_events(log: Path) -> tuple[Event, ...]:
    """Returns the events of all starts of a mission, from this log and the readable logs of earlier starts.

    Raises InputError if this log cannot be read.
    """

    def facts(events: Sequence[Event]) -> object:
        """Returns the commands, world and seed at the beginning of a log."""
        return next((event.data for event in events if event.topic == RUN), None)

    events, before = read_events(log), list[Event]()
    for name in (log_name(start) for start in range(1, _MOST_STARTS)):
        if name == log.name:
            break
        with suppress(InputError):
            earlier = read_events(log.with_name(name))
            before += earlier if facts(earlier) == facts(events) else ()
    return (*before, *events)


def _judge(
    prepared: Prepared, backend: Backend, result: RunResult, log: EventLog
) -> tuple[FinishedRun, Sequence[EndedTree]]:
    """Builds the report on a run with the referee's verdict, and returns the last state of each robot's tree as well.

    Objects that the other robots moved count as moved by the mission.
    """
    shares = {each.robot_name: Share(each.tree, each, 0) for each in result.robots}
    robots: dict[str, RobotReport] = {}
    for name, own in shares.items():
        seen = backend.judge(own.tree, own.result, before=[each for each in shares.values() if each is not own])
        robots[name] = robot_report(own.result, prepared.robots[name].kind, seen)
    worst = min(robots, key=lambda name: (robots[name].achieved, name != result.worst.robot_name))
    views = {name: node_view(each.tree.root, each.result.states) for name, each in shares.items()}
    ending = {name: value for name, value in vars(robots[worst]).items() if name != "kind"}
    report = RunReport(
        **ending,
        world=prepared.world.name,
        seed=prepared.request.seed,
        sim_time_s=round(result.sim_time_s, 3),
        wall_time_s=round(result.wall_time_s, 3),
        real_time_factor=round(result.sim_time_s / max(result.wall_time_s, 1e-6), 2),
        ticks=result.ticks,
        log=str(log.path),
        scenario=(*prepared.request.scenario.lines(), *prepared.request.variation.lines()),
        notes=tuple(backend.notes),
        zones=tuple(dict.fromkeys(zone.words for each in result.every for zone in each.tree.all_zones)),
        robots=robots if prepared.request.robots else {},
    )
    return FinishedRun(report, views[worst]), [
        EndedTree(shares[name].tree, view, robots[name]) for name, view in views.items()
    ]


def robot_report(ended: RobotResult, kind: str, seen: RefereeReport | None) -> RobotReport:
    """Returns a robot's report: outcome, commands, and the referee's verdict."""
    return RobotReport(
        kind=kind,
        outcome=ended.outcome.value,
        cause=None if ended.cause is None else ended.cause.value,
        message=ended.message,
        referee=seen,
        commands=tuple(map(str, ended.tree.commands)),
    )


def preload(entry: RunEntry) -> None:
    """Processes the robot's first scan and plans a short path, so that all code is compiled before the run."""
    robot, localiser, costmap = entry.robot, entry.localiser, entry.costmap
    localiser.update(robot)
    estimate = localiser.estimate()
    costmap.update(robot, estimate)
    here = Pose2D.from_transform(estimate.X_WO @ robot.odometry().X_OB)
    there = Pose2D(here.x_m, here.y_m, here.yaw_rad + 0.5)
    with suppress(PlanningError):
        entry.stack.planner.problem(costmap, Footprint.of(robot.capabilities()), here, there, max_speed_m_s=math.inf)()
    # garbage of an earlier run is collected; then the run's long-lived objects are excluded from collection
    if gc.get_freeze_count():
        gc.unfreeze()
        gc.collect()
    gc.freeze()


class FilesOfRun(RunVisitor):
    """Open files that a run reserves: some for the time when too many files are open, the others for its report."""

    def __init__(self) -> None:
        self._while_running, self._at_end = SpareFiles(_FILES_RESERVED), SpareFiles(_FILES_RESERVED)

    def tick(self, progress: Progress) -> None:
        """Frees files for the mission, which loads code and models late, when too many files are open."""
        if shortage_of_files(_FILES_FREE):
            self._while_running.close()

    def close(self) -> None:
        """Frees all files; idempotent."""
        self._while_running.close()
        self._at_end.close()


Happened = Callable[[], Sequence[tuple[float, str]]]
FAULT: Final = "fault"
EVENT: Final = "event"


class DisturbanceLog(RunVisitor):
    """Logger of the faults that begin and end, and of the events in the world."""

    def __init__(self, publish: Publish, robots: Iterable[Robot], happened: Happened) -> None:
        """`happened` returns all events in the world since the run began, as times (s) and sentences."""
        self._publish, self._happened = publish, happened
        self._robots = [robot for robot in robots if isinstance(robot, FaultyRobot)]
        self._active: tuple[str, ...] = ()
        self._logged = len(happened())

    def tick(self, progress: Progress) -> None:
        """Logs the faults and events since the last tick."""
        for now_s, sentence in self._happened()[self._logged :]:
            self._log(now_s, EVENT, sentence)
        self._logged = len(self._happened())
        now = tuple(dict.fromkeys(words for robot in self._robots for words in robot.faults_at_work()))
        for words in dict.fromkeys((*now, *self._active)):
            if (words in now) != (words in self._active):
                self._log(progress.now_s, FAULT, f"{words}: {'begins' if words in now else 'is over'}")
        self._active = now

    def _log(self, now_s: float, what: str, message: str) -> None:
        self._publish(CONTROL, {"t": round(now_s, 6), "what": what, "message": message})


def return_memory() -> None:
    """Frees the objects of an ended run, which `preload` has frozen, and returns their memory to the system.

    Without this they stay until the next run is built, and the C library keeps small pieces of freed memory.
    """
    gc.unfreeze()
    gc.collect()
    with suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
