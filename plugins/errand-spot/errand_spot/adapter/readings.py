"""Readings of the API as those of the Robot protocol: frames, joints, gripper, scan, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from bosdyn.api import image_pb2
from bosdyn.api.robot_state_pb2 import BehaviorFault, EStopState, FootState, PowerState, SystemFault
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from errand_spot.adapter.statuses import response_trouble
from errand_spot.messages import Frames, frames_of, our_joint, pose_between
from plant.robots.spot.description import spot_facts
from skills.estimate.scan_points import scan_of_points
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
RINGS_RAD: Final = np.deg2rad(np.arange(-15.0, 16.0, 2.0))
COLUMNS: Final = 900
_NO_DEPTH: Final = (0, 65535)
_MILD: Final = (SystemFault.SEVERITY_INFO, SystemFault.SEVERITY_WARN)
DEPTH_RANGE_M: Final = 4.0
_DEPTH_RINGS_RAD: Final = np.deg2rad(np.arange(-75.0, 16.0, 1.5))
_DEPTH_STRIDE: Final = 3


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
    feet_known: bool


def unfit(state: Any, capabilities: Capabilities) -> str | None:
    """Returns the parts that a robot's state lacks, as a text; None when it is complete."""
    names = {our_joint(joint.name) for joint in state.kinematic_state.joint_states}
    arm = () if capabilities.arm is None else capabilities.arm.joint_names
    if arm and not (state.HasField("manipulator_state") and names.intersection(arm)):
        return "the robot has no arm"
    missing = [name for name in arm if name not in names]
    return f"the robot does not report its joints {', '.join(missing)}" if missing else None


def readings(state: Any, stamp_s: float, capabilities: Capabilities, last_height_m: float | None = None) -> Readings:
    """Returns the readings of a state message. Raises KeyError and ValueError if frames or numbers are missing.

    The body's height is that over the feet, because `odom` drifts; without feet on the floor the last one counts.
    """
    kinematic = state.kinematic_state
    frames = frames_of(kinematic.transforms_snapshot)
    X_OB = pose_between(frames, "odom", "body")
    touching = [foot.foot_position_rt_body for foot in state.foot_state if foot.contact != FootState.CONTACT_LOST]
    feet_m = [(X_OB.rotation() @ np.array([foot.x, foot.y, foot.z]))[2] for foot in touching]
    feet_known = bool(feet_m) and bool(np.isfinite(feet_m).all())
    x, y, z = X_OB.translation()
    height_m = -float(np.mean(feet_m)) if feet_known else z if last_height_m is None else last_height_m
    X_OB = RigidTransform(X_OB.rotation(), [x, y, height_m])
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
    faults = [fault.name for fault in state.system_fault_state.faults if fault.severity not in _MILD]
    faults += [
        f"{BehaviorFault.Cause.Name(fault.cause)} (behaviour fault {fault.behavior_fault_id})"
        for fault in state.behavior_fault_state.faults
    ]
    return Readings(
        stamp_s,
        odometry,
        joints,
        gripper,
        Battery(stamp_s, charge),
        tuple(faults),
        frames,
        state.power_state.motor_power_state == PowerState.MOTOR_POWER_STATE_ON,
        all(stop.state == EStopState.STATE_NOT_ESTOPPED for stop in state.estop_states),
        feet_known,
    )


def off_path_rad(path_rad: FloatArray, q_rad: FloatArray) -> float:
    """Distance of an arm from its path (K, joints): the largest joint error (rad) at the nearest point."""
    starts, steps = path_rad[:-1], np.diff(path_rad, axis=0)
    lengths = np.maximum((steps**2).sum(axis=1), 1e-12)
    shares = np.clip(((q_rad - starts) * steps).sum(axis=1) / lengths, 0.0, 1.0)
    return float(np.abs(starts + shares[:, None] * steps - q_rad).max(axis=1).min())


def depth_scan(answers: Sequence[Any], stamp_s: float, X_BL: RigidTransform, X_OB: RigidTransform) -> Scan:
    """Returns the depth cameras' points within 4 m as a revolution of a LiDAR at X_BL. Raises NoImageError."""
    seen = [_points_B(answer) for answer in answers]
    points_L = X_BL.inverse() @ np.concatenate([np.zeros((0, 3)), *seen]).T
    return scan_of_points(np.asarray(points_L.T), _DEPTH_RINGS_RAD, COLUMNS, stamp_s, X_BL, X_OB)


