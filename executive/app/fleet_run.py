"""Runs what is queued with several robots in one plant, and writes what is kept of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from executive.app.artifacts import Artifacts
from executive.app.dispatch import Dispatch, silence
from executive.app.fleet import (
    EndedMission,
    FleetMission,
    charging_missions,
    fleet_mission,
    missions_json,
    missions_message,
)
from executive.app.mission_run import log_map, run_watched
from executive.app.page_view import PageView
from executive.app.prepared import Prepared
from executive.app.report import VERDICTS
from executive.app.report_file import MissionRow, ReportPage, ReportPart, map_of, part_of, save_report
from executive.app.robots import placed_robots
from executive.app.signals import ended_by_signals
from executive.app.simulated import SimulatedBackend, compile_first
from executive.app.worlds import knowledge_of, open_world
from executive.record.event_log import EventLog
from executive.record.history import Event, read_events
from executive.run.visitor import RunSettings
from executive.store.given import GivenMissions
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.words.robots import RobotConfig
from plant.worlds.world import World
from skills.files.errors import InputError, Problems

TIME_LIMIT_S: Final = 1200.0
"""For each mission of the queue, on the robots' clock."""
_OPEN: Final = frozenset({MissionState.QUEUED.value, MissionState.RUNNING.value})


def run_fleet(
    dispatch: Dispatch,
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
    backend, artifacts, begun_s = dispatch.backend, Artifacts(), dispatch.backend.clock.now()
    limit_s = TIME_LIMIT_S * max(1, len(dispatch.missions)) if time_limit_s is None else time_limit_s
    with closing(EventLog(out / "log.mcap", backend.clock, apart=True)) as log:
        dispatch.log = log
        if page is not None:
            page.serve(log, backend.show_live())
        if first is not None:
            log_map(log, first.world, first.knowledge)
        with ended_by_signals(dispatch.stop):
            result = run_watched(
                dispatch,
                backend,
                (artifacts, log, *([] if page is None else [page])),
                settings=RunSettings(seed=seed, time_limit_s=limit_s),
                control=None if page is None else page.control,
                spare=dispatch.spare(),
            )
        dispatch.close()
    recording = backend.leave(artifacts, out)
    rows = _rows(dispatch.store, missions_json(dispatch.store, list(dispatch.missions)))
    kinds = {name: robot.kind for name, robot in dispatch.robots.items()}
    lasted = f"{backend.clock.now() - begun_s:.1f} s simulated in {result.wall_time_s:.1f} s"
    facts = (("world and seed", f"{first.world.name}, seed {seed}"),) if first is not None else ()
    _write_report(out, rows, dispatch.over, kinds, artifacts, read_events(log.path), (*facts, ("duration", lasted)))
    if page is not None:
        page.offer(recording)


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
    """A fleet in the plant of a world (None: that of the first mission whose world there is). `faults` are by the
    robots' names; `tell` shows a line; with `record` it leaves a recording and pictures.

    A mission that is for none of these robots, for another world or that cannot be prepared is left out: it stays in
    the queue with the cause as its message.
    Raises:
        InputError: the robots do not fit into the world, or all missions are left out.
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
                done=given[each.id].done if each.id in given else 0,
            )
        except InputError as error:
            left_out.add(error)
            store.finish(each.id, MissionState.QUEUED, str(error))
            tell(f"It is left out of this run: {error}")
    if not missions:
        left_out.raise_any()
    compile_first()
    return Dispatch(
        store,
        missions,
        robots,
        SimulatedBackend(where, robots, seed=seed, record=record),
        faults or {},
        charging_missions(where, knowledge, robots),
        knowledge.battery,
        tell,
    )


def _world_of(queued: Sequence[StoredMission]) -> World:
    """The world of the first mission whose world there is. Raises InputError: there is none of them."""
    problems = Problems()
    for each in queued:
        with problems:
            return open_world(each.request.world or each.request.world_name)
    problems.raise_any()
    raise AssertionError("nothing is queued")


def _rows(store: MissionStore, values: Sequence[Mapping[str, Any]]) -> Sequence[MissionRow]:
    """Missions as the report has them."""
    rows = zip(missions_message(store, values)["missions"], values, strict=True)
    return [_row(row, each["referee"]) for row, each in rows]


def _row(row: Mapping[str, Any], referee: Mapping[str, Any] | None) -> MissionRow:
    seen = None if referee is None else referee["success"]
    word = row["outcome"] if referee is None else f"{row['outcome']}, {VERDICTS[seen]}"
    good = None if row["outcome"] in _OPEN else row["outcome"] == MissionState.SUCCESS.value and seen is not False
    return MissionRow(row["id"], row["sentence"], row["robot"] or "", good, word, row["reassigned"], row["message"])


def _write_report(
    out: Path,
    rows: Sequence[MissionRow],
    ended: Sequence[EndedMission],
    robots: Mapping[str, str],
    artifacts: Artifacts,
    events: Sequence[Event],
    facts: Sequence[tuple[str, str]],
) -> Path:
    """Write the report of a fleet's run; its path. `robots` are their names and kinds."""
    did = sum(row.good is True for row in rows)
    page = ReportPage(
        title="Fleet",
        request=f"{did} of {len(rows)} missions done",
        facts=(("robots", ", ".join(f"{name} ({kind})" for name, kind in robots.items())), *facts),
        missions=rows,
        map=map_of(artifacts, events, several=len(robots) > 1),
        parts=[_part(each, tuple(robots), artifacts, events) for each in ended],
    )
    return save_report(out, page)


def _part(mission: EndedMission, robots: Sequence[str], artifacts: Artifacts, events: Sequence[Event]) -> ReportPart:
    name = mission.ended.tree.robot_name
    own = [event for event in events if mission.since_s <= event.stamp_s <= mission.until_s]
    title = f"Mission {mission.number}, {name} ({mission.ended.report.kind}): {mission.ended.tree.mission_name}"
    return part_of(mission.ended, robots, artifacts, own, title=title)
