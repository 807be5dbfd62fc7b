"""Readings of the API as those of the Robot protocol: frames, joints, gripper, scan, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from bosdyn.api import image_pb2
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from plant.robots.spot.description import spot_facts
from plant.spot_api.messages import Frames, frames_of, our_joint, pose_between
from skills.robot import (
    Battery,
    Capabilities,
    FloatArray,
    FrameTree,
    Gripper,
    Image,
    Intrinsics,
    Joints,
    NoImageError,
    Odometry,
    Scan,
)

TIP_RADIUS_M: Final = float(spot_facts()["gripper"]["tip_radius"])
"""Distance of the fingertip from the hinge of the finger."""
_RINGS_DEG: Final = np.arange(-15.0, 16.0, 2.0)
_COLUMNS: Final = 900
_NO_DEPTH: Final = (0, 65535)


@dataclass(frozen=True)
class Readings:
    """Readings of one state message; `stamp_s` is on the robot's clock."""

    stamp_s: float
    odometry: Odometry
    joints: Joints
    gripper: Gripper
    battery: Battery
    faults: tuple[str, ...]
    frames: Frames
    powered: bool
    released: bool


def readings(state: Any, stamp_s: float, capabilities: Capabilities) -> Readings:
    """Returns the readings of a state message.

    The height of the body is that over the feet, because `odom` drifts in height.
    """
    kinematic = state.kinematic_state
    frames = frames_of(kinematic.transforms_snapshot)
    X_OB = pose_between(frames, "odom", "body")
    touching = [foot.foot_position_rt_body for foot in state.foot_state if foot.contact != 2]
    if touching:
        feet_O = [X_OB.rotation().matrix() @ [foot.x, foot.y, foot.z] for foot in touching]
        x, y, _ = X_OB.translation()
        X_OB = RigidTransform(X_OB.rotation(), [x, y, -float(np.mean([foot[2] for foot in feet_O]))])
    moving = kinematic.velocity_of_body_in_odom
    linear_B = X_OB.rotation().inverse() @ np.array([moving.linear.x, moving.linear.y, moving.linear.z])
    odometry = Odometry(stamp_s, X_OB, (float(linear_B[0]), float(linear_B[1]), float(moving.angular.z)))
    named = {our_joint(joint.name): joint for joint in kinematic.joint_states}
    joints = Joints(
        stamp_s,
        {name: joint.position.value for name, joint in named.items()},
        {name: joint.velocity.value for name, joint in named.items()},
        {name: joint.load.value for name, joint in named.items()},
    )
    widest = 0.0 if capabilities.gripper is None else capabilities.gripper.widest
    finger, arm = named.get("arm_f1x"), state.manipulator_state
    opening = widest * arm.gripper_open_percentage / 100.0 if finger is None else -finger.position.value
    force_n = 0.0 if finger is None else max(0.0, finger.load.value) / TIP_RADIUS_M
    still = finger is None or abs(finger.velocity.value) < 0.05
    gripper = Gripper(stamp_s, max(0.0, opening), force_n if still else 0.0, arm.is_gripper_holding_item)
    charge = state.power_state.locomotion_charge_percentage.value / 100.0
    faults = [fault.name for fault in state.system_fault_state.faults]
    faults += [f"behaviour fault {fault.behavior_fault_id}" for fault in state.behavior_fault_state.faults]
    return Readings(
        stamp_s,
        odometry,
        joints,
        gripper,
        Battery(stamp_s, charge),
        tuple(faults),
        frames,
        state.power_state.motor_power_state == 2,
        all(stop.state != 1 for stop in state.estop_states),
    )


