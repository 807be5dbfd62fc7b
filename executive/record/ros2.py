"""Converts an event log to a ROS 2 bag (MCAP with CDR messages) that RViz, Foxglove and `ros2 bag` read.

The map, transforms, laser scans, joint states, poses, paths and pictures become the usual message types; all others
become `std_msgs/String` with their JSON. Times are those of the wall clock, if the log states when it began.
"""

from __future__ import annotations

import base64
import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from mcap_ros2.writer import Writer

from executive.record.history import Event
from executive.record.other_tools import body_frame, grey_map, occupancies, origin_pose, ros_name, transform_of
from executive.record.schemas import DERIVED, JOINTS, MAP, PATH, POSE, SCAN, WALL, stamp
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import yaml_of

_RULE: Final = "=" * 80
_TIME: Final = f"{_RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER: Final = f"{_RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{_TIME}"
_QUATERNION: Final = f"{_RULE}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_POSE: Final = (
    f"{_RULE}\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    f"{_RULE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n{_QUATERNION}"
)
_POSE_STAMPED: Final = "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
_TEXT, _POSES, _PATH = "std_msgs/msg/String", "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Path"
_GRID, _TF, _SCAN = "nav_msgs/msg/OccupancyGrid", "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/LaserScan"
_JOINTS, _PICTURE = "sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"
DEFINITIONS: Final[Mapping[str, str]] = {
    _TEXT: "string data\n",
    _POSES: f"{_POSE_STAMPED}{_HEADER}{_POSE}",
    _PATH: (
        "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"
        f"{_RULE}\nMSG: geometry_msgs/PoseStamped\n{_POSE_STAMPED}{_HEADER}{_POSE}"
    ),
    _PICTURE: f"std_msgs/Header header\nstring format\nuint8[] data\n{_HEADER}",
    _GRID: (
        "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n"
        f"{_RULE}\nMSG: nav_msgs/MapMetaData\nbuiltin_interfaces/Time map_load_time\nfloat32 resolution\n"
        f"uint32 width\nuint32 height\ngeometry_msgs/Pose origin\n{_HEADER}{_POSE}"
    ),
    _TF: (
        "geometry_msgs/TransformStamped[] transforms\n"
        f"{_RULE}\nMSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n"
        f"geometry_msgs/Transform transform\n{_HEADER}{_RULE}\nMSG: geometry_msgs/Transform\n"
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
        f"{_RULE}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n{_QUATERNION}"
    ),
    _SCAN: (
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\n"
        "float32 time_increment\nfloat32 scan_time\nfloat32 range_min\nfloat32 range_max\n"
        f"float32[] ranges\nfloat32[] intensities\n{_HEADER}"
    ),
    _JOINTS: (
        f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{_HEADER}"
    ),
}
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"
_ROOT: Final = "map"
"""Frame that other tools take for the fixed one; it equals the world frame."""
_LONGEST_RANGE_M: Final = 100.0
_LEAST_RANGE_M: Final = 0.05
_LATCHED: Final = frozenset({f"/{MAP}", TF_STATIC})
_FOREVER: Final = {"sec": 9223372036, "nsec": 854775807}
_IDENTITY: Final = {"translation": {"x": 0.0, "y": 0.0, "z": 0.0}, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
_RELIABLE: Final = 1
"""Policies of rmw, by their numbers."""
_KEEP_LAST: Final = 1
_TRANSIENT_LOCAL: Final = 1
_VOLATILE: Final = 2
_AUTOMATIC: Final = 1

Data = Mapping[str, Any]


@dataclass(frozen=True)
class BagMessage:
    """Message in a bag: topic, type and fields."""

    topic: str
    kind: str
    fields: Data


def write_bag(events: Iterable[Event], folder: Path, name: str) -> int:
    """Writes the events as a ROS 2 bag with `metadata.yaml` into an existing folder; returns the number of messages.

    Raises InputError when the bag cannot be written.
    """
    file = f"{name}_0.mcap"
    written = _write(events, folder / file)
    (folder / "metadata.yaml").write_text(yaml_of(_metadata(written, file), flow_style=False), encoding="utf-8")
    return written.count


def write_ros2(events: Iterable[Event], path: Path) -> int:
    """Writes the events as one ROS 2 MCAP file; returns the message count. Raises InputError if it fails."""
    return _write(events, path).count


@dataclass
class _Written:
    """Counts the written messages by topic and type, with the times of the first and the last (ns since 1970)."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    first_ns: int = 0
    last_ns: int = 0

    @property
    def count(self) -> int:
        """Number of messages written."""
        return self.counts.total()


class _BagWriter(Writer):
    """Writer of ROS 2 messages, which gives each channel its quality of service."""

    def write_message(self, topic: str, schema: Any, *rest: Any) -> None:
        """Writes a message; registers the channel at a topic's first message."""
        if topic not in self._channel_ids:
            qos = {"offered_qos_profiles": _qos(topic)}
            self._channel_ids[topic] = self._writer.register_channel(topic, "cdr", schema.id, qos)
        super().write_message(topic, schema, *rest)


def _write(events: Iterable[Event], path: Path) -> _Written:
    written, events = _Written(), tuple(events)
    starts_s = (each.data["start_s"] for each in events if each.topic == WALL and "start_s" in each.data)
    converter = _Converter(next(starts_s, 0.0))
    try:
        with path.open("wb") as file:
            writer: Any = _BagWriter(file)
            schemas = {name: writer.register_msgdef(name, text) for name, text in DEFINITIONS.items()}
            for event in events:
                time_ns = round((converter.start_s + event.stamp_s) * 1e9)
                for message in converter.messages(event):
                    schema = schemas[message.kind]
                    writer.write_message(message.topic, schema, message.fields, time_ns, time_ns, written.count)
                    written.first_ns = written.first_ns if written.count else time_ns
                    written.last_ns = max(written.last_ns, time_ns)
                    written.counts[message.topic, message.kind] += 1
            writer.finish()
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another file", file=path) from error
    return written


def _qos(topic: str) -> str:
    """Quality of service for a topic, as bags state it: late subscribers still get the map and static transforms."""
    profile = {
        "history": _KEEP_LAST,
        "depth": 10,
        "reliability": _RELIABLE,
        "durability": _TRANSIENT_LOCAL if topic in _LATCHED else _VOLATILE,
        "deadline": dict(_FOREVER),
        "lifespan": dict(_FOREVER),
        "liveliness": _AUTOMATIC,
        "liveliness_lease_duration": dict(_FOREVER),
        "avoid_ros_namespace_conventions": False,
    }
    return yaml_of([profile], flow_style=False)


def _metadata(written: _Written, file: str) -> dict[str, Any]:
    """Content of `metadata.yaml` in the format of ROS 2 Humble, which later releases also read."""
    times = {
        "duration": {"nanoseconds": written.last_ns - written.first_ns},
        "starting_time": {"nanoseconds_since_epoch": written.first_ns},
        "message_count": written.count,
    }
    topics = [
        {
            "topic_metadata": {
                "name": topic,
                "type": kind,
                "serialization_format": "cdr",
                "offered_qos_profiles": _qos(topic),
            },
            "message_count": count,
        }
        for (topic, kind), count in written.counts.items()
    ]
    return {
        "rosbag2_bagfile_information": {
            "version": 5,
            "storage_identifier": "mcap",
            **times,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [file],
            "files": [{"path": file, **deepcopy(times)}],
        }
    }


@dataclass
class _Converter:
    """Converts events to ROS 2 messages; `start_s` is the wall time (s since 1970) at which the robot's clock began."""

    start_s: float
    statics: dict[str, Data] = field(default_factory=dict)

    def messages(self, event: Event) -> Iterator[BagMessage]:
        """Yields the ROS 2 messages for an event; none for an event that repeats another one."""
        data, robot = event.data, str(event.data.get("robot") or "")
        space = f"/{ros_name(robot)}" if robot else "/errand"
        header = self._header(data, event.stamp_s)
        if event.topic in DERIVED:
            return
        if not self.statics:
            yield self._static(self._transform(header, {**_IDENTITY, "child_frame_id": "world"}, _ROOT))
        if event.topic == POSE:
            yield BagMessage(f"{space}/{POSE}", _POSES, {"header": header, "pose": data["pose"]})
            moved = transform_of(data)
            yield BagMessage(TF, _TF, {"transforms": [self._transform(header, moved, moved["parent_frame_id"])]})
        elif event.topic == PATH:
            poses = [{"header": header, "pose": pose} for pose in data["poses"]]
            yield BagMessage(f"{space}/{PATH}", _PATH, {"header": header, "poses": poses})
        elif event.topic == JOINTS:
            yield BagMessage(f"{space}/joint_states", _JOINTS, _joint_state(header, data))
        elif event.topic == SCAN:
            yield from self._scan(header, data, robot, space)
        elif event.topic == MAP and "data" in data:
            yield BagMessage(f"/{MAP}", _GRID, _occupancy_grid(header, data))
        elif data.get("format") == "jpeg" and "data" in data:
            fields = {"header": header, "format": data["format"], "data": base64.b64decode(data["data"])}
            yield BagMessage(f"{space}/{event.topic}/compressed", _PICTURE, fields)
        else:
            yield BagMessage(f"/errand/{event.topic}", _TEXT, {"data": json.dumps(data, ensure_ascii=False)})

    def _header(self, data: Data, stamp_s: float) -> Data:
        own = data.get("timestamp")
        when = stamp(self.start_s + (stamp_s if own is None else own["sec"] + own["nsec"] * 1e-9))
        return {"stamp": {"sec": when["sec"], "nanosec": when["nsec"]}, "frame_id": data.get("frame_id", "world")}

    def _scan(self, header: Data, data: Data, robot: str, space: str) -> Iterator[BagMessage]:
        """Scan in the frame of the LiDAR, preceded by the frame's transform if it is new."""
        lidar = f"{ros_name(robot)}/lidar"
        if lidar not in self.statics:
            at = {"translation": data["pose"]["position"], "rotation": data["pose"]["orientation"]}
            yield self._static(self._transform(header, {**at, "child_frame_id": lidar}, body_frame(robot)))
        yield BagMessage(f"{space}/{SCAN}", _SCAN, _laser_scan({**header, "frame_id": lidar}, data))

    def _static(self, transform: Data) -> BagMessage:
        """Message with all static transforms and the new one, because late subscribers get only the last message."""
        self.statics[str(transform["child_frame_id"])] = transform
        return BagMessage(TF_STATIC, _TF, {"transforms": list(self.statics.values())})

    @staticmethod
    def _transform(header: Data, moved: Data, parent: str) -> Data:
        return {
            "header": {**header, "frame_id": parent},
            "child_frame_id": moved["child_frame_id"],
            "transform": {"translation": moved["translation"], "rotation": moved["rotation"]},
        }


def _occupancy_grid(header: Data, data: Data) -> Data:
    cells = occupancies(grey_map(data))
    info = {
        "map_load_time": header["stamp"],
        "resolution": data["resolution_m"],
        "width": cells.shape[1],
        "height": cells.shape[0],
        "origin": origin_pose(data),
    }
    return {"header": header, "info": info, "data": cells.ravel().tolist()}


def _laser_scan(header: Data, data: Data) -> Data:
    ranges = [value or math.inf for value in data["ranges"]]
    return {
        "header": header,
        "angle_min": data["start_angle"],
        "angle_max": data["end_angle"],
        "angle_increment": (data["end_angle"] - data["start_angle"]) / max(len(ranges) - 1, 1),
        "time_increment": 0.0,
        "scan_time": 0.0,
        "range_min": _LEAST_RANGE_M,
        "range_max": _LONGEST_RANGE_M,
        "ranges": ranges,
        "intensities": [],
    }


def _joint_state(header: Data, data: Data) -> Data:
    columns = {name: [joint[name] for joint in data["joints"]] for name in ("name", "position", "velocity", "effort")}
    return {"header": header, **columns}
