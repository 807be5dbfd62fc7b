"""The Robot protocol: all that a skill ever sees of a robot. Its verbs follow the Spot SDK.

Every motion command carries an expiry time on the robot's clock: a robot that hears nothing stops by itself. Sense
verbs return the latest immutable stamped snapshot and never block, except `image` (ask for it through the `Worker`).

Frames: `odom` (O) is fixed to the floor where the robot woke up and drifts against the world (W); `body` (B) is
x forward, y left, z up at the centre of the hips, or of a wheeled base's axle and riding on its torso; `hand` (H) is
the last arm link, x along the fingers, z along their closing; `head` (on a robot with one) turns with it;
`<source>_camera` (C) is z forward, x right, y down; `lidar` (L). `X_AB` is the pose of frame B in frame A. SI units
throughout.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NewType, Protocol

import numpy as np
from numpy.typing import NDArray

from skills import quantities as quantities
from skills.quantities import Angle, Coordinate

if TYPE_CHECKING:  # Drake takes a third of a second to import; commands that move nothing do without
    from pydrake.math import RigidTransform

FloatArray = NDArray[np.float64]
Picture = NDArray[np.uint8]
"""A picture, (H, W) grey or (H, W, 3) RGB."""
CommandId = NewType("CommandId", int)


@dataclass(frozen=True)
class Pose2D:
    """A planar pose: x_m, y_m, yaw_rad (counter-clockwise from x)."""

    x_m: Coordinate
    y_m: Coordinate
    yaw_rad: Angle

    def transform(self, z_m: float = 0.0) -> RigidTransform:
        """The same pose as a RigidTransform at height z_m."""
        from pydrake.math import RigidTransform, RotationMatrix

        return RigidTransform(RotationMatrix.MakeZRotation(self.yaw_rad), [self.x_m, self.y_m, z_m])

    @staticmethod
    def from_transform(X_AB: RigidTransform) -> Pose2D:
        """The planar part of X_AB."""
        (xx, _, _, x), (yx, _, _, y), _ = X_AB.GetAsMatrix34().tolist()
        return Pose2D(x, y, math.atan2(yx, xx))


class BaseKind(enum.Enum):
    """How a base moves."""

    OMNIDIRECTIONAL = "omnidirectional"  # moves in any direction and turns: legs, mecanum wheels
    DIFFERENTIAL = "differential"  # drives ahead or back, and turns on the spot: two driven wheels


InverseKinematics = Callable[["RigidTransform"], Sequence[FloatArray]]
"""An arm's own solver: from X_BH, joint angles (J,) of every branch; the caller checks the joint limits."""


@dataclass(frozen=True)
class ArmCapabilities:
    """The arm: joint names from the shoulder on, the furthest reach from the first joint (m), what it lifts (kg).

    `standing_m` are the distances of the body's origin from something to take or to put down, the best first, and
    `nearer_m` those for what is held from above; `carry_x_m` and `carry_z_m` are where in B the hand carries, best at
    `carry_best_x_m` and low. Where what is carried so sticks out over furniture, the hand is drawn in to the first of
    `tuck_x_m`, turned to a side; none for an arm that carries within the body's outline.
    Joints that turn without end are `continuous` in the description. `inverse` solves its inverse kinematics; None for
    the families whose closed form `skills.manipulation.arm.kinematics` reads from the description.
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
        """The range of distances at which there is no need to go elsewhere."""
        return min(self.standing_m) - 0.01, max(self.standing_m) - 0.04


class GripperKind(enum.Enum):
    """How a gripper closes, and what its opening counts."""

    HINGED = "hinged"  # one finger turns against a fixed one; the opening is its angle, rad
    PARALLEL = "parallel"  # two fingers slide to the middle together; the opening is their distance, m


@dataclass(frozen=True)
class GripperCapabilities:
    """The gripper. Its opening is 0 closed and `widest` fully open, in the unit of its kind.

    `finger_joints` are the joints of its fingers and how far each goes for an opening of one. Geometry in the hand
    frame H (x along the fingers, z along the closing, m): the palm at `palm_x_m`, the tip of a moving finger at
    `tip_x_m` and of the fixed one at `fixed_tip_x_m`, whose inner face is at `fixed_z_m` (where both move: when
    closed); tips are 2 `half_breadth_m` wide and `tip_thickness_m` thick. What it grips has its middle about `grip_x_m`
    ahead of H, is up to `max_grasp_m` wide and ends by `length_m`.
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
        """Where each finger joint is at an opening, by name."""
        return {name: share * opening for name, share in self.finger_joints}

    def like_turn(self, turn_rad: float) -> float:
        """The part of the opening that a turn is of that of a hinged finger, which opens to about a right angle."""
        return turn_rad if self.kind is GripperKind.HINGED else self.widest * turn_rad / (0.5 * math.pi)

    def opening_for(self, gap_m: float) -> float:
        """The opening at which the tips are about so far apart."""
        return self.widest * gap_m / self.max_opening_m