def _points_B(answer: Any) -> FloatArray:
    """Points (N, 3) of a depth picture in the body frame."""
    lens, depth_m = _lens(answer.source), _depth_m(answer)[::_DEPTH_STRIDE, ::_DEPTH_STRIDE]
    rows, columns = np.nonzero(depth_m > 0.0)
    far_m = depth_m[rows, columns].astype(np.float64)
    across = (columns * _DEPTH_STRIDE - lens.cx) / lens.fx * far_m
    down = (rows * _DEPTH_STRIDE - lens.cy) / lens.fy * far_m
    points_C = np.stack([across, down, far_m])
    points_C = points_C[:, np.linalg.norm(points_C, axis=0) < DEPTH_RANGE_M]
    return np.asarray((sensor_pose(answer, "body") @ points_C).T)


def sensor_pose(answer: Any, frame: str) -> RigidTransform:
    """Pose of the camera of a picture in a frame when it was taken. Raises NoImageError."""
    try:
        return pose_between(frames_of(answer.shot.transforms_snapshot), frame, answer.shot.frame_name_image_sensor)
    except (KeyError, ValueError) as error:
        raise NoImageError(f"{answer.source.name}: the picture lacks frame {error}") from error


def picture(
    source: str, camera_frame: str, answers: Sequence[Any], stamp_s: float, frames: FrameTree, *, coloured: bool
) -> Image:
    """Returns a picture with depth from the answers of the image service. Raises NoImageError."""
    colour: NDArray[np.uint8] | None = None
    grey: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)
    depth: NDArray[np.float32] = np.zeros((0, 0), dtype=np.float32)
    lenses: dict[bool, Intrinsics] = {}
    for answer in answers:
        if (wrong := response_trouble(answer)) is not None:
            raise NoImageError(f"{source}: {wrong.text}")
        is_depth = answer.shot.image.pixel_format == image_pb2.Image.PIXEL_FORMAT_DEPTH_U16
        lenses[is_depth] = _lens(answer.source)
        if is_depth:
            depth = _depth_m(answer)
        else:
            pixels = _pixels(answer.shot.image)
            grey = pixels if pixels.ndim == 2 else np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY))
            colour = pixels if pixels.ndim == 3 and coloured else None
    lens = lenses.get(False) or lenses[True]
    return Image(stamp_s, source, camera_frame, lens, lenses.get(True, lens), colour, grey, depth, frames)


def _depth_m(answer: Any) -> NDArray[np.float32]:
    """Depth (H, W) of a picture in metres, 0 where there is none. Raises NoImageError."""
    pixels = _pixels(answer.shot.image)
    metres = pixels.astype(np.float32) / np.float32(answer.source.depth_scale or 1000.0)
    return np.where(np.isin(pixels, _NO_DEPTH), np.float32(0.0), metres)


def _lens(source: Any) -> Intrinsics:
    """Intrinsics of a response, without the distortion of a lens. Raises NoImageError."""
    model = source.WhichOneof("camera_models")
    k = getattr(source, model).intrinsics if model else source.pinhole.intrinsics
    k = k if model in (None, "pinhole") else k.pinhole_intrinsics
    if not (k.focal_length.x > 0.0 and k.focal_length.y > 0.0):
        raise NoImageError(f"{source.name}: the picture lacks its intrinsics")
    return Intrinsics(
        source.cols, source.rows, k.focal_length.x, k.focal_length.y, k.principal_point.x, k.principal_point.y
    )


def _pixels(image: Any) -> NDArray[Any]:
    """Decodes an image: (H, W) uint8 or uint16, or (H, W, 3) RGB. Raises NoImageError."""
    Pixels = image_pb2.Image
    kinds: Mapping[int, tuple[Any, tuple[int, ...]]] = {
        Pixels.PIXEL_FORMAT_DEPTH_U16: (np.uint16, ()),
        Pixels.PIXEL_FORMAT_GREYSCALE_U8: (np.uint8, ()),
        Pixels.PIXEL_FORMAT_RGB_U8: (np.uint8, (3,)),
    }
    try:
        if image.format == Pixels.FORMAT_JPEG:
            decoded = np.asarray(cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_UNCHANGED))
            return decoded if decoded.ndim == 2 else np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB))
        kind, channels = kinds[image.pixel_format]
        return np.frombuffer(image.data, kind).reshape((image.rows, image.cols, *channels))
    except KeyError as error:
        raise NoImageError(f"the pixel format {error} of a picture is unknown") from error
    except (ValueError, cv2.error) as error:
        raise NoImageError(f"a picture cannot be decoded: {error}") from error