def scan(points_L: FloatArray, stamp_s: float, X_BL: RigidTransform, X_OB: RigidTransform) -> Scan:
    """Returns points (N, 3) in the lidar's frame as a revolution; the nearest of a ring and azimuth counts."""
    far_m = np.linalg.norm(points_L, axis=1)
    points_L, far_m = points_L[far_m > 0.3], far_m[far_m > 0.3]
    elevations = np.arcsin(np.clip(points_L[:, 2] / far_m, -1.0, 1.0))
    rings = np.rint((np.rad2deg(elevations) - _RINGS_DEG[0]) / 2.0).astype(int)
    turn = np.arctan2(points_L[:, 1], points_L[:, 0])
    columns = np.rint((turn + np.pi) / (2.0 * np.pi) * _COLUMNS).astype(int) % _COLUMNS
    ranges: NDArray[np.float32] = np.full((len(_RINGS_DEG), _COLUMNS), np.inf, dtype=np.float32)
    inside = (rings >= 0) & (rings < len(_RINGS_DEG))
    np.minimum.at(ranges, (rings[inside], columns[inside]), far_m[inside].astype(np.float32))
    ranges[np.isinf(ranges)] = np.nan
    azimuths = np.arange(_COLUMNS) / _COLUMNS * 2.0 * np.pi - np.pi
    return Scan(stamp_s, ranges, np.deg2rad(_RINGS_DEG), azimuths, X_BL, X_OB)


def picture(
    source: str, camera_frame: str, answers: Sequence[Any], stamp_s: float, frames: FrameTree, *, coloured: bool
) -> Image:
    """Returns a picture with depth from the answers of the image service. Raises NoImageError."""
    colour: NDArray[np.uint8] | None = None
    grey: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)
    depth: NDArray[np.float32] = np.zeros((0, 0), dtype=np.float32)
    lenses: dict[bool, Intrinsics] = {}
    for answer in answers:
        if answer.status != image_pb2.ImageResponse.STATUS_OK:
            raise NoImageError(f"{source}: {image_pb2.ImageResponse.Status.Name(answer.status)}")
        pixels = _pixels(answer.shot.image)
        is_depth = pixels.dtype == np.uint16
        lenses[is_depth] = _lens(answer.source)
        if is_depth:
            metres = pixels.astype(np.float32) / np.float32(answer.source.depth_scale or 1000.0)
            depth = np.where(np.isin(pixels, _NO_DEPTH), np.float32(0.0), metres)
        else:
            grey = pixels if pixels.ndim == 2 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))
            colour = pixels if pixels.ndim == 3 and coloured else None
    lens = lenses.get(False) or lenses[True]
    return Image(stamp_s, source, camera_frame, lens, lenses.get(True, lens), colour, grey, depth, frames)


def _lens(source: Any) -> Intrinsics:
    k = source.pinhole.intrinsics
    return Intrinsics(
        source.cols, source.rows, k.focal_length.x, k.focal_length.y, k.principal_point.x, k.principal_point.y
    )


def _pixels(image: Any) -> NDArray[Any]:
    """Decodes an image: (H, W) uint8 or uint16, or (H, W, 3) RGB. Raises NoImageError."""
    Pixels = image_pb2.Image
    if image.format == Pixels.FORMAT_JPEG:
        decoded = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_UNCHANGED)
        if decoded is None:
            raise NoImageError("a picture cannot be decoded")
        return decoded if decoded.ndim == 2 else np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB))
    kinds: Mapping[int, tuple[Any, int]] = {
        Pixels.PIXEL_FORMAT_DEPTH_U16: (np.uint16, 1),
        Pixels.PIXEL_FORMAT_GREYSCALE_U8: (np.uint8, 1),
        Pixels.PIXEL_FORMAT_RGB_U8: (np.uint8, 3),
    }
    if image.pixel_format not in kinds:
        raise NoImageError(f"pixel format {image.pixel_format} is unknown")
    kind, channels = kinds[image.pixel_format]
    flat = np.frombuffer(image.data, kind)
    shape = (image.rows, image.cols) if channels == 1 else (image.rows, image.cols, channels)
    return flat.reshape(shape)
