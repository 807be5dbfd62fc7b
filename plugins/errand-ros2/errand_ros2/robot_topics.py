"""Topics of one robot, at their usual names, types and rates, below the robot's namespace."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Final

import numpy as np
from pydrake.math import RigidTransform

from errand_ros2 import messages
from errand_ros2.messages import MOST_COLUMNS, Fields
from errand_ros2.wire.node import Node
from errand_ros2.wire.types import LATCHED, SENSOR, Qos
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import CameraCapabilities, Capabilities, Image, Mount, NoImageError, Robot

IMAGE_PERIOD_S, BATTERY_PERIOD_S, _EPSILON_S = 0.2, 1.0, 1e-6
_FRAMES: Final = ("odom", "body", "lidar", "hand")
_IMAGE, _INFO, _COMPRESSED = (f"sensor_msgs/msg/{each}" for each in ("Image", "CameraInfo", "CompressedImage"))
_PICTURES: Final[Mapping[bool, Mapping[str, tuple[str, Callable[[Image, str, int], Fields]]]]] = {
    False: {
        "image": (_IMAGE, messages.picture),
        "camera_info": (_INFO, messages.camera_info),
        "image/compressed": (_COMPRESSED, messages.compressed),
    },
    True: {
        "depth/image": (_IMAGE, messages.depth),
        "depth/camera_info": (_INFO, partial(messages.camera_info, of_depth=True)),
        "depth/image/compressedDepth": (_COMPRESSED, messages.compressed_depth),
    },
}
"""Topics of a camera, without and with depth: their types, and how their messages are made."""


class Frames:
    """Publisher of `/tf`, and of `/tf_static`, whose one message has the static transforms of all robots."""

    def __init__(self, node: Node) -> None:
        self.moving = node.publisher("/tf", "tf2_msgs/msg/TFMessage", Qos(depth=100))
        self._static = node.publisher("/tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
        self._fixed: dict[str, Fields] = {}

    def fix(self, *every: Fields) -> None:
        """Publishes static transforms, unless they have been published."""
        if any(each["child_frame_id"] not in self._fixed for each in every):
            self._fixed |= {each["child_frame_id"]: each for each in every}
            self._static.put({"transforms": [*self._fixed.values()]})


class _Stream:
    """Publishers of one camera's pictures, or of its depth; the plant renders only what a subscription asks for."""

    def __init__(self, node: Node, camera: CameraCapabilities, depth: bool) -> None:
        self.camera, self.depth, self.due_s = camera, depth, 0.0
        self.frame = f"{node.namespace.strip('/')}/{camera.source}_camera"
        topics = _PICTURES[depth].items()
        self.out = [(node.publisher(f"{camera.source}/{name}", kind, SENSOR), make) for name, (kind, make) in topics]


def frames_at(can: Capabilities, position_rad: Mapping[str, float]) -> dict[str, RigidTransform]:
    """Returns the poses in the body of body, hand, head and cameras at positions of the joints, by name."""
    found = {Mount.BODY.value: RigidTransform()}
    if can.arm is not None and position_rad.keys() >= {*can.arm.joint_names}:
        q_rad = np.array([position_rad[name] for name in can.arm.joint_names])
        found[Mount.HAND.value] = arm_model(can).X_BH(q_rad)
    if can.head is not None:
        found[Mount.HEAD.value] = can.head.X_BF(*(position_rad.get(name, 0.0) for name in can.head.joint_names))
    seen = [each for each in can.cameras if each.mount.value in found]
    return found | {f"{each.source}_camera": found[each.mount.value] @ each.X_FC for each in seen}


def frames_on_body(robot: Robot) -> dict[str, RigidTransform]:
    """Returns the poses in the body of all frames that the robot carries, by name."""
    found = frames_at(robot.capabilities(), robot.joints().position_rad)
    found |= {f"{name}_optical": X_BF for name, X_BF in found.items() if name.endswith("_camera")}
    found["base_link"] = found["body"]
    return found if (scan := robot.scan()) is None else {**found, "lidar": scan.X_BL}


