"""How fast a fetch mission runs, alone, with recording and page, and beside the plant alone with a robot that drives.

    python -m tests.benchmarks.mission_speed [--repeat 3] [--seed 1] [--world flat]

Each round measures all three on the same machine one after the other, so that their ratios hold on a busy one, too.
`errand run --profile` tells where the time goes.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time

from plant.simulation import Simulation
from plant.worlds.world import load_world

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"
DRIVING_S, TICK_S = 30.0, 0.05


def mission_factor(world, seed, *options):
    """Simulated seconds in a second of wall time of `errand run`."""
    with tempfile.TemporaryDirectory() as out:
        common = ["--say", SENTENCE, "--world", world, "--seed", str(seed), "--quiet", "--json", "--out", out]
        command = [sys.executable, "-m", "executive.cli.entry", "run", *common, *options]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    report = json.loads(done.stdout.splitlines()[-1])
    assert report["outcome"] == "success", report["message"]
    return report["real_time_factor"]


def plant_factor(world, seed):
    """The same of the plant while the robot drives in a small circle and nothing else is done, pictures included."""
    simulation = Simulation(load_world(world), seed=seed)
    clock, robot = simulation.clock, simulation.robots["Alice"]
    lease = robot.acquire_lease("benchmark")
    clock.advance(1.0)
    begin = time.perf_counter()
    for _ in range(round(DRIVING_S / TICK_S)):
        robot.drive(0.3, 0.0, 0.6, until_s=clock.now() + 2 * TICK_S, lease=lease)
        clock.advance(TICK_S)
    return DRIVING_S / (time.perf_counter() - begin)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--world", default="flat")
    options = parser.parse_args()
    rounds = []
    for number in range(options.repeat):
        stack = mission_factor(options.world, options.seed, "--no-record")
        shown = mission_factor(options.world, options.seed, "--view", "--view-for", "0")
        plant = plant_factor(options.world, options.seed)
        rounds.append((stack, shown, plant, stack / plant))
        print(f"round {number + 1}: mission {stack:.2f}, recorded and shown {shown:.2f}, plant alone {plant:.2f}")
    stack, shown, plant, ratio = (statistics.median(column) for column in zip(*rounds, strict=True))
    print(f"median: mission {stack:.2f}, recorded and shown {shown:.2f}, plant alone {plant:.2f}, ratio {ratio:.2f}")


if __name__ == "__main__":
    main()
