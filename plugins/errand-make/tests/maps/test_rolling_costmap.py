from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from errand_make.maps.rolling_costmap import RollingCostmap, RollingCostmapOptions
from executive.tree.registry import installed_skills
from skills.api import Succeeded
from skills.inputs.yaml_source import read_yaml
from skills.robot import Pose2D
from skills.stack import stack_of
from tests.skills.planar_robot import TWO_ROOMS, Bench, Box

START = Pose2D(1.5, 5.4, 0.0)
NAVIGATE = installed_skills()["navigate"]
ODOMETRY = stack_of({"localiser": {"use": "dead_reckoning"}}).localiser
PERSON = Box(3.2, 5.2, 3.6, 5.6, 0.0, 1.7)


def bench_of(*more, start=START, **options):
    bench = Bench(start, surveyed=[*TWO_ROOMS, *more], component=ODOMETRY, cameras=False)
    bench.costmap = RollingCostmap(RollingCostmapOptions(**options))
    return bench


def ticked(bench, ticks=20):
    bench.tick(ticks)
    return bench


def test_before_the_first_scan_all_is_free():
    assert RollingCostmap().clearance_m(np.array([[3.0, 4.0]]))[0] > 1.0


def test_walls_stand_where_the_beams_end_within_a_cell():
    off = ticked(bench_of()).costmap.clearance_m(np.array([[3.5, 4.6], [3.5, 5.9], [1.5, 4.3]]))
    assert off == pytest.approx([0.5, 1.0, 0.2], abs=0.05)  # no more than 1 m near the robot


def test_a_gap_is_as_wide_as_it_is_in_spite_of_noise():
    bench = ticked(bench_of(), 100)
    across = np.column_stack([np.linspace(2.0, 2.9, 91), np.full(91, 4.05)])
    free = across[bench.costmap.clearance_m(across) > 0.0, 0]
    assert free.max() - free.min() == pytest.approx(0.9, abs=0.09)


def test_obstacles_too_near_for_the_lidar_stay():
    bench = ticked(bench_of(Box(1.2, 5.75, 1.4, 5.85, 0.0, 1.0)), 1)
    bench.robot.push(0.0, -0.5, 0.0)
    ticked(bench)
    bench.robot.push(0.0, 0.5, 0.0)
    ticked(bench, 40)
    assert bench.costmap.clearance_m(np.array([[1.3, 5.78]]))[0] < 0.05


def test_obstacles_out_of_sight_are_remembered():
    bench = ticked(bench_of())
    bench.robot.push(7.0, 0.0, 0.0)
    ticked(bench)
    assert bench.costmap.clearance_m(np.array([[0.5, 4.05]]))[0] < 0.05


def test_the_costmap_can_be_cleared():
    bench = ticked(bench_of())
    assert bench.costmap.clear_obstacles() > 100
    assert bench.costmap.clearance_m(np.array([[3.5, 4.05]]))[0] > 0.3


def test_a_person_who_leaves_is_cleared_and_unseen_ground_is_a_little_free():
    bench = ticked(bench_of(PERSON))
    behind = np.array([[4.6, 5.4]])
    assert bench.costmap.clearance_m(np.array([[3.22, 5.4]]))[0] < 0.05
    assert bench.costmap.clearance_m(behind)[0] <= RollingCostmapOptions().unknown_clearance_m
    bench.robot.blocks.remove(PERSON)
    ticked(bench, 40)
    assert bench.costmap.clearance_m(np.array([[3.4, 5.4]]))[0] > 0.5
    assert bench.costmap.clearance_m(behind)[0] > RollingCostmapOptions().unknown_clearance_m


def test_the_window_follows_the_robot_and_keeps_its_cells():
    bench = ticked(bench_of(window_m=8.0))
    before = bench.costmap.clearance_m(np.array([[4.0, 4.6]]))[0]
    bench.robot.push(3.0, 0.0, 0.0)
    ticked(bench, 2)
    assert bench.costmap.clearance_m(np.array([[4.0, 4.6]]))[0] == pytest.approx(before, abs=0.05)
    assert bench.costmap.clearance_m(np.array([[7.0, 6.9]]))[0] == pytest.approx(0.1, abs=0.06)


def test_only_new_obstacles_count_as_unexplained():
    bench = ticked(bench_of())
    assert len(bench.costmap.unexplained_returns()[1]) < 20
    bench.robot.blocks.append(PERSON)
    ticked(bench, 2)
    near = bench.costmap.unexplained_returns()[1]
    assert np.count_nonzero(np.hypot(near[:, 0] - 3.3, near[:, 1] - 5.4) < 0.5) > 20


def test_robot_plans_around_a_new_obstacle_without_standing():
    bench, pillar = ticked(bench_of(start=Pose2D(2.2, 5.4, 0.0)), 10), Box(6.2, 5.3, 6.4, 5.6, 0.0, 1.7)
    skill, speeds = NAVIGATE(bench.context(), NAVIGATE.Options(review_m=5.0)), []

    def pillar_appears():
        x = bench.robot.pose.x_m
        if x > 3.0 and pillar not in bench.robot.blocks:
            bench.robot.blocks.append(pillar)
        if 3.2 < x < 6.5:
            speeds.append(float(bench.robot.velocity[0]))

    step = bench.run(skill, NAVIGATE.Inputs(Pose2D(7.6, 5.4, 0.0)), each=pillar_appears)
    assert isinstance(step, Succeeded), step.message
    assert bench.robot.least_clearance_m > 0.03
    assert min(speeds) > 0.1
    assert bench.worker.names.count("plan a path") >= 2


def test_the_stack_for_unknown_places_uses_it():
    (registered,) = entry_points(group="errand.stacks", name="no_map")
    stack = stack_of(read_yaml(Path(registered.load().__file__).with_name("no_map_stack.yaml")).data)
    assert stack.names["costmap"] == "rolling"
