"""Tests of right of way: what a robot keeps clear of, where it stops short, and where it steps aside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from skills.api import LocalisationEstimate
from skills.navigate.giving_way import first_that_suits, reachable, with_bodies
from skills.robot import FloatArray, Pose2D, Robot

DISCS = np.array([[0.2, 0.0, 0.3], [-0.2, 0.0, 0.3]])


@dataclass(frozen=True)
class Open:
    """A costmap with nothing within 5 m."""

    def clearance_m(self, points_W: FloatArray) -> FloatArray:
        """The same everywhere."""
        return np.full(len(points_W), 5.0)

    def update(self, robot: Robot, localisation: LocalisationEstimate) -> None:
        """Nothing."""

    def add_points(self, points_W: FloatArray, stamp_s: float) -> None:
        """Nothing."""


def test_a_body_takes_up_its_discs() -> None:
    """| from the body's middle | clearance |
    | 1.5 m ahead | 1.0 |
    | in it | -0.3 at a disc's centre |"""
    costmap = with_bodies(Open(), [(DISCS, np.array([[1.0, 0.0, 0.0]]))])
    clearance = costmap.clearance_m(np.array([[2.5, 0.0], [1.2, 0.0]]))
    assert clearance == pytest.approx([1.0, -0.3])


def test_a_body_is_turned_with_its_pose() -> None:
    """A quarter turn puts the front disc to the left."""
    costmap = with_bodies(Open(), [(DISCS, np.array([[0.0, 0.0, np.pi / 2.0]]))])
    assert costmap.clearance_m(np.array([[0.0, 1.0]])) == pytest.approx([0.5])


def test_nobody_about_leaves_the_costmap_as_it_is() -> None:
    """A robot alone plans as it always did."""
    costmap = Open()
    assert with_bodies(costmap, []) is costmap


def test_places_behind_a_wall_are_not_reached() -> None:
    """A wall in column 2 of three rows; only columns 0 and 1 are reached."""
    free = np.ones((3, 5), dtype=np.bool_)
    free[:, 2] = False
    assert {column for _, column in reachable(free, (1, 0))} == {0, 1}


def test_places_are_reached_through_a_door_and_nearest_first() -> None:
    """With a door in the wall's middle, the other side comes after the near one."""
    free = np.ones((3, 5), dtype=np.bool_)
    free[:, 2] = False
    free[1, 2] = True
    cells = reachable(free, (1, 0))
    assert len(cells) == 13
    assert cells.index((1, 1)) < cells.index((1, 2)) < cells.index((1, 3))


def test_the_first_place_that_suits_is_taken() -> None:
    """None where none suits."""
    cells = [(0, 0), (0, 3), (3, 3)]
    found = first_that_suits(cells, lambda row, column: Pose2D(column, row, 0.0) if row else None)
    assert found == Pose2D(3, 3, 0.0)
    assert first_that_suits(cells, lambda row, column: None) is None
