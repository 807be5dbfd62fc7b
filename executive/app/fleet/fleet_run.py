"""Runs the queued missions with several robots in one plant; writes log, recording and report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Final

from executive.app.fleet.dispatch import Dispatch, limit_of, silence
from executive.app.fleet.fleet_mission import (
    NOT_GIVEN,
    FleetMission,
    FleetRobot,
    charging_missions,
    fleet_mission,
    missions_message,
    options_for_fleet,
)
from executive.app.prepare.feasibility import check_prepared
from executive.app.prepare.placed_robots import placed_robots
from executive.app.prepare.prepared import Prepared
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.app.report.artifacts import Artifacts
from executive.app.report.report_page import (
    REPORT,
    MissionRow,
    ReportPage,
    ReportPart,
    facts_now,
    links_in,
    map_of,
    part_of,
    save_report,
)
from executive.app.report.run_report import VERDICTS, Verdict, title_of
from executive.app.runs.backend import Display, OpenRun
from executive.app.runs.one_run import log_map
from executive.app.runs.signals import ended_by_signals
from executive.app.runs.simulated import SimulatedBackend, compile_first
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.record.history import Event, read_events
from executive.run.control import Control
from executive.run.runner import run
from executive.run.visitor import RunSettings, RunVisitor
from executive.run.worker import LockStepWorker
from executive.store.missions import GivenMissions, MissionState, MissionStore, StoredMission
from executive.words.robot_config import RobotConfig
from plant.worlds.world import World
from skills.inputs.errors import InputError, Problems

TIME_LIMIT_S: Final = 1200.0
"""Time limit for each mission of the queue, on the robots' clock."""
_OPEN: Final = frozenset({MissionState.QUEUED.value, MissionState.RUNNING.value})


def run_fleet(
    dispatch: Dispatch,
    *,
    out: Path,
    seed: int,
    time_limit_s: float | None = None,
    visitors: Sequence[RunVisitor] = (),
    control: Control | None = None,
    first: Prepared | None = None,
    ended: Callable[..., None] = lambda **_: None,
) -> Verdict:
    """Runs until no mission can be assigned; writes log, recording and report into the folder `out`.

    `visitors` watch the run, a `Display` also before and after it, `control` pauses and cancels it, and `ended` is
    called with the `total` of missions whenever one ends. The log begins with the map of the `first` mission. Raises
    InputError for an unusable display or log.
    """
    backend, artifacts, begun_s = dispatch.backend, Artifacts(), dispatch.backend.clock.now()
    dispatch.ended, dispatch.extended = ended, time_limit_s is None
    limits_s = [limit_of(each.options) for each in dispatch.missions.values()] or [TIME_LIMIT_S]
    limit_s = sum(limits_s) if time_limit_s is None else time_limit_s
    with closing(EventLog(out / "log.mcap", backend.clock, apart=True)) as log:
        dispatch.log = log
        displays = [each for each in visitors if isinstance(each, Display)]
        for display in displays:
            display.opened(OpenRun(log, backend))
        if first is not None:
            log_map(log, first.world, first.knowledge)
        control = control or Control(pace=None)
        stop, cancel = ended_by_signals(dispatch.stop), ended_by_signals(control.cancel)
        with stop, cancel as ending, LockStepWorker(backend.clock) as worker:
            result = run(
                dispatch,
                clock=backend.clock,
                worker=worker,
                visitors=(artifacts, log, *visitors, *backend.visitors(control, log)),
                settings=RunSettings(seed=seed, time_limit_s=limit_s),
                control=control,
                spare=dispatch.spare(),
            )
        dispatch.close()
    if ending.hurried:
        backend.hurry()
    recording = backend.leave(artifacts, out)
    lasted = f"{backend.clock.now() - begun_s:.1f} s simulated in {result.wall_time_s:.1f} s"
    facts = (("world and seed", f"{first.world.name}, seed {seed}"),) if first is not None else ()
    verdict = _write_report(
        dispatch, out, artifacts, read_events(log.path), (*facts, ("duration", lasted), *facts_now())
    )
    for display in displays:
        display.reported(recording, out / REPORT, (verdict,))
    return verdict


