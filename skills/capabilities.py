"""Capabilities: the geometry and the limits of a robot, as skills read them through `skills.robot`."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Drake takes a third of a second to import; commands that move nothing do without
    from pydrake.math import RigidTransform


class BaseKind(enum.Enum):
    """Kind of motion that a base is capable of."""

    OMNIDIRECTIONAL = "omnidirectional"  # moves in any direction and turns: legs, mecanum wheels
    DIFFERENTIAL = "differential"  # drives ahead or back, and turns on the spot: two driven wheels


InverseKinematics = Callable[["RigidTransform"], Sequence[NDArray[np.float64]]]
"""Inverse kinematics of an arm: maps X_BH to joint angles (J,) of every IK solution; the caller checks joint limits."""


@dataclass(frozen=True)
class ArmCapabilities:
    """Arm: `joint_names` from the shoulder on, `max_reach_m` from the first joint, and `max_payload_kg`.

    `standing_m`: distances from the body's origin to an object to grasp or a spot to place on, the best first.
    `nearer_m`: the same for an object that is grasped from above. `carry_x_m` and `carry_z_m`: positions in B of the
    hand while it carries; the best has x nearest to `carry_best_x_m` and a low z. `tuck_x_m`: where an arm that
    overhangs furniture while it carries is drawn in to (the first of these x) and turned aside; empty for an arm that
    carries within the body's outline.

    Joints without limits are `continuous` in the description. `inverse` solves the inverse kinematics; it is None for
    the arm families whose closed form `skills.manipulation.arm.kinematics` derives from the description.
    """

    joint_names: tuple[str, ...]
    max_reach_m: float
    stowed_rad: tuple[float, ...]
    max_payload_kg: float
    inverse: InverseKinematics | None = None
    standing_m: tuple[float, ...] = (0.90, 0.94, 0.87, 0.84, 0.98, 0.81, 1.02, 1.06)
    nearer_m: tuple[float, ...] = (0.76, 0.79, 0.72, 0.68, 0.64)
    carry_x_m: tuple[float, ...] = (0.3, 0.35, 0.4, 0.45, 0.5)
    carry_z_m: tuple[float, ...] = (0.26, 0.29, 0.32, 0.36, 0.41, 0.46, 0.54)
    carry_best_x_m: float = 0.35
    tuck_x_m: tuple[float, ...] = ()

    @property
    def comfortable_m(self) -> tuple[float, float]:
        """Range of distances (m) to an object at which the robot need not drive nearer or farther."""
        return min(self.standing_m) - 0.01, max(self.standing_m) - 0.04


class GripperKind(enum.Enum):
    """Kind of a gripper's motion, which sets the unit of its opening."""

    HINGED = "hinged"  # one finger turns against a fixed one; the opening is its angle, rad
    PARALLEL = "parallel"  # two fingers slide to the middle together; the opening is their distance, m


@dataclass(frozen=True)
class GripperCapabilities:
    """Gripper. Its opening is 0 closed and `widest` fully open, in the unit of its kind.

    `finger_joints`: each finger joint with its position at an opening of 1. Geometry is in the hand frame H (x along
    the fingers, z along the closing direction, m). `palm_x_m`, `tip_x_m` and `fixed_tip_x_m`: the palm, the tip of a
    moving finger and the tip of the fixed one. `fixed_z_m`: the inner face of the fixed finger (of two moving fingers:
    when closed). `half_breadth_m` and `tip_thickness_m`: half the width of a tip, and its thickness. `grip_x_m`: about
    where the centre of a gripped object lies. `max_grasp_m`: largest width of an object; `length_m`: x beyond which an
    object must not extend.
    """

    finger_joints: tuple[tuple[str, float], ...]
    widest: float
    max_opening_m: float
    max_force_n: float
    depth_m: float
    palm_x_m: float
    tip_x_m: float
    fixed_tip_x_m: float
    fixed_z_m: float
    half_breadth_m: float
    tip_thickness_m: float
    grip_x_m: float
    max_grasp_m: float
    length_m: float
    kind: GripperKind = GripperKind.HINGED

    def finger_positions(self, opening: float) -> dict[str, float]:
        """Positions of the finger joints by name, at an opening."""
        return {name: share * opening for name, share in self.finger_joints}

    def refusal(self, opening: float, force_n: float) -> str | None:
        """Reason why the gripper cannot move to an opening with a force; None when it can."""
        if 0.0 <= opening <= self.widest and 0.0 < force_n <= self.max_force_n:
            return None
        unit = "rad" if self.kind is GripperKind.HINGED else "m"
        force = f"force {force_n:.0f} N in (0, {self.max_force_n}]"
        return f"set_gripper: opening {opening:.3f} {unit} must lie in [0, {self.widest}] and {force}"

    def like_turn(self, turn_rad: float) -> float:
        """Returns the change of the opening that corresponds to a rotation of a hinged finger by `turn_rad`.

        The full opening of a parallel gripper corresponds to a right angle.
        """
        return turn_rad if self.kind is GripperKind.HINGED else self.widest * turn_rad / (0.5 * math.pi)

    def opening_for(self, gap_m: float) -> float:
        """Opening at which the tips are about `gap_m` apart."""
        return self.widest * gap_m / self.max_opening_m


