"""The robots of a run with their starts and docks, given by the user or found on the map."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from executive.app.prepare.worlds import free_ground
from executive.mission.load import load_stack
from executive.mission.request import Start
from executive.words.knowledge import DOCK, Knowledge, Pose, RobotFacts
from executive.words.robot_config import RobotConfig
from plant.robots.robot_kind import PlacedRobot, robot_kind
from plant.worlds.world import World
from skills.detection import DetectorComponent, with_defaults
from skills.footprint import Footprint
from skills.inputs.errors import InputError
from skills.inputs.plugins import RECOGNISERS, PluginDefect, distribution_of, installed_plugins, run_plugin
from skills.robot import FloatArray, Pose2D
from skills.stack import RobotStack, default_component, default_stack

if TYPE_CHECKING:
    from skills.detection import Detector, Recogniser
    from skills.world_model import Tag


DEFAULT_KIND: Final = "spot"
TURNING_M: Final = 0.7
FROM_PEOPLE_M: Final = 1.2
BETWEEN_M: Final = 0.35
"""Clearance between two robots whose starts are chosen."""
_START_STREAM: Final = 7


def robot_stack(robot: PlacedRobot) -> RobotStack:
    """Loads the components of a robot's stack. Raises InputError with file and line if the file cannot be used."""
    return load_stack(robot.stack_file)


def reported_classes(robot: PlacedRobot) -> frozenset[str]:
    """Classes of a robot's own detector; empty for the default one. Raises InputError if its files cannot be used."""
    stack = None if robot.stack_file is None else robot_stack(robot)
    own = stack is not None and stack.detector != default_component("detector")
    return frozenset(shared_detector(stack).class_names if own else ())


def placed_robots(world: World, knowledge: Knowledge, configs: Sequence[RobotConfig]) -> Mapping[str, PlacedRobot]:
    """Places the robots of a run in the world; returns them by name, in the order of `configs`.

    By default the first robot stands at the world's start and charges at the world's dock. Each other robot stands at
    the nearest free pose, and charges there.

    Raises:
        InputError: two robots overlap, a robot stands in an obstacle, a dock is no place, or there is no free pose.
    """
    placed: dict[str, PlacedRobot] = {}
    given = {each.name: each.start or (world.start if each is configs[0] else None) for each in configs}
    for each in sorted(configs, key=lambda one: given[one.name] is None):
        try:
            start = given[each.name] or _free_start(world, each.kind, placed.values())
            if each.start is not None:
                _refuse_overlap(each, each.start, placed.values(), world)
            dock = _dock(each, knowledge) or (world.dock if each is configs[0] else start)
        except InputError as error:
            raise error if each.source is None else error.within(each.source.file, each.source.line) from error
        placed[each.name] = PlacedRobot(each.name, each.kind, start, dock, each.stack)
    return {each.name: placed[each.name] for each in configs}


def only_robot(
    name: str,
    world: World,
    *,
    start: Start | None = None,
    stack: Path | None = None,
    seed: int = 0,
    kind: str = DEFAULT_KIND,
) -> PlacedRobot:
    """Places the only robot of a run, by default at the world's start; it charges there. Raises InputError."""
    pose = world.start if start is None else stand_at(world, start, seed)
    return PlacedRobot(name, kind, pose, world.dock, stack, start != "unknown")


def _dock(robot: RobotConfig, knowledge: Knowledge) -> Pose2D | None:
    """Returns the pose of the dock that the user names. Raises InputError if it is no place."""
    if robot.dock is None:
        return None
    place = knowledge.place(robot.dock)
    if place is None:
        known = ", ".join(sorted(knowledge.places))
        raise InputError(f"the dock of {robot.name}, '{robot.dock}', is no place", hint=f"known: {known}")
    return knowledge.place_pose(place).pose_2d()


def _free_start(world: World, kind: str, placed: Iterable[PlacedRobot]) -> Pose2D:
    """Returns the free pose nearest to the world's start that keeps clear of other robots and of people's places.

    Raises InputError if there is no free pose.
    """
    from plant.worlds.seeding import standing_points_W

    reach_m, free = _reach_m(kind), free_ground(world)
    places = free.centres(np.argwhere(free.distance > max(TURNING_M, reach_m)))
    for other in placed:
        away_m = np.hypot(*(places - [other.start.x_m, other.start.y_m]).T)
        places = places[away_m > reach_m + _reach_m(other.kind) + BETWEEN_M]
    for person_W in standing_points_W(world):
        places = places[np.hypot(*(places - person_W).T) > FROM_PEOPLE_M]
    if not len(places):
        what = f"there is no free place in {world.name} for one more robot"
        raise InputError(what, hint="leave one out, or give starts")
    x, y = places[np.argmin(np.hypot(*(places - [world.start.x_m, world.start.y_m]).T))]
    return Pose2D(float(x), float(y), world.start.yaw_rad)


