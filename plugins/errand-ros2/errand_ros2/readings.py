"""Reads poses, velocities and readings of a robot from messages of ROS 2; `usable` drops what cannot be used."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix

from errand_ros2.messages import MAP_FRAME
from errand_ros2.wire.node import Node
from skills.grid_map import GridMap
from skills.inputs.errors import InputError
from skills.robot import Battery, Capabilities, Imu, Intrinsics, Joints, Odometry, Pose2D, Scan

FRAMES: Final = frozenset({MAP_FRAME, "world"})  # names of the map's frame
TOPIC: Final = "cmd_vel"
_TWIST, _STAMPED = (f"geometry_msgs/msg/{each}" for each in ("Twist", "TwistStamped"))
_SINCE_1970_S: Final = 1e9  # stamps beyond are of the wall clock
LIFE_S: Final = 0.2  # time after which a velocity no longer counts; then the robot stands
STILL: Final = ((0.0, 0.0, 0.0), -math.inf)
_SHORTEST_QUATERNION, _LONGEST_QUATERNION = 0.1, 1e6
_MOST_PIXELS: Final = 1 << 24
_POINT_TYPES: Final = {7: "f4", 8: "f8"}
_COLOURS: Final = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4}
_CHANNEL: Final = {"mono8": "u1", "16UC1": "u2", "mono16": "u2", "32FC1": "f4"}


def transform_of(at: Any, turn: Any) -> RigidTransform:
    """Reads a position and a quaternion. Raises InputError for numbers that are not finite, and for no rotation."""
    values = np.array([at.x, at.y, at.z, turn.w, turn.x, turn.y, turn.z], float)
    if not np.isfinite(values).all():
        raise InputError("the pose has a number that is not finite", hint="send finite numbers")
    if not _SHORTEST_QUATERNION <= (length := math.hypot(*values[3:])) < _LONGEST_QUATERNION:
        raise InputError("the pose's quaternion is zero or too long", hint="send w = 1 for no rotation")
    return RigidTransform(Quaternion(values[3:] / length), values[:3])


def planar_pose(pose: Any) -> Pose2D:
    """Reads geometry_msgs/Pose, as `transform_of`."""
    return Pose2D.from_transform(transform_of(pose.position, pose.orientation))


def pose_on_map(stamped: Any, grid: GridMap, frames: Mapping[str, RigidTransform]) -> Pose2D:
    """Reads geometry_msgs/PoseStamped as a pose on the map; `frames` are the poses of other frames on it.

    Raises InputError for an unknown frame, a pose off the map or in an obstacle of it, and what `planar_pose` refuses.
    """
    frame, X_FP = stamped.header.frame_id.strip("/"), transform_of(stamped.pose.position, stamped.pose.orientation)
    if frame not in FRAMES and frame not in frames:
        raise InputError(f"there is no frame '{frame[:60]}'", hint=f"known: {', '.join(sorted({*FRAMES, *frames}))}")
    placed = Pose2D.from_transform(X_FP if frame in FRAMES else frames[frame] @ X_FP)
    least, at = np.array(grid.origin_m), f"({placed.x_m:.6g}, {placed.y_m:.6g})"
    if not (np.all(least <= (placed.x_m, placed.y_m)) and np.all((placed.x_m, placed.y_m) <= least + grid.size_m)):
        raise InputError(f"{at} is not on the map", hint="name a pose on it")
    if grid.distance_m(np.array([[placed.x_m, placed.y_m]]))[0] <= 0.0:
        raise InputError(f"{at} lies in an obstacle of the map", hint="name a free pose")
    return placed


def velocity(twist: Any) -> tuple[float, float, float]:
    """Reads geometry_msgs/Twist as vx, vy (m/s), wz (rad/s). Raises InputError for numbers that are not finite."""
    values = (twist.linear.x, twist.linear.y, twist.angular.z)
    if not all(math.isfinite(value) for value in values):
        raise InputError("the velocity has a number that is not finite", hint="send finite numbers")
    return values


def within_limits(velocity: tuple[float, float, float], can: Capabilities) -> tuple[float, float, float]:
    """Returns a velocity of the base within its limits."""
    vx, vy, wz = velocity
    share, most = min(1.0, can.max_speed_m_s / max(math.hypot(vx, vy), 1e-9)), can.max_turn_rate_rad_s
    return share * vx, share * vy, max(-most, min(wz, most))


class HeardVelocity:
    """Last velocity of a topic, and when it came on the clock `now` (s). Any thread may call `hear`.

    One that is `late_s` late by the wall clock does not count; on another clock than the wall's, none is late. Of
    those with a stamp, one that is older than `LIFE_S` on its clock, the robot's or the wall's, does not count either.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now, self.last, self.late_s = now, STILL, LIFE_S if now is time.monotonic else math.inf

    def hear(self, twist: Any) -> None:
        """Takes a velocity; one that is not finite stops the robot."""
        read = usable(velocity, twist)
        self.last = STILL if read is None else (read, self._now())

    def listen(self, node: Node, robot_now: Callable[[], float]) -> None:
        """Takes velocities of a node's topic with and without a stamp; `robot_now` is the robot's clock (s)."""

        def hear_stamped(message: Any) -> None:
            if abs(age_s(message.header, robot_now())) <= LIFE_S:
                self.hear(message.twist)

        node.subscribe(TOPIC, _TWIST, self.hear, late_s=self.late_s)
        node.subscribe(TOPIC, _STAMPED, hear_stamped, late_s=self.late_s)


