"""Converts an event log to a ROS 2 bag (MCAP with CDR messages) that RViz, Foxglove and `ros2 bag` read.

The map, transforms, laser scans, joint states, poses, paths and pictures become the usual message types; all others
become `std_msgs/String` with their JSON. Times are those of the wall clock, if the log states when it began.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import rosbags.typesys.stores.ros2_humble as ros
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from executive.record.history import Event
from executive.record.other_tools import body_frame, ros_name
from skills.inputs.outside import writing

MAP: Final = "map"
GRID: Final = "map/grid"
POSE: Final = "pose"
PATH: Final = "path"
SCAN: Final = "scan"
JOINTS: Final = "joints"
WALL: Final = "wall"
VIEWER_COPIES: Final = frozenset({"detections/boxes", "map/zones", "transform"})
"""Topics of the log whose messages repeat others in a form that Foxglove draws."""
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
_ROOT: Final = "map"
"""Frame that other tools take for the fixed one; it equals the world frame."""
_LONGEST_RANGE_M: Final = 100.0
_LEAST_RANGE_M: Final = 0.05
_LATCHED: Final = frozenset({f"/{MAP}", TF_STATIC})
"""Topics whose last message stays for late listeners."""
_VERSION: Final = 8
"""Version of the metadata that ROS 2 Humble and all later releases read."""
_FOREVER: Final = QosTime(9223372036, 854775807)
_QOS: Final = Qos(
    history=QosHistory.KEEP_LAST,
    depth=10,
    reliability=QosReliability.RELIABLE,
    durability=QosDurability.VOLATILE,
    deadline=_FOREVER,
    lifespan=_FOREVER,
    liveliness=QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_FOREVER,
    avoid_ros_namespace_conventions=False,
)
_IDENTITY: Final = ros.geometry_msgs__msg__Transform(
    ros.geometry_msgs__msg__Vector3(0.0, 0.0, 0.0), ros.geometry_msgs__msg__Quaternion(0.0, 0.0, 0.0, 1.0)
)

Data = Mapping[str, Any]
Message = tuple[str, Any]
"""Topic and message."""


def write_bag(events: Iterable[Event], folder: Path, name: str) -> int:
    """Writes the events as a ROS 2 bag with `metadata.yaml` into an existing folder; returns the number of messages."""
    bag = folder / name
    count = _write(events, bag)
    for file in bag.iterdir():
        file.rename(folder / file.name)
    bag.rmdir()
    return count


def write_bag_file(events: Iterable[Event], path: Path) -> int:
    """Writes the events as one MCAP file of ROS 2; returns the number of messages.

    Raises InputError when it cannot be written.
    """
    with writing(path), TemporaryDirectory(dir=path.parent, prefix=f".{path.name}-") as folder:
        count = write_bag(events, Path(folder), path.stem)
        (Path(folder) / f"{path.stem}.mcap").replace(path)
    return count


def _write(events: Iterable[Event], bag: Path) -> int:
    events, store = tuple(events), get_typestore(Stores.ROS2_HUMBLE)
    starts_s = (each.data["start_s"] for each in events if each.topic == WALL and "start_s" in each.data)
    converter = _Converter(next(starts_s, 0.0))
    writer = Writer(bag, version=_VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for event in events:
            time_ns = round((converter.start_s + event.stamp_s) * 1e9)
            for topic, message in converter.messages(event):
                kind = message.__msgtype__
                if topic not in connections:
                    qos = _QOS._replace(durability=QosDurability.TRANSIENT_LOCAL) if topic in _LATCHED else _QOS
                    added = writer.add_connection(topic, kind, typestore=store, offered_qos_profiles=[qos])
                    connections[topic] = added
                writer.write(connections[topic], time_ns, store.serialize_cdr(message, kind))
    return sum(writer.counts.values())


@dataclass
class _Converter:
    """Converts events to ROS 2 messages; `start_s` is the wall time (s since 1970) at which the robot's clock began."""

    start_s: float
    statics: dict[str, ros.geometry_msgs__msg__TransformStamped] = field(default_factory=dict)

    def messages(self, event: Event) -> Iterator[Message]:
        """Iterates over the messages of an event; none for one that repeats another."""
        data, robot = event.data, str(event.data.get("robot") or "")
        space = f"/{ros_name(robot)}" if robot else "/errand"
        when, frame = self._stamp(data, event.stamp_s), str(data.get("frame_id", "world"))
        header = ros.std_msgs__msg__Header(when, frame)
        if event.topic in VIEWER_COPIES or (event.topic == MAP and "data" in data):  # the grid has the same map
            return
        if not self.statics:
            yield self._static(_transform(when, _ROOT, "world", _IDENTITY))
        if event.topic == POSE:
            pose = _pose(data["pose"])
            yield f"{space}/{POSE}", ros.geometry_msgs__msg__PoseStamped(header, pose)
            yield TF, ros.tf2_msgs__msg__TFMessage([_transform(when, frame, body_frame(robot), _moved(pose))])
        elif event.topic == PATH:
            poses = [ros.geometry_msgs__msg__PoseStamped(header, _pose(pose)) for pose in data["poses"]]
            yield f"{space}/{PATH}", ros.nav_msgs__msg__Path(header, poses)
        elif event.topic == JOINTS:
            yield f"{space}/joint_states", _joint_state(header, data)
        elif event.topic == SCAN:
            lidar = f"{ros_name(robot)}/lidar"
            if lidar not in self.statics:
                yield self._static(_transform(when, body_frame(robot), lidar, _moved(_pose(data["pose"]))))
            yield f"{space}/{SCAN}", _laser_scan(ros.std_msgs__msg__Header(when, lidar), data)
        elif event.topic == GRID:
            yield f"/{MAP}", _occupancy_grid(header, data)
        elif data.get("format") == "jpeg" and "data" in data:
            content = np.frombuffer(base64.b64decode(data["data"]), np.uint8)
            picture = ros.sensor_msgs__msg__CompressedImage(header, data["format"], content)
            yield f"{space}/{event.topic}/compressed", picture
        else:
            yield f"/errand/{event.topic}", ros.std_msgs__msg__String(json.dumps(data, ensure_ascii=False))

    def _stamp(self, data: Data, stamp_s: float) -> ros.builtin_interfaces__msg__Time:
        own = data.get("timestamp")
        time_s = self.start_s + (stamp_s if own is None else own["sec"] + own["nsec"] * 1e-9)
        return ros.builtin_interfaces__msg__Time(*divmod(round(time_s * 1e9), 10**9))

    def _static(self, transform: ros.geometry_msgs__msg__TransformStamped) -> Message:
        """All static transforms, with a new one; listeners that come late get the last message alone."""
        self.statics[transform.child_frame_id] = transform
        return TF_STATIC, ros.tf2_msgs__msg__TFMessage(list(self.statics.values()))


