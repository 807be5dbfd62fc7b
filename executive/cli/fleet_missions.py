"""The missions of a queue as a fleet sees them: which robots each is for, and what a robot would offer for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from executive.cli.durable import as_it_was
from executive.cli.feasibility import check_prepared
from executive.cli.requests import Prepared, prepare_alone, prepared_for
from executive.cli.several import prepared_part, understood_for_robots
from executive.cli.starts import PlacedRobot, knowledge_for
from executive.fleet.auction import Bid
from executive.language.robots import Part, Whom
from executive.mission.errors import InputError
from executive.mission.file.model import Mission
from executive.mission.knowledge import Knowledge
from executive.store.missions import MissionStore, StoredMission
from plant.worlds.world import World
from skills.robot import Pose2D

__all__ = ["CHARGE_LEFT", "FleetMission", "RobotNow", "bid_for", "fleet_mission", "rest_of"]

CHARGE_LEFT = 0.1
"""A robot offers nothing that would leave it less of its battery (0 to 1)."""


@dataclass(frozen=True)
class FleetMission:
    """A mission of the queue: what each robot that may do it would do. The first `done` commands are done already."""

    stored: StoredMission
    options: Mapping[str, Prepared]
    done: int = 0


@dataclass(frozen=True)
class RobotNow:
    """A robot as the auction sees it: where it is free next (world frame), in how long (s), and with which charge."""

    pose: Pose2D
    ready_s: float
    charge: float


def fleet_mission(
    store: MissionStore,
    stored: StoredMission,
    *,
    world: World,
    knowledge: Knowledge,
    robots: Mapping[str, PlacedRobot],
    done: int = 0,
) -> FleetMission:
    """A mission of the store for these robots. Raises InputError, which names the mission: it is for none of them."""
    try:
        options = _options(store, stored, world, knowledge, robots)
        return FleetMission(stored, {name: rest_of(each, done) for name, each in options.items()}, done)
    except InputError as error:
        what = f"mission {stored.id} ({stored.request.name}): {error.message}"
        raise InputError(what, hint=error.hint or "it stays in the queue", file=error.file, line=error.line) from error


def _options(
    store: MissionStore,
    stored: StoredMission,
    world: World,
    knowledge: Knowledge,
    robots: Mapping[str, PlacedRobot],
) -> Mapping[str, Prepared]:
    request = stored.request
    if request.world_name != world.name:
        hint = f"run those of {request.world_name} in a run of their own"
        raise InputError(f"it is for the world {request.world_name}, and this run is in {world.name}", hint=hint)
    if request.sentence is not None:
        meant = understood_for_robots(request, robots, knowledge, None)
        meanings = [part.meaning for part in meant.parts]
        named = _named(meant.parts, robots)
        return {name: prepared_part(name, meanings, request, world, knowledge, robots) for name in named}
    filed = prepare_alone(as_it_was(stored, store.path))
    if filed.world.seed_rules != world.seed_rules:
        raise InputError("its file brings objects into the world", hint="run it by `errand run`")
    return {name: _for_robot(name, filed, world, robots) for name in robots}


def _named(parts: Sequence[Part], robots: Mapping[str, PlacedRobot]) -> tuple[str, ...]:
    """The robots that may do a mission. Raises InputError: it is for several at once."""
    named = {part.robot for part in parts} - {Whom.ANY}
    if len(named) > 1 or (Whom.ALL in named and len(robots) > 1):
        raise InputError("it is for several robots at once", hint="queue a mission for each of them")
    return tuple(name for name in robots if not named or name in named or Whom.ALL in named)


def _for_robot(name: str, filed: Prepared, world: World, robots: Mapping[str, PlacedRobot]) -> Prepared:
    robot = robots[name]
    known = knowledge_for(name, robot, robots, filed.knowledge)
    own = replace(world, start=robot.start, dock=robot.dock)
    mission = replace(filed.mission, robot_name=name)
    return replace(prepared_for(filed.request, mission, own, known), kind=robot.kind, robots=robots)


def rest_of(prepared: Prepared, done: int) -> Prepared:
    """What is left of a mission of plain commands of which the first `done` are done."""
    if not done:
        return prepared
    (step,) = prepared.mission.steps
    mission: Mission = replace(prepared.mission, steps=(replace(step, commands=step.commands[done:]),))
    rest = prepared_for(prepared.request, mission, prepared.world, prepared.knowledge)
    return replace(rest, kind=prepared.kind, robots=prepared.robots)


def bid_for(mission: FleetMission, robot: str, now: RobotNow) -> Bid:
    """What a robot offers for a mission: it can do it, how long that takes from where it is, and the battery."""
    prepared = mission.options.get(robot)
    if prepared is None:
        other = next(iter(mission.options))
        return Bid(mission.stored.id, robot, now.ready_s, 0.0, problems=(f"it is for {other}",))
    checked = check_prepared(replace(prepared, world=replace(prepared.world, start=now.pose)))
    left = now.charge - checked.estimate.charge
    problems = [error.message for error in checked.errors]
    if left < CHARGE_LEFT:
        problems.append(f"its battery has {now.charge:.0%}, and {checked.estimate.charge:.0%} would be used")
    return Bid(mission.stored.id, robot, now.ready_s, checked.estimate.duration_s, left, tuple(problems))