class Mount(enum.Enum):
    """The frame that a camera is fixed to."""

    BODY = "body"
    HAND = "hand"
    HEAD = "head"


@dataclass(frozen=True)
class CameraCapabilities:
    """One camera: its source for `image`, the frame F that it is mounted on, and its pose X_FC in it."""

    source: str
    X_FC: RigidTransform
    mount: Mount = Mount.BODY

    @property
    def on_hand(self) -> bool:
        """Returns whether the arm moves it."""
        return self.mount is Mount.HAND

    @property
    def heading_rad(self) -> float:
        """Direction of the optical axis in its frame, counter-clockwise from ahead."""
        axis = self.X_FC.rotation().matrix()[:, 2]
        return math.atan2(axis[1], axis[0])

    def looks_towards(self, heading_rad: float, within_rad: float = math.pi / 4) -> bool:
        """Whether the optical axis is within an angle of a direction in the body frame, a head looking ahead."""
        return abs(math.remainder(self.heading_rad - heading_rad, math.tau)) < within_rad


@dataclass(frozen=True)
class HeadCapabilities:
    """A head that pans (z up, positive to the left) and then tilts (y, positive looks down), rad.

    p_BP_m is where the pan axis is in the body frame, p_PT_m where the tilt axis is in the panned frame; the frame
    `head` lies on the tilt axis and turns with it. `joint_names` are pan and tilt in the description.
    """

    joint_names: tuple[str, str]
    p_BP_m: tuple[float, float, float]
    p_PT_m: tuple[float, float, float]
    pan_range_rad: tuple[float, float]
    tilt_range_rad: tuple[float, float]

    def X_BF(self, pan_rad: float, tilt_rad: float) -> RigidTransform:
        """Pose of the frame `head` in the body frame at such angles."""
        from pydrake.math import RigidTransform, RotationMatrix

        X_BP = RigidTransform(RotationMatrix.MakeZRotation(pan_rad), np.array(self.p_BP_m))
        return X_BP @ RigidTransform(RotationMatrix.MakeYRotation(tilt_rad), np.array(self.p_PT_m))


