"""Fields of messages of ROS 2 from a robot's readings, with the stamps of its clock; what is left out is zero."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import cv2
import numpy as np
from pydrake.math import RigidTransform

from errand_ros2.wire.types import ros_types
from executive.record.event_log import plain_values
from skills.api import FreeSpace
from skills.footprint import clearance_on_grid
from skills.grid_map import GridMap
from skills.robot import Battery, FloatArray, Image, Imu, Intrinsics, Joints, Odometry, Pose2D, Scan

_NAMESPACES: Final = {"drake": "http://drake.mit.edu", "xacro": "http://ros.org/wiki/xacro"}
MAP_FRAME: Final = "map"  # it equals the frame "world" of logs
LEAST_RANGE_M, MOST_RANGE_M, _FLOAT32 = 0.05, 100.0, 7  # the last is a type of sensor_msgs/PointField
MOST_COLUMNS: Final = 320  # raw pictures of a run are reduced to at most so many columns
_UNKNOWN: Final = np.array([-1.0, *[0.0] * 8])  # covariance of what is not measured
_CELL_M, _DECAY_M = 0.1, 0.3  # cells of a costmap; where costs fall to 1/e
_SPHERE, _TEXT, _DELETE_ALL = 2, 9, 3  # types and an action of visualization_msgs/Marker
_MARKER_M, _GREEN = 0.12, {"r": 0.1, "g": 0.7, "b": 0.2, "a": 0.8}
_ODOMETRY_VARIANCES: Final = (4e-4, 4e-4, 1e-4, 1e-4, 1e-4, 1e-3)  # m², rad²: 2 cm and 2 degrees after some metres
_VELOCITY_VARIANCES: Final = (4e-4, 4e-4, 1e-4, 1e-4, 1e-4, 4e-4)  # m²/s², rad²/s²
_RATE_VARIANCE, _ACCELERATION_VARIANCE = 1e-4, 1e-2  # rad²/s², m²/s⁴
Fields = dict[str, Any]  # values of a message by field


def time_of(stamp_s: float) -> Fields:
    """Returns a time of the robot's clock; times before its beginning become zero."""
    sec, nanosec = divmod(max(0, round(stamp_s * 1e9)), 10**9)
    return {"sec": sec, "nanosec": nanosec}


def header(stamp_s: float, frame: str = "") -> Fields:
    """Returns a header."""
    return {"stamp": time_of(stamp_s), "frame_id": frame}


def vector(values: Sequence[float]) -> Fields:
    """Returns a vector or point of three numbers."""
    return dict(zip("xyz", map(float, values), strict=True))


def pose(X: RigidTransform) -> Fields:
    """Returns a pose."""
    turn = X.rotation().ToQuaternion()
    orientation = {"x": turn.x(), "y": turn.y(), "z": turn.z(), "w": turn.w()}
    return {"position": vector(X.translation()), "orientation": orientation}


def pose_stamped(stamp_s: float, frame: str, X: RigidTransform) -> Fields:
    """Returns a pose in a frame."""
    return {"header": header(stamp_s, frame), "pose": pose(X)}


def transform(stamp_s: float, parent: str, child: str, X: RigidTransform) -> Fields:
    """Returns the transform from a frame to its child."""
    return moved(header(stamp_s, parent), child, pose(X))


def moved(head: Fields, child: str, at: Mapping[str, Any]) -> Fields:
    """Returns the transform from a header's frame to its child, which has a pose in it."""
    values = {"translation": at["position"], "rotation": at["orientation"]}
    return {"header": head, "child_frame_id": child, "transform": values}


def well_formed(urdf: str) -> str:
    """Returns a URDF whose root declares each prefix that it uses, as XML asks and Drake does not."""
    used = {each: uri for each, uri in _NAMESPACES.items() if f"{each}:" in urdf and f"xmlns:{each}" not in urdf}
    declared = "".join(f' xmlns:{each}="{uri}"' for each, uri in used.items())
    return re.sub(r"<robot\b", f"<robot{declared}", urdf, count=1)


