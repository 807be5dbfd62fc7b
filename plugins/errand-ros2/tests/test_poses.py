"""Poses and velocities from ROS 2: what is not finite, lies off the map or in an unknown frame is refused."""

import math

import numpy as np
import pytest

from errand_ros2.readings import planar_pose, pose_on_map, velocity
from errand_ros2.wire.types import ros_types
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Pose2D

GRID = GridMap(np.zeros((40, 60), bool), 0.1, (-1.0, -2.0))
"""From (-1, -2) to (5, 2)."""
FRAMES = {"alice/odom": Pose2D(1.0, 0.0, math.pi / 2).transform()}


def stamped(frame, x, y, yaw=0.0):
    message = ros_types().make("geometry_msgs/msg/PoseStamped")
    message.header.frame_id, message.pose.position.x, message.pose.position.y = frame, x, y
    message.pose.orientation.w, message.pose.orientation.z = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return message


@pytest.mark.parametrize("yaw", [0.0, 1.0, -3.0, math.pi])
def test_a_pose_has_the_heading_of_its_quaternion(yaw):
    pose = planar_pose(stamped("map", 1.0, 2.0, yaw).pose)
    assert (pose.x_m, pose.y_m) == (1.0, 2.0)
    assert math.remainder(pose.yaw_rad - yaw, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_pose_in_odometry_is_placed_on_the_map():
    assert pose_on_map(stamped("alice/odom", 1.0, 0.0), GRID, FRAMES).y_m == pytest.approx(1.0)
    assert pose_on_map(stamped("/map", 1.0, 0.0), GRID, FRAMES) == Pose2D(1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("frame", "x", "y", "why"),
    [
        ("map", math.nan, 0.0, "not finite"),
        ("map", 0.0, math.inf, "not finite"),
        ("map", 1e9, 0.0, "not on the map"),
        ("map", 0.0, -2.1, "not on the map"),
        ("mars", 0.0, 0.0, "no frame 'mars'"),
        ("", 0.0, 0.0, "no frame ''"),
        ("x" * 10_000, 0.0, 0.0, "no frame 'xxx"),
    ],
)
def test_a_pose_that_is_no_goal_is_refused(frame, x, y, why):
    with pytest.raises(InputError, match=why):
        pose_on_map(stamped(frame, x, y), GRID, FRAMES)


@pytest.mark.parametrize("w", [0.0, 1e200, -1e300])
def test_a_quaternion_that_cannot_be_normalised_is_refused(w):
    message = stamped("map", 0.0, 0.0)
    message.pose.orientation.w = w
    with pytest.raises(InputError, match="quaternion"):
        planar_pose(message.pose)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("axis", ["x", "y", "wz"])
def test_a_velocity_that_is_not_finite_is_refused(bad, axis):
    twist = ros_types().make("geometry_msgs/msg/Twist")
    setattr(twist.angular if axis == "wz" else twist.linear, "z" if axis == "wz" else axis, bad)
    with pytest.raises(InputError, match="not finite"):
        velocity(twist)
