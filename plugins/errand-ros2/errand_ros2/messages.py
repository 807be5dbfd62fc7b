"""Messages of ROS 2 from a robot's readings. Stamps are those of the robot's clock, which `/clock` publishes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rosbags.typesys.stores.ros2_jazzy as ros

from skills.estimate.grid_map import GridMap
from skills.robot import Battery, FloatArray, Image, Imu, Intrinsics, Joints, Odometry, Pose2D, Scan

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

MAP_FRAME: Final = "map"
_LEAST_RANGE_M, _MOST_RANGE_M = 0.05, 100.0
MOST_COLUMNS: Final = 320
"""Raw pictures of a run are reduced to at most so many columns."""
_NAN: Final = math.nan


def time_of(stamp_s: float) -> Any:
    """Returns a time of the robot's clock; times before its beginning become zero."""
    return ros.builtin_interfaces__msg__Time(*divmod(max(0, round(stamp_s * 1e9)), 10**9))


def header(stamp_s: float, frame: str) -> Any:
    """Returns a header."""
    return ros.std_msgs__msg__Header(time_of(stamp_s), frame)


def clock(now_s: float) -> Any:
    """Returns the message for `/clock`."""
    return ros.rosgraph_msgs__msg__Clock(time_of(now_s))


def text(value: str) -> Any:
    """Returns a text as std_msgs/String."""
    return ros.std_msgs__msg__String(value)


def pose(X: RigidTransform) -> Any:
    """Returns a pose."""
    (x, y, z), turn = X.translation().tolist(), X.rotation().ToQuaternion()
    orientation = ros.geometry_msgs__msg__Quaternion(turn.x(), turn.y(), turn.z(), turn.w())
    return ros.geometry_msgs__msg__Pose(ros.geometry_msgs__msg__Point(x, y, z), orientation)


def pose_stamped(stamp_s: float, frame: str, X: RigidTransform) -> Any:
    """Returns a pose in a frame."""
    return ros.geometry_msgs__msg__PoseStamped(header(stamp_s, frame), pose(X))


def transform(stamp_s: float, parent: str, child: str, X: RigidTransform) -> Any:
    """Returns the transform from a frame to its child."""
    at = pose(X)
    moved = ros.geometry_msgs__msg__Vector3(at.position.x, at.position.y, at.position.z)
    return ros.geometry_msgs__msg__TransformStamped(
        header(stamp_s, parent), child, ros.geometry_msgs__msg__Transform(moved, at.orientation)
    )


def transforms(every: Iterable[Any]) -> Any:
    """Returns the message for `/tf` or `/tf_static`."""
    return ros.tf2_msgs__msg__TFMessage([*every])


def vector(values: Sequence[float]) -> Any:
    """Returns a vector of three numbers."""
    return ros.geometry_msgs__msg__Vector3(*map(float, values))


def odometry(reading: Odometry, frame: str, body: str) -> Any:
    """Returns the robot's dead reckoning."""
    return ros.nav_msgs__msg__Odometry(
        header(reading.stamp_s, frame),
        body,
        ros.geometry_msgs__msg__PoseWithCovariance(pose(reading.X_OB), np.zeros(36)),
        ros.geometry_msgs__msg__TwistWithCovariance(twist(reading.velocity), np.zeros(36)),
    )


def pose_with_covariance(stamp_s: float, X_WB: RigidTransform, covariance: FloatArray) -> Any:
    """Returns an estimated pose on the map; the covariance (3, 3) is over x, y and yaw."""
    full, axes = np.zeros((6, 6)), np.array([0, 1, 5])
    full[np.ix_(axes, axes)] = covariance
    estimate = ros.geometry_msgs__msg__PoseWithCovariance(pose(X_WB), full.ravel())
    return ros.geometry_msgs__msg__PoseWithCovarianceStamped(header(stamp_s, MAP_FRAME), estimate)


