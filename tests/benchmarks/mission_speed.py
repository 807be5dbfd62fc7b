"""How fast a fetch mission runs, alone, with recording and page, and beside the plant alone with a robot that drives.

    python -m tests.benchmarks.mission_speed [--repeat 3] [--seed 1] [--world flat]

Each round measures all three on the same machine one after the other, so that their ratios hold on a busy one, too.
Prints JSON. `errand run --profile` tells where the time goes.
"""

import tempfile
import time

from plant.simulation import Simulation
from plant.worlds.world import load_world
from tests.benchmarks.errand_process import report_of, run_errand
from tests.benchmarks.harness import command, quantile, tell

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"
DRIVING_S, TICK_S = 30.0, 0.05


def mission_factor(world, seed, *options):
    """Simulated seconds in a second of wall time of `errand run`."""
    with tempfile.TemporaryDirectory() as out:
        common = ["--world", world, "--seed", seed, "--quiet", "--json", "--out", out]
        report = report_of(run_errand("run", "--say", SENTENCE, *common, *options).stdout)
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


def measure(repeat: int = 3, seed: int = 1, world: str = "flat"):
    rounds = []
    for _ in range(repeat):
        mission, plant = mission_factor(world, seed, "--no-record"), plant_factor(world, seed)
        shown = mission_factor(world, seed, "--view", "0")
        rounds.append({"mission": mission, "recorded_and_shown": shown, "plant": plant, "ratio": mission / plant})
        tell(rounds[-1])
    return {name: quantile([each[name] for each in rounds]) for name in rounds[0]}


if __name__ == "__main__":
    command(measure)