@dataclass(frozen=True)
class Capabilities:
    """What a robot is and can do; `arm`, `gripper` or `head` is None on a robot without one.

    `lift_joint` is the joint of a torso that slides up from the lowest of `height_range_m` while the base stays.
    `footprint_m` is the standing outline in the body frame as (x, y) corners; `description` the robot's URDF text with
    collision shapes and a free base (link `body`); `height_range_m` that of the body origin while it walks.
    `lidar_height_m` is that of the LiDAR over the floor, the robot standing as usual: maps differ by it.
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

    @property
    def body_cameras(self) -> tuple[CameraCapabilities, ...]:
        """The cameras on body and head. They look for people and obstacles."""
        return tuple(camera for camera in self.cameras if not camera.on_hand)

    @property
    def hand_camera(self) -> CameraCapabilities | None:
        """The camera on the hand, None when there is none."""
        return next((camera for camera in self.cameras if camera.on_hand), None)

    @property
    def object_camera(self) -> CameraCapabilities | None:
        """The camera that looks for objects: the one on the hand, else the one on the head; None without either."""
        on_head = (camera for camera in self.cameras if camera.mount is Mount.HEAD)
        return self.hand_camera or next(on_head, None)


@dataclass(frozen=True)
class FrameTree:
    """Frames at one instant: child -> (parent, X_parent_child). The root is `odom`."""

    edges: Mapping[str, tuple[str, RigidTransform]]

    def pose(self, child: str, parent: str = "odom") -> RigidTransform:
        """X_parent_child. Raises KeyError when a frame is unknown."""
        return self._from_root(parent).inverse() @ self._from_root(child)

    def _from_root(self, frame: str) -> RigidTransform:
        from pydrake.math import RigidTransform

        X = RigidTransform()
        while frame != "odom":
            frame, X_PF = self.edges[frame]
            X = X_PF @ X
        return X


@dataclass(frozen=True)
class Odometry:
    """Dead reckoning: pose of the body in `odom` (drifts), velocity in the body frame (vx, vy in m/s, wz in rad/s)."""

    stamp_s: float
    X_OB: RigidTransform
    velocity: tuple[float, float, float]

    @property
    def pose(self) -> Pose2D:
        """The planar part of X_OB."""
        return Pose2D.from_transform(self.X_OB)


@dataclass(frozen=True)
class Imu:
    """Angular velocity (rad/s) and specific force (m/s^2), both in the body frame."""

    stamp_s: float
    angular_velocity_B: tuple[float, float, float]
    linear_acceleration_B: tuple[float, float, float]


@dataclass(frozen=True)
class Scan:
    """One LiDAR revolution: ranges_m[ring, azimuth] with NaN for no return, angles in the lidar frame, X_BL."""

    stamp_s: float
    ranges_m: NDArray[np.float32]
    elevations_rad: FloatArray
    azimuths_rad: FloatArray
    X_BL: RigidTransform
    X_OB: RigidTransform

    def repeats(self, other: Scan) -> bool:
        """Returns whether all ranges are those of another scan, noise and all."""
        ranges, others = self.ranges_m, other.ranges_m
        if ranges is others:
            return True
        first = slice(0, 1)  # as a rule noise differs in the first ring already
        equal = (np.array_equal(ranges[part], others[part], equal_nan=True) for part in (first, slice(None)))
        return all(equal)

    def points_B(self) -> FloatArray:
        """The valid returns as an (N, 3) array in the body frame."""
        ranges = self.ranges_m.astype(np.float64)
        points_L = (unit_rays(self.elevations_rad, self.azimuths_rad) * ranges[..., None])[np.isfinite(ranges)]
        return np.asarray(points_L @ self.X_BL.rotation().matrix().T + self.X_BL.translation())


def unit_rays(elevations_rad: FloatArray, azimuths_rad: FloatArray) -> FloatArray:
    """Unit vectors (rings, azimuths, 3) of a LiDAR's rays in its frame."""
    e, a = elevations_rad[:, None], azimuths_rad[None, :]
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e) + 0.0 * a], axis=-1)


@dataclass(frozen=True)
class Intrinsics:
    """Pinhole intrinsics in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True)
class Image:
    """A picture with depth, taken at `stamp_s` from frame `camera_frame`.

    `colour` is (H, W, 3) RGB, or None where the camera is grey; `grey` is (H, W). `depth_m` is in metres along the
    optical axis, 0 where there is none, registered to the picture by `depth_intrinsics` (same pose, perhaps fewer
    pixels). `frames` is the frame tree at capture time. Arrays that were not asked for have the shape (0, 0).
    """

    stamp_s: float
    source: str
    camera_frame: str
    intrinsics: Intrinsics
    depth_intrinsics: Intrinsics
    colour: NDArray[np.uint8] | None
    grey: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    frames: FrameTree


@dataclass(frozen=True)
class Joints:
    """Joint state by name: position (rad), velocity (rad/s), effort (N m); of joints that slide in m, m/s and N."""

    stamp_s: float
    position_rad: Mapping[str, float]
    velocity_rad_s: Mapping[str, float]
    effort_nm: Mapping[str, float]


@dataclass(frozen=True)
class Gripper:
    """Opening (0 closed; see `GripperKind`), clamp force at the tips (N), whether it believes to hold something."""

    stamp_s: float
    opening: float
    force_n: float
    holding: bool


@dataclass(frozen=True)
class Battery:
    """State of charge from 0 to 1."""

    stamp_s: float
    charge: float


@dataclass(frozen=True)
class ArmTrajectory:
    """Joint positions (K, arm joints) at times from the start (K,), interpolated linearly. Raises ValueError."""

    times_s: FloatArray
    positions_rad: FloatArray

    def __post_init__(self) -> None:
        if self.times_s.ndim != 1 or self.positions_rad.ndim != 2 or len(self.times_s) != len(self.positions_rad):
            raise ValueError("ArmTrajectory: times_s must be (K,) and positions_rad (K, joints)")
        if len(self.times_s) == 0 or np.any(np.diff(self.times_s) <= 0) or not np.all(np.isfinite(self.positions_rad)):
            raise ValueError("ArmTrajectory: times_s must increase and positions be finite")


class CommandState(enum.Enum):
    """What became of a command."""

    RUNNING = "running"  # accepted and being carried out
    DONE = "done"  # reached its goal (a drive: its expiry)
    STOPPED = "stopped"  # replaced, stopped or expired before the goal
    REFUSED = "refused"  # never started: lease, limits, fault


@dataclass(frozen=True)
class CommandStatus:
    """State of a command and, when it did not succeed, why."""

    state: CommandState
    reason: str = ""


@dataclass(frozen=True)
class Lease:
    """The right to move a robot. The one with the highest `number` counts."""

    robot_name: str
    holder: str
    number: int = 0


class Clock(Protocol):
    """The robot's time. A plant's clock steps the simulation, a real robot's waits."""

    def now(self) -> float:
        """Seconds since the clock began."""

    def advance(self, dt_s: float) -> None:
        """Lets dt_s seconds pass."""


