"""Messages of foreign robots as readings: encodings, one ring, clouds with other fields, and nonsense."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform

from errand_ros2 import readings
from errand_ros2.wire.types import ros_types

HERE = RigidTransform()


def blank(name):
    return ros_types().make(name)


def image(form, values, **changes):
    message, values = blank("sensor_msgs/msg/Image"), np.ascontiguousarray(values)
    message.encoding, (message.height, message.width) = form, values.shape[:2]
    message.step = values.nbytes // message.height
    message.data = values.view(np.uint8).ravel()
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_colours_come_in_the_order_of_red_green_blue():
    rgb = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    alpha = np.concatenate([rgb, np.full((2, 4, 1), 9, np.uint8)], axis=2)
    forms = {"rgb8": rgb, "bgr8": rgb[:, :, ::-1], "rgba8": alpha, "bgra8": alpha[:, :, [2, 1, 0, 3]]}
    for encoding, values in forms.items():
        assert np.array_equal(readings.pixels(image(encoding, values)), rgb), encoding
    assert readings.pixels(image("mono8", rgb[:, :, 0])).shape == (2, 4)


def test_depth_is_in_metres_and_zero_where_it_is_unknown():
    metres = np.array([[1.5, np.nan], [0.0, np.inf]], np.float32)
    assert readings.depth_m(image("32FC1", metres)).tolist() == [[1.5, 0.0], [0.0, 0.0]]
    assert readings.depth_m(image("16UC1", np.array([[1500, 0]], np.uint16)))[0, 0] == pytest.approx(1.5)
    big = image("16UC1", np.array([[1500, 0]], ">u2"), is_bigendian=1)
    assert readings.depth_m(big)[0, 0] == pytest.approx(1.5)


@pytest.mark.parametrize(
    "changes",
    [
        {"encoding": "yuv422"},
        {"width": 4000000000},
        {"height": 5},
        {"step": 1},
        {"step": 0},
        {"data": np.zeros(0, np.uint8)},
    ],
)
def test_a_picture_that_does_not_fit_is_not_used(changes):
    message = image("mono8", np.zeros((4, 4), np.uint8), **changes)
    assert readings.usable(readings.pixels, message) is None


def test_a_laser_scan_is_a_revolution_of_one_ring():
    message = blank("sensor_msgs/msg/LaserScan")
    message.angle_min, message.angle_increment, message.range_min, message.range_max = -0.1, 0.1, 0.1, 10.0
    message.ranges = np.array([2.0, np.inf, 0.01], np.float32)
    found = readings.flat_scan(message, 1.0, HERE, HERE)
    assert found.ranges_m.shape == (1, 3)
    assert np.isfinite(found.ranges_m[0]).tolist() == [True, False, False]
    assert found.points_B()[0] == pytest.approx([2.0 * math.cos(0.1), -2.0 * math.sin(0.1), 0.0])


def cloud(points, names="xyz", datatype=7, **changes):
    kind, message = "f4" if datatype == 7 else "f8", blank("sensor_msgs/msg/PointCloud2")
    dtype = np.dtype([("other", "u2"), *((name, kind) for name in names)])
    rows = np.zeros(len(points), dtype)
    for name, column in zip(names, np.transpose(points), strict=True):
        rows[name] = column
    for name in names:
        field = blank("sensor_msgs/msg/PointField")
        field.name, field.offset, field.datatype, field.count = name, dtype.fields[name][1], datatype, 1
        message.fields.append(field)
    message.height, message.width, message.point_step = 1, len(points), dtype.itemsize
    message.row_step, message.data = len(points) * dtype.itemsize, rows.view(np.uint8).ravel()
    for name, value in changes.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize("datatype", [7, 8])
def test_a_cloud_with_other_fields_gives_its_finite_points(datatype):
    points = [[1.0, 2.0, 0.1], [np.nan, 0.0, 0.0], [3.0, -1.0, 0.0]]
    found = readings.cloud_points(cloud(points, datatype=datatype))
    assert found == pytest.approx(np.array(points)[[0, 2]], abs=1e-6)


@pytest.mark.parametrize(
    "changes", [{"fields": []}, {"point_step": 3}, {"width": 1000}, {"row_step": 5}, {"height": 9}]
)
def test_a_cloud_that_does_not_fit_is_not_used(changes):
    assert readings.usable(readings.cloud_points, cloud([[1.0, 2.0, 3.0]], **changes)) is None


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_odometry_that_is_not_finite_is_not_used(value):
    message = blank("nav_msgs/msg/Odometry")
    message.pose.pose.orientation.w = 1.0
    assert readings.usable(readings.odometry, message, 1.0, 0.3).X_OB.translation()[2] == pytest.approx(0.3)
    message.pose.pose.position.x = value
    assert readings.usable(readings.odometry, message, 1.0, 0.0) is None
    message.pose.pose.position.x, message.twist.twist.angular.z = 0.0, value
    assert readings.usable(readings.odometry, message, 1.0, 0.0) is None


def test_joints_of_two_drivers_are_merged_under_our_names():
    message = blank("sensor_msgs/msg/JointState")
    message.name, message.position = ["their_arm"], np.array([0.5])
    first = readings.joints(message, 1.0, {"their_arm": "arm"})
    message.name, message.position = ["finger"], np.array([0.1])
    both = readings.merged(first, readings.joints(message, 2.0, {}))
    assert both.position_rad == {"arm": 0.5, "finger": 0.1}
    assert both.effort_nm == {"arm": 0.0, "finger": 0.0}
    message.position = np.array([math.nan])
    assert readings.usable(readings.joints, message, 3.0, {}) is None
