"""Two robots in each other's way; prints JSON.

    python -m tests.benchmarks.traffic [--what door,missions] [--first 0] [--count 5] [--jobs 1] [--out FOLDER]

`door`: the two meet at a door or passage that one fits through, each on its way to the place where the other begins;
world, door, kinds of robots, starts and delays are drawn from the case's number, and nobody else is about. `missions`:
each has a mission of its own. Reported are how many runs ended with both fulfilled (`resolved`: by the tree, and not
denied by the referee), contacts between the two and all collisions by the referee, and deadlocks: runs that stood
still for 60 s, or ran out of time.
"""

import math
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.run.visitor import RunVisitor
from executive.words.robot_config import RobotConfig
from plant.robots.robot_kind import robot_kind
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint, footprint_clearance_m
from skills.grid_map import load_grid_map
from skills.robot import Pose2D
from tests.benchmarks.harness import benchmark, for_each, totals
from tests.benchmarks.plant_mission import PlantMission

STILL_S, MOVED_M, TIME_LIMIT_S = 60.0, 0.1, 400.0
WORLDS, NAMES = ("flat", "lab"), ("Alice", "Bob")
PAIRS = (("spot", "spot"), ("spot", "fetch"), ("fetch", "spot"), ("fetch", "fetch"))
FOR_ONE_M, NEAR_M, FROM_DOOR_M, CLEAR_M, TRIES = 1.0, 9.0, (0.9, 3.0), 0.1, 400
DELAYS_S = (0, 0, 2, 4, 6)
GOING = {
    "flat": ("go to the bedroom", "go to the kitchen", "go to the office", "go to the workshop", "go to the hall"),
    "lab": ("go to the lounge", "go to the office", "go to the kitchen", "go to the meeting room", "go to the lobby"),
}
FETCHING = {
    "flat": ("fetch me a drink from the kitchen", "bring me a beer"),
    "lab": ("fetch me a drink from the kitchen", "bring me a drink"),
}
FETCHES = 0.3
"""Share of the missions of a Spot that are to fetch something."""


@dataclass
class Standing(RunVisitor):
    longest_s: float = 0.0
    _last: dict[str, Pose2D] = field(default_factory=dict)
    _moved_s: float = 0.0

    def tick(self, progress):
        for name, status in progress.robots.items():
            pose, last = status.pose, self._last.get(name)
            if pose is None:
                continue
            if last is None or math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m) > MOVED_M:
                self._last[name], self._moved_s = pose, progress.now_s
        self.longest_s = max(self.longest_s, progress.now_s - self._moved_s)


def meeting(number):
    """Two robots head-on at a door that one fits through, each on its way to the place where the other one begins."""
    rng = np.random.default_rng([number, 30])
    world = open_world(WORLDS[number % len(WORLDS)])
    knowledge = knowledge_of(world)
    grid = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
    doors, costmap = doors_for_one(knowledge), LayeredCostmap(grid)

    def start(kind, place, door):
        """Free pose in a place near a door, about facing it; None where there is none."""
        footprint = Footprint.of(robot_kind(kind).capabilities())
        low, high = (bound(knowledge.rooms[place], axis=0) for bound in (np.min, np.max))
        for _ in range(TRIES):
            away_m, angle = rng.uniform(*FROM_DOOR_M), rng.uniform(-math.pi, math.pi)
            x, y = door.at[0] + away_m * math.cos(angle), door.at[1] + away_m * math.sin(angle)
            pose = np.array([[x, y, angle + math.pi + rng.uniform(-0.5, 0.5)]])
            inside = low[0] < x < high[0] and low[1] < y < high[1]
            if inside and footprint_clearance_m(costmap, footprint, pose)[0] > CLEAR_M:
                return Pose2D(round(float(x), 3), round(float(y), 3), round(math.remainder(pose[0, 2], math.tau), 3))
        return None

    starts = [None]
    while None in starts:
        door = doors[rng.integers(len(doors))]
        kinds = PAIRS[rng.integers(len(PAIRS))]
        sides = list(door.between) if rng.integers(2) else list(reversed(door.between))
        starts = [start(kind, place, door) for kind, place in zip(kinds, sides, strict=True)]
    delays = (0, int(rng.choice(DELAYS_S)))
    asked = []
    for name, goal, late_s in zip(NAMES, sides[::-1], delays if rng.integers(2) else delays[::-1], strict=True):
        asked.append(f"{name}, {f'wait {late_s} seconds and then ' if late_s else ''}go to the {goal}")
    robots = tuple(RobotConfig(*each) for each in zip(NAMES, kinds, starts, strict=True))
    return world.name, ", and ".join(asked), robots


def doors_for_one(knowledge):
    """Doors that one robot fits through, with both places near."""

    def near(door, place):
        pose = knowledge.place_pose(place)
        return math.dist(door.at, (pose.x, pose.y)) < NEAR_M

    return [d for d in knowledge.doors if d.width < FOR_ONE_M and all(near(d, place) for place in d.between)]


def missions(number):
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


def cases(what: tuple[str, ...] = ("door",), first: int = 0, count: int = 5):
    return product(what, range(first, first + count))


def run_case(what, number, folder):
    world, sentence, robots = {"door": meeting, "missions": missions}[what](number)
    asked = {"sentence": sentence, "world": world, "time_limit_s": TIME_LIMIT_S, "robots": robots}

    def change(prepared):
        return prepared.world if what == "missions" else prepared.world.without_people()

    mission = PlantMission(folder, number, change=change, **asked)
    standing = Standing()
    report = mission.run(standing)
    seen = [each.referee for each in report.robots.values() if each.referee is not None]
    return {
        "what": what,
        "number": number,
        "world": world,
        "kinds": [robot.kind for robot in robots],
        "sentence": sentence,
        "resolved": all(each.achieved for each in report.robots.values()),
        "contacts": max(each.robots_hit for each in seen),
        "collisions": max(each.collisions for each in seen),
        "deadlock": standing.longest_s >= STILL_S or report.sim_time_s >= TIME_LIMIT_S,
        "stood_s": round(standing.longest_s, 1),
        "sim_time_s": report.sim_time_s,
        "messages": [each.message for each in report.robots.values()],
    }


def figures(results):
    return {
        "runs": len(results),
        **totals(results, "resolved", "contacts", "collisions"),
        "deadlocks": sum(each.deadlock for each in results),
        "longest_s": max(each.sim_time_s for each in results),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, for_each("what", figures))
