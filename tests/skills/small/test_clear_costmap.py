"""Tests of clearing the obstacle layer: the sensors fill it again."""

import dataclasses

import numpy as np
from planar_robot import Bench, Box

from skills.api import Cause, Succeeded
from skills.robot import Pose2D
from skills.small.clear_costmap import ClearCostmap, ClearCostmapInputs

CRATE = Box(4.4, 5.2, 4.8, 5.8, 0.0, 1.2)


def outcome(context, bench):
    return bench.run(ClearCostmap(context), ClearCostmapInputs())


def seen_bench():
    bench = Bench(Pose2D(3.0, 5.5, 0.0), unmapped=[CRATE])
    bench.tick(40)
    assert len(bench.costmap.obstacle_cells()) > 0
    return bench


def test_an_object_that_still_stands_there_is_seen_again():
    bench = seen_bench()
    assert isinstance(outcome(bench.context(), bench), Succeeded)
    assert len(bench.costmap.obstacle_cells()) > 0


def test_a_removed_obstacle_is_forgotten():
    bench = seen_bench()
    bench.robot.blocks.remove(CRATE)
    assert isinstance(outcome(bench.context(), bench), Succeeded)
    assert len(bench.costmap.obstacle_cells()) == 0


def test_the_surveyed_grid_stays():
    bench = seen_bench()
    near_wall = np.array([[0.5, 5.5]])
    before = bench.costmap.clearance_m(near_wall)
    assert bench.costmap.clear_obstacles() > 0
    assert len(bench.costmap.obstacle_cells()) == 0
    assert bench.costmap.clearance_m(near_wall) == before


def test_a_costmap_that_cannot_forget_is_a_failed_precondition():
    bench = seen_bench()
    assert outcome(dataclasses.replace(bench.context(), costmap=object()), bench).cause is Cause.PRECONDITION