def _pose(pose: Data) -> ros.geometry_msgs__msg__Pose:
    position = ros.geometry_msgs__msg__Point(**pose["position"])
    return ros.geometry_msgs__msg__Pose(position, ros.geometry_msgs__msg__Quaternion(**pose["orientation"]))


def _moved(pose: ros.geometry_msgs__msg__Pose) -> ros.geometry_msgs__msg__Transform:
    """The transform that moves a frame to a pose."""
    at = pose.position
    return ros.geometry_msgs__msg__Transform(ros.geometry_msgs__msg__Vector3(at.x, at.y, at.z), pose.orientation)


def _transform(
    stamp: ros.builtin_interfaces__msg__Time, parent: str, child: str, moved: ros.geometry_msgs__msg__Transform
) -> ros.geometry_msgs__msg__TransformStamped:
    return ros.geometry_msgs__msg__TransformStamped(ros.std_msgs__msg__Header(stamp, parent), child, moved)


def _occupancy_grid(header: ros.std_msgs__msg__Header, data: Data) -> ros.nav_msgs__msg__OccupancyGrid:
    cells = np.frombuffer(base64.b64decode(data["data"]), np.int8)  # an unknown cell, 255 in the log, is -1
    width, size_m = data["column_count"], data["cell_size"]["x"]
    height, origin = len(cells) // width, _pose(data["pose"])
    info = ros.nav_msgs__msg__MapMetaData(header.stamp, size_m, width, height, origin)
    return ros.nav_msgs__msg__OccupancyGrid(header, info, cells)


def _laser_scan(header: ros.std_msgs__msg__Header, data: Data) -> ros.sensor_msgs__msg__LaserScan:
    ranges = np.array([value or math.inf for value in data["ranges"]], np.float32)
    return ros.sensor_msgs__msg__LaserScan(
        header,
        angle_min=data["start_angle"],
        angle_max=data["end_angle"],
        angle_increment=(data["end_angle"] - data["start_angle"]) / max(len(ranges) - 1, 1),
        time_increment=0.0,
        scan_time=0.0,
        range_min=_LEAST_RANGE_M,
        range_max=_LONGEST_RANGE_M,
        ranges=ranges,
        intensities=np.zeros(0, np.float32),
    )


def _joint_state(header: ros.std_msgs__msg__Header, data: Data) -> ros.sensor_msgs__msg__JointState:
    columns = (np.array([each[name] for each in data["joints"]], float) for name in ("position", "velocity", "effort"))
    return ros.sensor_msgs__msg__JointState(header, [joint["name"] for joint in data["joints"]], *columns)