def stamp_of(header: Any) -> float:
    """Returns the time of a message (s)."""
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def age_s(header: Any, robot_now_s: float) -> float:
    """Returns the age of a stamp on its clock, the robot's or the wall's; 0 without a stamp."""
    sent_s = stamp_of(header)
    return 0.0 if sent_s == 0.0 else (time.time() if sent_s > _SINCE_1970_S else robot_now_s) - sent_s


def odometry(message: Any, stamp_s: float, raised_m: float) -> Odometry:
    """Returns the dead reckoning of nav_msgs/Odometry; B lies `raised_m` above its child frame."""
    X_OB = transform_of(message.pose.pose.position, message.pose.pose.orientation)
    X_OB.set_translation(X_OB.translation() + [0.0, 0.0, raised_m])
    return Odometry(stamp_s, X_OB, velocity(message.twist.twist))


def between(before: Odometry, after: Odometry, stamp_s: float) -> RigidTransform:
    """Returns the pose X_OB at a time between two readings."""
    span_s = after.stamp_s - before.stamp_s
    share = min(1.0, max(0.0, (stamp_s - before.stamp_s) / span_s)) if span_s > 0.0 else 1.0
    turned = before.X_OB.rotation().ToQuaternion().slerp(share, after.X_OB.rotation().ToQuaternion())
    p, q = before.X_OB.translation(), after.X_OB.translation()
    return RigidTransform(RotationMatrix(turned), p + share * (q - p))


def joints(message: Any, stamp_s: float, names: dict[str, str]) -> Joints:
    """Returns sensor_msgs/JointState under our names; `names` are ours by those of ROS. Unknown values are zero."""
    told = [names.get(each, each) for each in message.name]
    if len(message.position) != len(told) or not np.isfinite(message.position).all():
        raise ValueError("a joint has no finite position")
    columns = (message.position, message.velocity, message.effort)
    known = (values if len(values) == len(told) else np.zeros(len(told)) for values in columns)
    finite = (np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0).tolist() for values in known)
    return Joints(stamp_s, *(dict(zip(told, values, strict=True)) for values in finite))


def newer(before: Any, after: Any) -> Any:
    """Returns the newer of two readings, of which one may be None: a link may reorder them."""
    return before if after is None or (before is not None and after.stamp_s < before.stamp_s) else after


def merged(before: Joints | None, new: Joints) -> Joints:
    """Returns new joints over earlier ones: drivers of base, arm and gripper may publish apart."""
    latest: Joints = newer(before, new)
    if before is None or before.position_rad.keys() <= new.position_rad.keys():
        return latest
    columns = ("position_rad", "velocity_rad_s", "effort_nm")
    return Joints(latest.stamp_s, *({**getattr(before, each), **getattr(new, each)} for each in columns))


def imu(message: Any, stamp_s: float) -> Imu:
    """Returns sensor_msgs/Imu, in the axes of its frame."""
    w, a = message.angular_velocity, message.linear_acceleration
    return Imu(stamp_s, (w.x, w.y, w.z), (a.x, a.y, a.z))


