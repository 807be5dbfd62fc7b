"""Exact estimators of the scripted robot."""

import numpy as np
import pytest

from skills.api import ClearableCostmap, SearchingLocaliser
from skills.robot import Pose2D
from skills.testing.blocks import ROOM, Block, grid_of
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot, Start


def test_the_estimated_pose_is_that_of_the_robot():
    clock, start = VirtualClock(), Pose2D(1.0, -1.0, 0.5)
    robot, place = ScriptedRobot(clock, start=Start(pose=start)), KnownPlace(start)
    robot.drive(0.4, 0.1, 0.2, until_s=2.0, lease=robot.acquire_lease("test"))
    clock.advance(2.0)
    place.update(robot)
    seen = Pose2D.from_transform(place.estimate().X_WO @ robot.odometry().X_OB)
    assert (seen.x_m, seen.y_m, seen.yaw_rad) == pytest.approx((robot.pose.x_m, robot.pose.y_m, robot.pose.yaw_rad))
    assert place.estimate().stamp_s == 2.0


def test_a_lost_pose_can_be_searched_and_accepted():
    robot, place = ScriptedRobot(VirtualClock()), KnownPlace()
    place.localised = False
    place.accept(place.search(robot.scan(), place.estimate(), None))
    assert place.estimate().localised
    assert isinstance(place, SearchingLocaliser)


def test_clearance_is_the_distance_to_the_nearest_block():
    costmap = BlockCostmap([Block(1.0, -0.5, 2.0, 0.5), Block(0.0, 0.0, 9.0, 9.0, 2.0, 2.5)])
    points = np.array([[0.0, 0.0], [1.5, 0.0], [2.0 + 3.0, 0.5 + 4.0]])
    assert costmap.clearance_m(points) == pytest.approx([1.0, -0.5, 5.0])
    assert isinstance(costmap, ClearableCostmap)


def test_clearance_without_blocks_is_large():
    assert BlockCostmap().clearance_m(np.zeros((2, 2))) == pytest.approx([9.0, 9.0])


def test_a_grid_map_shows_the_blocks_in_its_band():
    low, high = grid_of(ROOM, (0.05, 0.6)), grid_of(ROOM, (0.71, 0.74))
    leg, top = np.array([[1.225, -0.575]]), np.array([[1.5, 0.0]])
    assert low.distance_m(leg)[0] < 0.0 < low.distance_m(top)[0]
    assert high.distance_m(top)[0] < 0.0
