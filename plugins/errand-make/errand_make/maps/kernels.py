"""Compiles the numeric code of making maps."""

from typing import Final

import numpy as np

from errand_make.maps.mapper import Mapper
from errand_make.maps.mppi import MppiOptions
from errand_make.maps.submap_matching import Window
from errand_make.maps.survey import Survey
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.simulated import simulate
from skills.footprint import Footprint
from skills.grid_map import load_grid_map
from skills.path import Path
from skills.robot import Pose2D
from skills.stack import default_stack

_WORLD: Final = "flat"
_TICK_S: Final = 0.05
_SURVEYED_S: Final = 4.0


def compile_kernels() -> None:
    """Begins a map and localises in it, to compile the functions that numba's cache lacks."""
    world, name = open_world(_WORLD), "Alice"
    simulation = simulate(world, {name: only_robot(name, world)}, seed=1, record=False)
    robot, clock, mapper = simulation.robots[name], simulation.clock, Mapper(world.start)
    survey = Survey(robot, robot.acquire_lease("errand warm-up"), mapper, home=world.start)
    while clock.now() < _SURVEYED_S and not survey.done:
        clock.advance(_TICK_S)
        survey.tick(clock.now())
    path = Path(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.full(2, 1.0))
    controller = MppiOptions().build(path, Footprint.of(robot.capabilities()), max_speed_m_s=1.0)
    costmap = default_stack().costmap.build(load_grid_map(world.keepout_map_path))
    controller.command(Pose2D(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), np.zeros(3), costmap)
    mapper.find_in(mapper.submaps[0], mapper.keyframes[0].points_F, mapper.pose, Window(0.5, 0.1))