def odometry(reading: Odometry, frame: str, body: str) -> Fields:
    """Returns the robot's dead reckoning; what it does not measure has a covariance so large that none counts it."""
    at = {"pose": pose(reading.X_OB), "covariance": np.diag(_ODOMETRY_VARIANCES).ravel()}
    moving = {"twist": twist(reading.velocity), "covariance": np.diag(_VELOCITY_VARIANCES).ravel()}
    return {"header": header(reading.stamp_s, frame), "child_frame_id": body, "pose": at, "twist": moving}


def pose_with_covariance(stamp_s: float, X_WB: RigidTransform, covariance: FloatArray) -> Fields:
    """Returns an estimated pose on the map; the covariance (3, 3) is over x, y and yaw."""
    full = np.zeros((6, 6))
    full[np.ix_([0, 1, 5], [0, 1, 5])] = covariance
    return {"header": header(stamp_s, MAP_FRAME), "pose": {"pose": pose(X_WB), "covariance": full.ravel()}}


def joint_state(reading: Joints) -> Fields:
    """Returns the joints' positions, velocities and efforts."""
    names = [*reading.position_rad]
    columns = {"position": reading.position_rad, "velocity": reading.velocity_rad_s, "effort": reading.effort_nm}
    values = {what: [column.get(name, 0.0) for name in names] for what, column in columns.items()}
    return {"header": header(reading.stamp_s), "name": names, **values}


def laser_scan(head: Fields, ranges: Any, first_rad: float, last_rad: float, period_s: float = 0.0) -> Fields:
    """Returns beams from the first to the last azimuth; a range of NaN becomes infinite."""
    step_rad = (last_rad - first_rad) / max(len(ranges) - 1, 1)
    angles = {"angle_min": first_rad, "angle_max": last_rad, "angle_increment": step_rad, "scan_time": period_s}
    reach = {"range_min": LEAST_RANGE_M, "range_max": MOST_RANGE_M}
    return {"header": head, **angles, **reach, "ranges": np.nan_to_num(np.asarray(ranges, np.float32), nan=np.inf)}


def level_scan(reading: Scan, frame: str, period_s: float) -> Fields:
    """Returns the ring of a scan that is nearest to the horizontal."""
    ring = int(np.argmin(np.abs(reading.elevations_rad)))
    ranges = reading.ranges_m[ring] * np.float32(math.cos(reading.elevations_rad[ring]))
    first_rad, last_rad = float(reading.azimuths_rad[0]), float(reading.azimuths_rad[-1])
    return laser_scan(header(reading.stamp_s, frame), ranges, first_rad, last_rad, period_s)


def points(reading: Scan, frame: str) -> Fields:
    """Returns all returns of a scan as points in the body frame."""
    xyz = np.ascontiguousarray(reading.points_B(), np.float32)
    fields = [{"name": each, "offset": 4 * n, "datatype": _FLOAT32, "count": 1} for n, each in enumerate("xyz")]
    size = {"height": 1, "width": len(xyz), "point_step": 12, "row_step": 12 * len(xyz)}
    data = xyz.view(np.uint8).ravel()
    return {"header": header(reading.stamp_s, frame), **size, "fields": fields, "data": data, "is_dense": True}


def imu(reading: Imu, frame: str) -> Fields:
    """Returns turn rates and accelerations; the orientation is not measured."""
    rates, accelerations = vector(reading.angular_velocity_B), vector(reading.linear_acceleration_B)
    spreads = {"angular_velocity": _RATE_VARIANCE, "linear_acceleration": _ACCELERATION_VARIANCE}
    unknown = {"orientation": {"w": 1.0}, "orientation_covariance": _UNKNOWN}
    unknown |= {f"{name}_covariance": (each * np.eye(3)).ravel() for name, each in spreads.items()}
    head = header(reading.stamp_s, frame)
    return {"header": head, **unknown, "angular_velocity": rates, "linear_acceleration": accelerations}


def battery(reading: Battery) -> Fields:
    """Returns the battery's charge; what is not measured is NaN."""
    unknown = ("voltage", "temperature", "current", "charge", "capacity", "design_capacity")
    known = {"header": header(reading.stamp_s), "percentage": reading.charge, "present": True}
    return dict.fromkeys(unknown, math.nan) | known


