"""Right of way: reserved paths, where a robot stops, and where it waits aside."""

from types import SimpleNamespace

import numpy as np
import pytest

from executive.run.traffic_table import TrafficTable
from skills.footprint import Footprint, with_outlines
from skills.navigate.giving_way import Avoided, GivingWay, GivingWayOptions, first_suitable_pose, reachable_cells
from skills.robot import Pose2D
from skills.testing.estimators import OPEN_M, BlockCostmap

FOOTPRINT = Footprint.rectangle([(-0.55, -0.25), (0.55, -0.25), (0.55, 0.25), (-0.55, 0.25)])
DISCS = np.array([[0.2, 0.0, 0.3], [-0.2, 0.0, 0.3]])


# clearances 1.5 m ahead of the body's middle and at the centre of a disc; a quarter turn puts a disc to the left
@pytest.mark.parametrize(
    ("pose", "points_W", "clearance_m"),
    [
        ((1.0, 0.0, 0.0), [[2.5, 0.0], [1.2, 0.0]], [1.0, -0.3]),
        ((0.0, 0.0, np.pi / 2.0), [[0.0, 1.0]], [0.5]),
    ],
)
def test_an_outline_occupies_its_discs_at_its_pose(pose, points_W, clearance_m):
    costmap = with_outlines(BlockCostmap(), [(DISCS, np.array([pose]))])
    assert costmap.clearance_m(np.array(points_W)) == pytest.approx(clearance_m)


def test_no_other_robots_leave_the_costmap_unchanged():
    costmap = BlockCostmap()
    assert with_outlines(costmap, []) is costmap


def test_an_outline_is_covered_to_its_corners():
    costmap = with_outlines(BlockCostmap(), [(FOOTPRINT.discs, np.zeros((1, 3)))])
    assert costmap.clearance_m(np.array([[0.65, 0.25]])) == pytest.approx([0.1], abs=0.02)


@pytest.fixture
def walled():
    """Three rows with a wall in column 2."""
    free = np.ones((3, 5), dtype=np.bool_)
    free[:, 2] = False
    return free


def test_cells_behind_a_wall_are_not_reachable(walled):
    assert {column for _, column in reachable_cells(walled, (1, 0))} == {0, 1}


def test_cells_are_reached_through_a_door_nearest_first(walled):
    walled[1, 2] = True
    cells = reachable_cells(walled, (1, 0))
    assert len(cells) == 13
    assert cells.index((1, 1)) < cells.index((1, 2)) < cells.index((1, 3))


@pytest.mark.parametrize(("beyond_m", "pose"), [(298.5, Pose2D(299.0, 0.0, 0.0)), (600.0, None)])
def test_the_first_suitable_pose_is_taken(beyond_m, pose):
    def suits(some):
        good = some[some[:, 0] > beyond_m]
        return Pose2D(float(good[0, 0]), 0.0, 0.0) if len(good) else None

    assert first_suitable_pose(np.column_stack([np.arange(500.0), np.zeros(500)]), suits) == pose


class StraightOn:
    """A controller with a straight path along x."""

    length_m = 4.0

    def __init__(self, x_m, y_m):
        self._poses = np.column_stack([np.arange(x_m, x_m + 4.0, 0.05), np.full(80, y_m), np.zeros(80)])

    def ahead(self, way_m):
        return self._poses[: int(min(len(self._poses), way_m / 0.05))]


def table_of(alice, bob):
    """Traffic table with two robots."""
    table = TrafficTable({"alice": FOOTPRINT.discs, "bob": FOOTPRINT.discs}, lambda: 0.0)
    table.report("alice", alice)
    table.report("bob", bob)
    return table


def giving_way(table, name):
    clock = SimpleNamespace(now=lambda: 0.0)
    return GivingWay(SimpleNamespace(traffic=table.view_of(name), clock=clock), GivingWayOptions())


