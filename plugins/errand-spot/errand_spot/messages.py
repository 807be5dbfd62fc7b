"""Conversions between SI values and the API's messages: times, poses, velocities and frame trees."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from bosdyn.api import geometry_pb2
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix

_NANOS = 1_000_000_000
_MOST_POINTS = 250

Frames = Mapping[str, tuple[str, RigidTransform]]
"""Frame tree: child -> (parent, X_parent_child); the root's parent is empty."""


class InvalidRequestError(ValueError):
    """A request with a value that the API does not allow; the message names the field."""


def timestamp(unix_s: float) -> Timestamp:
    """Returns the message of a time (s since 1970)."""
    nanos = round(unix_s * _NANOS)
    return Timestamp(seconds=nanos // _NANOS, nanos=nanos % _NANOS)


def duration(duration_s: float) -> Duration:
    """Returns the message of a duration (s)."""
    made = Duration()
    made.FromNanoseconds(round(duration_s * _NANOS))
    return made


def seconds(message: Timestamp | Duration) -> float:
    """Returns a time (s since 1970) or a duration (s)."""
    return float(message.seconds) + float(message.nanos) / _NANOS


def finite(value: float, field: str) -> float:
    """Returns a finite value. Raises InvalidRequestError."""
    if not math.isfinite(value):
        raise InvalidRequestError(f"{field} is {value}; it must be finite")
    return value


def points_of(trajectory: Any, field: str) -> Sequence[Any]:
    """Returns the points of a trajectory. Raises InvalidRequestError when there are none, or too many."""
    if not 0 < (count := len(trajectory.points)) <= _MOST_POINTS:
        raise InvalidRequestError(f"{field} has {count or 'no'} points; 1 to {_MOST_POINTS} are allowed")
    return list(trajectory.points)


def vector(message: geometry_pb2.Vec3, field: str) -> tuple[float, float, float]:
    """Returns the coordinates of a vector. Raises InvalidRequestError unless they are finite."""
    x, y, z = (finite(getattr(message, axis), f"{field}.{axis}") for axis in "xyz")
    return x, y, z


def vec3(values: Iterable[float]) -> geometry_pb2.Vec3:
    """Returns the message of a vector (x, y, z)."""
    x, y, z = (float(value) for value in values)
    return geometry_pb2.Vec3(x=x, y=y, z=z)


def transform(message: geometry_pb2.SE3Pose, field: str) -> RigidTransform:
    """Returns the transform of a pose; a rotation that was left out is none. Raises InvalidRequestError."""
    wxyz = [finite(getattr(message.rotation, name), f"{field}.rotation.{name}") for name in "wxyz"]
    length = math.hypot(*wxyz)
    unit = [each / length for each in wxyz] if length > 1e-6 else [1.0, 0.0, 0.0, 0.0]
    p = np.array(vector(message.position, f"{field}.position"))  # Drake takes three times as long for a tuple
    return RigidTransform(RotationMatrix(Quaternion(*unit)), p)


def pose(X_AB: RigidTransform) -> geometry_pb2.SE3Pose:
    """Returns the message of a transform."""
    w, x, y, z = X_AB.rotation().ToQuaternion().wxyz()
    return geometry_pb2.SE3Pose(position=vec3(X_AB.translation()), rotation=geometry_pb2.Quaternion(w=w, x=x, y=y, z=z))


def velocity(linear: Iterable[float], angular: Iterable[float]) -> geometry_pb2.SE3Velocity:
    """Returns the message of a linear (m/s) and an angular (rad/s) velocity."""
    return geometry_pb2.SE3Velocity(linear=vec3(linear), angular=vec3(angular))


def frame_tree(frames: Frames) -> geometry_pb2.FrameTreeSnapshot:
    """Returns the message of a frame tree."""
    made = geometry_pb2.FrameTreeSnapshot()
    for child, (parent, X_PC) in frames.items():
        edge = made.child_to_parent_edge_map[child]
        edge.parent_frame_name = parent
        edge.parent_tform_child.CopyFrom(pose(X_PC))
    return made


def frames_of(message: geometry_pb2.FrameTreeSnapshot) -> Frames:
    """Returns the frame tree of a message."""
    edges = message.child_to_parent_edge_map
    return {name: (edge.parent_frame_name, transform(edge.parent_tform_child, name)) for name, edge in edges.items()}


def pose_between(frames: Frames, a: str, b: str) -> RigidTransform:
    """Pose of frame `b` in frame `a`. Raises KeyError for an unknown frame."""
    return _from_root(frames, a).inverse() @ _from_root(frames, b)


def _from_root(frames: Frames, frame: str) -> RigidTransform:
    X = RigidTransform()
    for _ in range(len(frames) + 1):
        if not frame:
            return X
        parent, X_PF = frames[frame]
        X, frame = X_PF @ X, parent
    raise KeyError(f"{frame}, whose parents are a circle")


def api_joint(name: str) -> str:
    """Name of a joint in the API: `fl_hx` is `fl.hx`, `arm_sh0` is `arm0.sh0`."""
    limb, _, joint = name.partition("_")
    return f"{'arm0' if limb == 'arm' else limb}.{joint}"


def our_joint(name: str) -> str:
    """Name of an API's joint in the robot's description: `fl.hx` is `fl_hx`, `arm0.sh0` is `arm_sh0`."""
    limb, _, joint = name.partition(".")
    return f"{'arm' if limb == 'arm0' else limb}_{joint}"


def picture_frame(source: str) -> str:
    """Name in the API of the frame of a camera's picture."""
    return "hand_color_image_sensor" if source == "hand" else f"{source}_fisheye"


def depth_frame(source: str) -> str:
    """Name in the API of the frame of a camera's depth, which has the same pose here."""
    return "hand_depth_sensor" if source == "hand" else source
