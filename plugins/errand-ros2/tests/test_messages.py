"""Messages from a robot's readings: what the readings say, in the units and conventions of ROS 2."""

import math
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform

from errand_ros2 import messages
from errand_ros2.wire.types import ros_types
from skills.grid_map import GridMap
from skills.robot import FrameTree, Image, Intrinsics, Odometry, Pose2D, Scan
from skills.testing.blocks import Block
from skills.testing.estimators import BlockCostmap

RANGES = np.array([[1.0] * 3, [2.0, math.nan, 3.0]], np.float32)
LENS = Intrinsics(640, 480, 320.0, 322.0, 318.0, 240.0)


def scan_of(ranges):
    still = RigidTransform()
    azimuths = np.linspace(-1.0, 1.0, ranges.shape[1])
    return Scan(1.5, ranges, np.array([-0.4, 0.0])[: len(ranges)], azimuths, still, still)


def image_of(colour):
    grey, depth = np.full((480, 640), 7, np.uint8), np.full((480, 640), 2.0, np.float32)
    depth[0, 0] = 0.0
    picture = np.full((480, 640, 3), 9, np.uint8) if colour else None
    return Image(1.0, "hand", "hand_camera", LENS, LENS, picture, grey, depth, FrameTree({}))


def decoded(name, fields):
    """A message after encoding, as others get it."""
    kind = ros_types().message(name)
    return kind.decode(kind.encode(fields))


@pytest.mark.parametrize(("stamp_s", "parts"), [(0.0, (0, 0)), (1.25, (1, 250_000_000)), (-1.0, (0, 0))])
def test_a_time_has_seconds_and_nanoseconds(stamp_s, parts):
    time = messages.time_of(stamp_s)
    assert (time["sec"], time["nanosec"]) == parts


def test_a_scan_is_its_level_ring_without_returns_as_infinity():
    scan = decoded(
        "sensor_msgs/msg/LaserScan",
        messages.level_scan(scan_of(RANGES), "lidar", 0.1),
    )
    assert scan.ranges.tolist() == [2.0, math.inf, 3.0]
    assert (scan.angle_min, scan.angle_increment) == (-1.0, 1.0)


