"""Right of way: reserved paths, where a robot stops, and where it waits aside."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from executive.run.traffic_table import TrafficTable
from skills.api import LocalisationEstimate, SkillContext
from skills.navigate.footprint import Footprint, with_outlines
from skills.navigate.giving_way import Avoided, GivingWay, GivingWayOptions, first_suitable_pose, reachable_cells
from skills.robot import FloatArray, Pose2D, Robot
from skills.stack import LocalController

FOOTPRINT = Footprint.rectangle([(-0.55, -0.25), (0.55, -0.25), (0.55, 0.25), (-0.55, 0.25)])
DISCS = np.array([[0.2, 0.0, 0.3], [-0.2, 0.0, 0.3]])


@dataclass(frozen=True)
class Open:
    """A costmap without obstacles within 5 m."""

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """5 m everywhere."""
        return np.full(len(points_W), 5.0)

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Ignores it."""

    def add_points(self, points_W: FloatArray, stamp_s: float) -> None:
        """Ignores it."""


def test_an_outline_occupies_its_discs() -> None:
    """| from the body's middle | clearance |
    | 1.5 m ahead | 1.0 |
    | in it | -0.3 at a disc's centre |"""
    costmap = with_outlines(Open(), [(DISCS, np.array([[1.0, 0.0, 0.0]]))])
    clearance = costmap.clearance_m(np.array([[2.5, 0.0], [1.2, 0.0]]))
    assert clearance == pytest.approx([1.0, -0.3])


def test_an_outline_turns_with_its_pose() -> None:
    """A quarter turn puts the front disc to the left."""
    costmap = with_outlines(Open(), [(DISCS, np.array([[0.0, 0.0, np.pi / 2.0]]))])
    assert costmap.clearance_m(np.array([[0.0, 1.0]])) == pytest.approx([0.5])


def test_no_other_robots_leave_the_costmap_unchanged() -> None:
    """A single robot plans on the same costmap."""
    costmap = Open()
    assert with_outlines(costmap, []) is costmap


def test_cells_behind_a_wall_are_not_reachable() -> None:
    """A wall in column 2 of three rows; only columns 0 and 1 are reached."""
    free = np.ones((3, 5), dtype=np.bool_)
    free[:, 2] = False
    assert {column for _, column in reachable_cells(free, (1, 0))} == {0, 1}


def test_cells_are_reached_through_a_door_nearest_first() -> None:
    """With a door in the wall's middle, the other side comes after the near one."""
    free = np.ones((3, 5), dtype=np.bool_)
    free[:, 2] = False
    free[1, 2] = True
    cells = reachable_cells(free, (1, 0))
    assert len(cells) == 13
    assert cells.index((1, 1)) < cells.index((1, 2)) < cells.index((1, 3))


def test_the_first_suitable_pose_is_taken() -> None:
    """None where no position suits."""
    places = np.column_stack([np.arange(500.0), np.zeros(500)])

    def beyond(x_m: float) -> Pose2D | None:
        def suits(some: FloatArray) -> Pose2D | None:
            good = some[some[:, 0] > x_m]
            return Pose2D(float(good[0, 0]), 0.0, 0.0) if len(good) else None

        return first_suitable_pose(places, suits)

    assert beyond(298.5) == Pose2D(299.0, 0.0, 0.0)
    assert beyond(600.0) is None


class StraightOn:
    """A controller with a straight path along x."""

    length_m = 4.0

    def __init__(self, x_m: float, y_m: float) -> None:
        self._poses = np.column_stack([np.arange(x_m, x_m + 4.0, 0.05), np.full(80, y_m), np.zeros(80)])

    def ahead(self, way_m: float) -> FloatArray:
        """The poses of the path, so far on."""
        return self._poses[: int(min(len(self._poses), way_m / 0.05))]


def among(name: str) -> tuple[GivingWay, Footprint]:
    """One of two robots, alice's claim being older: she goes from (3, -2) to (3, 2), across x = 3."""
    table = TrafficTable({"alice": FOOTPRINT.discs, "bob": FOOTPRINT.discs}, lambda: 0.0)
    table.report("alice", Pose2D(3.0, -2.0, np.pi / 2.0))
    table.report("bob", Pose2D(0.0, 0.0, 0.0))
    table.view_of("alice").claim()
    y = np.arange(-2.0, 2.0, 0.05)
    table.view_of("alice").announce(np.column_stack([np.full(80, 3.0), y, np.full(80, np.pi / 2.0)]), FOOTPRINT.discs)
    context = SimpleNamespace(traffic=table.view_of(name), clock=SimpleNamespace(now=lambda: 0.0))
    giving = GivingWay(cast(SkillContext, context), GivingWayOptions())
    giving.begin()
    return giving, FOOTPRINT


