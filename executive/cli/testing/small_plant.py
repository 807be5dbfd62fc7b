"""The small plant: Spot in one room with a table and a can, with contact and noisy sensors, and its estimators."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from executive.app.robots import shared_detector
from executive.testing.bench import SkillBench
from executive.testing.small_room import write_small_room
from plant.simulation import Simulation
from plant.worlds.world import World, load_world
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import load_grid_map
from skills.estimate.localiser import ScanMatchingLocaliser

ROBOT_NAME = "Alice"


@dataclass(frozen=True)
class SmallPlant:
    """The simulated room: `bench` runs skills with the robot in it; its clock steps the plant."""

    world: World
    simulation: Simulation
    bench: SkillBench


def make_small_plant(folder: Path, *, seed: int = 1, can: bool = True) -> SmallPlant:
    """Write the world into `folder` and put the robot into it, at (-0.5, 0) and 1.7 m before the table."""
    world = load_world(write_small_room(folder, can=can))
    simulation = Simulation(world, seed=seed, robots={ROBOT_NAME: "spot"}, visuals=False)
    bench = SkillBench(
        simulation.robots[ROBOT_NAME],
        simulation.clock,
        localiser=ScanMatchingLocaliser(load_grid_map(world.scan_map_path), world.start),
        costmap=LayeredCostmap(load_grid_map(world.keepout_map_path)),
        detector=shared_detector(),
        seed=seed,
    )
    return SmallPlant(world, simulation, bench)