class Mount(enum.Enum):
    """Frame that a camera is fixed to."""

    BODY = "body"
    HAND = "hand"
    HEAD = "head"


@dataclass(frozen=True)
class CameraCapabilities:
    """Camera: its `source` for `image`, the frame F on which it is mounted, and its pose X_FC in F."""

    source: str
    X_FC: RigidTransform
    mount: Mount = Mount.BODY

    @property
    def on_hand(self) -> bool:
        """Returns whether the camera is on the hand."""
        return self.mount is Mount.HAND

    @property
    def heading_rad(self) -> float:
        """Direction of the optical axis in frame F, counter-clockwise from its x axis."""
        axis = self.X_FC.rotation().matrix()[:, 2]
        return math.atan2(axis[1], axis[0])

    def looks_towards(self, heading_rad: float, within_rad: float = math.pi / 4) -> bool:
        """Returns whether the optical axis is within an angle of a heading in the body frame, with the head ahead."""
        return abs(math.remainder(self.heading_rad - heading_rad, math.tau)) < within_rad


@dataclass(frozen=True)
class HeadCapabilities:
    """Head that pans (about z up, positive to the left) and then tilts (about y, positive looks down), rad.

    `p_BP_m` is the pan axis in the body frame, `p_PT_m` the tilt axis in the panned frame. The frame `head` lies on the
    tilt axis and turns with the head. `joint_names` are the pan and tilt joints in the description.
    """

    joint_names: tuple[str, str]
    p_BP_m: tuple[float, float, float]
    p_PT_m: tuple[float, float, float]
    pan_range_rad: tuple[float, float]
    tilt_range_rad: tuple[float, float]

    def refusal(self, pan_rad: float, tilt_rad: float) -> str | None:
        """Reason why the head cannot turn to a pan and a tilt; None when it can."""
        (left, right), (up, down) = self.pan_range_rad, self.tilt_range_rad
        if left <= pan_rad <= right and up <= tilt_rad <= down:
            return None
        tilt = f"tilt {tilt_rad:.2f} rad in [{up}, {down}]"
        return f"point_head: pan {pan_rad:.2f} rad must lie in [{left}, {right}] and {tilt}"

    def X_BF(self, pan_rad: float, tilt_rad: float) -> RigidTransform:
        """Pose of the frame `head` in the body frame at a pan and a tilt angle."""
        from pydrake.math import RigidTransform, RotationMatrix

        X_BP = RigidTransform(RotationMatrix.MakeZRotation(pan_rad), np.array(self.p_BP_m))
        return X_BP @ RigidTransform(RotationMatrix.MakeYRotation(tilt_rad), np.array(self.p_PT_m))


@dataclass(frozen=True)
class Capabilities:
    """Geometry and limits of a robot; `arm`, `gripper` or `head` is None on a robot without one.

    `footprint_m`: outline of the standing robot in the body frame, as (x, y) corners. `description`: URDF text with
    collision shapes and a floating base (link `body`). `height_range_m`: range of the body origin's height while the
    robot walks. `lift_joint`: joint of a torso that slides up from the lower end of `height_range_m` while the base
    stays. `lidar_height_m`: height of the LiDAR above the floor at the standing height; a map is valid for one such
    height. `sensor_period_s`: period at which joints and gripper are measured. `drive_expiry_s`: lifetime of a drive
    command that is renewed at each tick; longer than a tick plus the transmission, and short enough to be safe.
    `docks`: the robot docks and undocks by itself. `opens_doors`: it opens doors. `localises`: it localises itself in a
    map of its own.
    """

    footprint_m: tuple[tuple[float, float], ...]
    max_speed_m_s: float
    max_turn_rate_rad_s: float
    standing_height_m: float
    height_range_m: tuple[float, float]
    pitch_range_rad: tuple[float, float]
    arm: ArmCapabilities | None
    gripper: GripperCapabilities | None
    cameras: tuple[CameraCapabilities, ...]
    description: str
    base_kind: BaseKind = BaseKind.OMNIDIRECTIONAL
    head: HeadCapabilities | None = None
    lift_joint: str | None = None
    lidar_height_m: float | None = None
    sensor_period_s: float = 0.05
    drive_expiry_s: float = 0.3
    docks: bool = False
    opens_doors: bool = False
    localises: bool = False

    @property
    def body_cameras(self) -> tuple[CameraCapabilities, ...]:
        """Cameras on body and head, which look for people and obstacles."""
        return tuple(camera for camera in self.cameras if not camera.on_hand)

    @property
    def hand_camera(self) -> CameraCapabilities | None:
        """Camera on the hand; None when there is none."""
        return next((camera for camera in self.cameras if camera.on_hand), None)

    @property
    def object_camera(self) -> CameraCapabilities | None:
        """Camera that searches for objects: on the hand, else the head, else ahead on the body; None without any."""
        on_head = (camera for camera in self.cameras if camera.mount is Mount.HEAD)
        ahead = (camera for camera in self.cameras if camera.mount is Mount.BODY and camera.looks_towards(0.0))
        return self.hand_camera or next(on_head, None) or next(ahead, None)
