"""How much faster than real time the plant runs, and what its parts cost; each as a ratio in `extra_info`."""

import pytest

from plant.simulation import Simulation
from plant.snapshot_file import SnapshotWriter
from plant.worlds.world import load_world

SECOND_S = 1.0


@pytest.fixture(scope="module")
def simulation():
    return Simulation(load_world("flat"), seed=1)


def test_one_second_of_walking_in_the_flat(benchmark, simulation):
    spot, clock = simulation.robots["Alice"], simulation.clock
    lease = spot.take_lease("benchmark")

    def walk():
        for _ in range(20):
            spot.drive(0.0, 0.0, 0.5, until_s=clock.now() + 0.3, lease=lease)
            clock.advance(SECOND_S / 20)

    benchmark.pedantic(walk, rounds=5, warmup_rounds=1)
    benchmark.extra_info["simulated time per wall time"] = round(SECOND_S / benchmark.stats["median"], 2)


@pytest.mark.parametrize("source", ["hand", "frontleft"])
def test_one_picture(benchmark, simulation, source):
    spot = simulation.robots["Alice"]
    benchmark.pedantic(lambda: spot.image(source), rounds=5, warmup_rounds=1)
    benchmark.extra_info["pictures per second"] = round(1.0 / benchmark.stats["median"], 1)


def test_one_snapshot_of_the_state(benchmark, simulation, tmp_path):
    writer = SnapshotWriter(tmp_path / "often.plant", simulation.engine, simulation.referee, {})
    benchmark.pedantic(writer, rounds=50, warmup_rounds=5)
    benchmark.extra_info["snapshots per second"] = round(1.0 / benchmark.stats["median"], 1)
