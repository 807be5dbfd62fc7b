"""Where the robots of a run stand at the beginning and where they charge: told, or found free on the map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from executive.mission.request import Start
from executive.mission.stack_file import load_stack
from executive.words.knowledge import Knowledge, Pose, RobotFacts
from executive.words.robots import RobotSetup, display_name
from plant.kinds import robot_kind
from plant.worlds.world import World
from skills.files.errors import InputError
from skills.navigate.footprint import Footprint
from skills.robot import Capabilities, FloatArray, Pose2D
from skills.stack import RobotStack

if TYPE_CHECKING:
    from skills.estimate.grid_map import GridMap

__all__ = ["DEFAULT_KIND", "PlacedRobot", "alone", "knowledge_for", "placed_robots", "stand_at"]

DEFAULT_KIND: Final = "spot"
TURNING_M: Final = 0.7
FROM_PEOPLE_M: Final = 1.2
BETWEEN_M: Final = 0.35
"""So much room is left between two robots that are told no start."""
_START_STREAM: Final = 7


@dataclass(frozen=True)
class PlacedRobot:
    """One robot of a run: its kind and stack, where it stands at the beginning and charges (world frame).

    Without a `dock` it charges where the world says; it is `told` where it stands, or finds that out.
    """

    kind: str
    start: Pose2D
    stack: RobotStack
    dock: Pose2D | None = None
    told: bool = True

    @property
    def capabilities(self) -> Capabilities:
        """What this kind of robot is and can do."""
        return robot_kind(self.kind).capabilities()


def placed_robots(world: World, knowledge: Knowledge, setups: Mapping[str, RobotSetup]) -> Mapping[str, PlacedRobot]:
    """The robots of a run by their names as people read them, in the order in which they are named.

    The first stands at the world's start and charges at its dock, where nothing else is said; each other one stands at
    the free pose that is nearest to there, and charges where it stands.

    Raises:
        InputError: two overlap, a robot stands in something, a dock or a stack is none, or there is no room.
    """
    from skills.estimate.grid_map import load_grid_map

    free = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    placed: dict[str, PlacedRobot] = {}
    told = {name: setup.start or (world.start if not number else None) for number, (name, setup) in _numbered(setups)}
    for number, (name, setup) in sorted(_numbered(setups), key=lambda each: told[each[1][0]] is None):
        try:
            start = told[name] or _free_start(free, world, setup, placed)
            if setup.start is not None:
                _refuse_overlap(name, setup.kind, start, placed, free)
            own = _dock(name, setup, knowledge) or (world.dock if number == 0 else start)
        except InputError as error:
            raise InputError.at(setup.source, error.message, hint=error.hint) from error
        stack = load_stack(setup.stack or robot_kind(setup.kind).stack)
        placed[display_name(name)] = PlacedRobot(setup.kind, start, stack, own)
    return {display_name(name): placed[display_name(name)] for name in setups}


def _numbered(setups: Mapping[str, RobotSetup]) -> Iterator[tuple[int, tuple[str, RobotSetup]]]:
    yield from enumerate(setups.items())


def _dock(name: str, setup: RobotSetup, knowledge: Knowledge) -> Pose2D | None:
    """The dock that is said. Raises InputError: it is no place."""
    if setup.dock is None:
        return None
    place = knowledge.place(setup.dock)
    if place is None:
        known = ", ".join(sorted(knowledge.places))
        raise InputError(f"the dock of {name}, '{setup.dock}', is no place", hint=f"known: {known}")
    pose = knowledge.place_pose(place)
    return Pose2D(pose.x, pose.y, pose.yaw)


def _free_start(free: GridMap, world: World, setup: RobotSetup, placed: Mapping[str, PlacedRobot]) -> Pose2D:
    """The free pose nearest to the world's start, clear of the robots that stand already and of where people may be.

    Raises InputError: there is none.
    """
    from plant.worlds.placement import people_stand_W

    reach_m = _reach_m(setup.kind)
    places = free.centres(np.argwhere(free.distance > max(TURNING_M, reach_m)))
    for other in placed.values():
        away_m = np.hypot(*(places - [other.start.x_m, other.start.y_m]).T)
        places = places[away_m > reach_m + _reach_m(other.kind) + BETWEEN_M]
    for person_W in people_stand_W(world):
        places = places[np.hypot(*(places - person_W).T) > FROM_PEOPLE_M]
    if not len(places):
        raise InputError(f"there is no room in {world.name} for one more robot", hint="leave one out, or give starts")
    x, y = places[np.argmin(np.hypot(*(places - [world.start.x_m, world.start.y_m]).T))]
    return Pose2D(float(x), float(y), world.start.yaw_rad)


def _refuse_overlap(name: str, kind: str, start: Pose2D, placed: Mapping[str, PlacedRobot], free: GridMap) -> None:
    """Raise InputError where a robot would stand in another, or in something."""
    own = _discs(kind, start)
    for other, one in placed.items():
        theirs = _discs(one.kind, one.start)
        apart = np.hypot(*(own[:, None, :2] - theirs[None, :, :2]).transpose(2, 0, 1))
        if np.any(apart < own[:, None, 2] + theirs[None, :, 2]):
            raise InputError(f"the starts of {display_name(name)} and {other} overlap", hint="put them further apart")
    if float(np.min(free.distance_m(own[:, :2]) - own[:, 2])) < 0.0:
        there = f"({start.x_m:g}, {start.y_m:g}, {start.yaw_rad:g})"
        raise InputError(f"at the start {there} {display_name(name)} stands in something", hint="give a free pose")


def _discs(kind: str, pose: Pose2D) -> FloatArray:
    """Discs (N, 3) of x, y and radius (m, world frame) that cover a robot of a kind at a pose."""
    discs = Footprint.of(robot_kind(kind).capabilities()).discs
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    middles = discs[:, :2] @ np.array([[c, s], [-s, c]]) + [pose.x_m, pose.y_m]
    return np.column_stack([middles, discs[:, 2]])


def _reach_m(kind: str) -> float:
    """How far the outline of a kind reaches from its middle."""
    return float(np.linalg.norm(np.array(robot_kind(kind).capabilities().footprint_m), axis=1).max())


def alone(
    world: World, *, seed: int = 0, stack: Path | None = None, start: Start | None = None, kind: str = DEFAULT_KIND
) -> PlacedRobot:
    """The only robot of a run, at the world's start or another, charging at the world's dock. Raises InputError."""
    pose = world.start if start is None else stand_at(world, start, seed)
    told = start is None or start.pose is not None
    return PlacedRobot(kind, pose, load_stack(stack or robot_kind(kind).stack), world.dock, told)


def knowledge_for(name: str, robot: PlacedRobot, names: Mapping[str, PlacedRobot], knowledge: Knowledge) -> Knowledge:
    """What one robot of several knows: its own name, start and dock, and the names of the others."""
    others = tuple(other for other in names if other != name)
    facts = RobotFacts(name=name, others=others, require_wake=knowledge.robot.require_wake)
    dock = None if robot.dock is None else _pose(robot.dock)
    return knowledge.model_copy(update={"robot": facts, "start": _pose(robot.start), "dock": dock})


def _pose(pose: Pose2D) -> Pose:
    return Pose(x=pose.x_m, y=pose.y_m, yaw=pose.yaw_rad)


def stand_at(world: World, start: Start, seed: int) -> Pose2D:
    """The pose of a start: its own, or a free one with room to turn, away from people, that the seed chooses.

    Raises InputError: there is nowhere.
    """
    if start.pose is not None:
        return start.pose
    from plant.worlds.placement import place_people
    from skills.estimate.grid_map import load_grid_map

    keepout = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    places = keepout.centres(np.argwhere(keepout.distance > TURNING_M))
    for person in place_people(world, seed):
        places = places[np.hypot(*(places - person.X_WO.translation()[:2]).T) > FROM_PEOPLE_M]
    if not len(places):
        raise InputError(f"there is nowhere in {world.name} where the robot can turn", hint="give --start X Y YAW")
    rng = np.random.default_rng([seed, _START_STREAM])
    x, y = places[rng.integers(len(places))]
    return Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))