@pytest.fixture
def bob():
    """One of two robots, alice's claim being older: she goes from (3, -2) to (3, 2), across x = 3."""
    table = table_of(Pose2D(3.0, -2.0, np.pi / 2.0), Pose2D(0.0, 0.0, 0.0))
    table.view_of("alice").claim()
    y = np.arange(-2.0, 2.0, 0.05)
    table.view_of("alice").announce(np.column_stack([np.full(80, 3.0), y, np.full(80, np.pi / 2.0)]), FOOTPRINT.discs)
    giving = giving_way(table, "bob")
    giving.begin()
    return giving


def test_robot_stops_before_a_reserved_path(bob):
    """Bob, 0.55 m long to the front, meets a path 0.25 m to each side of x = 3 at about 2.05 m, and names its robot."""
    assert bob.conflict_m(StraightOn(0.0, 0.0), FOOTPRINT) == (pytest.approx(2.05, abs=0.12), "alice")
    assert bob.conflict_m(StraightOn(0.0, 4.0), FOOTPRINT) is None


def test_robot_on_a_reserved_path_finds_a_waiting_pose_off_it(bob):
    here = Pose2D(3.0, 0.0, 0.0)
    assert bob.blocked_robots(here, FOOTPRINT) == ["alice"]
    assert bob.blocked_robots(Pose2D(0.0, 0.0, 0.0), FOOTPRINT) == []
    place = bob.waiting_pose(BlockCostmap(), FOOTPRINT, here)
    assert place is not None and not bob.blocked_robots(place, FOOTPRINT)
    other = bob.waiting_pose(BlockCostmap(), FOOTPRINT, here, tried=(place,))
    assert other is not None and np.hypot(other.x_m - place.x_m, other.y_m - place.y_m) > 0.6


def test_a_goal_without_a_path_can_be_reserved():
    """Alice reserves (6, 0), where Bob stands: he blocks her there, and not at (9, 0)."""
    start, goal = Pose2D(0.0, 0.0, 0.0), Pose2D(6.0, 0.0, 0.0)
    table = table_of(start, goal)
    alice, bob = giving_way(table, "alice"), giving_way(table, "bob")
    alice.begin()
    bob.begin()
    alice.reserve_poses(FOOTPRINT, start, goal)
    assert bob.blocked_robots(goal, FOOTPRINT)
    assert not bob.blocked_robots(Pose2D(9.0, 0.0, 0.0), FOOTPRINT)


# Bob goes later, has nothing to do, or works where he stands: Alice, who goes first, plans through him or not.
@pytest.mark.parametrize(
    ("bob_goes", "bob_idle", "less", "clearance_m"),
    [
        (True, False, Avoided.WORKING, OPEN_M),
        (False, True, Avoided.WORKING, OPEN_M),
        (False, False, None, None),
    ],
)
def test_a_second_plan_ignores_robots_that_clear_a_reserved_path(bob_goes, bob_idle, less, clearance_m):
    table = table_of(Pose2D(0.0, 0.0, 0.0), Pose2D(2.0, 0.0, 0.0))
    alice, bob = giving_way(table, "alice"), giving_way(table, "bob")
    alice.begin()
    if bob_goes:
        bob.begin()
    table.rest("bob", idle=bob_idle)
    assert alice.less_avoided(Avoided.PATHS) is less
    at_bob = np.array([[2.0, 0.0]])
    assert alice.costmap(BlockCostmap(), Avoided.BODIES).clearance_m(at_bob)[0] < 0.0
    if less is not None:
        assert alice.costmap(BlockCostmap(), less).clearance_m(at_bob) == pytest.approx([clearance_m])


# Alice, 1.1 m by 0.5 m, stands at (3, -2) along y.
@pytest.mark.parametrize(("place_W", "is_robot"), [((3.0, -1.2), True), ((3.5, -2.0), True), ((3.0, -0.8), False)])
def test_a_detected_person_where_a_robot_stands_is_that_robot(bob, place_W, is_robot):
    assert bob.is_robot(place_W) is is_robot
