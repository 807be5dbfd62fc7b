import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from planar_robot import OUTLINE, TWO_ROOMS, Box, grid_of

import plant
from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint, footprint_clear, footprint_clearance_m, pose_array
from skills.grid_map import load_grid_map
from skills.navigate.planner import LatticePlanner, NoPathError, plan_path
from skills.path import path_length
from skills.robot import Pose2D

FOOTPRINT = Footprint.rectangle(OUTLINE)
LEFT_ROOM, RIGHT_ROOM = Pose2D(1.5, 2.0, 0.0), Pose2D(8.5, 2.0, -1.57)


def costmap_of(*more):
    return LayeredCostmap(grid_of([*TWO_ROOMS, *more], (0.05, 1.0)))


def test_clearance_of_the_outline_is_exact_at_sides_ends_and_corners():
    wall = LayeredCostmap(grid_of([Box(-3.0, 1.0, 3.0, 1.4), Box(-3.0, -3.0, 3.0, -2.9)], (0.05, 1.0)))
    poses = np.array([[0.0, 0.5, 0.0], [0.0, 0.3, math.pi / 2], [0.0, 0.3, math.pi / 4]])
    corner = math.sqrt(0.5) * (0.55 + 0.25)
    assert footprint_clearance_m(wall, FOOTPRINT, poses) == pytest.approx([0.25, 0.15, 0.7 - corner], abs=0.02)


@pytest.fixture(scope="module")
def path():
    """From the left room to the right one."""
    return plan_path(costmap_of(), FOOTPRINT, LEFT_ROOM, RIGHT_ROOM)


def test_path_leads_through_both_doors_with_clearance(path):
    assert footprint_clearance_m(costmap_of(), FOOTPRINT, path.poses).min() >= LatticePlanner().margin_m - 0.01
    for door_x in (2.45, 7.45):
        inside = np.abs(path.poses[:, 1] - 4.05) < 0.05
        assert np.min(np.abs(path.poses[inside, 0] - door_x)) < 0.2
    assert 8.0 < path_length(path) < 12.5


def test_equal_problems_give_equal_paths(path):
    assert np.array_equal(path.poses, plan_path(costmap_of(), FOOTPRINT, LEFT_ROOM, RIGHT_ROOM).poses)


def test_ends_are_exactly_start_and_goal(path):
    assert path.start == LEFT_ROOM
    assert (path.goal.x_m, path.goal.y_m) == (RIGHT_ROOM.x_m, RIGHT_ROOM.y_m)
    assert math.remainder(path.goal.yaw_rad - RIGHT_ROOM.yaw_rad, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_poses_are_close_together_and_yaw_is_continuous(path):
    steps = np.abs(np.diff(path.poses, axis=0))
    assert np.hypot(steps[:, 0], steps[:, 1]).max() < 0.1
    assert steps[:, 2].max() < 0.25


def test_long_paths_are_driven_forwards(path):
    steps = np.diff(path.poses, axis=0)
    ahead = np.cos(path.poses[:-1, 2]) * steps[:, 0] + np.sin(path.poses[:-1, 2]) * steps[:, 1]
    assert ahead[ahead > 0].sum() > 0.9 * path_length(path)


def test_turning_about_needs_no_travel():
    assert path_length(plan_path(costmap_of(), FOOTPRINT, Pose2D(2.5, 2.0, 0.0), Pose2D(2.5, 2.0, 3.1))) < 0.5


def test_the_least_margin_applies_where_no_path_keeps_more():
    costmap = costmap_of()
    with pytest.raises(PlanningError):
        plan_path(costmap, FOOTPRINT, LEFT_ROOM, RIGHT_ROOM, LatticePlanner(margin_m=0.25, least_margin_m=0.25))
    path = plan_path(costmap, FOOTPRINT, LEFT_ROOM, RIGHT_ROOM, LatticePlanner(margin_m=0.25, least_margin_m=0.1))
    assert 0.09 < path.clearance_m.min() < 0.25


IN_CUPBOARD = Pose2D(1.0, 0.7, 0.0)


@pytest.mark.parametrize(
    ("boxes", "start", "goal", "error", "message"),
    [
        ((), LEFT_ROOM, IN_CUPBOARD, PlanningError, r"goal \(1\.00, 0\.70\) is blocked"),
        ((), LEFT_ROOM, Pose2D(30.0, 2.0, 0.0), PlanningError, "blocked"),
        ((), IN_CUPBOARD, RIGHT_ROOM, PlanningError, "stands in an obstacle"),
        ([Box(2.0, 4.0, 2.9, 4.1)], LEFT_ROOM, RIGHT_ROOM, NoPathError, "There is no path"),
        ([Box(2.0, 4.0, 2.4, 4.1)], LEFT_ROOM, RIGHT_ROOM, NoPathError, "path"),
    ],
    ids=["blocked goal", "off the map", "start in an obstacle", "closed door", "narrow door"],
)
def test_without_a_path_an_error_is_raised(boxes, start, goal, error, message):
    with pytest.raises(error, match=message):
        plan_path(costmap_of(*boxes), FOOTPRINT, start, goal)


def test_a_path_leaves_a_start_slightly_in_collision():
    costmap = costmap_of()
    start = Pose2D(0.53, 2.0, 0.0)  # its rear is 2 cm in the wall
    assert not footprint_clear(costmap, FOOTPRINT, start, 0.0)
    path = plan_path(costmap, FOOTPRINT, start, RIGHT_ROOM)
    assert footprint_clearance_m(costmap, FOOTPRINT, path.poses).min() > -0.06
    beyond = np.hypot(path.poses[:, 0] - start.x_m, path.poses[:, 1] - start.y_m) > 0.7
    assert footprint_clearance_m(costmap, FOOTPRINT, path.poses[beyond]).min() > 0.04


def test_goal_at_an_odd_heading_in_a_tight_place_is_found():
    slot = [Box(-0.1, -2.0, 6.0, -0.4), Box(-0.1, 0.4, 1.3, 2.0), Box(-0.1, -0.4, 0.0, 0.4), Box(5.9, -2.0, 6.0, 3.0)]
    costmap = LayeredCostmap(grid_of(slot, (0.05, 1.0)))
    goal = Pose2D(0.68, 0.0, 0.1)
    path = plan_path(costmap, FOOTPRINT, Pose2D(4.0, 1.5, 2.0), goal)
    assert (path.goal.x_m, path.goal.y_m) == (goal.x_m, goal.y_m)
    assert math.remainder(path.goal.yaw_rad - goal.yaw_rad, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_all_pairs_of_places_of_the_flat_can_be_planned():
    flat = Path(plant.__file__).parent / "worlds" / "flat"
    knowledge = yaml.safe_load((flat / "knowledge.yaml").read_text())
    poses = [Pose2D(*(place["pose"][key] for key in ("x", "y", "yaw"))) for place in knowledge["places"].values()]
    costmap = LayeredCostmap(load_grid_map(flat / "truth" / "keepout.yaml"))
    assert (footprint_clearance_m(costmap, FOOTPRINT, pose_array(poses)) > 0.1).all()
    for start, goal in zip(poses, poses[1:] + poses[:1], strict=True):
        path = plan_path(costmap, FOOTPRINT, start, goal)
        assert footprint_clearance_m(costmap, FOOTPRINT, path.poses).min() > 0.05
