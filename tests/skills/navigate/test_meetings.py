"""Robots that meet where only one fits: one makes way, and both arrive."""

import math

import pytest
from planar_robot import TWO_ROOMS
from traffic_floor import Floor

from skills.api import Failed
from skills.robot import BaseKind, Pose2D
from skills.testing.blocks import Block, grid_of

UP, DOWN = math.pi / 2.0, -math.pi / 2.0
ROUND, OBLONG = BaseKind.DIFFERENTIAL, BaseKind.OMNIDIRECTIONAL
DEAD_END = (
    Block(-0.1, -0.1, 8.1, 0.0),
    Block(-0.1, 0.9, 5.0, 1.0),
    Block(-0.1, 0.0, 0.0, 0.9),
    Block(5.0, 0.9, 5.1, 4.0),
    Block(5.0, 4.0, 8.1, 4.1),
    Block(8.0, 0.0, 8.1, 4.0),
)
"""A corridor for one, 5 m long and closed at x = 0, that ends in a room of 3 m by 4 m."""


@pytest.fixture(scope="module")
def rooms():
    """Two rooms under a corridor, joined by doors of 0.9 m."""
    return grid_of(TWO_ROOMS, (0.05, 1.0))


@pytest.mark.parametrize("kinds", [pytest.param((OBLONG, OBLONG), marks=pytest.mark.nightly), (ROUND, OBLONG)])
def test_two_robots_that_swap_places_through_a_door_both_arrive(rooms, kinds):
    """One robot backs out, the other passes, then the first follows; they never touch."""
    floor = Floor(rooms)
    floor.send("alice", Pose2D(2.4, 5.0, DOWN), Pose2D(2.5, 2.6, DOWN), base_kind=kinds[0])
    floor.send("bob", Pose2D(2.5, 2.6, UP), Pose2D(2.4, 5.0, UP), base_kind=kinds[1])
    assert floor.run(until_s=120.0)
    assert floor.apart_m > 0.05


def test_robots_swap_priority_when_one_is_stuck_in_a_dead_end(rooms):
    """Alice claims first and wants in; Bob has no waiting place behind him, so the two swap priorities."""
    floor = Floor(grid_of(DEAD_END, (0.05, 1.0)))
    floor.send("alice", Pose2D(6.2, 0.45, math.pi), Pose2D(1.0, 0.45, math.pi))
    floor.send("bob", Pose2D(1.0, 0.45, 0.0), Pose2D(6.5, 3.2, 0.0))
    assert floor.run(until_s=120.0)
    assert floor.apart_m > 0.05


def test_an_idle_robot_clears_a_reserved_path_and_stays_aside(rooms):
    """Bob arrives in a door first; Alice, who comes later, gets through it."""
    floor = Floor(rooms)
    floor.send("bob", Pose2D(7.4, 3.0, UP), Pose2D(7.45, 4.05, UP))
    floor.send("alice", Pose2D(7.4, 5.8, DOWN), Pose2D(7.4, 2.2, DOWN), after_s=6.0)
    assert floor.run(until_s=120.0)
    bob = floor.robots["bob"].pose
    assert math.hypot(bob.x_m - 7.45, bob.y_m - 4.05) > 0.5
    assert floor.apart_m > 0.05


def test_an_idle_robot_off_all_paths_stays(rooms):
    """Bob stands in the room; Alice passes above it."""
    floor = Floor(rooms)
    floor.send("bob", Pose2D(7.4, 1.5, UP), Pose2D(7.4, 1.5, UP))
    floor.send("alice", Pose2D(1.5, 5.5, 0.0), Pose2D(7.4, 5.5, 0.0))
    assert floor.run(until_s=60.0)
    assert floor.robots["bob"].pose.y_m == pytest.approx(1.5, abs=0.1)


def test_robot_without_any_path_on_the_map_does_not_wait_for_others():
    """Bob blocks nobody; no path exists for Alice on the map, and three attempts are over soon."""
    floor = Floor(grid_of((*DEAD_END, Block(5.0, 0.0, 5.1, 0.9)), (0.05, 1.0)))
    floor.send("alice", Pose2D(1.0, 0.45, 0.0), Pose2D(6.5, 3.2, 0.0))
    floor.add("bob", Pose2D(3.5, 0.45, 0.0))
    floor.run(until_s=20.0)
    assert isinstance(floor.trips["alice"].ended, Failed)
