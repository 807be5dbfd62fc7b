"""Converts an event log to a ROS 2 bag (MCAP, CDR); what has no usual type becomes JSON. Times are the wall clock's."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from errand_ros2 import messages
from errand_ros2.messages import Fields
from errand_ros2.wire.types import ros_types
from executive.record.history import Event
from executive.record.other_tools import body_frame, ros_name
from executive.words.schemas import DERIVED, GRID
from skills.inputs.outside import writing

VIEWER_COPIES: Final = DERIVED - {GRID}
TF, TF_STATIC = "/tf", "/tf_static"
_VERSION: Final = 8  # version of the metadata that ROS 2 Humble and all later releases read
_FOREVER: Final = QosTime(9223372036, 854775807)
_QOS: Final = Qos(
    *(QosHistory.KEEP_LAST, 10, QosReliability.RELIABLE, QosDurability.VOLATILE, _FOREVER, _FOREVER),
    *(QosLiveliness.AUTOMATIC, _FOREVER, False),
)
_LATE: Final = _QOS._replace(durability=QosDurability.TRANSIENT_LOCAL)  # late listeners get the last message
_HERE: Final = {"position": {}, "orientation": {"w": 1.0}}

Message = tuple[str, str, Fields]  # topic, type and fields


def write_bag(events: Iterable[Event], out: Path) -> int:
    """Writes the events as a ROS 2 bag, a new folder or one file `*.mcap`; returns the number of messages.

    Raises InputError when it cannot be written, as where a folder is not empty.
    """
    events, types, is_file = tuple(events), ros_types(), out.suffix == ".mcap"
    starts_s = (each.data["start_s"] for each in events if each.topic == "wall" and "start_s" in each.data)
    converter, connections = _Converter(next(starts_s, 0.0)), dict[str, Any]()
    with writing(out, "name another --out"):
        if not is_file:
            out.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as folder:
            bag = Path(folder) / out.resolve().stem
            writer = Writer(bag, version=_VERSION, storage_plugin=StoragePlugin.MCAP)
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            with writer:
                for event in events:
                    time_ns = round((converter.start_s + event.stamp_s) * 1e9)
                    for topic, kind, fields in converter.messages(event):
                        if topic not in connections:
                            qos = [_LATE if topic in ("/map", TF_STATIC) else _QOS]
                            added = writer.add_connection(topic, kind, typestore=types.store, offered_qos_profiles=qos)
                            connections[topic] = added, types.message(kind)
                        connection, message_type = connections[topic]
                        writer.write(connection, time_ns, message_type.encode(fields))
            (bag / f"{bag.name}.mcap" if is_file else bag).replace(out)
    return sum(writer.counts.values())


@dataclass
class _Converter:
    """Converts events to ROS 2 messages; `start_s` is the wall time (s since 1970) at which the robot's clock began."""

    start_s: float
    statics: dict[str, Fields] = field(default_factory=dict)

    def messages(self, event: Event) -> Iterator[Message]:
        """Iterates over the messages of an event; none for one that repeats another."""
        data, topic, robot = event.data, event.topic, str(event.data.get("robot") or "")
        space = f"/{ros_name(robot)}" if robot else "/errand"
        own = data.get("timestamp")
        stamp_s = self.start_s + (event.stamp_s if own is None else own["sec"] + own["nsec"] * 1e-9)
        header = messages.header(stamp_s, str(data.get("frame_id", "world")))
        if topic in VIEWER_COPIES or (topic == "map" and "data" in data):  # the grid has the same map
            return
        if not self.statics:
            yield self._static(messages.moved(messages.header(stamp_s, messages.MAP_FRAME), "world", _HERE))
        if topic == "pose":
            yield f"{space}/pose", "geometry_msgs/msg/PoseStamped", {"header": header, "pose": data["pose"]}
            moved = messages.moved(header, body_frame(robot), data["pose"])
            yield TF, "tf2_msgs/msg/TFMessage", {"transforms": [moved]}
        elif topic == "path":
            poses = [{"header": header, "pose": pose} for pose in data["poses"]]
            yield f"{space}/path", "nav_msgs/msg/Path", {"header": header, "poses": poses}
        elif topic == "joints":
            parts = ("name", "position", "velocity", "effort")
            columns = {what: [joint[what] for joint in data["joints"]] for what in parts}
            yield f"{space}/joint_states", "sensor_msgs/msg/JointState", {"header": header, **columns}
        elif topic == "scan":
            lidar = f"{ros_name(robot)}/lidar"
            if lidar not in self.statics:
                yield self._static(messages.moved(messages.header(stamp_s, body_frame(robot)), lidar, data["pose"]))
            ranges, ends = [value or np.nan for value in data["ranges"]], (data["start_angle"], data["end_angle"])
            scan = messages.laser_scan(messages.header(stamp_s, lidar), ranges, *ends)
            yield f"{space}/scan", "sensor_msgs/msg/LaserScan", scan
        elif topic == GRID:
            cells = np.frombuffer(base64.b64decode(data["data"]), np.int8)  # an unknown cell, 255 in the log, is -1
            width, size_m = data["column_count"], data["cell_size"]["x"]
            info = {"resolution": size_m, "width": width, "height": len(cells) // width}
            info |= {"origin": data["pose"], "map_load_time": header["stamp"]}
            yield "/map", "nav_msgs/msg/OccupancyGrid", {"header": header, "info": info, "data": cells}
        elif data.get("format") == "jpeg" and "data" in data:
            content = np.frombuffer(base64.b64decode(data["data"]), np.uint8)
            picture = {"header": header, "format": "jpeg", "data": content}
            yield f"{space}/{topic}/compressed", "sensor_msgs/msg/CompressedImage", picture
        else:
            text = json.dumps(data, ensure_ascii=False)
            yield f"/errand/{topic}", "std_msgs/msg/String", {"data": text}

    def _static(self, transform: Fields) -> Message:
        """All static transforms, with a new one; listeners that come late get the last message alone."""
        self.statics[transform["child_frame_id"]] = transform
        return TF_STATIC, "tf2_msgs/msg/TFMessage", {"transforms": [*self.statics.values()]}