def test_points_are_all_returns_of_all_rings():
    cloud = decoded(
        "sensor_msgs/msg/PointCloud2",
        messages.points(scan_of(RANGES), "body"),
    )
    xyz = cloud.data.view(np.float32).reshape(-1, 3)
    assert (cloud.width, cloud.point_step, len(xyz)) == (5, 12, 5)
    assert np.linalg.norm(xyz, axis=1).tolist() == pytest.approx([1.0, 1.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(("colour", "encoding", "row"), [(True, "rgb8", 960), (False, "mono8", 320)])
def test_a_picture_is_reduced_with_its_intrinsics(colour, encoding, row):
    picture, info = (
        decoded("sensor_msgs/msg/Image", messages.picture(image_of(colour), "c")),
        decoded("sensor_msgs/msg/CameraInfo", messages.camera_info(image_of(colour), "c")),
    )
    assert (picture.width, picture.height, picture.encoding, picture.step) == (320, 240, encoding, row)
    assert len(picture.data) == row * 240
    assert (info.width, info.k[0], info.k[2], info.p[5]) == (320, 160.0, 159.0, 161.0)


@pytest.mark.parametrize(("colour", "shape"), [(True, (240, 320, 3)), (False, (240, 320))])
def test_a_compressed_picture_shows_the_same(colour, shape):
    reading = image_of(colour)
    if colour:
        reading.colour[:] = (200, 100, 50)
    told = decoded("sensor_msgs/msg/CompressedImage", messages.compressed(reading, "c"))
    assert told.format == f"{'rgb8' if colour else 'mono8'}; jpeg compressed"
    pixels = cv2.imdecode(told.data, cv2.IMREAD_UNCHANGED)
    assert pixels.shape == shape
    assert np.abs(pixels.astype(int) - np.array([50, 100, 200] if colour else 7)).max() <= 3


@pytest.mark.parametrize(
    ("urdf", "declared"),
    [
        ('<robot name="a"><drake:joint/></robot>', '<robot xmlns:drake="http://drake.mit.edu" name="a">'),
        ('<robot name="a"><mesh/></robot>', '<robot name="a">'),
        ('<robot xmlns:drake="own"><drake:joint/></robot>', '<robot xmlns:drake="own">'),
    ],
)
def test_a_description_declares_the_prefixes_that_it_uses(urdf, declared):
    told = messages.well_formed(urdf)
    assert told.startswith(declared)
    assert ElementTree.fromstring(told).tag == "robot"


def test_unknown_depth_is_nan():
    values = decoded("sensor_msgs/msg/Image", messages.depth(image_of(True), "c")).data.view(np.float32)
    assert math.isnan(values[0])
    assert values[1] == 2.0


def test_compressed_depth_is_in_millimetres_behind_a_header_of_12_bytes():
    told = decoded("sensor_msgs/msg/CompressedImage", messages.compressed_depth(image_of(True), "c"))
    assert told.format == "16UC1; compressedDepth png"
    values = cv2.imdecode(told.data[12:], cv2.IMREAD_UNCHANGED)
    assert (values.dtype, values.shape, values[0, 0], values[0, 1]) == (np.uint16, (240, 320), 0, 2000)


def test_markers_take_the_place_of_those_before():
    seen = [("coke", (1.0, 2.0, 0.8)), ("beer", (1.5, 2.0, 0.8))]
    told = decoded("visualization_msgs/msg/MarkerArray", messages.markers(2.0, seen)).markers
    # all before are deleted; then a sphere and a name for each
    assert [(each.action, each.type, each.text) for each in told] == [
        *[(3, 0, ""), (0, 2, ""), (0, 9, "coke"), (0, 2, ""), (0, 9, "beer")],
    ]
    assert (told[3].header.frame_id, told[3].pose.position.x, told[3].pose.position.z) == ("map", 1.5, 0.8)
    assert len({(each.ns, each.id) for each in told}) == 5


def test_a_map_has_free_occupied_and_unknown_cells():
    occupied, unknown = np.zeros((2, 3), bool), np.zeros((2, 3), bool)
    occupied[0, 1] = unknown[1, 2] = True
    grid = decoded("nav_msgs/msg/OccupancyGrid", messages.occupancy_grid(GridMap(occupied, 0.5, (-1.0, -2.0), unknown)))
    assert grid.data.tolist() == [0, 100, 0, 0, 0, -1]
    assert (grid.info.width, grid.info.height, grid.info.origin.position.y) == (3, 2, -2.0)


def test_a_costmap_costs_most_in_obstacles_and_less_away_from_them():
    free = BlockCostmap([Block(2.0, 0.95, 2.4, 1.45)])
    grid = decoded("nav_msgs/msg/OccupancyGrid", messages.costmap(1.0, free, (-2.0, -2.0), (6.0, 6.0)))
    costs = grid.data.reshape(grid.info.height, grid.info.width)
    assert (costs.shape, grid.info.origin.position.x, grid.info.origin.position.y) == ((60, 60), -2.0, -2.0)
    assert costs[31, 41] == 100  # (2.15, 1.15)
    assert 0 <= costs[31, 10] < 5 < costs[31, 36] < costs[31, 38] < 100


def test_particles_have_equal_weights():
    cloud = decoded(
        "nav2_msgs/msg/ParticleCloud", messages.particles(0.0, np.array([[1.0, 2.0, math.pi], [3.0, 4.0, 0.0]]))
    )
    assert [each.weight for each in cloud.particles] == [0.5, 0.5]
    assert (cloud.particles[0].pose.position.y, cloud.particles[0].pose.orientation.z) == pytest.approx((2.0, 1.0))


def test_odometry_has_velocities_in_the_body():
    reading = Odometry(2.0, Pose2D(1.0, 2.0, math.pi / 2).transform(0.5), (0.3, 0.1, -0.2))
    told = decoded("nav_msgs/msg/Odometry", messages.odometry(reading, "odom", "body"))
    assert (told.pose.pose.position.z, told.twist.twist.linear.y, told.twist.twist.angular.z) == (0.5, 0.1, -0.2)
    assert told.pose.pose.orientation.z == pytest.approx(math.sqrt(0.5))


def test_a_covariance_is_over_x_y_and_yaw():
    told = decoded(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        messages.pose_with_covariance(0.0, RigidTransform(), np.diag([1.0, 2.0, 3.0])),
    )
    assert [told.pose.covariance[each] for each in (0, 7, 35)] == [1.0, 2.0, 3.0]


def test_faults_are_errors():
    told = decoded(
        "diagnostic_msgs/msg/DiagnosticArray",
        messages.diagnostics(0.0, "Alice", ("the LiDAR is silent",), {"battery": "0.5"}),
    )
    assert (told.status[0].level, told.status[0].message) == (2, "the LiDAR is silent")
