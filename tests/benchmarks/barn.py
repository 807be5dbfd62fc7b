"""How well the robot gets through narrow places that it has no map of: worlds in BARN's format; prints JSON.

    python -m tests.benchmarks.barn DIR [--worlds 3,9] [--stack FILE] [--seed 1] [--jobs 2] [--out FOLDER] [--json]

Each world is made of its cylinders; the robot is given no map, only the goal relative to its start. A run is a success
when the robot ends within 1 m of the goal and touched nothing on its way. As in the BARN challenge, its time runs from
when the robot has left the start by 0.1 m until it is within 1 m of the goal; `stood_s` is until it stands there.
"""

import json
import math
from pathlib import Path

import numpy as np

from errand_make.worlds.own import world_from_cylinders
from executive.mission.load import load_stack
from plant.worlds.world import load_world
from skills.grid_map import GridMap
from skills.navigate.skill import NavigateInputs
from skills.robot import Pose2D
from skills.stack import stack_file
from tests.benchmarks.driving import TICK_S, Driver
from tests.benchmarks.harness import benchmark, quantile, share

NEAR_M, LEFT_M, LIMIT_S, OPTIMAL_M_S = 1.0, 0.1, 100.0, 2.0
NO_MAP_STACK = stack_file(Path("no_map"))
NOTHING = GridMap(np.zeros((2, 2), dtype=bool), 1.0, (0.0, 0.0))


def cases(folder: Path, worlds: tuple[int, ...] = (), stack: Path = NO_MAP_STACK, seed: int = 1):
    """Numbers and files of the worlds, of all unless some are named, with the stack and the seed."""
    for number, file in sorted((int(file.stem.split("_")[1]), file) for file in folder.glob("world_*.json")):
        if number in worlds or not worlds:
            yield number, file, stack, seed


def run_case(number, file, stack, seed, folder):
    told = json.loads(file.read_text())
    start, goal = Pose2D(*told["start"]), told["goal"]
    world_from_cylinders(folder, told["cylinders"], start=start, around=[(start.x_m, start.y_m), tuple(goal)])
    driver = Driver(load_world(str(folder)), load_stack(stack), (NOTHING, NOTHING), seed=seed)
    trip = driver.go(NavigateInputs(Pose2D(*goal, start.yaw_rad), 0.5, 3.0, 1.6), limit_s=LIMIT_S)
    off_m = np.hypot(*(trip.poses[:, :2] - goal).T)
    left = np.hypot(*(trip.poses[:, :2] - trip.poses[0, :2]).T) > LEFT_M
    arrived = np.flatnonzero(off_m < NEAR_M)
    took_s = TICK_S * float(arrived[0] - int(np.argmax(left))) if len(arrived) and left.any() else LIMIT_S
    success = bool(len(arrived)) and not trip.hits and bool(off_m[-1] < NEAR_M)
    optimal_s = told["optimal_path_len"] / OPTIMAL_M_S
    return {
        "world": told["world"],
        "success": success,
        "collided": bool(trip.hits),
        "time_s": round(took_s, 2),
        "path_m": round(trip.path_m, 2),
        "score": round(success * optimal_s / float(np.clip(took_s, 2.0 * optimal_s, 8.0 * optimal_s)), 3),
        "stood_s": round(trip.time_s, 2),
        "plans": len(trip.planning_ms),
        "control_ms_median": quantile(trip.control_ms),
        "control_ms_p99": quantile(trip.control_ms, 0.99),
        "planning_ms_max": quantile(trip.planning_ms, 1.0, 1),
        "message": "; ".join((trip.message, *trip.hits)),
    }


def summary(runs):
    mean_score = round(math.fsum(run.score for run in runs) / len(runs), 4)
    return {"runs": runs, "success_rate": share([run.success for run in runs], 4), "mean_score": mean_score}


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
