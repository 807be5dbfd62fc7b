"""Puts a fleet together: the missions of a store, the robots that do them, and the plant of their world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rich.console import Console

from executive.cli.fleet_dispatch import FleetDispatch
from executive.cli.fleet_missions import charging_missions, fleet_mission
from executive.cli.simulated import SimulatedBackend
from executive.cli.starts import placed_robots
from executive.cli.worlds import knowledge_of, open_world
from executive.mission.robots import RobotSetup
from executive.store.given import GivenMissions
from executive.store.missions import MissionStore, StoredMission

__all__ = ["simulated_fleet"]


def simulated_fleet(
    store: MissionStore,
    queued: Sequence[StoredMission],
    setups: Mapping[str, RobotSetup],
    *,
    world: str | None = None,
    seed: int = 1,
    faults: Mapping[str, Sequence[str]] | None = None,
    console: Console | None = None,
    record: bool = False,
) -> FleetDispatch:
    """A fleet in the plant of a world (None: that of the first mission). `faults` are by the robots' names; with
    `record` it leaves a recording and pictures.

    Raises:
        InputError: the robots do not fit into the world, or a mission is for none of them or for another world.
    """
    where = open_world(world or queued[0].request.world or queued[0].request.world_name)
    knowledge = knowledge_of(where)
    robots = placed_robots(where, knowledge, setups)
    given = GivenMissions(store).all()
    missions = {
        each.id: fleet_mission(
            store,
            replace(each, request=replace(each.request, seed=seed)),
            world=where,
            knowledge=knowledge,
            robots=robots,
            done=given[each.id].done if each.id in given else 0,
        )
        for each in queued
    }
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
