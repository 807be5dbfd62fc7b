"""Puts a fleet together: the missions of a store, the robots that do them, and the plant of their world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rich.console import Console

from executive.app.fleet_dispatch import FleetDispatch
from executive.app.fleet_missions import FleetMission, charging_missions, fleet_mission
from executive.app.robots import placed_robots
from executive.app.simulated import SimulatedBackend, compile_first
from executive.app.worlds import knowledge_of, open_world
from executive.store.given import GivenMissions
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.words.robots import RobotConfig
from plant.worlds.world import World
from skills.files.errors import InputError, Problems

__all__ = ["simulated_fleet"]


def simulated_fleet(
    store: MissionStore,
    queued: Sequence[StoredMission],
    configs: Sequence[RobotConfig],
    *,
    world: str | None = None,
    seed: int = 1,
    faults: Mapping[str, Sequence[str]] | None = None,
    console: Console | None = None,
    record: bool = False,
) -> FleetDispatch:
    """A fleet in the plant of a world (None: that of the first mission whose world there is). `faults` are by the
    robots' names; with `record` it leaves a recording and pictures.

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
                store,
                replace(each, request=replace(each.request, seed=seed)),
                world=where,
                knowledge=knowledge,
                robots=robots,
                done=given[each.id].done if each.id in given else 0,
            )
        except InputError as error:
            left_out.add(error)
            store.finish(each.id, MissionState.QUEUED, str(error))
            if console is not None:
                console.print(f"It is left out of this run: {error}", markup=False)
    if not missions:
        left_out.raise_any()
    compile_first()
    return FleetDispatch(
        store,
        missions,
        robots,
        SimulatedBackend(where, robots, seed=seed, record=record),
        faults or {},
        charging_missions(where, knowledge, robots),
        knowledge.battery,
        console,
    )


def _world_of(queued: Sequence[StoredMission]) -> World:
    """The world of the first mission whose world there is. Raises InputError: there is none of them."""
    problems = Problems()
    for each in queued:
        with problems:
            return open_world(each.request.world or each.request.world_name)
    problems.raise_any()
    raise AssertionError("nothing is queued")