class RobotTopics:
    """Publishers of one robot's readings. `publish` reads the robot, and must be called where its verbs may be."""

    def __init__(self, node: Node, robot: Robot, frames: Frames, most_columns: int = MOST_COLUMNS) -> None:
        """The last part of the node's namespace names the robot's frames."""
        self._robot, self._frames = robot, frames
        self._most_columns, self.image_period_s = most_columns, IMAGE_PERIOD_S
        space = node.namespace.strip("/")
        self._odom_frame, self._body, self._lidar, self._hand = (f"{space}/{each}" for each in _FRAMES)
        self._odom = node.publisher("odom", "nav_msgs/msg/Odometry")
        self._joints = node.publisher("joint_states", "sensor_msgs/msg/JointState")
        self._imu = node.publisher("imu", "sensor_msgs/msg/Imu", SENSOR)
        self._scan = node.publisher("scan", "sensor_msgs/msg/LaserScan", SENSOR)
        self._points = node.publisher("points", "sensor_msgs/msg/PointCloud2", SENSOR)
        self._battery = node.publisher("battery_state", "sensor_msgs/msg/BatteryState")
        self._holding = node.publisher("gripper/holding", "std_msgs/msg/Bool")
        self._force = node.publisher("gripper/force", "geometry_msgs/msg/WrenchStamped")
        abilities = robot.capabilities()
        urdf = {"data": messages.well_formed(abilities.description)}
        node.publisher("robot_description", "std_msgs/msg/String", LATCHED).put(urdf)
        self._streams = [_Stream(node, each, depth) for each in abilities.cameras for depth in (False, True)]
        on_body = [each for each in self._streams if each.camera.mount is Mount.BODY]
        frames.fix(*(messages.transform(0.0, self._body, each.frame, each.camera.X_FC) for each in on_body))
        others = {f"{space}/base_link": self._body, **{f"{each.frame}_optical": each.frame for each in self._streams}}
        frames.fix(*(messages.transform(0.0, frame, name, RigidTransform()) for name, frame in others.items()))
        self.stamps_s: dict[str, float] = {}  # of the last odometry and scan that were published, by topic
        self._battery_due_s = 0.0

    def publish(self, now_s: float, X_WO: RigidTransform | None) -> None:
        """Publishes the readings that are new, and with `X_WO` where the odometry's frame lies on the map."""
        odometry = self._robot.odometry()
        stamp_s = self.stamps_s["odom"] = odometry.stamp_s
        moving = [messages.transform(stamp_s, self._odom_frame, self._body, odometry.X_OB)]
        if X_WO is not None:
            moving.append(messages.transform(stamp_s, messages.MAP_FRAME, self._odom_frame, X_WO))
        self._odom.put(messages.odometry(odometry, self._odom_frame, self._body))
        self._joints.put(messages.joint_state(self._robot.joints()))
        if self._robot.capabilities().gripper is not None:
            gripper = self._robot.gripper()
            self._holding.put({"data": gripper.holding})
            head = messages.header(gripper.stamp_s, self._hand)
            if (X_BH := frames_on_body(self._robot).get("hand")) is not None:
                moving.append(messages.transform(stamp_s, self._body, self._hand, X_BH))
            self._force.put({"header": head, "wrench": {"force": {"z": gripper.force_n}}})
        if (imu := self._robot.imu()) is not None:
            self._imu.put(messages.imu(imu, self._body))
        self._publish_scan()
        if now_s >= self._battery_due_s - _EPSILON_S:
            self._battery_due_s = now_s + BATTERY_PERIOD_S
            self._battery.put(messages.battery(self._robot.battery()))
        self._frames.moving.put({"transforms": moving})
        self.publish_pictures(now_s)

    def publish_pictures(self, now_s: float) -> None:
        """Publishes the pictures for which subscriptions wait."""
        for at in self._streams:
            if now_s >= at.due_s - _EPSILON_S and any(each.is_heard for each, _ in at.out):
                at.due_s = now_s + self.image_period_s
                with suppress(NoImageError):
                    self._publish_picture(at, self._robot.image(at.camera.source, visual=not at.depth, depth=at.depth))

    def _publish_scan(self) -> None:
        scan = self._robot.scan()
        if scan is None or scan.stamp_s == self.stamps_s.get("scan"):
            return
        period_s = scan.stamp_s - self.stamps_s.get("scan", scan.stamp_s)
        self.stamps_s["scan"] = scan.stamp_s
        self._frames.fix(messages.transform(scan.stamp_s, self._body, self._lidar, scan.X_BL))
        self._scan.put(messages.level_scan(scan, self._lidar, max(0.0, period_s)))
        if self._points.is_heard:
            self._points.put(messages.points(scan, self._body))

    def _publish_picture(self, at: _Stream, reading: Image) -> None:
        """Publishes a picture or depth, and the transform of a camera that moves on the body."""
        if at.camera.mount is not Mount.BODY:
            X_OC = reading.frames.pose(reading.camera_frame)
            moved = messages.transform(reading.stamp_s, self._odom_frame, at.frame, X_OC)
            self._frames.moving.put({"transforms": [moved]})
        for out, make in at.out:
            if out.is_heard:
                out.put(make(reading, at.frame, self._most_columns))