def twist(velocity: Sequence[float]) -> Fields:
    """Returns a velocity of the base: vx, vy (m/s), wz (rad/s)."""
    vx, vy, wz = velocity
    return {"linear": {"x": vx, "y": vy}, "angular": {"z": wz}}


def picture(reading: Image, frame: str, most_columns: int = MOST_COLUMNS) -> Fields:
    """Returns a picture, colour or grey, reduced to at most so many columns."""
    step = _step(reading.intrinsics, most_columns)
    pixels, encoding = (reading.grey, "mono8") if reading.colour is None else (reading.colour, "rgb8")
    return _image(header(reading.stamp_s, frame), pixels[::step, ::step], encoding)


def depth(reading: Image, frame: str, most_columns: int = MOST_COLUMNS) -> Fields:
    """Returns depth in metres along the optical axis, NaN where it is unknown, reduced like the picture."""
    step = _step(reading.depth_intrinsics, most_columns)
    values = reading.depth_m[::step, ::step].astype(np.float32)
    return _image(header(reading.stamp_s, frame), np.where(values > 0.0, values, np.float32(math.nan)), "32FC1")


def _image(head: Fields, pixels: Any, encoding: str) -> Fields:
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    size = {"height": len(pixels), "width": pixels.shape[1], "step": rows.shape[1]}
    return {"header": head, "encoding": encoding, **size, "data": rows.ravel()}


def compressed(reading: Image, frame: str, most_columns: int = MOST_COLUMNS) -> Fields:
    """Returns what `picture` returns as JPEG."""
    raw = picture(reading, frame, most_columns)
    _, data = cv2.imencode(".jpg", raw["data"].reshape(raw["height"], raw["width"], -1)[:, :, ::-1])
    return {"header": raw["header"], "format": f"{raw['encoding']}; jpeg compressed", "data": data.ravel()}


def compressed_depth(reading: Image, frame: str, most_columns: int = MOST_COLUMNS) -> Fields:
    """Returns depth in millimetres as PNG, behind the empty header of image_transport's `compressedDepth`."""
    step = _step(reading.depth_intrinsics, most_columns)
    _, data = cv2.imencode(".png", np.rint(1e3 * reading.depth_m[::step, ::step]).astype(np.uint16))
    content = np.append(np.zeros(12, np.uint8), data)
    return {"header": header(reading.stamp_s, frame), "format": "16UC1; compressedDepth png", "data": content}


def camera_info(reading: Image, frame: str, most_columns: int = MOST_COLUMNS, *, of_depth: bool = False) -> Fields:
    """Returns the intrinsics of what `picture`, or `depth`, returns."""
    lens = reading.depth_intrinsics if of_depth else reading.intrinsics
    step = _step(lens, most_columns)
    K = np.diag([lens.fx / step, lens.fy / step, 1.0])
    K[:2, 2] = lens.cx / step, lens.cy / step
    size = {"height": math.ceil(lens.height / step), "width": math.ceil(lens.width / step)}
    flat = {"distortion_model": "plumb_bob", "d": np.zeros(5), "r": np.eye(3).ravel()}
    values = {**size, **flat, "k": K.ravel(), "p": (K @ np.eye(3, 4)).ravel()}
    return {"header": header(reading.stamp_s, frame), **values}


def _step(lens: Intrinsics, most_columns: int) -> int:
    return max(1, math.ceil(lens.width / most_columns))


def occupancy_grid(grid: GridMap) -> Fields:
    """Returns a map: 0 free, 100 occupied, -1 unknown; row 0 has the least y."""
    cells = np.where(grid.occupied, 100, 0).astype(np.int8)
    if grid.unknown is not None:
        cells[grid.unknown & ~grid.occupied] = -1
    return grid_of(0.0, cells, grid.resolution_m, grid.origin_m)


def grid_of(stamp_s: float, cells: Any, resolution_m: float, origin_m: Sequence[float]) -> Fields:
    """Returns cells (rows, columns) on the map; the corner of the first cell lies at `origin_m`."""
    (rows, columns), origin = cells.shape, {"position": vector((*origin_m, 0.0)), "orientation": {"w": 1.0}}
    info = {"resolution": resolution_m, "width": columns, "height": rows, "origin": origin}
    return {"header": header(stamp_s, MAP_FRAME), "info": info, "data": cells.ravel()}


