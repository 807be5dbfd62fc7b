"""How well a base that cannot go sideways drives to random poses on a world's surveyed map; prints JSON.

    python -m tests.benchmarks.differential [--goals 30] [--worlds shop,lab] [--seed 1] [--controller path_follower]

A kinematic base, 0.56 x 0.56 m, that knows its pose; its velocity follows the commands with a lag. Each goal is free
for its footprint, with 8 cm around, and can be planned to. A goal is reached within 5 cm and 3 degrees.
"""

import math
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from plant.worlds.world import load_world
from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint, footprint_clearance_m, pose_array
from skills.geometry import compose
from skills.navigate.planner import LatticePlanner
from skills.robot import BaseKind, Pose2D
from skills.stack import components
from tests.benchmarks.driving import TICK_S, free_poses, maps_of, within
from tests.benchmarks.harness import command, tell, totals

HALF_M, LAG_S, SPEED_M_S = 0.28, 0.12, 0.8
REACHED = (0.05, math.radians(3.0))
CORNERS = [(HALF_M, HALF_M), (-HALF_M, HALF_M), (-HALF_M, -HALF_M), (HALF_M, -HALF_M)]
BASE = replace(Footprint.rectangle(CORNERS), base_kind=BaseKind.DIFFERENTIAL)


def drive(costmap, footprint, start, goal, controller, *, limit_s=180.0):
    """Plans once and follows until the base stands at the goal: time (s), least clearance (m), all commands (N, 3).

    Raises PlanningError.
    """
    path = LatticePlanner().problem(costmap, footprint, start, goal, max_speed_m_s=SPEED_M_S)()
    follower = controller.build(path, footprint, max_speed_m_s=SPEED_M_S)
    pose, velocity, last, commands, least_m = start, np.zeros(3), np.zeros(3), [], math.inf
    for _ in range(round(limit_s / TICK_S)):
        last = np.array(follower.command(pose, tuple(velocity), last, costmap).velocity)
        commands.append(last)
        for _ in range(5):
            velocity = velocity + (last - velocity) * min(1.0, 0.2 * TICK_S / LAG_S)
            pose = compose(pose, Pose2D(*(0.2 * TICK_S * velocity).tolist()))
        least_m = min(least_m, float(footprint_clearance_m(costmap, footprint, pose_array([pose]))[0]))
        near = within(goal, pose, (0.4 * REACHED[0], 0.4 * REACHED[1]))
        if near and float(np.max(np.abs(velocity))) < 0.05:
            break
    ended = {"reached": within(goal, pose, REACHED), "pose": pose, "least_m": least_m}
    return SimpleNamespace(**ended, time_s=TICK_S * len(commands), commands=np.array(commands))


def measure(
    goals: int = 30, worlds: tuple[str, ...] = ("shop", "lab"), seed: int = 1, controller: str = "path_follower"
):
    return [measure_world(each, goals, seed, components("controller")[controller]()) for each in worlds]


def measure_world(world, count, seed, controller):
    grid = maps_of(load_world(world))[1]
    costmap, poses = LayeredCostmap(grid), free_poses(grid, BASE, seed)
    here, drives, no_way = next(poses), [], 0
    begun = time.perf_counter()
    while len(drives) < count:
        goal = next(poses)
        try:
            driven = drive(costmap, BASE, here, goal, controller)
        except PlanningError as error:
            no_way += 1
            tell(f"{world}: {error}")
            continue
        here = driven.pose if driven.reached else goal
        drives.append(driven)
        tell(f"{world} {len(drives)}: {driven.reached}, {driven.time_s:.1f} s, least {driven.least_m:.3f} m")
    return {
        "world": world,
        "goals": len(drives),
        **totals(drives, "reached"),
        "without_a_way": no_way,
        "least_clearance_m": round(min(each.least_m for each in drives), 3),
        "most_sideways_m_s": max(float(np.abs(each.commands[:, 1]).max()) for each in drives),
        "wall_time_s": round(time.perf_counter() - begun, 1),
    }


if __name__ == "__main__":
    command(measure)
