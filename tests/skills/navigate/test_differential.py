"""Paths and commands for a base that drives ahead or back and turns on the spot."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_robot import TWO_ROOMS, Box, grid_of
from wheeled_toy import BODY, TOY

from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint, footprint_clearance_m
from skills.navigate.follower import FollowerOptions, corners_of, tracking_velocity
from skills.navigate.planner import LatticePlanner, NoPathError, plan_path
from skills.path import Path, path_length
from skills.robot import BaseKind, Pose2D
from tests.benchmarks.differential import BASE, drive

LONG = replace(Footprint.rectangle(BODY), base_kind=BaseKind.DIFFERENTIAL)
LEFT_ROOM, RIGHT_ROOM = Pose2D(1.5, 2.0, 0.0), Pose2D(8.5, 2.0, -1.57)
OPEN = (Box(-0.1, -5.0, 0.0, 5.0), Box(9.9, -5.0, 10.0, 5.0), Box(-0.1, -5.0, 10.0, -4.9), Box(-0.1, 4.9, 10.0, 5.0))
DEAD_END = (*OPEN, Box(0.0, 0.4, 1.6, 4.9), Box(0.0, -4.9, 1.6, -0.4))
"""A corridor 0.8 m wide, from x = 0 to 1.6, with a wall at its end."""
L_SHAPE = (Box(0.0, 0.0, 3.0, 3.0), Box(-0.3, -1.3, 4.3, -1.2), Box(4.2, -1.3, 4.3, 4.0), Box(-0.3, -1.2, -0.2, 1.0))
"""A corridor 1.2 m wide under and beside a block, round its corner at (3, 0)."""


def costmap_of(*boxes):
    return LayeredCostmap(grid_of(boxes, (0.05, 1.0)))


def motion(path):
    """Metres ahead (negative: back) and aside, and radians, of each step."""
    steps = np.diff(path.poses, axis=0)
    yaw = path.poses[:-1, 2] + 0.5 * steps[:, 2]
    ahead = np.cos(yaw) * steps[:, 0] + np.sin(yaw) * steps[:, 1]
    return ahead, -np.sin(yaw) * steps[:, 0] + np.cos(yaw) * steps[:, 1], steps[:, 2]


ROUTES = {
    "through two doors": (TWO_ROOMS, LEFT_ROOM, RIGHT_ROOM),
    "a narrow door": ((*TWO_ROOMS, Box(2.75, 4.0, 2.9, 4.1)), LEFT_ROOM, Pose2D(1.2, 5.5, math.pi)),
    "a corner": (L_SHAPE, Pose2D(0.5, -0.6, 0.0), Pose2D(3.6, 3.0, math.pi / 2)),
    "a goal beside": (OPEN, Pose2D(3.0, 0.0, 0.0), Pose2D(3.0, 0.4, 0.0)),
    "a goal behind": (OPEN, Pose2D(5.0, 0.0, 0.0), Pose2D(2.0, 0.0, 0.0)),
    "about": (OPEN, Pose2D(5.0, 0.0, 0.0), Pose2D(5.0, 0.0, 3.0)),
    "out of a dead end": (DEAD_END, Pose2D(0.6, 0.0, math.pi), Pose2D(5.0, 2.0, 1.0)),
    "into a dead end": (DEAD_END, Pose2D(5.0, 2.0, 1.0), Pose2D(0.6, 0.0, math.pi)),
}


@pytest.mark.parametrize("footprint", [BASE, LONG], ids=["square", "long"])
@pytest.mark.parametrize("route", ROUTES)
def test_no_path_goes_sideways_and_all_keep_their_clearance(route, footprint):
    boxes, start, goal = ROUTES[route]
    costmap = costmap_of(*boxes)
    path = plan_path(costmap, footprint, start, goal)
    _, aside, turns = motion(path)
    assert np.abs(aside).max() < 0.002
    assert np.abs(turns).max() < 0.25
    assert footprint_clearance_m(costmap, footprint, path.poses).min() > LatticePlanner().margin_m - 0.015
    assert path.start == start
    assert (path.goal.x_m, path.goal.y_m) == pytest.approx((goal.x_m, goal.y_m), abs=1e-9)
    assert math.remainder(path.goal.yaw_rad - goal.yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_dead_end_is_left_backwards_by_a_base_that_cannot_turn_in_it():
    boxes, start, goal = ROUTES["out of a dead end"]
    path = plan_path(costmap_of(*boxes), LONG, start, goal)
    ahead, _, turns = motion(path)
    inside = path.poses[:-1, 0] < 1.4
    assert ahead[inside].max() <= 1e-6 and ahead[inside].sum() < -0.7
    assert np.abs(turns[inside]).sum() < 0.3


def test_a_goal_beside_is_reached_by_turning_and_an_omnidirectional_base_just_shifts():
    boxes, start, goal = ROUTES["a goal beside"]
    costmap = costmap_of(*boxes)
    _, _, turns = motion(plan_path(costmap, LONG, start, goal))
    assert np.abs(turns).sum() > 1.5
    _, aside, turns = motion(plan_path(costmap, replace(LONG, base_kind=BaseKind.OMNIDIRECTIONAL), start, goal))
    assert aside.sum() == pytest.approx(0.4, abs=0.05) and np.abs(turns).sum() < 0.2


def test_paths_are_about_as_short_as_those_of_an_omnidirectional_base():
    costmap = costmap_of(*TWO_ROOMS)
    free = path_length(plan_path(costmap, replace(BASE, base_kind=BaseKind.OMNIDIRECTIONAL), LEFT_ROOM, RIGHT_ROOM))
    assert path_length(plan_path(costmap, BASE, LEFT_ROOM, RIGHT_ROOM)) < 1.08 * free


def test_corners_are_rounded_where_there_is_clearance():
    ahead, _, turns = motion(plan_path(costmap_of(*TWO_ROOMS), BASE, LEFT_ROOM, RIGHT_ROOM))
    assert np.count_nonzero((np.abs(turns) > 0.02) & (np.abs(ahead) > 0.01)) > 20


def test_a_missing_path_raises_an_error():
    with pytest.raises(NoPathError, match="There is no path"):
        plan_path(costmap_of(*TWO_ROOMS, Box(2.0, 4.0, 2.9, 4.1)), BASE, LEFT_ROOM, RIGHT_ROOM)
    with pytest.raises(PlanningError, match="blocked"):
        plan_path(costmap_of(*TWO_ROOMS), BASE, LEFT_ROOM, Pose2D(1.0, 0.7, 0.0))


def test_the_footprint_takes_the_base_kind_from_the_capabilities():
    assert Footprint.of(TOY).base_kind is BaseKind.OMNIDIRECTIONAL
    assert Footprint.of(replace(TOY, base_kind=BaseKind.DIFFERENTIAL)).base_kind is BaseKind.DIFFERENTIAL


def test_a_round_outline_is_one_disc():
    circle = [(0.28 * math.cos(a), 0.28 * math.sin(a)) for a in np.linspace(0.0, math.tau, 16, endpoint=False)]
    footprint = Footprint.of(replace(TOY, footprint_m=tuple(circle)))
    assert footprint.discs == pytest.approx(np.array([[0.0, 0.0, 0.28]]))
    assert footprint.circumscribed_m == pytest.approx(0.28)


@pytest.mark.parametrize("route", ROUTES)
def test_the_base_drives_there_and_no_command_goes_sideways(route):
    boxes, start, goal = ROUTES[route]
    driven = drive(costmap_of(*boxes), LONG, start, goal, FollowerOptions(), limit_s=90.0)
    assert driven.reached, driven.pose
    assert (driven.commands[:, 1] == 0.0).all()
    assert driven.least_m > 0.02


def test_off_its_path_it_steers_back_ahead_and_in_reverse():
    left_of_it = np.array([0.0, -0.1, 0.0])  # the path lies to the right
    here = np.zeros(3)
    assert tracking_velocity(here, 0.0, np.array([0.5, 0.0, 0.0]), left_of_it, 1.6)[2] < 0.0
    assert tracking_velocity(here, 0.0, np.array([-0.3, 0.0, 0.0]), left_of_it, 1.6)[2] > 0.0


def test_far_off_the_heading_it_turns_on_the_spot():
    velocity = tracking_velocity(np.zeros(3), 1.0, np.array([0.3, 0.4, 0.0]), np.array([0.0, 0.0, 1.0]), 1.6)
    assert velocity[:2] == pytest.approx([0.0, 0.0]) and velocity[2] > 0.0


def test_corners_are_where_turning_begins_and_ends_and_where_the_direction_changes():
    poses = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0, 0.2], [0.1, 0, 0], [0.2, 0, 0], [0.1, 0, 0]])
    assert corners_of(Path(poses, np.ones(len(poses)))).tolist() == [1, 3, 4]


def test_a_turn_on_the_spot_shorter_than_a_step_is_still_made():
    # A path of 0.04 rad on the spot, less than 2 cm long: the base turns to its end.
    turn_rad = 0.04
    path = Path(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, turn_rad]]), np.full(2, 3.0))
    follower = FollowerOptions().build(path, BASE, max_speed_m_s=0.8)
    command = follower.command(Pose2D(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), np.zeros(3), costmap_of(*OPEN))
    assert command.velocity[2] > 0.01