def battery(message: Any, stamp_s: float) -> Battery | None:
    """Returns sensor_msgs/BatteryState; None where it does not tell the charge."""
    return Battery(stamp_s, float(message.percentage)) if 0.0 <= message.percentage <= 1.0 else None


def cloud_points(message: Any) -> NDArray[np.float64]:
    """Returns the finite points (N, 3) of sensor_msgs/PointCloud2, in its frame."""
    fields = {each.name: each for each in message.fields}
    order = ">" if message.is_bigendian else "<"
    formats = [order + _POINT_TYPES[fields[axis].datatype] for axis in "xyz"]
    layout: Any = {"names": [*"xyz"], "formats": formats, "offsets": [fields[axis].offset for axis in "xyz"]}
    kind = np.dtype(layout | {"itemsize": message.point_step})
    rows = np.asarray(message.data, np.uint8)
    if message.row_step != message.width * message.point_step:
        rows = rows.reshape(message.height, message.row_step)[:, : message.width * message.point_step].ravel()
    points = np.frombuffer(np.ascontiguousarray(rows).tobytes(), kind, message.width * message.height)
    xyz = np.stack([points[axis].astype(np.float64) for axis in "xyz"], axis=1)
    return np.asarray(xyz[np.isfinite(xyz).all(axis=1)])


def flat_scan(message: Any, stamp_s: float, X_BL: RigidTransform, X_OB: RigidTransform) -> Scan:
    """Returns sensor_msgs/LaserScan as a revolution of one ring."""
    ranges = np.asarray(message.ranges, np.float32)
    if len(ranges) < 2 or not all(map(math.isfinite, (message.angle_min, message.angle_increment))):
        raise ValueError("the scan has no beams")
    unknown = ~np.isfinite(ranges) | (ranges < max(message.range_min, 0.01)) | (ranges > message.range_max)
    azimuths = float(message.angle_min) + float(message.angle_increment) * np.arange(float(len(ranges)))
    values = np.where(unknown, np.float32(np.nan), ranges)[None, :]
    return Scan(stamp_s, values, np.zeros(1), azimuths, X_BL, X_OB)


def pixels(message: Any) -> NDArray[Any]:
    """Returns the pixels of sensor_msgs/Image: (H, W) grey or depth, or (H, W, 3) RGB."""
    height, width, channels = message.height, message.width, _COLOURS.get(message.encoding, 1)
    if not 0 < width * height <= _MOST_PIXELS:
        raise ValueError(f"a picture of {width}x{height} pixels")
    name = "u1" if message.encoding in _COLOURS else _CHANNEL[message.encoding]
    kind = np.dtype((">" if message.is_bigendian else "<") + name)
    rows = np.asarray(message.data, np.uint8)[: height * message.step].reshape(height, message.step)
    row_bytes = width * channels * kind.itemsize
    if message.step < row_bytes:
        raise ValueError("the rows of a picture are too short")
    made = np.ascontiguousarray(rows[:, :row_bytes]).view(kind).reshape((height, width, channels))
    if channels == 1:
        return np.asarray(made[:, :, 0])
    return np.ascontiguousarray(made[:, :, :3] if message.encoding.startswith("rgb") else made[:, :, 2::-1])


def depth_m(message: Any) -> NDArray[np.float32]:
    """Returns depth (H, W) in metres from floats in metres or integers in millimetres, 0 where it is unknown."""
    values = pixels(message)
    if values.ndim != 2:
        raise ValueError("the depth has colours")
    metres = values.astype(np.float32) * np.float32(0.001 if values.dtype.kind == "u" else 1.0)
    return np.where(np.isfinite(metres) & (metres > 0.0), metres, np.float32(0.0))


def lens(message: Any) -> Intrinsics:
    """Returns the intrinsics of sensor_msgs/CameraInfo, without distortion."""
    fx, fy, cx, cy = (float(message.k[number]) for number in (0, 4, 2, 5))
    if not (fx > 0.0 and fy > 0.0 and math.isfinite(fx + fy + cx + cy)):
        raise ValueError("the camera has no intrinsics")
    return Intrinsics(int(message.width), int(message.height), fx, fy, cx, cy)


def usable(read: Callable[..., Any], *args: Any) -> Any:
    """Returns what a function reads, None for what cannot be used."""
    try:
        return read(*args)
    except (InputError, ValueError, IndexError, TypeError, OverflowError, KeyError, MemoryError):
        return None