def joint_state(reading: Joints) -> Any:
    """Returns the joints' positions, velocities and efforts."""
    names = [*reading.position_rad]
    columns = (reading.position_rad, reading.velocity_rad_s, reading.effort_nm)
    values = (np.array([column.get(name, 0.0) for name in names]) for column in columns)
    return ros.sensor_msgs__msg__JointState(header(reading.stamp_s, ""), names, *values)


def laser_scan(reading: Scan, frame: str, period_s: float) -> Any:
    """Returns the ring of a scan that is nearest to the horizontal; a beam without a return has infinite range."""
    ring = int(np.argmin(np.abs(reading.elevations_rad)))
    ranges = reading.ranges_m[ring] * np.float32(math.cos(reading.elevations_rad[ring]))
    first, last = float(reading.azimuths_rad[0]), float(reading.azimuths_rad[-1])
    return ros.sensor_msgs__msg__LaserScan(
        header(reading.stamp_s, frame),
        angle_min=first,
        angle_max=last,
        angle_increment=(last - first) / max(len(ranges) - 1, 1),
        time_increment=0.0,
        scan_time=period_s,
        range_min=_LEAST_RANGE_M,
        range_max=_MOST_RANGE_M,
        ranges=np.nan_to_num(ranges, nan=np.inf).astype(np.float32),
        intensities=np.zeros(0, np.float32),
    )


def points(reading: Scan, frame: str) -> Any:
    """Returns all returns of a scan as points in the body frame."""
    xyz = np.ascontiguousarray(reading.points_B(), np.float32)
    kind = ros.sensor_msgs__msg__PointField
    fields = [kind(name, 4 * number, kind.FLOAT32, 1) for number, name in enumerate("xyz")]
    width, data = 12 * len(xyz), xyz.view(np.uint8).ravel()
    return ros.sensor_msgs__msg__PointCloud2(
        header(reading.stamp_s, frame), 1, len(xyz), fields, False, 12, width, data, True
    )


def imu(reading: Imu, frame: str) -> Any:
    """Returns turn rates and accelerations; the orientation is not measured, which -1 in its covariance says."""
    unknown, still = np.array([-1.0, *[0.0] * 8]), np.zeros(9)
    level = ros.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 1.0)
    rates, accelerations = vector(reading.angular_velocity_B), vector(reading.linear_acceleration_B)
    return ros.sensor_msgs__msg__Imu(header(reading.stamp_s, frame), level, unknown, rates, still, accelerations, still)


def battery(reading: Battery) -> Any:
    """Returns the battery's charge; what is not measured is NaN."""
    kind, none = ros.sensor_msgs__msg__BatteryState, np.zeros(0, np.float32)
    return kind(
        header(reading.stamp_s, ""),
        voltage=_NAN,
        temperature=_NAN,
        current=_NAN,
        charge=_NAN,
        capacity=_NAN,
        design_capacity=_NAN,
        percentage=reading.charge,
        power_supply_status=kind.POWER_SUPPLY_STATUS_UNKNOWN,
        power_supply_health=kind.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=kind.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        present=True,
        cell_voltage=none,
        cell_temperature=none,
        location="",
        serial_number="",
    )


def truth_value(value: bool) -> Any:
    """Returns a truth value as std_msgs/Bool."""
    return ros.std_msgs__msg__Bool(value)


def wrench(stamp_s: float, frame: str, force_n: float) -> Any:
    """Returns a force along the frame's z axis."""
    force = ros.geometry_msgs__msg__Wrench(vector((0.0, 0.0, force_n)), vector((0.0, 0.0, 0.0)))
    return ros.geometry_msgs__msg__WrenchStamped(header(stamp_s, frame), force)


def twist(velocity: Sequence[float]) -> Any:
    """Returns a velocity of the base: vx, vy (m/s), wz (rad/s)."""
    vx, vy, wz = velocity
    return ros.geometry_msgs__msg__Twist(vector((vx, vy, 0.0)), vector((0.0, 0.0, wz)))


def twist_stamped(stamp_s: float, frame: str, velocity: Sequence[float]) -> Any:
    """Returns a velocity of the base with its time."""
    return ros.geometry_msgs__msg__TwistStamped(header(stamp_s, frame), twist(velocity))


