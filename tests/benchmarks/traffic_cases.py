"""Cases of two robots in each other's way, drawn from a number: equal numbers give equal cases."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from executive.app.worlds import knowledge_of, open_world
from executive.words.knowledge import Door, Knowledge
from executive.words.robot_config import RobotConfig
from plant.robots.robot_kind import robot_kind
from plant.worlds.world import World
from skills.estimate.grid_map import GridMap, load_grid_map
from skills.navigate.footprint import Footprint, footprint_clearance_m
from skills.robot import Pose2D

WORLDS = ("flat", "lab")
PAIRS = (("spot", "spot"), ("spot", "fetch"), ("fetch", "spot"), ("fetch", "fetch"))
NAMES = ("Alice", "Bob")
FOR_ONE_M = 1.0
NEAR_M = 9.0
FROM_DOOR_M = (0.9, 3.0)
DELAYS_S = (0, 0, 2, 4, 6)
ROOM_M = 0.1
TRIES = 400
GOING = {
    "flat": ("go to the bedroom", "go to the kitchen", "go to the office", "go to the workshop", "go to the hall"),
    "lab": ("go to the lounge", "go to the office", "go to the kitchen", "go to the meeting room", "go to the lobby"),
}
FETCHING = {
    "flat": ("fetch me a drink from the kitchen", "bring me a beer"),
    "lab": ("fetch me a drink from the kitchen", "bring me a drink"),
}
FETCHES = 0.3
"""The share of the missions of a Spot that are to fetch something."""


@dataclass(frozen=True)
class Meeting:
    """Two robots on both sides of a door, each on its way to the place where the other one begins."""

    world: str
    door: str
    robots: tuple[RobotConfig, ...]
    places: Mapping[str, str]
    delays_s: Mapping[str, int]

    @property
    def sentence(self) -> str:
        """What the two are asked to do."""
        return ", and ".join(f"{robot.name}, {self._asked(robot.name)}" for robot in self.robots)

    def _asked(self, name: str) -> str:
        wait = f"wait {self.delays_s[name]} seconds and then " if self.delays_s[name] else ""
        return f"{wait}go to the {self.places[name]}"


@dataclass(frozen=True)
class Costs:
    """A costmap of the surveyed grid alone."""

    grid: GridMap

    def clearance_m(self, points_W: np.ndarray) -> np.ndarray:
        """As the grid has it."""
        return self.grid.distance_m(points_W)


def meeting(number: int) -> Meeting:
    """One case of two robots head-on at a door that one fits through."""
    rng = np.random.default_rng([number, 30])
    world = open_world(WORLDS[number % len(WORLDS)])
    knowledge = knowledge_of(world)
    doors = doors_for_one(knowledge)
    while True:
        door = doors[rng.integers(len(doors))]
        kinds = PAIRS[rng.integers(len(PAIRS))]
        sides = list(door.between) if rng.integers(2) else list(reversed(door.between))
        starts = [_start(kind, place, door, world, knowledge, rng) for kind, place in zip(kinds, sides, strict=True)]
        if None not in starts:
            break
    delays = (0, int(rng.choice(DELAYS_S)))
    late = dict(zip(NAMES, delays if rng.integers(2) else delays[::-1], strict=True))
    robots = tuple(RobotConfig(*each) for each in zip(NAMES, kinds, starts, strict=True))
    return Meeting(world.name, " and ".join(door.between), robots, dict(zip(NAMES, reversed(sides), strict=True)), late)


def doors_for_one(knowledge: Knowledge) -> Sequence[Door]:
    """Doors that one robot fits through, with both places near."""
    return [
        door
        for door in knowledge.doors
        if door.width < FOR_ONE_M
        and all(
            math.dist(door.at, (pose.x, pose.y)) < NEAR_M
            for pose in (knowledge.place_pose(place) for place in door.between)
        )
    ]


def _start(
    kind: str, place: str, door: Door, world: World, knowledge: Knowledge, rng: np.random.Generator
) -> Pose2D | None:
    """A free pose in a place near a door, about facing it; None: there is none."""
    grid = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    footprint = Footprint.of(robot_kind(kind).capabilities())
    low, high = (bound(knowledge.places[place].polygon, axis=0) for bound in (np.min, np.max))
    for _ in range(TRIES):
        away_m, angle = rng.uniform(*FROM_DOOR_M), rng.uniform(-math.pi, math.pi)
        x, y = door.at[0] + away_m * math.cos(angle), door.at[1] + away_m * math.sin(angle)
        pose = np.array([[x, y, angle + math.pi + rng.uniform(-0.5, 0.5)]])
        inside = low[0] < x < high[0] and low[1] < y < high[1]
        if inside and footprint_clearance_m(Costs(grid), footprint, pose)[0] > ROOM_M:  # type: ignore[arg-type]
            return Pose2D(round(float(x), 3), round(float(y), 3), round(math.remainder(pose[0, 2], math.tau), 3))
    return None


def missions(number: int) -> tuple[str, str, tuple[RobotConfig, ...]]:
    """A world, a sentence with a mission for each of two robots, and the robots."""
    rng = np.random.default_rng([number, 31])
    world = WORLDS[number % len(WORLDS)]
    kinds = PAIRS[rng.integers(len(PAIRS))]
    first, second = (str(each) for each in rng.choice(GOING[world], 2, replace=False))
    fetches = rng.uniform(size=2) < FETCHES
    if fetches[0] and kinds[0] == "spot":
        first = str(rng.choice(FETCHING[world]))
    elif fetches[1] and kinds[1] == "spot":
        second = str(rng.choice(FETCHING[world]))
    robots = tuple(RobotConfig(name, kind) for name, kind in zip(NAMES, kinds, strict=True))
    return world, f"Alice, {first}, and Bob, {second}", robots