def _refuse_overlap(robot: RobotConfig, start: Pose2D, placed: Iterable[PlacedRobot], world: World) -> None:
    """Raises InputError if the robot's body would overlap another robot or an obstacle at a start."""
    own = _discs(robot.kind, start)
    for other in placed:
        theirs = _discs(other.kind, other.start)
        apart = np.hypot(*(own[:, None, :2] - theirs[None, :, :2]).transpose(2, 0, 1))
        if np.any(apart < own[:, None, 2] + theirs[None, :, 2]):
            raise InputError(f"the starts of {robot.name} and {other.name} overlap", hint="put them further apart")
    refuse_blocked(world, start, robot.name, robot.kind)


def refuse_blocked(world: World, pose: Pose2D, name: str = "the robot", kind: str = DEFAULT_KIND) -> None:
    """Raises InputError unless a robot's body is in free space at a pose, by the world's surveyed map."""
    if clearance_m(world, [kind], pose) < 0.0:
        there = f"({pose.x_m:g}, {pose.y_m:g}, {pose.yaw_rad:g})"
        hint = "give a free pose; `errand world show` draws the world"
        raise InputError(f"at the start {there} {name} stands in an obstacle or outside of {world.name}", hint=hint)


def clearance_m(world: World, kinds: Iterable[str], pose: Pose2D) -> float:
    """Clearance (m) of a body of one of these kinds, by default Spot's, at a pose; negative if none is free."""
    bodies, ground = [_discs(kind, pose) for kind in kinds or [DEFAULT_KIND]], free_ground(world)
    return max(float(np.min(ground.distance_m(discs[:, :2]) - discs[:, 2])) for discs in bodies)


def _discs(kind: str, pose: Pose2D) -> FloatArray:
    """Returns discs that cover a kind of robot at a pose: (N, 3) of x, y and radius, in metres in the world frame."""
    discs = Footprint.of(robot_kind(kind).capabilities()).discs
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    middles = discs[:, :2] @ np.array([[c, s], [-s, c]]) + [pose.x_m, pose.y_m]
    return np.column_stack([middles, discs[:, 2]])


def _reach_m(kind: str) -> float:
    """Largest distance from the origin of a robot's footprint to its outline, in metres."""
    return float(np.linalg.norm(np.array(robot_kind(kind).capabilities().footprint_m), axis=1).max())


def knowledge_for(robot: PlacedRobot, names: Iterable[str], knowledge: Knowledge) -> Knowledge:
    """Returns the knowledge of one robot among several: its own name, start and dock, and the names of the others."""
    others = tuple(other for other in names if other != robot.name)
    facts = RobotFacts(name=robot.name, others=others, require_wake=knowledge.robot.require_wake)
    dock = None if robot.dock is None else _pose(robot.dock)
    tags = tuple(tag for tag in knowledge.tags if tag.on != DOCK or dock == knowledge.dock)
    return knowledge.model_copy(update={"robot": facts, "start": _pose(robot.start), "dock": dock, "tags": tags})


def _pose(pose: Pose2D) -> Pose:
    return Pose(x=pose.x_m, y=pose.y_m, yaw=pose.yaw_rad)


def stand_at(world: World, start: Start, seed: int) -> Pose2D:
    """Returns the given start, or a free pose that the seed chooses, away from people and with space to turn.

    Raises InputError if there is no such pose.
    """
    if isinstance(start, Pose2D):
        return start
    from plant.worlds.seeding import place_people

    keepout = free_ground(world)
    places = keepout.centres(np.argwhere(keepout.distance > TURNING_M))
    for person in place_people(world, seed):
        places = places[np.hypot(*(places - person.X_WO.translation()[:2]).T) > FROM_PEOPLE_M]
    if not len(places):
        raise InputError(f"there is nowhere in {world.name} where the robot can turn", hint="give --start X Y YAW")
    rng = np.random.default_rng([seed, _START_STREAM])
    x, y = places[rng.integers(len(places))]
    return Pose2D(float(x), float(y), float(rng.uniform(-math.pi, math.pi)))


@cache
def _built(component: DetectorComponent) -> Detector:
    return with_defaults(component.build())


def shared_detector(stack: RobotStack | None = None, world: World | None = None, tags: Sequence[Tag] = ()) -> Detector:
    """Returns the detector of a stack (None: the default one), extended by the world's own objects and its tags.

    Loads the networks once in a process. Raises InputError if a model or a recogniser cannot be used.
    """
    detector = _built((stack or default_stack()).detector)
    folders = () if world is None else tuple(each.folder for each in world.own_objects.values())
    for entry in sorted(installed_plugins(RECOGNISERS), key=lambda entry: entry.name) if folders or tags else ():
        try:
            recogniser: Recogniser = run_plugin(entry, entry.load)
            detector = run_plugin(entry, partial(recogniser, detector, folders, tags))
        except PluginDefect as defect:
            if isinstance(defect.__cause__, InputError):
                raise defect.__cause__ from defect
            raise _cannot_recognise(entry, str(defect)) from defect
        if not callable(getattr(detector, "detect", None)):
            raise _cannot_recognise(entry, "it returns no detector")
    return detector


def _cannot_recognise(entry: EntryPoint, why: str) -> InputError:
    what = f"cannot use recogniser '{entry.name}' ({entry.value}) of {distribution_of(entry)}: {why}"
    return InputError(what, hint="repair or uninstall that distribution")
