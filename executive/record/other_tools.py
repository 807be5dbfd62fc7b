"""Converts messages for other tools: laser scans, joint states, transforms of the body, and the map as a grid.

Scans and joint states are measured; transforms and the grid are computed from logged poses and the logged map.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any, Final

import cv2
import numpy as np

from executive.words.schemas import pose_values, stamp
from executive.words.slug import slug
from skills.map_drawing import ZONE_COLOURS
from skills.robot import Joints, Scan

_UINT8: Final = 1
_LINE_LOOP: Final = 1
_ALL: Final = 1
_ABOVE_FLOOR_M: Final = 0.02
_OTHER_SHAPES: Final = ("arrows", "cubes", "spheres", "cylinders", "triangles", "models")
_STEP: Final = 2
"""Only one of so many beams of a scan is logged."""

Message = Mapping[str, Any]


def ros_name(robot: str) -> str:
    """Name of a robot as used in topics and frames: "Alice" becomes "alice"."""
    return slug(robot).replace("-", "_")


def body_frame(robot: str) -> str:
    """Name of the frame that is fixed to a robot's body."""
    return f"{ros_name(robot)}/body"


def scan_message(scan: Scan, robot: str) -> Message:
    """Encodes the ring of a LiDAR scan that is nearest to the horizontal; range 0 is a beam without a return."""
    ring = int(np.argmin(np.abs(scan.elevations_rad)))
    ranges = scan.ranges_m[ring, ::_STEP] * np.cos(scan.elevations_rad[ring])
    return {
        "timestamp": stamp(scan.stamp_s),
        "frame_id": body_frame(robot),
        "robot": robot,
        "pose": pose_values(scan.X_BL),
        "start_angle": float(scan.azimuths_rad[0]),
        "end_angle": float(scan.azimuths_rad[::_STEP][-1]),
        "ranges": [round(value, 2) for value in np.nan_to_num(ranges, nan=0.0).tolist()],
        "intensities": [],
    }


def joints_message(joints: Joints, robot: str) -> Message:
    """Encodes positions, velocities and efforts of the robot's joints."""
    states = [
        {
            "name": name,
            "position": round(position, 4),
            "velocity": round(joints.velocity_rad_s.get(name, 0.0), 3),
            "effort": round(joints.effort_nm.get(name, 0.0), 2),
        }
        for name, position in joints.position_rad.items()
    ]
    return {"timestamp": stamp(joints.stamp_s), "robot": robot, "joints": states}


def transform_of(pose: Message) -> Message:
    """Transform from the world to the body, read from a message with the robot's pose."""
    return {
        "timestamp": pose["timestamp"],
        "parent_frame_id": pose["frame_id"],
        "child_frame_id": body_frame(str(pose.get("robot", ""))),
        "translation": pose["pose"]["position"],
        "rotation": pose["pose"]["orientation"],
    }


def grid_of(data: Message, now_s: float) -> Message:
    """Map as an occupancy grid: 0 free, 100 occupied, 255 unknown; row 0 is at the smallest y."""
    content = np.frombuffer(base64.b64decode(data["data"]), np.uint8)
    grey = np.asarray(cv2.imdecode(content, cv2.IMREAD_GRAYSCALE))[::-1]
    cells = np.select([grey == 0, grey == 255], [100, 0], 255).astype(np.uint8)
    cell, corner = data["resolution_m"], {**data["origin_m"], "z": 0.0}
    return {
        "timestamp": stamp(now_s),
        "frame_id": data["frame_id"],
        "pose": {"position": corner, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}},
        "column_count": grey.shape[1],
        "cell_size": {"x": cell, "y": cell},
        "row_stride": grey.shape[1],
        "cell_stride": 1,
        "fields": [{"name": "occupancy", "offset": 0, "type": _UINT8}],
        "data": base64.b64encode(cells.tobytes()).decode(),
    }


def scene_of(zones: Sequence[Message], now_s: float) -> Message:
    """Zones with their rules as outlines on the floor; the message replaces all zones sent before."""
    when = stamp(now_s)
    level = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    entities = []
    for zone in zones:
        colour = {**dict(zip("rgb", (part / 255.0 for part in ZONE_COLOURS[zone["kind"]]), strict=True)), "a": 1.0}
        line = {"type": _LINE_LOOP, "pose": level, "thickness": 0.05, "scale_invariant": False, "color": colour}
        outlines = [[{"x": x, "y": y, "z": _ABOVE_FLOOR_M} for x, y in outline] for outline in zone["outlines"]]
        middle = {axis: sum(each[axis] for each in outlines[0]) / len(outlines[0]) for axis in "xyz"}
        text = {"pose": {**level, "position": middle}, "billboard": True, "font_size": 0.3, "scale_invariant": False}
        shapes = {
            "lines": [{**line, "points": points, "colors": [], "indices": []} for points in outlines],
            "texts": [{**text, "color": colour, "text": zone["rule"]}],
        }
        head = {"timestamp": when, "frame_id": "world", "id": zone["rule"], "lifetime": stamp(0.0), "metadata": []}
        entities.append({**head, "frame_locked": False, **{name: [] for name in _OTHER_SHAPES}, **shapes})
    return {"deletions": [{"timestamp": when, "type": _ALL, "id": ""}], "entities": entities}
