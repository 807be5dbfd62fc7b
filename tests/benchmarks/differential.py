"""How well a base that cannot go sideways drives to random poses on a world's surveyed map; prints JSON.

    python -m tests.benchmarks.differential [--goals 30] [--worlds shop,lab] [--seed 1] [--controller path_follower]

A kinematic base, 0.56 x 0.56 m, that knows its pose; its velocity follows the commands with a lag. Each goal is free
for its footprint, with 8 cm around, and can be planned to. A goal is reached within 5 cm and 3 degrees.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import plant
from skills.api import Costmap, PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import GridMap, load_grid_map
from skills.geometry import compose, relative_pose
from skills.navigate.footprint import Footprint, footprint_clear, footprint_clearance_m, pose_array
from skills.navigate.planner import LatticePlanner
from skills.robot import BaseKind, Pose2D
from skills.stack import ControllerComponent, components

HALF_M, TICK_S, LAG_S, SPEED_M_S = 0.28, 0.05, 0.12, 0.8
REACHED = (0.05, math.radians(3.0))
BASE = replace(
    Footprint.rectangle([(HALF_M, HALF_M), (-HALF_M, HALF_M), (-HALF_M, -HALF_M), (HALF_M, -HALF_M)]),
    base_kind=BaseKind.DIFFERENTIAL,
)


@dataclass(frozen=True)
class Driven:
    """One drive: whether it reached its goal, the time (s), the least clearance (m), all commands (N, 3)."""

    reached: bool
    time_s: float
    least_m: float
    commands: np.ndarray
    pose: Pose2D


def drive(
    costmap: Costmap,
    footprint: Footprint,
    start: Pose2D,
    goal: Pose2D,
    controller: ControllerComponent,
    *,
    limit_s: float = 180.0,
) -> Driven:
    """Plan once and follow until the base stands at the goal. Raises PlanningError."""
    path = LatticePlanner().problem(costmap, footprint, start, goal, max_speed_m_s=SPEED_M_S)()
    follower = controller.build(path, footprint, max_speed_m_s=SPEED_M_S)
    pose, velocity, last, commands, least_m = start, np.zeros(3), np.zeros(3), [], math.inf
    for _ in range(round(limit_s / TICK_S)):
        answer = follower.command(pose, (velocity[0], velocity[1], velocity[2]), last, costmap)
        last = np.array(answer.velocity)
        commands.append(last)
        for _ in range(5):
            velocity = velocity + (last - velocity) * min(1.0, 0.2 * TICK_S / LAG_S)
            pose = compose(pose, Pose2D(*(0.2 * TICK_S * velocity).tolist()))
        least_m = min(least_m, float(footprint_clearance_m(costmap, footprint, pose_array([pose]))[0]))
        off = relative_pose(goal, pose)
        near = math.hypot(off.x_m, off.y_m) < 0.4 * REACHED[0] and abs(off.yaw_rad) < 0.4 * REACHED[1]
        if near and float(np.max(np.abs(velocity))) < 0.05:
            break
    off = relative_pose(goal, pose)
    reached = math.hypot(off.x_m, off.y_m) <= REACHED[0] and abs(off.yaw_rad) <= REACHED[1]
    return Driven(reached, TICK_S * len(commands), least_m, np.array(commands), pose)


def surveyed(world: str) -> GridMap:
    """The surveyed keep-out grid of a shipped world."""
    folder = Path(plant.__file__).parent / "worlds" / world
    return load_grid_map(folder / "map" / "keepout.yaml").with_unknown_blocked()


def goals(grid: GridMap, costmap: Costmap, footprint: Footprint, seed: int) -> Iterator[Pose2D]:
    """Random poses that the footprint fits at."""
    rng = np.random.default_rng([seed, 27])
    free = grid.centres(np.argwhere(grid.distance > footprint.inscribed_m))
    while True:
        x, y = (float(value) for value in free[rng.integers(len(free))])
        pose = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        if footprint_clear(costmap, footprint, pose, 0.08):
            yield pose


def measure(world: str, count: int, seed: int, controller: str) -> dict[str, object]:
    """Drive from goal to goal."""
    grid = surveyed(world)
    costmap, component = LayeredCostmap(grid), components("controller")[controller]()
    poses = goals(grid, costmap, BASE, seed)
    here, drives, no_way = next(poses), [], 0
    begun = time.perf_counter()
    for goal in poses:
        try:
            driven = drive(costmap, BASE, here, goal, component)
        except PlanningError as error:
            no_way += 1
            print(f"{world}: {error}", file=sys.stderr, flush=True)
            continue
        here = driven.pose if driven.reached else goal
        drives.append(driven)
        told = f"{world} {len(drives)}: {driven.reached}, {driven.time_s:.1f} s, least {driven.least_m:.3f} m"
        print(told, file=sys.stderr, flush=True)
        if len(drives) == count:
            break
    return {
        "world": world,
        "goals": len(drives),
        "reached": sum(each.reached for each in drives),
        "without_a_way": no_way,
        "least_clearance_m": round(min(each.least_m for each in drives), 3),
        "most_sideways_m_s": max(float(np.abs(each.commands[:, 1]).max()) for each in drives),
        "wall_time_s": round(time.perf_counter() - begun, 1),
    }


def main() -> None:
    """Measure each world."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goals", type=int, default=30)
    parser.add_argument("--worlds", default="shop,lab")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--controller", default="path_follower")
    given = parser.parse_args()
    print(json.dumps([measure(each, given.goals, given.seed, given.controller) for each in given.worlds.split(",")]))


if __name__ == "__main__":
    main()