def simulated_fleet(
    store: MissionStore,
    queued: Sequence[StoredMission],
    configs: Sequence[RobotConfig],
    *,
    world: str | None = None,
    seed: int = 1,
    faults: Mapping[str, Sequence[str]] | None = None,
    tell: Callable[[str], None] = silence,
    record: bool = False,
) -> Dispatch:
    """Builds a fleet for the `queued` missions in the plant of a world, by default that of the first one that exists.

    A mission that these robots cannot do in this world stays in the queue, with the reason as its message. The `faults`
    are words, by the robots' names; `tell` shows a line; with `record` the run has a recording and pictures. Raises
    InputError if the robots do not fit into the world, or no mission can be run.
    """
    where = _world_of(queued) if world is None else open_world(world)
    knowledge = knowledge_of(where)
    robots = placed_robots(where, knowledge, configs)
    given = GivenMissions(store).all()
    missions, left_out = dict[int, FleetMission](), Problems()
    for each in queued:
        try:
            missions[each.id] = fleet_mission(
                replace(each, request=replace(each.request, seed=seed)),
                world=where,
                knowledge=knowledge,
                robots=robots,
                given=given.get(each.id, NOT_GIVEN),
            )
        except InputError as error:
            left_out.add(error)
            store.finish(each.id, MissionState.QUEUED, str(error))
            tell(f"It is left out of this run: {error}")
    if not missions:
        left_out.raise_any()
    compile_first()
    docks, faults = charging_missions(where, knowledge, robots), faults or {}
    fleet = {
        name: FleetRobot(placed, placed.start, dock=docks.get(name), faults=tuple(faults.get(name, ())))
        for name, placed in robots.items()
    }
    backend = SimulatedBackend(where, robots, seed=seed, record=record)

    def prepare(request: Request) -> tuple[Mapping[str, Prepared], float]:
        options = options_for_fleet(request, where, knowledge, robots)
        return options, min(check_prepared(each).estimate.duration_s for each in options.values())

    left = [each.id for each in queued if each.id not in missions]
    return Dispatch(store, missions, fleet, backend, prepare, knowledge.battery, tell, left_out=left)


def _world_of(queued: Sequence[StoredMission]) -> World:
    """Opens the world of the first mission whose world exists. Raises InputError if none does."""
    problems = Problems()
    for each in queued:
        with problems:
            return open_world(each.request.world or each.request.world_name)
    problems.raise_any()
    raise AssertionError("nothing is queued")


def _write_report(
    dispatch: Dispatch, out: Path, artifacts: Artifacts, events: Sequence[Event], facts: Sequence[tuple[str, str]]
) -> Verdict:
    """Writes the report of a fleet's run into the folder `out`; returns how many of its missions are achieved."""
    kinds = {name: robot.placed.kind for name, robot in dispatch.robots.items()}
    values = dispatch.rows
    rows: list[MissionRow] = []
    for row, full in zip(missions_message(dispatch.store, values)["missions"], values, strict=True):
        seen = None if full["referee"] is None else full["referee"]["success"]
        word = row["outcome"] if full["referee"] is None else f"{row['outcome']}, {VERDICTS[seen]}"
        good = None if row["outcome"] in _OPEN else row["outcome"] == MissionState.SUCCESS.value and seen is not False
        number, robot = row["id"], row["robot"] or ""
        rows.append(MissionRow(number, row["sentence"], robot, good, word, row["reassigned"], row["message"]))
    parts: list[ReportPart] = []
    for each in sorted(dispatch.missions.values(), key=lambda each: each.until_s):
        if each.ended is not None:
            tree, kind = each.ended.tree, each.ended.report.kind
            own = [event for event in events if each.since_s <= event.stamp_s <= each.until_s]
            title = f"Mission {each.number}, {tree.robot_name} ({kind}): {tree.mission_name}"
            parts.append(part_of(each.ended, tuple(kinds), artifacts, own, title=title))
    asked = [each.stored.request for each in dispatch.missions.values()]
    wholes = [row.good is True for row, full in zip(rows, values, strict=True) if full["part_of"] is None]
    done = f"{sum(wholes)} of {len(wholes)} missions achieved"
    page = ReportPage(
        title=title_of(each.name or each.sentence or "fleet" for each in asked),
        request=done,
        facts=(("robots", ", ".join(f"{name} ({kind})" for name, kind in kinds.items())), *facts),
        missions=rows,
        map=map_of(artifacts, events, several=len(kinds) > 1),
        parts=parts,
        links=links_in(out, "log.mcap"),
        commands=(("replay", shlex.join(["errand", "replay", str(out / "log.mcap")])),),
    )
    save_report(out, page)
    left = "; ".join(f"{row.request}: {row.message or row.word}" for row in rows if row.good is not True)
    return Verdict("The fleet", not left, done, left)