def test_robot_stops_before_a_reserved_path() -> None:
    """Bob, 0.55 m long to the front, meets a path 0.25 m to each side of x = 3 at about 2.05 m, and names its robot."""
    giving, footprint = among("bob")
    found = giving.conflict_m(cast(LocalController, StraightOn(0.0, 0.0)), footprint)
    assert found is not None and found[1] == "alice"
    assert found[0] == pytest.approx(2.05, abs=0.12)
    assert giving.conflict_m(cast(LocalController, StraightOn(0.0, 4.0)), footprint) is None


def test_robot_on_a_reserved_path_finds_a_waiting_pose_off_it() -> None:
    """| stands at | blocks the path | its waiting pose |
    | (3, 0) | yes | at least 0.25 m off the path |
    | (0, 0) | no | - |"""
    giving, footprint = among("bob")
    assert giving.blocked_robots(Pose2D(3.0, 0.0, 0.0), footprint) == ["alice"]
    assert giving.blocked_robots(Pose2D(0.0, 0.0, 0.0), footprint) == []
    place = giving.waiting_pose(Open(), footprint, Pose2D(3.0, 0.0, 0.0))
    assert place is not None and not giving.blocked_robots(place, footprint)
    other = giving.waiting_pose(Open(), footprint, Pose2D(3.0, 0.0, 0.0), tried=(place,))
    assert other is not None and np.hypot(other.x_m - place.x_m, other.y_m - place.y_m) > 0.6


def test_a_goal_without_a_path_can_be_reserved() -> None:
    """Alice reserves (6, 0), where Bob stands: he blocks her there, and not at (9, 0)."""
    table = TrafficTable({"alice": FOOTPRINT.discs, "bob": FOOTPRINT.discs}, lambda: 0.0)
    table.report("alice", Pose2D(0.0, 0.0, 0.0))
    table.report("bob", Pose2D(6.0, 0.0, 0.0))
    views = [SimpleNamespace(traffic=table.view_of(name), clock=None) for name in ("alice", "bob")]
    alice, bob = (GivingWay(cast(SkillContext, view), GivingWayOptions()) for view in views)
    alice.begin()
    bob.begin()
    alice.reserve_goal(Pose2D(0.0, 0.0, 0.0), Pose2D(6.0, 0.0, 0.0), FOOTPRINT)
    assert bob.blocked_robots(Pose2D(6.0, 0.0, 0.0), FOOTPRINT)
    assert not bob.blocked_robots(Pose2D(9.0, 0.0, 0.0), FOOTPRINT)


@pytest.mark.parametrize(
    ("bob_goes", "bob_idle", "less", "clearance_m"),
    [(True, False, Avoided.WORKING, 5.0), (False, True, Avoided.WORKING, 5.0), (False, False, None, None)],
)
def test_a_second_plan_ignores_robots_that_clear_a_reserved_path(
    bob_goes: bool, bob_idle: bool, less: Avoided | None, clearance_m: float | None
) -> None:
    """| bob | alice, who goes first, plans instead |
    | goes later | through where he stands |
    | has nothing to do | through where he stands |
    | works where he stands | nothing else |"""
    table = TrafficTable({"alice": FOOTPRINT.discs, "bob": FOOTPRINT.discs}, lambda: 0.0)
    table.report("alice", Pose2D(0.0, 0.0, 0.0))
    table.report("bob", Pose2D(2.0, 0.0, 0.0))
    views = [SimpleNamespace(traffic=table.view_of(name), clock=None) for name in ("alice", "bob")]
    alice, bob = (GivingWay(cast(SkillContext, view), GivingWayOptions()) for view in views)
    alice.begin()
    if bob_goes:
        bob.begin()
    table.rest("bob", idle=bob_idle)
    assert alice.less_avoided(Avoided.PATHS) is less
    at_bob = np.array([[2.0, 0.0]])
    assert alice.costmap(Open(), Avoided.BODIES).clearance_m(at_bob)[0] < 0.0
    if less is not None:
        assert alice.costmap(Open(), less).clearance_m(at_bob) == pytest.approx([clearance_m])


def test_an_outline_is_covered_to_its_corners() -> None:
    """The corner of an oblong lies beyond its round middle, and counts as well."""
    costmap = with_outlines(Open(), [(FOOTPRINT.discs, np.zeros((1, 3)))])
    assert costmap.clearance_m(np.array([[0.65, 0.25]])) == pytest.approx([0.1], abs=0.02)


@pytest.mark.parametrize(("place_W", "is_robot"), [((3.0, -1.2), True), ((3.5, -2.0), True), ((3.0, -0.8), False)])
def test_a_detected_person_where_a_robot_stands_is_that_robot(place_W: tuple[float, float], is_robot: bool) -> None:
    """Alice, 1.1 m by 0.5 m, stands at (3, -2) along y."""
    giving, _ = among("bob")
    assert giving.is_robot(place_W) is is_robot