class Robot(Protocol):
    """One robot. Motion verbs return at once with a command id; `command_status` says what became of it."""

    @property
    def name(self) -> str:
        """The robot's name, as in "Hey Alice"."""

    def capabilities(self) -> Capabilities:
        """What the robot is and can do."""

    def odometry(self) -> Odometry:
        """Latest dead reckoning."""

    def imu(self) -> Imu:
        """Latest inertial measurement."""

    def scan(self) -> Scan | None:
        """Latest LiDAR revolution, None before the first."""

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """Takes a picture with depth now, or only one of the two; may block.

        Raises ValueError: no such source. Raises NoImageError: the camera gives none just now.
        """

    def joints(self) -> Joints:
        """Latest joint state."""

    def gripper(self) -> Gripper:
        """Latest gripper state."""

    def battery(self) -> Battery:
        """Latest battery state."""

    def faults(self) -> tuple[str, ...]:
        """Present faults, empty when well."""

    def drive(self, vx: float, vy: float, wz: float, *, until_s: float, lease: Lease) -> CommandId:
        """Walks at a body-frame velocity (m/s, m/s, rad/s) until the clock reads until_s."""

    def stand(self, height_m: float, pitch_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Holds the body origin at a height above the floor and a pitch (positive looks down)."""

    def sit(self, *, until_s: float, lease: Lease) -> CommandId:
        """Lowers the body to the floor."""

    def move_arm(self, trajectory: ArmTrajectory, *, until_s: float, lease: Lease) -> CommandId:
        """Follows a joint trajectory; done when its end is reached and the arm is still."""

    def point_head(self, pan_rad: float, tilt_rad: float, *, until_s: float, lease: Lease) -> CommandId:
        """Turns the head, if there is one, to angles of `HeadCapabilities`; done when it is there and still."""

    def set_gripper(self, opening: float, force_n: float, *, until_s: float, lease: Lease) -> CommandId:
        """Moves the gripper to an opening with at most force_n at its tip, which stays; done when there or blocked."""

    def stop(self, *, lease: Lease, only: CommandId | None = None) -> CommandId:
        """Stops all motion, or only the given command if it still runs; the gripper keeps its clamp force."""

    def command_status(self, command: CommandId) -> CommandStatus:
        """What became of a command. Raises KeyError for an id never given."""

    def lease_holder(self) -> Lease | None:
        """The lease that counts now; None while it is free."""

    def acquire_lease(self, holder: str) -> Lease:
        """Takes a free lease. Raises LeaseError when another holds it."""

    def take_lease(self, holder: str) -> Lease:
        """Takes the lease from whoever holds it; the robot stops."""

    def return_lease(self, lease: Lease) -> None:
        """Gives the lease back; the robot stops. A lease that was taken away is ignored."""


class NoImageError(RuntimeError):
    """A camera gives no picture just now; it may do so again."""


class LeaseError(RuntimeError):
    """The lease is held by another."""