def costmap(stamp_s: float, free: FreeSpace, low_m: Sequence[float], size_m: Sequence[float]) -> Fields:
    """Returns costs by clearance in a rectangle from its lowest corner on: 100 in obstacles, less the farther away."""
    spans = zip(low_m, size_m, strict=True)
    x_m, y_m = (low + _CELL_M * (np.arange(float(round(size / _CELL_M))) + 0.5) for low, size in spans)
    clearance_m = clearance_on_grid(free, x_m, y_m)
    costs = np.where(clearance_m <= 0.0, 100.0, 98.0 * np.exp(-clearance_m / _DECAY_M))
    return grid_of(stamp_s, costs.astype(np.int8), _CELL_M, low_m)


def markers(stamp_s: float, seen: Iterable[tuple[str, Sequence[float]]]) -> Fields:
    """Returns a sphere and a name at each place on the map, instead of all before (visualization_msgs/MarkerArray)."""
    every: list[Fields] = [{"action": _DELETE_ALL}]
    for number, (name, at) in enumerate(seen):
        place = {"position": vector(at), "orientation": {"w": 1.0}}
        shown = {"header": header(stamp_s, MAP_FRAME), "pose": place, "scale": vector([_MARKER_M] * 3), "color": _GREEN}
        every += [shown | {"ns": "places", "id": number, "type": _SPHERE}]
        every += [shown | {"ns": "names", "id": number, "type": _TEXT, "text": name}]
    return {"markers": every}


def particles(stamp_s: float, poses: FloatArray) -> Fields:
    """Returns poses (N, 3) of equal weight as nav2_msgs/ParticleCloud."""
    every = [{"pose": pose(Pose2D(*row).transform()), "weight": 1.0 / len(poses)} for row in poses.tolist()]
    return {"header": header(stamp_s, MAP_FRAME), "particles": every}


def path(stamp_s: float, poses: Iterable[Sequence[float]]) -> Fields:
    """Returns a path of poses (x, y in m, yaw in rad) on the map."""
    every = [pose_stamped(stamp_s, MAP_FRAME, Pose2D(*map(float, each)).transform()) for each in poses]
    return {"header": header(stamp_s, MAP_FRAME), "poses": every}


def diagnostics(now_s: float, robot: str, faults: Sequence[str], values: Mapping[str, str]) -> Fields:
    """Returns the robot's diagnostics: an error (2) while it has faults."""
    pairs = [{"key": key, "value": value} for key, value in values.items()]
    status = {"level": 2 if faults else 0, "name": f"errand: {robot}", "hardware_id": robot, "values": pairs}
    return {"header": header(now_s), "status": [{**status, "message": "; ".join(faults) or "OK"}]}


def detections(head: Fields, found: Iterable[Mapping[str, Any]]) -> Fields:
    """Returns detections in a picture, in its pixels (vision_msgs/Detection2DArray)."""
    every = []
    for each in found:
        u0, v0, u1, v1 = each["box"]
        center = {"position": {"x": 0.5 * (u0 + u1), "y": 0.5 * (v0 + v1)}}
        result = {"hypothesis": {"class_id": each["class_name"], "score": each["score"]}}
        box = {"center": center, "size_x": float(u1 - u0), "size_y": float(v1 - v0)}
        every.append({"header": head, "results": [result], "bbox": box})
    return {"header": head, "detections": every}


def typed(kind: str, message: Mapping[str, Any]) -> Fields:
    """Returns those fields of a message of the log that a type has."""
    names = [name for name, _ in ros_types().store.fielddefs[kind][1]]
    return {**{name: message[name] for name in names if name in message}, "stamp": time_of(message["stamp"])}


def event(topic: str, message: Mapping[str, Any]) -> Fields:
    """Returns an event of the log as text: its topic, and its message in JSON."""
    values = {key: value for key, value in message.items() if key != "image"}
    return {"data": json.dumps({"topic": topic, **plain_values(values)}, ensure_ascii=False)}
