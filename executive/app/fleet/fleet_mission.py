"""Missions and robots of a fleet: each robot's version of a mission, its progress, and its bids."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from py_trees.common import Status

from executive.app.fleet.auction import Auction, Bid
from executive.app.prepare.feasibility import check_prepared, route_planner_of
from executive.app.prepare.from_request import Setting, prepare_alone
from executive.app.prepare.prepared import Prepared
from executive.app.report.report_page import EndedTree
from executive.app.runs.goal_conditions import Share
from executive.language.addressees import RobotChoice
from executive.mission.request import Request
from executive.run.visitor import RunEntry, TickNote
from executive.store.missions import GivenMission, GivenMissions, MissionStore, StoredMission
from executive.tree.board import LastKnown, LastKnownTracker
from executive.tree.check import Checked
from executive.tree.compiler import CompiledTree
from executive.tree.estimate import RoutePlanner, load_estimates
from executive.tree.node import NodeSpec
from executive.tree.nodes.guard import KnowsPlace
from executive.words.command import Command
from executive.words.knowledge import BatteryFacts, Knowledge, SurfaceFacts
from executive.words.leaf_steps import Do, Say, steps_of_commands
from executive.words.mission import Mission
from executive.words.step import Step
from executive.words.task import basic
from plant.robots.robot_kind import PlacedRobot, robot_kind
from plant.worlds.world import World
from skills.api import Zone
from skills.geometry import surface_spots, wrap
from skills.inputs.errors import InputError
from skills.robot import Pose2D

URGENT: Final = 0.5
"""Share of the low charge at which a robot goes to its dock although it holds an object."""
_TOUCHED: Final = (Status.RUNNING, Status.SUCCESS)
_HEADINGS: Final = 16
NOT_GIVEN: Final = GivenMission()


@dataclass
class FleetMission:
    """Queued mission, prepared for each robot that may do it: `options` hold the remaining commands.

    It runs from `since_s` to `until_s` (s on the robots' clock; infinite: not yet), and `ended` is its last tree.
    `shares` are the parts that other robots did; `tried` maps a robot that failed to the reason. The store holds the
    rest of its state (`executive.store.missions.GivenMission`).
    """

    stored: StoredMission
    options: Mapping[str, Prepared]
    since_s: float = math.inf
    until_s: float = math.inf
    shares: tuple[Share, ...] = ()
    tried: Mapping[str, str] = field(default_factory=dict)
    ended: EndedTree | None = None

    @property
    def number(self) -> int:
        """Number of the mission in the store."""
        return self.stored.id


def fleet_mission(
    stored: StoredMission,
    *,
    world: World,
    knowledge: Knowledge,
    robots: Mapping[str, PlacedRobot],
    given: GivenMission = NOT_GIVEN,
) -> FleetMission:
    """Prepares the unfinished part of a stored mission for the robots; `given` says which commands are done.

    Raises InputError with the mission's number if none of the robots can do it.
    """
    try:
        options = options_for_fleet(stored.request, world, knowledge, robots)
        rests = {name: rest_of(each, given.done, given.last_known) for name, each in options.items()}
        return FleetMission(stored, rests)
    except InputError as error:
        what = f"mission {stored.id} ({stored.request.name}): {error.message}"
        raise InputError(what, hint=error.hint or "it stays in the queue", file=error.file, line=error.line) from error


def options_for_fleet(
    request: Request, world: World, knowledge: Knowledge, robots: Mapping[str, PlacedRobot]
) -> Mapping[str, Prepared]:
    """Prepares a request for each robot that may do it. Raises InputError if there is none."""
    if request.world_name != world.name:
        hint = f"run the missions of {request.world_name} in a run of their own"
        raise InputError(f"it is for the world {request.world_name}, and this run is in {world.name}", hint=hint)
    if request.sentence is not None:
        setting = Setting(request, world, _patient(knowledge), robots)
        meant = setting.understand()
        meanings, named = (
            [part.meaning for part in meant.parts],
            {part.robot for part in meant.parts} - {RobotChoice.ANY},
        )
        if len(named) > 1 or (RobotChoice.ALL in named and len(robots) > 1):
            raise InputError("it is for several robots at once", hint="queue a mission for each of them")
        able = [name for name in robots if not named or name in named or RobotChoice.ALL in named]
        return {name: setting.part(name, meanings) for name in able}
    alone = prepare_alone(request)
    if alone.world.seed_rules != world.seed_rules:
        raise InputError("its file brings objects into the world", hint="run it by `errand run`")
    setting = Setting(alone.request, world, _patient(alone.knowledge), robots)
    missions = {name: alone.mission.model_copy(update={"robot": name}) for name in robots}
    return {name: setting.for_robot(name).compile(mission) for name, mission in missions.items()}


def rest_of(prepared: Prepared, done: int, last_known: LastKnown | None) -> Prepared:
    """Returns a mission of plain commands without its first `done` ones; a search begins at the last known place."""
    if not done and (last_known is None or not is_plain(prepared.tree)):
        return prepared
    return with_commands(replace(prepared, last_known=last_known), prepared.tree.commands[done:])


def surfaces_of(prepared: Prepared) -> frozenset[str]:
    """Returns the surfaces that a mission's commands name; only one robot at a time works at each surface."""
    goals = {command.goal for command in prepared.tree.commands if command.goal is not None}
    return frozenset(filter(None, map(prepared.knowledge.place, goals))) & prepared.knowledge.surfaces.keys()


def with_commands(prepared: Prepared, commands: Sequence[Command]) -> Prepared:
    """Replaces the commands of a mission of plain commands. Raises InputError if they cannot be compiled."""
    steps: tuple[Step, ...] = steps_of_commands(commands)
    match prepared.mission.steps:
        case (Say() as said,):
            steps = (said.with_commands(tuple(commands)),)
        case (Do() as only,):
            steps = tuple(map(only.with_command, commands))
    mission = prepared.mission.model_copy(update={"steps": steps})
    return prepared.with_mission(mission)


def _patient(knowledge: Knowledge) -> Knowledge:
    """Lowers the charge at which a robot interrupts its own mission, because the fleet recalls the robot earlier."""
    battery = knowledge.battery.model_copy(update={"low": URGENT * knowledge.battery.low})
    return knowledge.model_copy(update={"battery": battery})


def charging_missions(world: World, knowledge: Knowledge, robots: Mapping[str, PlacedRobot]) -> Mapping[str, Prepared]:
    """Prepares a charging mission for each robot that has a dock."""
    charge = Command(task=basic().charge)
    setting = Setting(Request(commands=(str(charge),), world_name=world.name), world, _patient(knowledge), robots)
    steps = steps_of_commands([charge])
    return {
        name: setting.for_robot(name).compile(Mission.from_steps(steps, world=world.name, robot=name))
        for name, robot in robots.items()
        if robot.dock is not None
    }


def bid_for(mission: FleetMission, now: FleetRobot, low: float) -> Bid:
    """Returns a free robot's bid for a mission: problems, duration, and the charge left, at least `low`."""
    robot, planner = now.name, now.routes(mission)
    prepared = mission.options.get(robot)
    if prepared is None:
        other = next(iter(mission.options))
        return Bid(mission.number, robot, 0.0, 0.0, problems=(f"it is for {other}",))
    checked = _checked_from(now.pose, prepared, planner)
    taken, left = checked.estimate, now.charge - checked.estimate.charge
    problems = (*(error.message for error in checked.errors), *_out_of_reach(prepared, now.pose, planner))
    bid = Bid(mission.number, robot, 0.0, taken.duration_s, left, problems=problems)
    if left >= low or problems:
        return bid
    charged = prepared.knowledge.battery.charged
    if now.dock is None or now.dock.world.dock is None or charged - taken.charge < low:
        return replace(bid, problems=(f"its battery has {now.charge:.0%}, and {taken.charge:.0%} would be used",))
    to_dock = _checked_from(now.pose, now.dock, planner)
    again = _checked_from(now.dock.world.dock, prepared, planner)
    problems = tuple(error.message for error in (*to_dock.errors, *again.errors))
    full_s = charging_time_s(now.charge, charged)
    duration_s = to_dock.estimate.duration_s + full_s + again.estimate.duration_s
    return replace(bid, duration_s=duration_s, charge=charged - again.estimate.charge, charges=True, problems=problems)


def charging_time_s(charge: float, charged: float) -> float:
    """Duration of charging from one state of charge (0 to 1) to another, in s."""
    return max(0.0, charged - charge) / load_estimates().battery.charging_per_s


def _checked_from(pose: Pose2D, prepared: Prepared, planner: RoutePlanner) -> Checked:
    return check_prepared(replace(prepared, world=replace(prepared.world, start=pose)), planner)


def _out_of_reach(prepared: Prepared, pose: Pose2D, planner: RoutePlanner) -> Iterator[str]:
    """Yields a sentence for each object that the robot must take from a place that it cannot reach.

    A single robot would search elsewhere; in a fleet another robot can do it.
    """
    knowledge = prepared.knowledge
    for command in prepared.tree.commands:
        if not command.takes or command.object is None:
            continue
        place = None if command.goal is None else knowledge.place(command.goal)
        usual = knowledge.usual_surfaces(command.object.name) if place is None else (place,)
        surfaces = [name for spot in usual for name in knowledge.surfaces_in(spot)]
        views = [view for name in surfaces for view in knowledge.surfaces[name].viewpoints]
        poses, zones = (Pose2D(each.x, each.y, each.yaw) for each in views), prepared.tree.zones
        if surfaces and not any(is_reachable(planner, pose, view, zones) for view in poses):
            yield f"no path leads to the {place or surfaces[0]}, where it must take the {command.object}"


def is_reachable(planner: RoutePlanner, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> bool:
    """Returns whether a route within the zones leads from one pose to another."""
    try:
        planner.route(start, goal, zones)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class MissionProgress:
    """Progress of a mission.

    The first `done` commands are finished. In the command after them, `begun` is True once a skill that changes the
    world has begun, and `put` is True once such a skill has released an object.
    """

    done: int
    begun: bool = False
    put: bool = False


def is_plain(tree: CompiledTree) -> bool:
    """Returns whether a mission is a sequence of commands and nothing else."""
    commands = all(isinstance(step, Do | Say) for step in tree.steps) and len(tree.parts) == len(tree.commands)
    return commands and (len(tree.steps) == 1 or all(step.source is None for step in tree.steps))


def progress_of(tree: CompiledTree, statuses: Callable[[str], Status | None]) -> MissionProgress:
    """Returns the progress of a tree; `statuses` returns the last status of a node by its path id.

    Another robot can continue only before a command that begins with an empty gripper. A mission with more than plain
    commands counts as one command.
    """
    done = 0
    for number, part in enumerate(tree.parts if is_plain(tree) else ()):
        if statuses(part.node or part.path_id) is not Status.SUCCESS:
            break
        after = number + 1
        if after == len(tree.parts) or tree.commands[after].item is None:
            done = after
    over = {part.path_id for part in tree.parts[:done]}
    begun = [leaf for leaf in _changing(tree.mission, over) if statuses(leaf.path_id) in _TOUCHED]
    return MissionProgress(done, bool(begun), any(not leaf.options["skill"].gripper_after for leaf in begun))


def is_lost(tree: CompiledTree, statuses: Callable[[str], Status | None]) -> bool:
    """Returns whether a mission ended because its robot could not localise."""
    watches = (node for node in tree.root.walk() if node.behaviour.watches)
    lost = (node.path_id for node in watches if isinstance(node.options.get("condition"), KnowsPlace))
    return any(statuses(path_id) is Status.FAILURE for path_id in lost)


def _changing(node: NodeSpec, over: set[str]) -> list[NodeSpec]:
    """Returns the nodes below a node whose skills change the world, except nodes in the parts `over`."""
    if any(node.path_id == path or node.path_id.startswith(f"{path}/") for path in over):
        return []
    own = [node] if node.skill is not None and node.skill.changes_world else []
    return own + [leaf for child in node.children for leaf in _changing(child, over)]


class ProgressJournal:
    """Tracks the progress of a mission and reports each change; `last_known` is the last place of its object."""

    def __init__(self, tree: CompiledTree, tell: Callable[[MissionProgress], None]) -> None:
        self._tree, self._tell = tree, tell
        self._tracker = LastKnownTracker(tree.root)
        self._statuses: dict[str, Status] = {}
        self.progress = MissionProgress(0)

    def note(self, note: TickNote) -> None:
        """Updates the progress with the changes of a tick."""
        self._tracker.note(note.board, note.pose)
        if not note.changes:
            return
        for change in note.changes:
            if change.after.status is not Status.INVALID:  # a reset node keeps its last result
                self._statuses[change.path_id] = change.after.status
        progress = progress_of(self._tree, self._statuses.get)
        if progress != self.progress:
            self.progress = progress
            self._tell(progress)

    @property
    def last_known(self) -> LastKnown | None:
        """Last known place of the mission's object."""
        return self._tracker.last


@dataclass
class FleetRobot:
    """State of a robot in the fleet: pose and charge at the time `free_at_s` when it is next free (s, robots' clock).

    `dock` is its charging mission; None if it cannot charge.

    | the robot | its record |
    |---|---|
    | works | `mission` is the mission under way |
    | goes to its dock in the next round | `to_dock`; the auction lets it rest until it is charged |
    | leaves a table to another robot meanwhile | `leaves` is the number of the part that it has done there |
    | must stop | `recalled` is the reason |
    | gets no more work | `lost` is the reason |
    """

    placed: PlacedRobot
    pose: Pose2D
    charge: float = 1.0
    free_at_s: float = 0.0
    entry: RunEntry | None = None
    journal: ProgressJournal | None = None
    dock: Prepared | None = None
    planner: RoutePlanner | None = None
    faults: tuple[str, ...] = ()
    mission: FleetMission | None = None
    to_dock: bool = False
    leaves: int | None = None
    recalled: str | None = None
    lost: str | None = None

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.placed.name

    def ready_s(self, now_s: float, *, busy: bool) -> float:
        """Time until the robot is free (s); a robot that is late by 10 s is assumed to need another 10 s."""
        left_s = self.free_at_s - now_s
        return abs(left_s) if busy else max(0.0, left_s)

    def routes(self, mission: FleetMission) -> RoutePlanner:
        """Returns the route planner for the robot in the world of its missions."""
        if self.planner is None:
            world = next(iter(mission.options.values())).world
            self.planner = route_planner_of(world, self.placed, cached=False)
        return self.planner

    @property
    def progress(self) -> MissionProgress:
        """Progress of the robot's mission."""
        return MissionProgress(0) if self.journal is None else self.journal.progress

    @property
    def last_known(self) -> LastKnown | None:
        """Last known place of the object in the robot's mission."""
        return None if self.journal is None else self.journal.last_known


class Offers:
    """Bids of the robots, each computed once for the same state of the mission and the robot."""

    def __init__(
        self,
        robots: Mapping[str, FleetRobot],
        battery: BatteryFacts,
        now: Callable[[], float],
        auction: Auction,
        bid: Callable[[FleetMission, FleetRobot, float], Bid] = bid_for,
    ) -> None:
        """`now` returns the robots' clock (s); `bid` computes a bid as if the robot were free now."""
        self._robots, self._battery, self._now, self._auction, self._bid = robots, battery, now, auction, bid
        self._known: dict[tuple[int, str, int, Pose2D, float, bool], Bid] = {}

    def known(self, wanted: FleetMission, name: str) -> Bid:
        """Returns a robot's bid for a queued mission; computes it only if the mission or the robot has changed."""
        robot = self._robots[name]
        if (tried := wanted.tried.get(name)) is not None:
            return Bid(wanted.number, name, 0.0, 0.0, problems=(tried,))
        key = (wanted.number, name, len(wanted.shares), robot.pose, robot.charge, name in self._auction.resting)
        if key not in self._known:
            self._known[key] = self.new(wanted, name)
        return replace(self._known[key], ready_s=self._ready_s(name))

    def new(self, wanted: FleetMission, name: str) -> Bid:
        """Computes a robot's bid from the pose where the robot is next free; a charging robot bids from its dock."""
        robot = self._robots[name]
        robot.routes(wanted)
        if name in self._auction.resting and robot.dock is not None:
            robot = replace(robot, pose=robot.dock.world.dock or robot.pose, charge=self._battery.charged)
        return replace(self._bid(wanted, robot, self._battery.low), ready_s=self._ready_s(name))

    def _ready_s(self, name: str) -> float:
        """Time until a robot is free (s); a charging robot counts as busy."""
        busy = name in self._auction.resting or name in self._auction.under_way
        return self._robots[name].ready_s(self._now(), busy=busy)

    def takes_from(self, name: str, table: SurfaceFacts) -> bool:
        """Returns whether a robot that has bid before reaches an object that another robot puts on a table.

        The other robot puts the object on the free spot nearest to the table's first viewpoint.
        """
        robot, arm = self._robots[name], robot_kind(self._robots[name].placed.kind).capabilities().arm
        view, planner = table.viewpoints[0], robot.planner
        if arm is None or planner is None:
            return False
        x, y = min(surface_spots(table.polygon), key=lambda spot: float(np.hypot(*(spot - [view.x, view.y]))))
        yaws = [wrap(2.0 * math.pi * n / _HEADINGS) for n in range(_HEADINGS)]
        return any(
            is_reachable(planner, robot.pose, Pose2D(x - d_m * math.cos(yaw), y - d_m * math.sin(yaw), yaw))
            for d_m in arm.standing_m
            for yaw in yaws
        )


def missions_json(store: MissionStore, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Returns missions with robots and outcomes as JSON values; a split mission is returned with all its parts."""
    given = GivenMissions(store).all()
    missions = {mission.id: mission for mission in store.missions()}
    wanted = {*numbers, *(whole for number in numbers if (whole := given.get(number, GivenMission()).part_of))}
    wanted |= {number for number, each in given.items() if each.part_of in wanted}
    return [_mission_json(missions[number], given) for number in sorted(wanted)]


def _mission_json(mission: StoredMission, given: Mapping[int, GivenMission]) -> dict[str, Any]:
    known = given.get(mission.id, GivenMission())
    parts = [each.robot for each in given.values() if each.part_of == mission.id and each.robot is not None]
    return {
        "id": mission.id,
        "robot": parts[-1] if parts else known.robot,
        "outcome": mission.state.value,
        "referee": known.referee,
        "reassigned": known.reassigned,
        "message": mission.message,
        "part_of": known.part_of,
        "after": known.follows,
    }


def missions_message(store: MissionStore, rows: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """Returns the log message on missions: request, robot and outcome of each."""
    requests = {each.id: each.request for each in store.missions()}
    keys = ("id", "robot", "outcome", "reassigned", "message")
    missions = [
        {**{key: each[key] for key in keys}, "sentence": requests[each["id"]].sentence or requests[each["id"]].name}
        for each in rows
    ]
    return {"missions": missions}
