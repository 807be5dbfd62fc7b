"""How well the robot gets through narrow places that it has no map of: worlds in BARN's format; prints JSON.

    python -m tests.benchmarks.barn DIR [--worlds 3,9] [--jobs 2] [--stack FILE] [--json]

Each world is made of its cylinders; the robot is given no map, only the goal relative to its start. A run is a success
when the robot ends within 1 m of the goal and touched nothing on its way. As in the BARN challenge, its time runs from
when the robot has left the start by 0.1 m until it is within 1 m of the goal; `stood_s` is until it stands there.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from executive.mission.load import load_stack
from plant.worlds.builder.own import world_from_cylinders
from plant.worlds.world import load_world
from skills.estimate.grid_map import GridMap
from skills.navigate.skill import NavigateInputs
from skills.robot import Pose2D
from tests.benchmarks.driving import TICK_S, Driver

NEAR_M, LEFT_M, LIMIT_S, OPTIMAL_M_S = 1.0, 0.1, 100.0, 2.0
NO_MAP_STACK = Path(__file__).parents[2] / "skills" / "no_map_stack.yaml"


@dataclass(frozen=True)
class Run:
    """One world's result, rounded."""

    world: int
    success: bool
    collided: bool
    time_s: float
    path_m: float
    score: float
    stood_s: float
    plans: int
    control_ms_median: float
    control_ms_p99: float
    planning_ms_max: float
    message: str


def drive(file: Path, stack_file: Path, seed: int) -> Run:
    """Drive through one world."""
    told = json.loads(file.read_text())
    start, goal = Pose2D(*told["start"]), told["goal"]
    nothing = GridMap(np.zeros((2, 2), dtype=bool), 1.0, (0.0, 0.0))
    with tempfile.TemporaryDirectory() as folder:
        world_from_cylinders(Path(folder), told["cylinders"], start=start, around=[(start.x_m, start.y_m), tuple(goal)])
        driver = Driver(load_world(folder), load_stack(stack_file), (nothing, nothing), seed=seed)
        trip = driver.go(NavigateInputs(Pose2D(*goal, start.yaw_rad), 0.5, 3.0, 1.6), limit_s=LIMIT_S)
    off_m = np.hypot(*(trip.poses[:, :2] - goal).T)
    left = np.hypot(*(trip.poses[:, :2] - trip.poses[0, :2]).T) > LEFT_M
    arrived = np.flatnonzero(off_m < NEAR_M)
    took_s = TICK_S * (arrived[0] - int(np.argmax(left))) if len(arrived) and left.any() else LIMIT_S
    collided, success = bool(trip.hits), bool(len(arrived)) and not trip.hits and bool(off_m[-1] < NEAR_M)
    optimal_s = told["optimal_path_len"] / OPTIMAL_M_S
    score = success * optimal_s / float(np.clip(took_s, 2.0 * optimal_s, 8.0 * optimal_s))
    control = trip.control_ms or (0.0,)
    return Run(
        told["world"],
        success,
        collided,
        round(float(took_s), 2),
        round(trip.path_m, 2),
        round(score, 3),
        round(trip.time_s, 2),
        len(trip.planning_ms),
        round(float(np.median(control)), 2),
        round(float(np.percentile(control, 99)), 2),
        round(max(trip.planning_ms, default=0.0), 1),
        "; ".join((trip.message, *trip.hits)),
    )


def _drive(job: tuple[Path, Path, int]) -> Run:
    begun = time.perf_counter()
    run = drive(*job)
    wall_s = time.perf_counter() - begun
    told = f"world {run.world}: {run.score:.3f} {run.time_s:.1f} s, {run.path_m:.1f} m, {run.message} ({wall_s:.0f} s)"
    print(told, file=sys.stderr, flush=True)
    return run


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--worlds", help="such as 3,9,15; all that there are unless said")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stack", type=Path, default=NO_MAP_STACK)
    parser.add_argument("--json", action="store_true", help="one line of JSON at the end, and nothing else")
    options = parser.parse_args()
    files = sorted(options.folder.glob("world_*.json"), key=lambda file: int(file.stem.split("_")[1]))
    if options.worlds:
        chosen = {int(each) for each in options.worlds.split(",")}
        files = [file for file in files if int(file.stem.split("_")[1]) in chosen]
    jobs = [(file, options.stack, options.seed) for file in files]
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        runs = pool.map(_drive, jobs, chunksize=1)
    if not runs:
        sys.exit("there are no such worlds")
    result = {
        "runs": [asdict(run) for run in runs],
        "success_rate": round(sum(run.success for run in runs) / len(runs), 4),
        "mean_score": round(math.fsum(run.score for run in runs) / len(runs), 4),
    }
    print(json.dumps(result, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