def picture(reading: Image, frame: str, most_columns: int = MOST_COLUMNS) -> Any:
    """Returns a picture, colour or grey, reduced to at most so many columns."""
    step = _step(reading.intrinsics, most_columns)
    pixels = reading.grey if reading.colour is None else reading.colour
    encoding, depth = ("mono8", 1) if reading.colour is None else ("rgb8", 3)
    return _image(header(reading.stamp_s, frame), pixels[::step, ::step], encoding, depth)


def depth(reading: Image, frame: str, most_columns: int = MOST_COLUMNS) -> Any:
    """Returns depth in metres along the optical axis, NaN where it is unknown, reduced like the picture."""
    step = _step(reading.depth_intrinsics, most_columns)
    values = reading.depth_m[::step, ::step].astype(np.float32)
    return _image(header(reading.stamp_s, frame), np.where(values > 0.0, values, np.float32(_NAN)), "32FC1", 4)


def _image(head: Any, pixels: Any, encoding: str, pixel_bytes: int) -> Any:
    height, width = pixels.shape[:2]
    data = np.ascontiguousarray(pixels).view(np.uint8).ravel()
    return ros.sensor_msgs__msg__Image(head, height, width, encoding, 0, width * pixel_bytes, data)


def camera_info(stamp_s: float, frame: str, lens: Intrinsics, most_columns: int = MOST_COLUMNS) -> Any:
    """Returns the intrinsics of a picture that `picture` or `depth` returns; `lens` are those before."""
    step = _step(lens, most_columns)
    fx, fy, cx, cy = (value / step for value in (lens.fx, lens.fy, lens.cx, lens.cy))
    return ros.sensor_msgs__msg__CameraInfo(
        header(stamp_s, frame),
        height=math.ceil(lens.height / step),
        width=math.ceil(lens.width / step),
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        r=np.eye(3).ravel(),
        p=np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=ros.sensor_msgs__msg__RegionOfInterest(0, 0, 0, 0, False),
    )


def _step(lens: Intrinsics, most_columns: int) -> int:
    return max(1, math.ceil(lens.width / most_columns))


def occupancy_grid(grid: GridMap) -> Any:
    """Returns a map: 0 free, 100 occupied, -1 unknown; row 0 has the least y."""
    cells = np.where(grid.occupied, 100, 0).astype(np.int8)
    if grid.unknown is not None:
        cells[grid.unknown & ~grid.occupied] = -1
    rows, columns = cells.shape
    level = ros.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 1.0)
    origin = ros.geometry_msgs__msg__Pose(
        ros.geometry_msgs__msg__Point(float(grid.origin_m[0]), float(grid.origin_m[1]), 0.0), level
    )
    about = ros.nav_msgs__msg__MapMetaData(time_of(0.0), grid.resolution_m, columns, rows, origin)
    return ros.nav_msgs__msg__OccupancyGrid(header(0.0, MAP_FRAME), about, cells.ravel())


def path(stamp_s: float, poses: Iterable[Sequence[float]]) -> Any:
    """Returns a path of poses (x, y in m, yaw in rad) on the map."""
    every = [pose_stamped(stamp_s, MAP_FRAME, Pose2D(*map(float, each)).transform()) for each in poses]
    return ros.nav_msgs__msg__Path(header(stamp_s, MAP_FRAME), every)


def diagnostics(now_s: float, robot: str, faults: Sequence[str], values: Sequence[tuple[str, str]]) -> Any:
    """Returns the robot's diagnostics: an error while it has faults."""
    level = (
        ros.diagnostic_msgs__msg__DiagnosticStatus.ERROR if faults else ros.diagnostic_msgs__msg__DiagnosticStatus.OK
    )
    pairs = [ros.diagnostic_msgs__msg__KeyValue(*pair) for pair in values]
    status = ros.diagnostic_msgs__msg__DiagnosticStatus(
        level, f"errand: {robot}", "; ".join(faults) or "OK", robot, pairs
    )
    return ros.diagnostic_msgs__msg__DiagnosticArray(header(now_s, ""), [status])
