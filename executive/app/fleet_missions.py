"""The missions of a queue as a fleet sees them: which robots each is for, and what a robot would offer for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.app.auction import Bid
from executive.app.durable import as_it_was
from executive.app.feasibility import check_prepared
from executive.app.goal_conditions import Share
from executive.app.prepare import Setting, instead, prepare_alone
from executive.app.prepared import Prepared
from executive.app.robots import PlacedRobot
from executive.language.robots import Part, Whom
from executive.mission.mission import mission_from_lines
from executive.mission.request import Request
from executive.store.missions import MissionStore, StoredMission
from executive.tree.check import Checked
from executive.tree.estimate import RoutePlanner, load_estimates
from executive.words.command import Command, Task
from executive.words.knowledge import Knowledge
from executive.words.steps import Mission
from plant.worlds.world import World
from skills.files.errors import InputError
from skills.robot import Pose2D

__all__ = [
    "FleetMission",
    "RobotNow",
    "bid_for",
    "charging_missions",
    "charging_time_s",
    "fleet_mission",
    "is_way",
    "rest_of",
    "surfaces_of",
    "with_commands",
]

URGENT: Final = 0.5
"""At this share of the charge that counts as low, a robot that has something in hand goes to its dock all the same."""


@dataclass(frozen=True)
class FleetMission:
    """A mission of the queue: what each robot that may do it would do. The first `done` commands are done already.

    It began at `since_s` (s on the robots' clock; None: not yet); `shares` are what robots did that had it before, and
    `tried` why one did not do it, by its name.
    """

    stored: StoredMission
    options: Mapping[str, Prepared]
    done: int = 0
    since_s: float | None = None
    shares: tuple[Share, ...] = ()
    tried: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RobotNow:
    """A robot as the auction sees it: where it is free next (world frame), with which charge, its mission to `dock`
    (None: it cannot), below which charge it is `low`, and what plans its routes."""

    pose: Pose2D
    charge: float
    low: float
    planner: RoutePlanner
    dock: Prepared | None = None


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
        setting = Setting(request, world, _patient(knowledge), robots)
        meant = setting.understood()
        meanings = [part.meaning for part in meant.parts]
        return {name: setting.part(name, meanings) for name in _named(meant.parts, robots)}
    alone = prepare_alone(as_it_was(stored, store.path))
    if alone.world.seed_rules != world.seed_rules:
        raise InputError("its file brings objects into the world", hint="run it by `errand run`")
    setting = Setting(alone.request, world, _patient(alone.knowledge), robots)
    return {name: setting.for_robot(name).compiled(replace(alone.mission, robot_name=name)) for name in robots}


def _named(parts: Sequence[Part], robots: Mapping[str, PlacedRobot]) -> tuple[str, ...]:
    """The robots that may do a mission. Raises InputError: it is for several at once."""
    named = {part.robot for part in parts} - {Whom.ANY}
    if len(named) > 1 or (Whom.ALL in named and len(robots) > 1):
        raise InputError("it is for several robots at once", hint="queue a mission for each of them")
    return tuple(name for name in robots if not named or name in named or Whom.ALL in named)


def rest_of(prepared: Prepared, done: int) -> Prepared:
    """What is left of a mission of plain commands of which the first `done` are done."""
    return with_commands(prepared, prepared.tree.commands[done:]) if done else prepared


def surfaces_of(prepared: Prepared) -> frozenset[str]:
    """The surfaces that a mission's commands name, at each of which one robot works at a time."""
    goals = {command.goal for command in prepared.tree.commands if command.goal is not None}
    return frozenset(filter(None, map(prepared.knowledge.place, goals))) & prepared.knowledge.surfaces.keys()


def with_commands(prepared: Prepared, commands: Sequence[Command]) -> Prepared:
    """A mission of plain commands with others in their place. Raises InputError: they cannot be carried out."""
    (step,) = prepared.mission.steps
    mission: Mission = replace(prepared.mission, steps=(replace(step, commands=tuple(commands)),))
    return instead(prepared, mission)


def _patient(knowledge: Knowledge) -> Knowledge:
    """What a robot of a fleet knows: others go on with its mission when it is low, so that it interrupts it later."""
    battery = knowledge.battery.model_copy(update={"low": URGENT * knowledge.battery.low})
    return knowledge.model_copy(update={"battery": battery})


def charging_missions(world: World, knowledge: Knowledge, robots: Mapping[str, PlacedRobot]) -> Mapping[str, Prepared]:
    """What each robot does to charge; one without a dock is not among them."""
    line = str(Command(task=Task.CHARGE))
    setting = Setting(Request(commands=(line,), world_name=world.name), world, _patient(knowledge), robots)
    return {
        name: setting.for_robot(name).compiled(mission_from_lines((line,), world=world.name, robot_name=name))
        for name, robot in robots.items()
        if robot.dock is not None
    }


def bid_for(mission: FleetMission, robot: str, now: RobotNow) -> Bid:
    """What a robot offers for a mission: it can do it, how long that takes from where it is, and the battery."""
    prepared = mission.options.get(robot)
    if prepared is None:
        other = next(iter(mission.options))
        return Bid(mission.stored.id, robot, 0.0, 0.0, problems=(f"it is for {other}",))
    checked = _checked_from(now.pose, prepared, now.planner)
    taken, left = checked.estimate, now.charge - checked.estimate.charge
    problems = (*(error.message for error in checked.errors), *_out_of_reach(prepared, now))
    bid = Bid(mission.stored.id, robot, 0.0, taken.duration_s, left, problems=problems)
    if left >= now.low or problems:
        return bid
    charged = prepared.knowledge.battery.charged
    if now.dock is None or now.dock.world.dock is None or charged - taken.charge < now.low:
        return replace(bid, problems=(f"its battery has {now.charge:.0%}, and {taken.charge:.0%} would be used",))
    to_dock = _checked_from(now.pose, now.dock, now.planner)
    again = _checked_from(now.dock.world.dock, prepared, now.planner)
    problems = tuple(error.message for error in (*to_dock.errors, *again.errors))
    full_s = charging_time_s(now.charge, charged)
    duration_s = to_dock.estimate.duration_s + full_s + again.estimate.duration_s
    return replace(bid, duration_s=duration_s, charge=charged - again.estimate.charge, charges=True, problems=problems)


def charging_time_s(charge: float, charged: float) -> float:
    """How long a battery charges (s), from one state of charge to another (0 to 1)."""
    return max(0.0, charged - charge) / load_estimates().battery.charging_per_s


def _checked_from(pose: Pose2D, prepared: Prepared, planner: RoutePlanner) -> Checked:
    return check_prepared(replace(prepared, world=replace(prepared.world, start=pose)), planner)


def _out_of_reach(prepared: Prepared, now: RobotNow) -> Iterator[str]:
    """What a robot is to take from where it cannot come. Alone it would look elsewhere; of a fleet another one can."""
    knowledge = prepared.knowledge
    for command in prepared.tree.commands:
        if command.task is not Task.GRASP or command.object is None:
            continue
        place = None if command.goal is None else knowledge.place(command.goal)
        usual = knowledge.usual_surfaces(command.object.name) if place is None else (place,)
        surfaces = [name for spot in usual for name in knowledge.surfaces_in(spot)]
        views = [view for name in surfaces for view in knowledge.surfaces[name].viewpoints]
        if surfaces and not any(is_way(now.planner, now.pose, Pose2D(each.x, each.y, each.yaw)) for each in views):
            yield f"there is no way to the {place or surfaces[0]}, where the {command.object} is to be taken"


def is_way(planner: RoutePlanner, start: Pose2D, goal: Pose2D) -> bool:
    """Whether there is a route."""
    try:
        planner.route(start, goal)
    except ValueError:
        return False
    return True
