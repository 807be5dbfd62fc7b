"""Converter of an event log to a ROS 2 bag (MCAP with CDR messages).

Poses, paths and pictures become the usual message types; all others become `std_msgs/String` with their JSON.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from mcap_ros2.writer import Writer

from executive.record.history import Event
from executive.record.schemas import BOXES, DETECTIONS, PATH, POSE, stamp
from executive.words.slug import slug
from skills.files.errors import InputError

_RULE: Final = "=" * 80
_TIME: Final = f"{_RULE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER: Final = f"{_RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{_TIME}"
_POSE: Final = (
    f"{_RULE}\nMSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
    f"{_RULE}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    f"{_RULE}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)
_POSE_STAMPED: Final = "std_msgs/Header header\ngeometry_msgs/Pose pose\n"
DEFINITIONS: Final[Mapping[str, str]] = {
    "std_msgs/msg/String": "string data\n",
    "geometry_msgs/msg/PoseStamped": f"{_POSE_STAMPED}{_HEADER}{_POSE}",
    "nav_msgs/msg/Path": (
        "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"
        f"{_RULE}\nMSG: geometry_msgs/PoseStamped\n{_POSE_STAMPED}{_HEADER}{_POSE}"
    ),
    "sensor_msgs/msg/CompressedImage": f"std_msgs/Header header\nstring format\nuint8[] data\n{_HEADER}",
}

Data = Mapping[str, Any]


def write_ros2(events: Iterable[Event], path: Path) -> int:
    """Writes the events as a ROS 2 bag; returns the number of its messages.

    Raises InputError when the file cannot be written.
    """
    count = 0
    try:
        with path.open("wb") as file:
            writer: Any = Writer(file)
            schemas = {name: writer.register_msgdef(name, text) for name, text in DEFINITIONS.items()}
            for event in events:
                if event.topic != BOXES:
                    topic, kind, message = ros2_message(event)
                    time_ns = round(event.stamp_s * 1e9)
                    writer.write_message(topic, schemas[kind], message, time_ns, time_ns, count)
                    count += 1
            writer.finish()
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another file", file=path) from error
    return count


def ros2_message(event: Event) -> tuple[str, str, Data]:
    """Converts an event to a ROS 2 message: topic, type and fields."""
    form = _FORMS.get(event.topic)
    if form is None or (event.topic == DETECTIONS and "data" not in event.data):
        return f"/errand/{event.topic}", "std_msgs/msg/String", {"data": json.dumps(event.data, ensure_ascii=False)}
    kind, fields = form
    robot = event.data.get("robot")
    return (
        f"/{slug(robot).replace('-', '_') if robot else 'errand'}/{event.topic}",
        kind,
        fields(event.data, event.stamp_s),
    )


def _header(data: Data, stamp_s: float) -> Data:
    when = stamp(stamp_s)
    return {"stamp": {"sec": when["sec"], "nanosec": when["nsec"]}, "frame_id": data.get("frame_id", "world")}


def _path(data: Data, stamp_s: float) -> Data:
    header = _header(data, stamp_s)
    return {"header": header, "poses": [{"header": header, "pose": pose} for pose in data["poses"]]}


_FORMS: Final[Mapping[str, tuple[str, Callable[[Data, float], Data]]]] = {
    POSE: (
        "geometry_msgs/msg/PoseStamped",
        lambda data, stamp_s: {"header": _header(data, stamp_s), "pose": data["pose"]},
    ),
    PATH: ("nav_msgs/msg/Path", _path),
    DETECTIONS: (
        "sensor_msgs/msg/CompressedImage",
        lambda data, stamp_s: {
            "header": _header(data, stamp_s),
            "format": data["format"],
            "data": base64.b64decode(data["data"]),
        },
    ),
}
