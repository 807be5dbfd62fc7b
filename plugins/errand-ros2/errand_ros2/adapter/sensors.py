"""Sensors of a robot of ROS 2: what its topics said last. Handlers run in threads of Zenoh."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any, Final, cast

import cv2
import numpy as np
from pydrake.math import RigidTransform

from errand_ros2 import readings
from errand_ros2.adapter.clocks import RobotClock
from errand_ros2.adapter.description import CameraFile, Description
from errand_ros2.readings import newer, planar_pose, transform_of
from errand_ros2.robot_topics import frames_at
from errand_ros2.wire.node import Node
from errand_ros2.wire.types import LATCHED, SENSOR
from skills.estimate.scan_points import scan_of_points
from skills.geometry import compose, inverse
from skills.robot import (
    Battery,
    Capabilities,
    FrameTree,
    Gripper,
    Image,
    Imu,
    Joints,
    NoImageError,
    Odometry,
    OwnLocalisation,
    Pose2D,
    Scan,
)

OLD_STATE_S, SILENT_S, _PICTURE_S = 0.5, 3.0, 2.0  # ages of the last reading; longest wait for a picture
_SAME_S, _EPSILON_S = 0.051, 1e-6  # readings so far apart count as of one time; rounding of stamps
NEVER: Final = Odometry(-math.inf, RigidTransform(), (0.0, 0.0, 0.0))
_KEPT, _MOST_FRAMES = 400, 32


class SensedRobot:
    """Robot that senses: the verbs of `skills.robot.Robot` for that."""

    def __init__(self, name: str, node: Node, clock: RobotClock, description: Description) -> None:
        self.name, self._node, self._clock, self._description = name, node, clock, description
        file = description.file
        self._lidar_frame = file.lidar.frame or f"{node.namespace.strip('/')}/lidar"
        self._names = {theirs: ours for ours, theirs in file.joint_names.items()}
        self._lock = threading.RLock()
        self._odometry: deque[Odometry] = deque(maxlen=_KEPT)
        self._joints: deque[Joints] = deque(maxlen=_KEPT)
        self._fixed: dict[str, tuple[str, RigidTransform]] = {}
        self._jumps, self.body_frame = 0, ""
        self._latest: dict[str, Any] = {}  # readings that come alone
        self._felt = Gripper(0.0, 0.0, 0.0, False)
        node.subscribe(file.odometry.topic, "nav_msgs/msg/Odometry", self._hear_odometry)
        node.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", self._hear_fixed, LATCHED)
        self._hear(file.joints, "sensor_msgs/msg/JointState", self._hear_joints)
        self._hear(file.lidar.points, "sensor_msgs/msg/PointCloud2", partial(self._take, "scan", self._ringed_scan))
        self._hear(file.lidar.scan, "sensor_msgs/msg/LaserScan", partial(self._take, "scan", self._flat_scan))
        self._hear(file.imu, "sensor_msgs/msg/Imu", partial(self._take, "imu", readings.imu))
        self._hear(file.battery, "sensor_msgs/msg/BatteryState", partial(self._take, "battery", readings.battery))
        self._hear(file.pose, "geometry_msgs/msg/PoseWithCovarianceStamped", partial(self._take, "place", self._own))
        if (grip := file.gripper) is not None:
            self._hear(grip.holding, "std_msgs/msg/Bool", lambda told: self._feel(holding=bool(told.data)))
            self._hear(grip.force, "geometry_msgs/msg/WrenchStamped", self._hear_force)

    def _hear(self, topic: str | None, kind: str, handle: Callable[[Any], None]) -> None:
        if topic is not None:
            self._node.subscribe(topic, kind, handle, SENSOR)

    def capabilities(self) -> Capabilities:
        """Capabilities of the described robot."""
        return self._description.capabilities

    def odometry(self) -> Odometry:
        """Latest dead reckoning; before the first, that of a robot which never answered."""
        with self._lock:
            return self._odometry[-1] if self._odometry else NEVER

    def joints(self) -> Joints:
        """Latest joint state; empty before the first."""
        with self._lock:
            return self._joints[-1] if self._joints else Joints(self._clock.now(), {}, {}, {})

    def own_localisation(self) -> OwnLocalisation | None:
        """Latest pose by the robot's own localisation; None without one."""
        return cast(OwnLocalisation | None, self._latest.get("place"))

    def imu(self) -> Imu | None:
        """Latest inertial measurement; None without one."""
        return cast(Imu | None, self._latest.get("imu"))

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution; None before the first."""
        return cast(Scan | None, self._latest.get("scan"))

    def gripper(self) -> Gripper:
        """Latest gripper state."""
        now, can = self.joints(), self._description.capabilities.gripper
        fingers = [(now.position_rad.get(name), share) for name, share in (can.finger_joints if can else ())]
        openings = [position / share for position, share in fingers if position is not None]
        opening = float(np.mean(openings)) if openings else self._felt.opening
        return replace(self._felt, stamp_s=now.stamp_s, opening=max(0.0, opening))

    def battery(self) -> Battery:
        """Latest battery state; full when no topic tells."""
        return self._latest.get("battery") or Battery(self._clock.now(), 1.0)

    def faults(self) -> tuple[str, ...]:
        """Returns a fault while the robot is silent."""
        silent_s = self.silent_s()
        return (f"the robot has not answered for {silent_s:.0f} s",) if silent_s > SILENT_S else ()

    def silent_s(self) -> float:
        """Age of the last odometry; infinite before the first."""
        return self._clock.now() - self.odometry().stamp_s

    def missing(self) -> str:
        """Names the first topic that has said nothing yet; empty when all that is needed was heard."""
        file, can = self._description.file, self._description.capabilities
        left = sorted({*(can.arm.joint_names if can.arm else ())} - self.joints().position_rad.keys())
        if self.odometry() is NEVER:
            return file.odometry.topic
        if left:
            return f"{file.joints} with {', '.join(left)}"
        if "scan" not in self._latest:
            frame = f" (or no /tf_static to {self._lidar_frame})" if self._X_BF(self._lidar_frame) is None else ""
            return f"{file.lidar.points or file.lidar.scan}{frame}"
        return ""

    def _feel(self, **changes: Any) -> None:
        with self._lock:
            self._felt = replace(self._felt, **changes)

    def _stamp(self, message: Any) -> float:
        return self._clock.ours(readings.stamp_of(message.header))

    def _hear_odometry(self, message: Any) -> None:
        raised_m, stamp_s = self._description.file.odometry.raised, readings.stamp_of(message.header)
        read = readings.usable(readings.odometry, message, stamp_s, raised_m)
        if read is None:
            return
        with self._lock:
            self.body_frame = message.child_frame_id.strip("/")
            self._clock.hear(stamp_s)
            if self._clock.jumps != self._jumps:
                self._jumps = self._clock.jumps
                self._odometry.clear()
                self._joints.clear()
            stamped = replace(read, stamp_s=self._clock.ours(stamp_s))
            if not self._odometry or stamped.stamp_s > self._odometry[-1].stamp_s - _EPSILON_S:
                self._odometry.append(stamped)

    def _hear_joints(self, message: Any) -> None:
        with self._lock:
            stamp_s = self._stamp(message)
            read = readings.usable(readings.joints, message, stamp_s, self._names)
            if read is not None and (not self._joints or stamp_s > self._joints[-1].stamp_s - _SAME_S):
                self._joints.append(readings.merged(self._joints[-1] if self._joints else None, read))

    def _hear_fixed(self, message: Any) -> None:
        for each in message.transforms:
            moved = readings.usable(transform_of, each.transform.translation, each.transform.rotation)
            if moved is not None and len(self._fixed) < _KEPT:
                self._fixed[each.child_frame_id.strip("/")] = (each.header.frame_id.strip("/"), moved)

    def _take(self, what: str, read: Callable[[Any, float], Any], message: Any) -> None:
        """Reads a message with its stamp; what cannot be used, and what is older than the last, is dropped."""
        found = newer(self._latest.get(what), readings.usable(read, message, self._stamp(message)))
        self._latest |= {} if found is None else {what: found}

    def _ringed_scan(self, message: Any, stamp_s: float) -> Scan | None:
        X_BF, X_BL = self._X_BF(message.header.frame_id.strip("/")), self._X_BF(self._lidar_frame)
        points_F, X_OB, file = readings.cloud_points(message), self._X_OB(stamp_s), self._description.file.lidar
        if X_BF is None or X_BL is None or X_OB is None:
            return None
        points_L = (X_BL.inverse() @ X_BF @ points_F.T).T if len(points_F) else points_F
        elevations = np.radians(np.linspace(file.lowest, file.highest, file.rings))
        return scan_of_points(points_L, elevations, file.columns, stamp_s, X_BL, X_OB)

    def _flat_scan(self, message: Any, stamp_s: float) -> Scan | None:
        X_BL, X_OB = self._X_BF(message.header.frame_id.strip("/")), self._X_OB(stamp_s)
        return None if X_BL is None or X_OB is None else readings.flat_scan(message, stamp_s, X_BL, X_OB)

    def _own(self, message: Any, stamp_s: float) -> OwnLocalisation | None:
        pose, X_OB = planar_pose(message.pose.pose), self._X_OB(stamp_s)
        return X_OB and OwnLocalisation(stamp_s, compose(pose, inverse(Pose2D.from_transform(X_OB))))

    def _hear_force(self, message: Any) -> None:
        force = message.wrench.force
        if math.isfinite(force_n := math.hypot(force.x, force.y, force.z)):
            self._feel(force_n=force_n)

    def _X_BF(self, frame: str) -> RigidTransform | None:
        """Pose of a fixed frame in the body; None when no static transforms lead there."""
        to_body, to_frame = self._above(self.body_frame), self._above(frame)
        common = next((each for each in to_frame if each in to_body), None)
        if common is None or not self.body_frame:
            return None
        raised = RigidTransform([0.0, 0.0, -self._description.file.odometry.raised])
        return raised @ to_body[common].inverse() @ to_frame[common]

    def _above(self, frame: str) -> dict[str, RigidTransform]:
        """Frames from a frame up to its root, each with the pose of the first in it."""
        found = {frame: RigidTransform()}
        while frame in self._fixed and len(found) < _MOST_FRAMES:
            parent, X_PF = self._fixed[frame]
            found[parent], frame = X_PF @ found[frame], parent
        return found

    def _X_OB(self, stamp_s: float) -> RigidTransform | None:
        """Pose of the body at a time; None when odometry does not reach so far back."""
        with self._lock:
            seen = list(self._odometry)
        after = next((n for n in range(len(seen) - 1, -1, -1) if seen[n].stamp_s <= stamp_s + _EPSILON_S), None)
        if after is None:
            return None
        return readings.between(seen[after], seen[min(after + 1, len(seen) - 1)], stamp_s)

    def frames_at(self, stamp_s: float) -> FrameTree | None:
        """Frame tree at a time; None when odometry or joints do not reach so far back."""
        can, X_OB = self._description.capabilities, self._X_OB(stamp_s)
        with self._lock:
            joints = min(self._joints, key=lambda each: abs(each.stamp_s - stamp_s), default=None)
        found = frames_at(can, {} if joints is None else joints.position_rad)
        if X_OB is None or (can.arm is not None and "hand" not in found):
            return None
        return FrameTree({**{name: ("body", X_BF) for name, X_BF in found.items()}, "body": ("odom", X_OB)})

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Subscribes for one picture with depth. Raises ValueError and NoImageError."""
        file = self._description.file.cameras.get(source)
        if file is None:
            raise ValueError(f"there is no camera {source!r}")
        if depth and file.depth is None:
            raise NoImageError(f"{source}: the camera has no depth")
        found = self._take_one(file, visual=visual, depth=depth)
        if found is None:
            raise NoImageError(f"{source}: no picture came within {_PICTURE_S:g} s")
        return self._image(source, found, visual=visual, depth=depth)

    def _take_one(self, file: CameraFile, *, visual: bool, depth: bool) -> Mapping[str, Any] | None:
        """Returns messages of about one time, none from before this call; None when they do not come in time."""
        since_s, new, found = self._clock.now() - _EPSILON_S, threading.Condition(), dict[str, Any]()
        info, image = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Image"
        wanted = {"info": (file.info, info), "image": (file.image, image)} if visual else {}
        if depth:
            wanted |= {"depth_info": (file.depth_info or file.info, info), "depth": (str(file.depth), image)}

        def take(what: str, message: Any) -> None:
            with new:
                found[what] = message
                new.notify()

        def fits() -> bool:
            if found.keys() != wanted.keys():
                return False
            stamps = [self._stamp(found[each]) for each in found if "info" not in each]
            return min(stamps) >= since_s and max(stamps) - min(stamps) <= _SAME_S

        with ExitStack() as ends:
            for what, (topic, kind) in wanted.items():
                ends.callback(self._node.subscribe(topic, kind, partial(take, what), SENSOR))
            with new:
                return dict(found) if new.wait_for(fits, _PICTURE_S) else None

    def _image(self, source: str, found: Mapping[str, Any], *, visual: bool, depth: bool) -> Image:
        stamp_s = self._stamp(found["image" if visual else "depth"])
        frames = self.frames_at(stamp_s)
        picture = readings.usable(readings.pixels, found["image"]) if visual else np.zeros((0, 0), np.uint8)
        far = readings.usable(readings.depth_m, found["depth"]) if depth else np.zeros((0, 0), np.float32)
        lenses = [readings.usable(readings.lens, found[each]) for each in ("info", "depth_info") if each in found]
        if frames is None or picture is None or far is None or None in lenses:
            raise NoImageError(f"{source}: the picture cannot be used")
        colour = picture if picture.ndim == 3 else None
        grey = picture if colour is None else np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), np.uint8)
        return Image(stamp_s, source, f"{source}_camera", lenses[0], lenses[-1], colour, grey, far, frames)
